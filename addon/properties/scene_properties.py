# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of a scene: `Scene.palpate`."""

from __future__ import annotations

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ...core.figures import color_maps
from ...core.figures.quantities import QUANTITIES, between
from ..session import session_state, transforms
from . import figure_properties, scene_units

NUMBER, WORDS = "NUMBER", "WORDS"
"""Kinds of what varies: numbers have every distribution, switches, words and whole numbers only a choice."""
DESIGNS = (
    ("LATIN_HYPERCUBE", "Latin Hypercube", "Random values that cover the range of each number evenly"),
    ("SOBOL", "Sobol", "A sequence that covers the ranges evenly; best with 2, 4, 8, 16, … runs"),
    ("RANDOM", "Random", "Independent random values"),
    ("GRID", "Grid", "All combinations of some values of each number"),
)
DISTRIBUTIONS = (
    ("UNIFORM", "Uniform", "Evenly between two numbers"),
    ("LOG_UNIFORM", "Log-Uniform", "The logarithm evenly, for numbers above zero of unknown size"),
    ("NORMAL", "Normal", "Normal with a mean and a standard deviation, truncated at the bounds of the number"),
    ("CHOICE", "Choice", "One of a list of values"),
)


class PALPATE_PG_study_variable(bpy.types.PropertyGroup):
    """One thing that varies. Its `name` is that in the file of the study."""

    kind: StringProperty(default=NUMBER, options={"HIDDEN"})
    unit: StringProperty(options={"HIDDEN"})
    use: BoolProperty(name="Vary", description="Vary it in the study", default=True, options=set())
    distribution: EnumProperty(name="Distribution", description="Which values it has", items=DISTRIBUTIONS, options=set())
    low: FloatProperty(name="Lowest", description="Lowest value, in the unit next to the name", precision=5, options=set())
    high: FloatProperty(
        name="Highest", description="Highest value, in the unit next to the name", default=1.0, precision=5, options=set()
    )
    mean: FloatProperty(name="Mean", description="Mean, in the unit next to the name", precision=5, options=set())
    deviation: FloatProperty(
        name="Deviation",
        description="Standard deviation, in the unit next to the name",
        default=1.0,
        min=0.0,
        precision=5,
        options=set(),
    )
    choices: StringProperty(name="Values", description="Values separated by commas", options=set())
    levels: IntProperty(
        name="Levels", description="How many values a grid takes", default=5, min=1, soft_max=20, max=10_000, options=set()
    )


def _press_number(unit: str, label: str, default: float, text: str, **more):
    """Return the number of Blender for a bound of a number of presses. Its specification loads too much to be read here."""
    return FloatProperty(
        name=f"{label} ({unit})", description=f"{text}, {unit}", default=default, min=0.0, options=set(), **more
    )


class PALPATE_PG_study(bpy.types.PropertyGroup):
    """`Scene.palpate.study`"""

    file: StringProperty(
        name="Study File",
        description="Path of the study file. The results are written to a folder of the same name in the same directory. "
        "// is the folder of the .blend",
        default="//study.toml",
        subtype="FILE_PATH",
        options=scene_units.OUTPUT,
    )
    design: EnumProperty(name="Design", description="How the values of the runs are chosen", items=DESIGNS, options=set())
    samples: IntProperty(
        name="Runs", description="Number of runs", default=100, min=1, soft_max=10_000, max=1_000_000, options=set()
    )
    seed: IntProperty(name="Seed", description="Seed of the random values", default=1, min=0, options=set())
    images: BoolProperty(
        name="Tactile Images", description="Each run also writes a tactile image for each frame", options=set()
    )
    use_limit: BoolProperty(name="Limit Time", description="Runs that take too long count as failed", options=set())
    run_limit: FloatProperty(
        name="Longest Run (s)", description="Time after which a run counts as failed, s", default=60.0, min=0.1, options=set()
    )
    use_memory_limit: BoolProperty(
        name="Limit Memory", description="Runs that hold too much memory count as failed", options=set()
    )
    run_memory: FloatProperty(
        name="Most Memory (MB)",
        description="Memory of its process above which a run counts as failed, MB",
        default=4000.0,
        min=1.0,
        options=set(),
    )
    workers: IntProperty(
        name="Processes", description="Processes that compute runs; 0: one for each core", min=0, max=4096, options=set()
    )
    use_press: BoolProperty(
        name="Random Presses",
        description="The target presses on random places of the sensor's surface, instead of its own motion",
        options=set(),
    )
    press_by: EnumProperty(
        name="Press by",
        description="Controlled quantity of each press",
        items=(("DEPTH", "Depth", "Depth of the target below the surface"), ("FORCE", "Force", "Sum of normal forces")),
        options=set(),
    )
    depth_low: _press_number("m", "Least Depth", 0.5e-3, "Least depth of a press", precision=5, step=0.01)
    depth_high: _press_number("m", "Largest Depth", 2e-3, "Largest depth of a press", precision=5, step=0.01)
    force_low: _press_number("N", "Least Force", 0.5, "Least sum of normal forces", precision=4)
    force_high: _press_number("N", "Largest Force", 2.0, "Largest sum of normal forces", precision=4)
    slide: _press_number("m", "Slide up to", 0.0, "Longest slide after the press; zero: none", precision=5, step=0.01)
    tilt: _press_number("rad", "Tilt up to", 0.0, "Largest angle between the approach and the normal", max=1.4)
    twist: _press_number("rad", "Twist up to", 0.0, "Largest turn during the slide, either way; zero: none", max=12.5)
    variables: CollectionProperty(
        type=PALPATE_PG_study_variable,
        name="What Varies",
        description="Parameters that vary from run to run: right-click on a number and choose Vary in Study",
    )


