# SPDX-License-Identifier: GPL-3.0-or-later
"""What channels a sensor is read out by, and the magnets and magnetometers that stand in a scene as empties."""

import bpy
from bpy.props import EnumProperty, FloatProperty, FloatVectorProperty, PointerProperty

from ...core.skins.skin_presets import PRESETS
from .parameter_properties import FIXED
from .scene_units import in_units

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


class PALPATE_PG_readout(bpy.types.PropertyGroup):
    """Channels of a sensor besides its texels' readings: `Object.palpate.readout`"""

    kind: EnumProperty(name="Channels", description="Further channels that the sensor is read out by", items=KINDS, **FIXED)
    collection: PointerProperty(
        name="Magnets",
        description="Collection with the empties that are magnets and magnetometers",
        type=bpy.types.Collection,
        **FIXED,
    )
    thickness: FloatProperty(
        name="Layer (m)",
        description="Thickness of the compliant layer, whose base is rigid, m",
        default=6e-3,
        min=1e-6,
        max=0.999,
        precision=5,
        step=0.01,
        **FIXED,
    )
    thickness_in_units: in_units("thickness", "m", "Layer", "Thickness of the compliant layer, whose base is rigid", step=0.1)
    shear_stiffness: FloatProperty(
        name="Shear Stiffness (N/m)",
        description="Stiffness of a texel against shear, N/m: its surface moves sideways by its shear divided by it; "
        "0 is its normal stiffness",
        min=0.0,
        precision=3,
        **FIXED,
    )


class PALPATE_PG_magnetic(bpy.types.PropertyGroup):
    """The part that an empty has in magnetic skins: `Object.palpate.magnetic`"""

    part: EnumProperty(name="Part", description="What the empty is in a magnetic skin", items=PARTS, **FIXED)
    moment: FloatProperty(
        name="Moment (A·m²)",
        description="Dipole moment of a magnet along its Z axis, A·m²; "
        "a cylinder of N52, 1.6 mm wide and 1.7 mm high, has 0.004",
        default=4e-3,
        precision=5,
        step=0.01,
        **FIXED,
    )
    full_scale: FloatProperty(
        name="Range (T)",
        description="Largest field that an axis of a magnetometer shows, T; what is larger is clipped",
        default=50e-3,
        min=1e-9,
        precision=4,
        step=0.1,
        **FIXED,
    )
    zero_field: FloatVectorProperty(
        name="Offset (T)",
        description="What the axes of a magnetometer show more, T: its own zero and the field of the surroundings",
        size=3,
        subtype="XYZ",
        precision=6,
        **FIXED,
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
