# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of an object: `Object.palpate`."""

from __future__ import annotations

import bpy
import numpy as np
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

from ...core.skins.skin_presets import PRESETS
from ..session import first_use, identity, session_state
from . import effect_stack
from .migrations import VERSION
from .parameter_properties import FIXED, DriveParameterProperties, PaintedProperties, SensorParameterProperties
from .scene_units import ENDING, in_units

# Where a free or driven body starts: its location and rotation at the first frame.
#
# While playing displaces a body, or a bake moves it by keyframes, its properties keep the start, so that it can be
# restored exactly.

MOVED_BY_FORCES = ("FREE", "DRIVEN")
"""Values of the property `body` of objects that forces move."""


def transform_channels(obj) -> np.ndarray:
    """Return location, Euler, quaternion and axis-angle rotation of an object, (14,) float."""
    return np.concatenate([obj.location, obj.rotation_euler, obj.rotation_quaternion, obj.rotation_axis_angle])


def set_transform_channels(obj, values: np.ndarray) -> None:
    """Give an object the values of :func:`transform_channels`."""
    obj.location, obj.rotation_euler = values[:3], values[3:6]
    obj.rotation_quaternion, obj.rotation_axis_angle = values[6:10], values[10:14]


def store_start(obj, matrix: np.ndarray) -> None:
    """Store where a body starts, before it is moved for the first time; later calls change nothing.

    Parameters
    ----------
    obj : Object
    matrix : (4, 4) float
        Its world matrix at the first frame.
    """
    settings = obj.palpate
    if not settings.has_start:
        settings.start_matrix = matrix.ravel()
        settings.start_channels = transform_channels(obj)
        settings.has_start = True


def restore_unless_moved(obj) -> None:
    """Move an object back to its start when neither a run nor a bake will move it, because its role or body has changed."""
    settings = obj.palpate
    if (settings.body not in MOVED_BY_FORCES or settings.role == "NONE") and not settings.is_baked:
        restore_start(obj)


def restore_start(obj) -> None:
    """Move a body back to its start, equal to the last bit, and delete the stored start."""
    if obj.palpate.has_start:
        set_transform_channels(obj, np.array(obj.palpate.start_channels))
        for name in ("has_start", "start_matrix", "start_channels"):
            obj.palpate.property_unset(name)


SKIN_METHODS = (
    ("NONE", "None", "Not laid onto a surface"),
    ("ARRAY", "Array", "Rows and columns of a given pitch, wrapped around the surface"),
    ("GRID", "Rows at a Spacing", "Rows and columns at a spacing, as far as the region goes"),
    ("NOISE", "Even", "Evenly spaced without rows (blue noise)"),
    ("VERTICES", "Vertices", "One texel for each vertex of the region"),
)

FIELDS = {
    "ARRAY": ("rows", "columns", "pitch_x", "pitch_y", "shift_x", "shift_y", "angle", "lift"),
    "GRID": ("spacing", "angle", "lift"),
    "NOISE": ("spacing", "seed", "lift"),
    "VERTICES": ("lift",),
}
"""Settings that each pattern is made from."""


LENGTHS = {
    "pitch_x": ("Column Pitch", "Distance between columns"),
    "pitch_y": ("Row Pitch", "Distance between rows"),
    "shift_x": ("Shift Across", "Displacement of the middle of the array along its rows"),
    "shift_y": ("Shift Along", "Displacement of the middle of the array across its rows"),
    "spacing": ("Spacing", "Distance between texels"),
    "lift": ("Lift", "Height of the texels above the surface"),
}
"""Name and tooltip, without a unit, of the settings of patterns that are lengths."""


def _length(name: str, **more):
    """Return a property that is a length in metres."""
    label, text = LENGTHS[name]
    return FloatProperty(name=f"{label} (m)", description=f"{text}, m", precision=5, step=0.01, options=set(), **more)


class LengthsInUnits:
    """The lengths of a pattern in the units of the scene."""

    __annotations__ = {name + ENDING: in_units(name, "m", *words, step=0.1) for name, words in LENGTHS.items()}


class PatternProperties:
    """Settings of patterns besides the spacing, whose default is not the same everywhere."""

    rows: IntProperty(name="Rows", description="Number of rows of the array", default=14, min=2, soft_max=128, options=set())
    columns: IntProperty(
        name="Columns", description="Number of columns of the array", default=6, min=2, soft_max=128, options=set()
    )
    pitch_x: _length("pitch_x", default=0.0034, min=1e-6)
    pitch_y: _length("pitch_y", default=0.0034, min=1e-6)
    shift_x: _length("shift_x")
    shift_y: _length("shift_y")
    angle: FloatProperty(
        name="Turn", description="Angle of the rows, anticlockwise seen from outside", subtype="ANGLE", options=set()
    )
    seed: IntProperty(name="Seed", description="Seed of the random pattern", min=0, options=set())
    lift: _length("lift", min=0.0)


