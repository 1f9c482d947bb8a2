# SPDX-License-Identifier: GPL-3.0-or-later
"""What the user says about objects and scenes. No state of a simulation lives here, only what has to be saved with the file.

Numbers are in SI units with the unit in the name, since Blender has none for N/m; see :mod:`.units`.
"""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ...core.figures import color_maps
from ...core.io.settings_migration import VERSION
from ...core.model.drive import Drive
from ...core.model.sensor_parameters import SensorParameters
from ..scene import meshes, moved_bodies
from ..session import first_use, identity, session_state
from . import effect_stack, figure_properties

ROLES = (
    ("NONE", "None", "Takes no part"),
    ("SENSOR", "Sensor", "Feels what touches it, in every texel"),
    ("TARGET", "Target", "Presses on sensors and pads"),
    ("PAD", "Pad", "Gives way like a sensor, but is not read out: a table, the back of a finger"),
)
SKIN_METHODS = (
    ("NONE", "None", "Not laid onto a surface"),
    ("ARRAY", "Array", "Rows and columns of a given pitch, wrapped around the surface"),
    ("GRID", "Rows at a Spacing", "Rows and columns at a spacing, as far as the region goes"),
    ("NOISE", "Even", "Evenly spaced without rows (blue noise)"),
    ("VERTICES", "Vertices", "One texel for each vertex of the region"),
)
COLOR_MAPS = tuple((name, *words) for name, words in color_maps.NAMES.items())
OVERLAYS = (
    ("FORCE", "Net Force", "Arrow at the centre of pressure: what the sensor pushes back with"),
    ("TORQUE", "Free Moment", "Double arrow: the net torque about the centre of pressure, as the sensor pushes back"),
    ("CENTRE", "Centre of Pressure", "Ball at the centre of pressure"),
    ("SLIP", "Slip", "Ring around it, as wide as the share of the load on slipping texels"),
    ("NORMALS", "Texel Normals", "Arrow at each texel, as long as its normal force"),
    ("SHEARS", "Texel Shear", "Arrow at each texel, along the shear with which it pushes back"),
)
PARAMETERS = (
    "k", "cn", "ct", "sigma0", "sigma1", "x0", "mus", "mud", "max_penetration", "normal_law", "exponent", "dissipation",
    "points_per_texel", "gain", "zero", "unit",
)  # fmt: skip
"""Names that :class:`SensorParameters` and :class:`PALPATE_PG_object` share."""

_default = SensorParameters()
_fixed = {"options": set(), "override": {"LIBRARY_OVERRIDABLE"}}
"""A parameter is one number for the whole run, so it has no keyframes."""


def _role_changed(settings, context):
    """Also a script that only sets the role gets an object that can be found again."""
    settings.schema_version = VERSION
    identity.ensure(settings.id_data)
    session_state.participants_changed()
    if settings.role in {"SENSOR", "PAD"}:
        first_use.begin()
    _body_changed(settings, context)


def _body_changed(settings, _context):
    """Put back what playing has moved, when no run will do it any more."""
    if (settings.body not in moved_bodies.MOVED or settings.role == "NONE") and not settings.is_baked:
        moved_bodies.restore(settings.id_data)


def _number(name, key, text, **more):
    """A parameter of the model with the paper's default."""
    more = {"min": 0.0, "default": getattr(_default, key), "precision": 4, "step": 10, **more}
    return FloatProperty(name=name, description=text, **more, **_fixed)


def _maps(settings, context, typed):
    """Offer what can hold a number for each vertex."""
    obj = settings.id_data
    names = [group.name for group in obj.vertex_groups]
    if obj.type == "MESH":
        names += [item.name for item in obj.data.attributes if meshes.is_map(item)]
    return [name for name in names if typed.lower() in name.lower()]


