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

from ...core.io.settings_migration import VERSION
from ..session import first_use, identity, session_state
from . import effect_stack, laid_sensor_properties, start_transforms
from .painted_maps import PaintedProperties
from .parameter_properties import FIXED, DriveParameterProperties, SensorParameterProperties

ROLES = (
    ("NONE", "None", "Takes no part"),
    ("SENSOR", "Sensor", "Feels what touches it, in every texel"),
    ("TARGET", "Target", "Presses on sensors and pads"),
    ("PAD", "Pad", "Gives way like a sensor, but is not read out: a table, the back of a finger"),
)


def _role_changed(settings, context):
    """Also a script that only sets the role gets an object that can be found again."""
    settings.schema_version = VERSION
    identity.ensure_uid(settings.id_data)
    session_state.participants_changed()
    if settings.role in {"SENSOR", "PAD"}:
        first_use.begin()
    _body_changed(settings, context)


def _body_changed(settings, _context):
    start_transforms.restore_unless_moved(settings.id_data)


class PALPATE_PG_object(SensorParameterProperties, PaintedProperties, DriveParameterProperties, bpy.types.PropertyGroup):
    """`Object.palpate`"""

    schema_version: IntProperty(options={"HIDDEN"})
    uid: StringProperty(options={"HIDDEN"})
    role: EnumProperty(name="Role", description="Part of this object", items=ROLES, update=_role_changed, **FIXED)

    region: EnumProperty(
        name="Region",
        description="Which vertices become texels",
        items=(
            ("MESH", "Whole Mesh", "Every vertex"),
            ("GROUP", "Vertex Group", "Vertices whose weight reaches the threshold"),
            ("MATERIAL", "Material", "Faces that wear a material"),
            ("FACE_SET", "Face Set", "Faces of one of Sculpt Mode's face sets"),
        ),
        **FIXED,
    )
    material: StringProperty(name="Material", description="Of the faces that belong to the sensor", **FIXED)
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
    image_map: StringProperty(name="UV Map", description="Of the tactile image; empty: the one that renders use", **FIXED)
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
        name="Felt by Other Sensors",
        description="Other sensors and pads feel this one's surface too; both skins share the overlap as springs in series",
        **FIXED,
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
        **FIXED,
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
        **FIXED,
    )
    mass: FloatProperty(
        name="Mass (kg)",
        description="Of a free or driven body, kg; inertia follows from the mesh, taken as a solid of uniform density",
        default=1.0,
        min=0.0,
        precision=4,
        **FIXED,
    )
    velocity: FloatVectorProperty(
        name="Velocity (m/s)",
        description="Of a free body at the first frame, m/s, world axes",
        size=3,
        subtype="XYZ",
        precision=4,
        **FIXED,
    )
    angular_velocity: FloatVectorProperty(
        name="Spin (rad/s)",
        description="Of a free body at the first frame, rad/s, world axes",
        size=3,
        subtype="XYZ",
        precision=4,
        **FIXED,
    )

    effects: CollectionProperty(
        type=effect_stack.PALPATE_PG_effect,
        name="Effects",
        description="What real sensors do and the base model does not",
        override={"LIBRARY_OVERRIDABLE", "USE_INSERTION"},
    )

    measured: StringProperty(
        name="Rig", description="Measurements of the real sensor: a rig.toml, with its CSV files beside it", **FIXED
    )

    made_vertices: IntProperty(options={"HIDDEN"})
    skin: PointerProperty(
        type=laid_sensor_properties.PALPATE_PG_skin,
        description="How it was laid onto its parent's surface",
        override={"LIBRARY_OVERRIDABLE"},
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
        **FIXED,
    )
    drive_axis: EnumProperty(
        name="Axis",
        description="Direction in which the drive moves it; a finger closes this way",
        items=tuple((key, key, f"Along {key}") for key in ("X", "Y", "Z", "-X", "-Y", "-Z")),
        default="Z",
        **FIXED,
    )
    drive_space: EnumProperty(
        name="Axis of",
        description="Whose axis it is",
        items=(
            ("LOCAL", "Object", "The object's own; turns along with what carries it"),
            ("PARENT", "Parent", "Its parent's at the first frame; turns along with what carries it"),
            ("WORLD", "World", "Stands still"),
        ),
        **FIXED,
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

    # Bookkeeping of a free body that was moved, and of a bake. Saved, so that a reopened file can be put right.
    has_start: BoolProperty(options={"HIDDEN"})
    start_matrix: FloatVectorProperty(size=16, options={"HIDDEN"})
    start_channels: FloatVectorProperty(size=14, options={"HIDDEN"})
    is_baked: BoolProperty(options={"HIDDEN"})
    made_action: BoolProperty(options={"HIDDEN"})
    bake_folder: StringProperty(options={"HIDDEN"})