class PALPATE_PG_skin(PatternProperties, LengthsInUnits, bpy.types.PropertyGroup):
    """How the texels of a sensor were laid onto the surface of its parent: `Object.palpate.skin`"""

    method: EnumProperty(
        name="Pattern",
        description="How texels are laid onto the surface",
        items=SKIN_METHODS,
        options=set(),
        override={"LIBRARY_OVERRIDABLE"},
    )
    spacing: _length("spacing", default=0.002, min=1e-6)
    region: StringProperty(options={"HIDDEN"})
    region_name: StringProperty(options={"HIDDEN"})
    region_number: IntProperty(options={"HIDDEN"})
    region_threshold: FloatProperty(default=0.5, options={"HIDDEN"})  # that of sensors that were laid before it was stored
    made_from: StringProperty(options={"HIDDEN"})


PLACED, NET_FORCE = "PLACED", "NET_FORCE"
KINDS = (
    ("NONE", "None", "One reading for each texel, and nothing else", 0),
    (PLACED, "Magnets in the Scene", "Magnetometers read the field of magnets: empties of a collection are both", 1),
    (NET_FORCE, "Net Force", "Three channels of a load cell below the whole sensor, N", 2),
    *(
        (name.upper(), f"Skin {name}", f"Magnetometers read the field of magnets: {one.text}", number)
        for number, (name, one) in enumerate(PRESETS.items(), 3)
    ),
)
"""Kinds of read-outs with several channels. Their numbers are saved: a new one takes the next."""
PARTS = (
    ("NONE", "None", "Not part of a skin"),
    ("MAGNET", "Magnet", "It moves with the texels above it; its moment is along its Z axis"),
    ("MAGNETOMETER", "Magnetometer", "It measures the field along its X, Y and Z axes"),
)


def _number(name: str, text: str, **more):
    """Return a number that is constant during a run."""
    return FloatProperty(name=name, description=text, **more, **FIXED)


def _vector(name: str, text: str, precision: int = 4):
    """Return a vector that is constant during a run."""
    return FloatVectorProperty(name=name, description=text, size=3, subtype="XYZ", precision=precision, **FIXED)


class PALPATE_PG_readout(bpy.types.PropertyGroup):
    """Channels of a sensor besides its texels' readings: `Object.palpate.readout`"""

    kind: EnumProperty(name="Channels", description="Further channels that the sensor is read out by", items=KINDS, **FIXED)
    collection: PointerProperty(
        name="Magnets",
        description="Collection with the empties that are magnets and magnetometers",
        type=bpy.types.Collection,
        **FIXED,
    )
    thickness: _number(
        "Layer (m)",
        "Thickness of the compliant layer, whose base is rigid, m",
        default=6e-3,
        min=1e-6,
        max=0.999,
        precision=5,
        step=0.01,
    )
    thickness_in_units: in_units("thickness", "m", "Layer", "Thickness of the compliant layer, whose base is rigid", step=0.1)
    shear_stiffness: _number(
        "Shear Stiffness (N/m)",
        "Stiffness of a texel against shear, N/m: its surface moves sideways by its shear divided by it; "
        "0 is its normal stiffness",
        min=0.0,
        precision=3,
    )


class PALPATE_PG_magnetic(bpy.types.PropertyGroup):
    """The part that an empty has in magnetic skins: `Object.palpate.magnetic`"""

    part: EnumProperty(name="Part", description="What the empty is in a magnetic skin", items=PARTS, **FIXED)
    moment: _number(
        "Moment (A·m²)",
        "Dipole moment of a magnet along its Z axis, A·m²; a cylinder of N52, 1.6 mm wide and 1.7 mm high, has 0.004",
        default=4e-3,
        precision=5,
        step=0.01,
    )
    full_scale: _number(
        "Range (T)",
        "Largest field that an axis of a magnetometer shows, T; what is larger is clipped",
        default=50e-3,
        min=1e-9,
        precision=4,
        step=0.1,
    )
    zero_field: _vector(
        "Offset (T)",
        "What the axes of a magnetometer show more, T: its own zero and the field of the surroundings",
        precision=6,
    )


def parts(obj) -> list:
    """Return the empties of a sensor's collection that are magnets or magnetometers, by name."""
    own = obj.palpate.readout
    if own.kind != PLACED or own.collection is None:
        return []
    found = [part for part in own.collection.all_objects if part.type == "EMPTY" and part.palpate.magnetic.part != "NONE"]
    return sorted(found, key=lambda part: part.name)


