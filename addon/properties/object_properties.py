# SPDX-License-Identifier: GPL-3.0-or-later
"""What a user says about an object: `Object.palpate`."""

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

from ..session import first_use, identity, session_state
from . import effect_stack, laid_sensor_properties, magnetic_properties, start_transforms
from .painted_maps import PaintedProperties
from .parameter_properties import FIXED, DriveParameterProperties, SensorParameterProperties
from .scene_units import in_units
from .settings_migration import VERSION

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
    start_transforms.restore_unless_moved(settings.id_data)
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
    threshold: FloatProperty(
        name="Threshold",
        description="Least weight at which a vertex belongs to the sensor",
        default=0.5,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
        **FIXED,
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
    mass: FloatProperty(
        name="Mass (kg)",
        description="Mass of a free or driven body, kg; the inertia is that of a solid of uniform density",
        default=1.0,
        min=0.0,
        precision=4,
        **FIXED,
    )
    velocity: FloatVectorProperty(
        name="Velocity (m/s)",
        description="Velocity of a free body at the first frame, m/s, world axes",
        size=3,
        subtype="XYZ",
        precision=4,
        **FIXED,
    )
    mass_in_units: in_units(
        "mass", "kg", "Mass", "Mass of a free or driven body; its inertia is that of a solid of uniform density", min=0.0
    )
    velocity_in_units: in_units(
        "velocity", "m/s", "Velocity", "Velocity of a free body at the first frame, world axes", is_vector=True
    )
    angular_velocity: FloatVectorProperty(
        name="Spin (rad/s)",
        description="Angular velocity of a free body at the first frame, rad/s, world axes",
        size=3,
        subtype="XYZ",
        precision=4,
        **FIXED,
    )

    effects: CollectionProperty(
        type=effect_stack.PALPATE_PG_effect,
        name="Effects",
        description="Effects of real sensors that the base model lacks",
        override={"LIBRARY_OVERRIDABLE", "USE_INSERTION"},
    )

    readout: PointerProperty(
        type=magnetic_properties.PALPATE_PG_readout,
        description="Channels of the sensor besides its texels' readings",
        override={"LIBRARY_OVERRIDABLE"},
    )
    magnetic: PointerProperty(
        type=magnetic_properties.PALPATE_PG_magnetic,
        description="What an empty is in a magnetic skin",
        override={"LIBRARY_OVERRIDABLE"},
    )

    measured: StringProperty(name="Rig", description="Measurements of the real sensor: a rig.toml, with its CSV files", **FIXED)

    made_vertices: IntProperty(options={"HIDDEN"})
    skin: PointerProperty(
        type=laid_sensor_properties.PALPATE_PG_skin,
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