def _map(what: str, effect: str):
    return StringProperty(
        name=what,
        description=f"Vertex group or attribute that says, texel by texel, how much {effect}. "
        "A weight of 1 means the factor below, 0 leaves the texel as it is; an attribute holds the factors themselves",
        search=_maps,
        **_fixed,
    )


def _factor(what: str):
    return FloatProperty(
        name="At Full Weight (×)",
        description=f"What {what} is multiplied by where the weight is 1, no unit; 1 changes nothing",
        default=0.5,
        min=0.0,
        soft_max=4.0,
        precision=3,
        **_fixed,
    )


def _length(name: str, text: str, **more):
    return FloatProperty(name=name, description=text, precision=5, step=0.01, options=set(), **more)


class PALPATE_PG_skin(bpy.types.PropertyGroup):
    """How the texels of a sensor were laid onto its parent's surface; `Object.palpate.skin`"""

    method: EnumProperty(
        name="Pattern",
        description="How texels are laid onto the surface",
        items=SKIN_METHODS,
        options=set(),
        override={"LIBRARY_OVERRIDABLE"},
    )
    rows: IntProperty(name="Rows", description="Of the array", default=14, min=2, options=set())
    columns: IntProperty(name="Columns", description="Of the array", default=6, min=2, options=set())
    pitch_x: _length("Column Pitch (m)", "From column to column, m", default=0.0034, min=1e-6)
    pitch_y: _length("Row Pitch (m)", "From row to row, m", default=0.0034, min=1e-6)
    shift_x: _length("Shift Across (m)", "Of the array's middle, along its rows, m")
    shift_y: _length("Shift Along (m)", "Of the array's middle, from row to row, m")
    angle: FloatProperty(
        name="Turn", description="Of the rows, anticlockwise seen from outside", subtype="ANGLE", options=set()
    )
    spacing: _length("Spacing (m)", "From texel to texel, m", default=0.002, min=1e-6)
    seed: IntProperty(name="Seed", description="Another pattern for each", min=0, options=set())
    lift: _length("Lift (m)", "How far above the surface the texels are, m: so much earlier they are touched", min=0.0)
    region: StringProperty(options={"HIDDEN"})
    region_name: StringProperty(options={"HIDDEN"})
    region_number: IntProperty(options={"HIDDEN"})
    made_from: StringProperty(options={"HIDDEN"})


def _drive_number(name, key, text):
    """A number of the drive with the solver's default."""
    default = getattr(Drive(), key)
    return FloatProperty(name=name, description=text, default=default, min=0.0, precision=4, step=10, **_fixed)