def settings(obj) -> tuple:
    """Return all on which a sensor's channels depend besides its texels, in a form that can be compared; () without any."""
    own = obj.palpate.readout
    if own.kind == "NONE" or obj.palpate.role != "SENSOR":
        return ()
    return own.kind, own.thickness, own.shear_stiffness, *(_stated(part) for part in parts(obj))


def _stated(part) -> tuple:
    own = part.palpate.magnetic
    place = (*part.matrix_basis, *part.matrix_parent_inverse)  # not where a sensor that moves has carried it
    values = part.name, own.part, own.moment, own.full_scale, tuple(own.zero_field), part.parent and part.parent.name
    return *values, *(tuple(row) for row in place)


ROLES = (
    ("NONE", "None", "Not part of the simulation"),
    ("SENSOR", "Sensor", "Reports the forces on its texels"),
    ("TARGET", "Target", "Can touch sensors and pads"),
    ("PAD", "Pad", "Compliant like a sensor, without read-out: a table, the back of a finger"),
)


def _role_changed(settings, context):
    """Prepare an object that has got a role, also when a script has only set the property."""
    settings.schema_version = VERSION
    identity.ensure_uid(settings.id_data)
    session_state.participants_changed()
    if settings.role in {"SENSOR", "PAD"}:
        first_use.begin()
    _body_changed(settings, context)


def _body_changed(settings, _context):
    restore_unless_moved(settings.id_data)
    session_state.settings_changed()


