# SPDX-License-Identifier: GPL-3.0-or-later
"""The study that a scene shows in its panel, `Scene.palpate.study`, and where Palpate's command for studies is."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    StringProperty,
)

from . import scene_units

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
        description="The study is written here; its results go into a folder of the same name beside it. "
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