class PALPATE_PG_object(bpy.types.PropertyGroup):
    """`Object.palpate`"""

    schema_version: IntProperty(options={"HIDDEN"})
    uid: StringProperty(options={"HIDDEN"})
    role: EnumProperty(name="Role", description="Part of this object", items=ROLES, update=_role_changed, **_fixed)

    region: EnumProperty(
        name="Region",
        description="Which vertices become texels",
        items=(
            ("MESH", "Whole Mesh", "Every vertex"),
            ("GROUP", "Vertex Group", "Vertices whose weight reaches the threshold"),
            ("MATERIAL", "Material", "Faces that wear a material"),
            ("FACE_SET", "Face Set", "Faces of one of Sculpt Mode's face sets"),
        ),
        **_fixed,
    )
    material: StringProperty(name="Material", description="Of the faces that belong to the sensor", **_fixed)
    face_set: IntProperty(name="Face Set", description="Number of the face set that is the sensor", default=1, **_fixed)
    vertex_group: StringProperty(name="Vertex Group", description="Painted or assigned region of the sensor", **_fixed)
    threshold: FloatProperty(
        name="Threshold",
        description="Least weight at which a vertex belongs to the sensor",
        default=0.5,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
        **_fixed,
    )

    k: _number(
        "Stiffness k (N/m)",
        "k",
        "Normal stiffness of one texel, N/m (Eq. 8). Eq. 18 finds it from foam data. Table 2: 58.5; the pad of Table 3: 1000",
    )
    cn: _number(
        "Damping cn (N·s/m)", "cn", "Normal damping of one texel, N·s/m (Eq. 8). About 1 % of k in number; Table 2 has 0.0583"
    )
    max_penetration: _number(
        "Max Penetration (m)",
        "max_penetration",
        "Depth past which a texel no longer acts, m. About twice the thickness of the foam: 0.012 for 6 mm",
        precision=5,
        step=0.1,
    )
    normal_law: EnumProperty(
        name="Normal Law",
        description="How the normal force follows from depth and its rate",
        items=(
            ("linear", "Linear", "k d + cn ḋ (Eq. 8): a spring and a damper"),
            (
                "hunt-crossley",
                "Hunt–Crossley",
                "k dᵖ (1 + 3/2 α ḋ): no force jump at first touch; e = 1 - α v for slow impacts",
            ),
        ),
        **_fixed,
    )
    exponent: _number(
        "Exponent p",
        "exponent",
        "Power of the depth (Hunt–Crossley); k then is in N/mᵖ. Hertz: 1.5",
        min=1.0,
        max=4.0,
    )
    dissipation: _number(
        "Dissipation α (s/m)",
        "dissipation",
        "Hunt–Crossley, s/m: an impact at v m/s leaves with the share 1 - α v",
    )
    points_per_texel: EnumProperty(
        name="Contact Points",
        description="Per texel, spread over its cell; they share out its stiffness. More of them are slower and make force and "
        "contact area of small or curved objects exact on coarser pads",
        items=[
            ("1", "1", "At the texel's vertex, as in the paper"),
            *((str(n * n), f"{n} × {n}", f"{n * n} points in the cell of each texel") for n in range(2, 11)),
        ],
        **_fixed,
    )
    sigma0: _number(
        "Bristles σ0 (N/m)",
        "sigma0",
        "Bristle stiffness: tangential stiffness before a texel slips, N/m (Eq. 9, 13). Table 2: 1",
    )
    sigma1: _number("Bristles σ1 (N·s/m)", "sigma1", "Bristle damping, N·s/m (Eq. 13). Table 2: 0.1")
    ct: _number("Viscous ct (N·s/m)", "ct", "Viscous friction: grows with sliding speed, N·s/m (Eq. 13). Table 2: 0.01")
    mus: _number("Static Friction μs", "mus", "Coefficient at which sliding begins, no unit (Eq. 11). Foam on metal: 0.435")
    mud: _number("Dynamic Friction μd", "mud", "Coefficient of fast sliding, no unit, at most μs (Eq. 12). Foam on metal: 0.23")
    x0: _number(
        "Stribeck x0 (m/s)",
        "x0",
        "Stribeck velocity: speed at which static friction gives way to dynamic, m/s (Eq. 10). Table 2: 0.3",
    )

    gain: _number(
        "Gain (unit/N)", "gain", "Reading = zero + gain · normal force; what one newton adds to the reading, unit/N", min=-1e9
    )
    zero: _number("Zero (unit)", "zero", "Reading without load, in the unit above", min=-1e9)
    unit: StringProperty(name="Unit", description="Of the reading, as in N, V or counts", default=_default.unit, **_fixed)

    image_layout: EnumProperty(
        name="Tactile Image",
        description="How the texels become the images that a bake writes",
        items=(
            ("AUTO", "Automatic", "A pixel for each texel where they form rows and columns; other regions are flattened"),
            ("UV", "UV Map", "As a UV map of the mesh lays the surface out"),
        ),
        **_fixed,
    )
    image_map: StringProperty(name="UV Map", description="Of the tactile image; empty: the one that renders use", **_fixed)
    image_size: IntProperty(
        name="Resolution", description="Side of the tactile image, pixels", default=256, min=16, max=4096, **_fixed
    )
    image_filter: EnumProperty(
        name="Pixels",
        description="What a pixel between texels shows",
        items=(
            ("SMOOTH", "Smooth", "Values that change linearly from texel to texel over the surface"),
            ("NEAREST", "Nearest", "The value of the texel to whose part of the surface it belongs"),
        ),
        **_fixed,
    )

    k_map: _map("Painted Stiffness", "stiffer or softer it is (stiffness and damping)")
    k_factor: _factor("stiffness and damping")
    friction_map: _map("Painted Friction", "rougher or smoother it is (static and dynamic friction)")
    friction_factor: _factor("friction")
    gain_map: _map("Painted Gain", "more or less it reports for the same force")
    gain_factor: _factor("the gain")

    presses: BoolProperty(
        name="Felt by Other Sensors",
        description="Other sensors and pads feel this one's surface too; both skins share the overlap as springs in series",
        **_fixed,
    )
    contact_normals: EnumProperty(
        name="Contact Normals",
        description="In which direction this object presses",
        items=(
            ("FLAT", "Flat", "Along the normals of its triangles"),
            (
                "SMOOTH",
                "Smooth",
                "Along normals interpolated between its vertices, as for smooth shading: for balls and fingers",
            ),
        ),
        **_fixed,
    )
    body: EnumProperty(
        name="Body",
        description="What moves this object",
        items=(
            ("KEYFRAMED", "Keyframed", "Its animation, parents and constraints; forces do not move it"),
            ("FREE", "Free", "Gravity and the sensors' forces, from where it is at the first frame"),
            ("DRIVEN", "Driven", "A servo of limited force along one axis; its parent carries it. A gripper's finger"),
            ("PARENT", "Part of Parent", "It is fixed to its parent: what presses on it moves the parent's body"),
        ),
        update=_body_changed,
        **_fixed,
    )
    mass: FloatProperty(
        name="Mass (kg)",
        description="Of a free or driven body, kg; inertia follows from the mesh, taken as a solid of uniform density",
        default=1.0,
        min=0.0,
        precision=4,
        **_fixed,
    )
    velocity: FloatVectorProperty(
        name="Velocity (m/s)",
        description="Of a free body at the first frame, m/s, world axes",
        size=3,
        subtype="XYZ",
        precision=4,
        **_fixed,
    )
    angular_velocity: FloatVectorProperty(
        name="Spin (rad/s)",
        description="Of a free body at the first frame, rad/s, world axes",
        size=3,
        subtype="XYZ",
        precision=4,
        **_fixed,
    )

    effects: CollectionProperty(
        type=effect_stack.PALPATE_PG_effect,
        name="Effects",
        description="What real sensors do and the base model does not",
        override={"LIBRARY_OVERRIDABLE", "USE_INSERTION"},
    )

    measured: StringProperty(
        name="Rig", description="Measurements of the real sensor: a rig.toml, with its CSV files beside it", **_fixed
    )

    made_vertices: IntProperty(options={"HIDDEN"})
    skin: PointerProperty(
        type=PALPATE_PG_skin, description="How it was laid onto its parent's surface", override={"LIBRARY_OVERRIDABLE"}
    )

    drive_control: EnumProperty(
        name="Control",
        description="What the drive aims at",
        items=(
            ("POSITION", "Position", "A way along its axis, from where the object starts on its parent"),
            ("VELOCITY", "Velocity", "A speed along its axis"),
            (
                "FORCE",
                "Tactile Force",
                "The sum of a sensor's normal forces: approaches with the speed limit until it touches, then holds the sum",
            ),
        ),
        **_fixed,
    )
    drive_axis: EnumProperty(
        name="Axis",
        description="Direction in which the drive moves it; a finger closes this way",
        items=tuple((key, key, f"Along {key}") for key in ("X", "Y", "Z", "-X", "-Y", "-Z")),
        default="Z",
        **_fixed,
    )
    drive_space: EnumProperty(
        name="Axis of",
        description="Whose axis it is",
        items=(
            ("LOCAL", "Object", "The object's own; turns along with what carries it"),
            ("PARENT", "Parent", "Its parent's at the first frame; turns along with what carries it"),
            ("WORLD", "World", "Stands still"),
        ),
        **_fixed,
    )
    drive_position: FloatProperty(
        name="Way (m)",
        description="Target of position control, m from where the object starts; can be keyframed",
        precision=5,
        step=0.1,
    )
    drive_speed: FloatProperty(
        name="Speed (m/s)", description="Target of velocity control, m/s; can be keyframed", precision=4, step=1
    )
    drive_force: FloatProperty(
        name="Tactile Sum (N)",
        description="Target of force control: sum of the sensor's normal forces, N; zero opens. Can be keyframed",
        default=5.0,
        precision=4,
    )
    drive_max_force: _drive_number("Max Force (N)", "max_force", "Largest force of the drive, N")
    drive_max_speed: _drive_number(
        "Max Speed (m/s)", "max_speed", "Speed that the drive asks for at the most, m/s; force control approaches with it"
    )
    drive_stiffness: _drive_number("Stiffness (N/m)", "stiffness", "Position control: force per metre that is lacking, N/m")
    drive_damping: _drive_number("Damping (N·s/m)", "damping", "Force for each m/s that is lacking, N·s/m")
    drive_settling: _drive_number(
        "Settling (s)",
        "settling",
        "Force control: time in which the rest is made up, s; longer than the foam swings",
    )
    drive_sensor: PointerProperty(
        name="Sensor",
        description="Sensor whose tactile sum is controlled; the object itself when empty",
        type=bpy.types.Object,
        **_fixed,
    )
    drive_leader: PointerProperty(
        name="Coupled With",
        description="Driven object whose drive moves this one as well, each along its own axis: the other finger of a gripper",
        type=bpy.types.Object,
        **_fixed,
    )

    # Bookkeeping of a free body that was moved, and of a bake. Saved, so that a reopened file can be put right.
    has_start: BoolProperty(options={"HIDDEN"})
    start_matrix: FloatVectorProperty(size=16, options={"HIDDEN"})
    start_channels: FloatVectorProperty(size=14, options={"HIDDEN"})
    is_baked: BoolProperty(options={"HIDDEN"})
    made_action: BoolProperty(options={"HIDDEN"})
    bake_folder: StringProperty(options={"HIDDEN"})