class PALPATE_PG_object(SensorParameterProperties, PaintedProperties, DriveParameterProperties, bpy.types.PropertyGroup):
    """`Object.palpate`"""

    schema_version: IntProperty(options={"HIDDEN"})
    uid: StringProperty(options={"HIDDEN"})
    role: EnumProperty(
        name="Role", description="Role of the object in the simulation", items=ROLES, **(FIXED | {"update": _role_changed})
    )

    region: EnumProperty(
        name="Region",
        description="Which vertices become texels",
        items=(
            ("MESH", "Whole Mesh", "Every vertex"),
            ("GROUP", "Vertex Group", "Vertices whose weight reaches the threshold"),
            ("MATERIAL", "Material", "Faces with a material"),
            ("FACE_SET", "Face Set", "Faces of a face set of Sculpt Mode"),
        ),
        **FIXED,
    )
    material: StringProperty(name="Material", description="Material of the faces that belong to the sensor", **FIXED)
    face_set: IntProperty(name="Face Set", description="Number of the face set that is the sensor", default=1, **FIXED)
    vertex_group: StringProperty(name="Vertex Group", description="Painted or assigned region of the sensor", **FIXED)
    threshold: _number(
        "Threshold", "Least weight at which a vertex belongs to the sensor", default=0.5, min=0.0, max=1.0, subtype="FACTOR"
    )

    image_layout: EnumProperty(
        name="Tactile Image",
        description="How the texels become the images that a bake writes",
        items=(
            ("AUTO", "Automatic", "A pixel for each texel where they form rows and columns; other regions are flattened"),
            ("UV", "UV Map", "As a UV map of the mesh lays the surface out"),
        ),
        **FIXED,
    )
    image_map: StringProperty(
        name="UV Map", description="UV map of the tactile image; empty: the one that renders use", **FIXED
    )
    image_size: IntProperty(
        name="Resolution", description="Side of the tactile image, pixels", default=256, min=16, max=4096, **FIXED
    )
    image_filter: EnumProperty(
        name="Pixels",
        description="What a pixel between texels shows",
        items=(
            ("SMOOTH", "Smooth", "Values that change linearly from texel to texel over the surface"),
            ("NEAREST", "Nearest", "The value of the texel to whose part of the surface it belongs"),
        ),
        **FIXED,
    )

    presses: BoolProperty(
        name="Contact with Other Sensors",
        description="Other sensors and pads also touch the surface of this one; "
        "the two soft layers share the overlap as springs in series",
        **FIXED,
    )
    contact_normals: EnumProperty(
        name="Contact Normals",
        description="Direction of the contact normals",
        items=(
            ("FLAT", "Flat", "Along the normals of its triangles"),
            (
                "SMOOTH",
                "Smooth",
                "Along normals interpolated between its vertices, as for smooth shading: for balls and fingers",
            ),
        ),
        **FIXED,
    )
    body: EnumProperty(
        name="Body",
        description="Cause of the motion of this object",
        items=(
            ("KEYFRAMED", "Keyframed", "Animation, parents and constraints move it; forces do not"),
            ("FREE", "Free", "Gravity and contact forces move it, from where it is at the first frame"),
            ("DRIVEN", "Driven", "An actuator of limited force along one axis; its parent carries it. A finger of a gripper"),
            ("PARENT", "Part of Parent", "It is fixed to its parent: contact forces on it act on the parent's body"),
        ),
        **(FIXED | {"update": _body_changed}),
    )
    mass: _number(
        "Mass (kg)",
        "Mass of a free or driven body, kg; the inertia is that of a solid of uniform density",
        default=1.0,
        min=0.0,
        precision=4,
    )
    velocity: _vector("Velocity (m/s)", "Velocity of a free body at the first frame, m/s, world axes")
    mass_in_units: in_units(
        "mass", "kg", "Mass", "Mass of a free or driven body; its inertia is that of a solid of uniform density", min=0.0
    )
    velocity_in_units: in_units(
        "velocity", "m/s", "Velocity", "Velocity of a free body at the first frame, world axes", is_vector=True
    )
    angular_velocity: _vector("Spin (rad/s)", "Angular velocity of a free body at the first frame, rad/s, world axes")

    effects: CollectionProperty(
        type=effect_stack.PALPATE_PG_effect,
        name="Effects",
        description="Effects of real sensors that the base model lacks",
        override={"LIBRARY_OVERRIDABLE", "USE_INSERTION"},
    )

    readout: PointerProperty(
        type=PALPATE_PG_readout,
        description="Channels of the sensor besides its texels' readings",
        override={"LIBRARY_OVERRIDABLE"},
    )
    magnetic: PointerProperty(
        type=PALPATE_PG_magnetic,
        description="What an empty is in a magnetic skin",
        override={"LIBRARY_OVERRIDABLE"},
    )

    measured: StringProperty(name="Rig", description="Measurements of the real sensor: a rig.toml, with its CSV files", **FIXED)

    made_vertices: IntProperty(options={"HIDDEN"})
    skin: PointerProperty(
        type=PALPATE_PG_skin,
        description="How the texels were laid onto the surface of the parent",
        override={"LIBRARY_OVERRIDABLE"},
    )

    drive_control: EnumProperty(
        name="Control",
        description="Quantity that the drive controls",
        items=(
            ("POSITION", "Position", "A distance along its axis, from where the object starts on its parent"),
            ("VELOCITY", "Velocity", "A speed along its axis"),
            (
                "FORCE",
                "Tactile Force",
                "The sum of a sensor's normal forces: approaches with the speed limit until it touches, then holds the sum",
            ),
        ),
        **FIXED,
    )
    drive_axis: EnumProperty(
        name="Axis",
        description="Direction in which the drive moves the object; a finger closes in this direction",
        items=tuple((key, key, f"Along {key}") for key in ("X", "Y", "Z", "-X", "-Y", "-Z")),
        default="Z",
        **FIXED,
    )
    drive_space: EnumProperty(
        name="Axis of",
        description="Frame in which the axis is fixed",
        items=(
            ("LOCAL", "Object", "The frame of the object; it turns with its carrier"),
            ("PARENT", "Parent", "The frame of the parent at the first frame; it turns with the carrier"),
            ("WORLD", "World", "The axis never turns"),
        ),
        **FIXED,
    )
    drive_position: FloatProperty(
        name="Way (m)",
        description="Target of position control, m from the start; can be keyframed",
        precision=5,
        step=0.1,
        update=session_state.settings_changed,
    )
    drive_speed: FloatProperty(
        name="Speed (m/s)",
        description="Target of velocity control, m/s; can be keyframed",
        precision=4,
        step=1,
        update=session_state.settings_changed,
    )
    drive_force: FloatProperty(
        name="Tactile Sum (N)",
        description="Target of force control: sum of the sensor's normal forces, N; zero opens. Can be keyframed",
        default=5.0,
        precision=4,
        update=session_state.settings_changed,
    )
    drive_sensor: PointerProperty(
        name="Sensor",
        description="Sensor whose tactile sum is controlled; the object itself when empty",
        type=bpy.types.Object,
        **FIXED,
    )
    drive_leader: PointerProperty(
        name="Coupled With",
        description="Driven object whose drive moves this one as well, each along its own axis: the other finger of a gripper",
        type=bpy.types.Object,
        **FIXED,
    )

    # The start of a free body that was moved, and what a bake left. They are saved, so that a reopened file can be restored.
    has_start: BoolProperty(options={"HIDDEN"})
    start_matrix: FloatVectorProperty(size=16, options={"HIDDEN"})
    start_channels: FloatVectorProperty(size=14, options={"HIDDEN"})
    is_baked: BoolProperty(options={"HIDDEN"})
    made_action: BoolProperty(options={"HIDDEN"})
    bake_folder: StringProperty(options={"HIDDEN"})
    # Blender saves what has a user: heat maps do not use the images of a bake for every quantity.
    tactile_images: PointerProperty(type=bpy.types.Image, options={"HIDDEN"})