class PALPATE_AP_preferences(bpy.types.AddonPreferences):
    """Preferences of the add-on. A .blend cannot set them, so none can name a program that a button starts."""

    bl_idname = __package__.removesuffix(".addon.properties")

    study_command: StringProperty(
        name="Command of Palpate",
        description="File of the command palpate in a Python that has Palpate with its extra 'sweep'; it computes studies. "
        "Empty: the one on the path",
        subtype="FILE_PATH",
    )

    def draw(self, _context):
        self.layout.prop(self, "study_command")


def command_in_preferences() -> str:
    """Return the command for studies that the user has chosen; empty if none."""
    addon = bpy.context.preferences.addons.get(PALPATE_AP_preferences.bl_idname)
    return "" if addon is None or addon.preferences is None else addon.preferences.study_command


SETTING: dict = {"options": set(), "update": session_state.settings_changed}
"""A setting of a scene has no keyframes; what is shown follows it."""
FOLDER, EARLIER_FOLDER = "//palpate-bake", "//palpate"
"""Where scenes are baked unless they say otherwise, and where those of earlier versions were: a folder beside a .blend that has
the name of the package would hide it from a Python that is started there."""
COLOR_MAPS = tuple((name, *words) for name, words in color_maps.NAMES.items())
OVERLAYS = (
    ("FORCE", "Net Force", "Arrow at the centre of pressure: the reaction to the net force on the sensor"),
    ("TORQUE", "Free Moment", "Double arrow: the reaction torque on the target about the centre of pressure"),
    ("CENTRE", "Centre of Pressure", "Ball at the centre of pressure"),
    ("SLIP", "Slip", "Ring around the centre of pressure, as wide as the share of the load on slipping texels"),
    ("NORMALS", "Texel Normals", "Arrow at each texel, as long as its normal force"),
    ("SHEARS", "Texel Shear", "Arrow at each texel: the reaction on the target, opposite to the shear force on the texel"),
)


def range_names(settings) -> tuple[str, ...]:
    """Return the names of the properties that are the ends of the colours of the quantity in view; zero is not among them."""
    name = settings.quantity.lower()
    upper = RANGE_NAMES.get(name, f"range_max_{name}")
    return (f"range_min_{name}", upper) if QUANTITIES[name].span is between else (upper,)


RANGE_NAMES = {"force": "range_max"}
"""Names of upper ends that are not ``range_max_`` and the quantity."""


def color_range(settings) -> tuple[float | None, float | None]:
    """Return the ends of the colours as set; the lower one is None where it follows from the other, both if they are none."""
    *lower, upper = (transforms.as_typed(getattr(settings, name)) for name in range_names(settings))
    if lower and lower[0] >= upper:
        return None, None
    return (lower[0] if lower else None), upper


def set_color_range(settings, lowest: float | None, limit: float) -> None:
    """Set the ends of the colours of the quantity in view."""
    *lower, upper = range_names(settings)
    setattr(settings, upper, limit)
    for name in lower:
        setattr(settings, name, lowest or 0.0)


def _switch(name: str, text: str, default: bool = True):
    """Return a setting that is on or off."""
    return BoolProperty(name=name, description=text, default=default, **SETTING)


def _number(name: str, text: str, **more):
    """Return a setting that is a number."""
    return FloatProperty(name=name, description=text, **more, **SETTING)


def _ranges() -> dict:
    """Return the properties of the ends of all quantities' colours."""
    found = {}
    for name, quantity in QUANTITIES.items():
        unit = f" ({quantity.unit})" if isinstance(quantity.unit, str) else ""
        is_between = quantity.span is between
        text = f"{quantity.title} at the %s of the heat map{unit or ', in the unit of the sensor'}"
        least = {} if is_between else {"min": 1e-9}
        upper = RANGE_NAMES.get(name, f"range_max_{name}")
        found[upper] = _number(f"Maximum{unit}", text % "end", default=quantity.limit, **least)
        if is_between:
            found[f"range_min_{name}"] = _number(f"Minimum{unit}", text % "beginning")
    return found


class ColorRanges:
    """The ends of the colours of each quantity."""

    __annotations__ = _ranges()