class PALPATE_PG_scene(bpy.types.PropertyGroup):
    """`Scene.palpate`"""

    schema_version: IntProperty(options={"HIDDEN"})
    folder: StringProperty(
        name="Bake Folder",
        description="Tactile images and recordings go here, in one folder per sensor; // is the folder of the .blend",
        default="//palpate",
        subtype="DIR_PATH",
        options=set(),
    )
    use_auto_dt: BoolProperty(
        name="Auto Time Step",
        description="Choose the substep from the stability limit of the stiffest contact",
        default=True,
        options=set(),
    )
    dt: FloatProperty(
        name="Time Step (s)", description="Longest substep, s", default=1e-4, min=0.0, precision=6, step=0.001, options=set()
    )
    interpolation: EnumProperty(
        name="Between Frames",
        description="How animated bodies move between the frames that are read",
        items=(
            ("LINEAR", "Linear", "Straight, with constant speed: speeds jump at the frames"),
            ("SMOOTH", "Smooth", "Without jumps of speed"),
        ),
        options=set(),
    )
    subframes: IntProperty(
        name="Samples per Frame",
        description="How often the motion of animated bodies is read in each frame, in a bake and while playing",
        default=1,
        min=1,
        soft_max=16,
        max=1000,
        options=set(),
    )
    use_live: BoolProperty(
        name="Live Playback",
        description="Playing forward from the first frame computes frame by frame; scrubbing shows what was computed",
        default=True,
        options=set(),
    )
    show_texels: BoolProperty(
        name="Texels",
        description="Mark the texels of the active sensor in the 3D view; red ones have a problem",
        default=True,
        options=set(),
    )
    show_normals: BoolProperty(
        name="Normals", description="Show which way the texels of the active sensor feel", default=True, options=set()
    )
    show_numbers: BoolProperty(
        name="Numbers",
        description="Show row and column of the texels where they form a grid, and their number where not",
        default=False,
        options=set(),
    )
    show_reach: BoolProperty(
        name="Reach",
        description="Show the maximum penetration: how deep the texels of the active sensor reach",
        default=False,
        options=set(),
    )
    show_overlay: BoolProperty(
        name="Live Heat Map",
        description="Colour the texels in the 3D view while playing; nothing of it is saved",
        default=True,
        options=set(),
    )
    show_inset: BoolProperty(
        name="Live Images and Curves",
        description="Tactile images, their scale and the force over time in a corner of the 3D view",
        default=True,
        options=set(),
    )
    color_map: EnumProperty(name="Colour Map", description="Colours of the heat map", items=COLOR_MAPS, options=set())
    use_auto_range: BoolProperty(
        name="Auto Range",
        description="The heat maps of all sensors end at the largest value of any of them",
        default=True,
        options=set(),
    )
    quantity: EnumProperty(
        name="Shows",
        description="What the colours of heat maps and tactile images mean",
        items=(
            ("FORCE", "Force", "Normal force of the texel, N"),
            ("PRESSURE", "Pressure", "Normal force over the area of the texel, kPa"),
        ),
        options=set(),
    )
    range_max_pressure: FloatProperty(
        name="Maximum (kPa)", description="Pressure at the end of the heat map, kPa", default=10.0, min=1e-9, options=set()
    )
    overlays: EnumProperty(
        name="On Baked Sensors",
        description="What a bake puts on its sensors, besides the heat map; Shift-click adds one to those chosen",
        items=OVERLAYS,
        default={"FORCE"},
        options={"ENUM_FLAG"},
    )
    texel_arrow_scale: FloatProperty(
        name="Texel Arrow Scale (m/N)",
        description="Length of the arrow at a texel for each newton, m/N",
        default=0.1,
        min=0.0,
        precision=5,
        options=set(),
    )
    range_max: FloatProperty(
        name="Maximum (N)", description="Normal force at the end of the heat map, N", default=0.1, min=1e-9, options=set()
    )
    use_auto_arrow: BoolProperty(
        name="Auto Length",
        description="The longest arrow of a bake is as long as the largest side of any sensor",
        default=True,
        options=set(),
    )
    arrow_scale: FloatProperty(
        name="Arrow Scale (m/N)",
        description="Length of the net-force arrow for each newton, m/N",
        default=0.05,
        min=0.0,
        precision=5,
        options=set(),
    )
    figures: PointerProperty(
        type=figure_properties.PALPATE_PG_figures, description="What figures are made of the bake, and how"
    )
    baked_digest: StringProperty(options={"HIDDEN"})
    baked_fingerprint: StringProperty(options={"HIDDEN"})
    baked_shapes: StringProperty(options={"HIDDEN"})
    baked_start: IntProperty(options={"HIDDEN"})
    baked_end: IntProperty(options={"HIDDEN"})


CLASSES = (
    effect_stack.PALPATE_PG_effect,
    figure_properties.PALPATE_PG_figures,
    PALPATE_PG_skin,
    PALPATE_PG_object,
    PALPATE_PG_scene,
)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Object.palpate = PointerProperty(type=PALPATE_PG_object, override={"LIBRARY_OVERRIDABLE"})
    bpy.types.Scene.palpate = PointerProperty(type=PALPATE_PG_scene)


def unregister():
    del bpy.types.Scene.palpate
    del bpy.types.Object.palpate
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