class PALPATE_PG_scene(ColorRanges, bpy.types.PropertyGroup):
    """`Scene.palpate`"""

    schema_version: IntProperty(options={"HIDDEN"})
    folder: StringProperty(
        name="Bake Folder",
        description="Tactile images and recordings go here, in one folder per sensor; // is the folder of the .blend",
        default=FOLDER,
        subtype="DIR_PATH",
        **{**SETTING, "options": scene_units.OUTPUT},
    )
    use_auto_dt: _switch(
        "Auto Time Step", "Choose the substep from the stability limit of each free body against all texels that can touch it"
    )
    dt: _number(
        "Time Step (s)",
        "Longest step of the solver, s; a whole number of steps makes a frame",
        default=1e-4,
        min=0.0,
        precision=6,
        step=0.001,
    )
    interpolation: EnumProperty(
        name="Between Frames",
        description="How animated bodies move between the frames that are read",
        items=(
            ("LINEAR", "Linear", "Straight, with constant speed: speeds jump at the frames"),
            ("SMOOTH", "Smooth", "Without jumps of speed"),
        ),
        **SETTING,
    )
    subframes: IntProperty(
        name="Samples per Frame",
        description="How often the motion of animated bodies is read in each frame, in a bake and while playing",
        default=1,
        min=1,
        soft_max=16,
        max=1000,
        **SETTING,
    )
    use_live: _switch(
        "Live Playback", "Playing forward from the first frame computes frame by frame; scrubbing shows what was computed"
    )
    show_texels: _switch("Texels", "Mark the texels of the active sensor in the 3D view; red ones have a problem")
    show_normals: _switch("Normals", "Show the normals of the texels of the active sensor")
    show_numbers: _switch(
        "Numbers", "Show row and column of the texels where they form a grid, and their number where not", default=False
    )
    show_reach: _switch("Reach", "Show the maximum penetration: how deep the texels of the active sensor reach", default=False)
    show_overlay: _switch("Live Heat Map", "Colour the texels in the 3D view while playing; nothing of it is saved")
    show_through: _switch(
        "Through Objects", "Draw the heat map over what covers it in the 3D view, as X-ray does (Alt Z)", default=False
    )
    show_inset: _switch(
        "Live Images and Curves", "Tactile images, their scale and the force over time in a corner of the 3D view"
    )
    color_map: EnumProperty(name="Colour Map", description="Colours of the heat map", items=COLOR_MAPS, **SETTING)
    use_auto_range: _switch("Auto Range", "The heat maps of all sensors end at the largest value of any of them")
    quantity: EnumProperty(
        name="Shows",
        description="What the colours of heat maps and tactile images mean",
        items=[(name.upper(), quantity.title, quantity.text) for name, quantity in QUANTITIES.items()],
        **SETTING,
    )
    show_indentation: _switch(
        "Indentation",
        "The surface of a sensor is displaced by its penetration, while playing and after a bake, "
        "so that objects hardly intersect it",
    )
    indentation_factor: _number(
        "Factor",
        "Displacement of the surface over its penetration: 1 is true to scale, more exaggerates",
        default=1.0,
        min=0.0,
        soft_max=10.0,
        max=1000.0,
    )
    overlays: EnumProperty(
        name="On Baked Sensors",
        description="Overlays that a bake adds to its sensors, besides the heat map; Shift-click adds one to those chosen",
        items=OVERLAYS,
        default={"FORCE"},
        options={"ENUM_FLAG"},
        update=session_state.settings_changed,
    )
    texel_arrow_scale: _number(
        "Texel Arrow Scale (m/N)", "Length of the arrow at a texel for each newton, m/N", default=0.1, min=0.0, precision=5
    )
    use_auto_arrow: _switch("Auto Length", "The longest arrow of a bake is as long as the largest side of any sensor")
    arrow_scale: _number(
        "Arrow Scale (m/N)", "Length of the net-force arrow for each newton, m/N", default=0.05, min=0.0, precision=5
    )
    figures: PointerProperty(type=figure_properties.PALPATE_PG_figures, description="Figures of the bake and their settings")
    study: PointerProperty(type=PALPATE_PG_study, description="Varied parameters of the study and their distributions")
    # Tells this scene from others that bake into the same folder; made at the first bake.
    scene_id: StringProperty(options={"HIDDEN"})
    # What the latest bake has left: the digest of its scenario (empty without a bake) and its id, by which the bake in the
    # folder is recognised, the fingerprints of settings and of the shapes of deforming objects, by which changes are noticed,
    # the names of its objects at that time, and its first and last frame.
    baked_digest: StringProperty(options={"HIDDEN"})
    baked_id: StringProperty(options={"HIDDEN"})
    baked_fingerprint: StringProperty(options={"HIDDEN"})
    baked_shapes: StringProperty(options={"HIDDEN"})
    baked_names: StringProperty(options={"HIDDEN"})
    baked_start: IntProperty(options={"HIDDEN"})
    baked_end: IntProperty(options={"HIDDEN"})
    # Says that the saved .blend has not changed since its bake (core/simulators/baked_sensors.py).
    unchanged_note: StringProperty(options={"HIDDEN"})
