# SPDX-License-Identifier: GPL-3.0-or-later
"""Read what computes a sensor's channels out of Blender: a preset, a load cell, or empties as magnets and magnetometers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...core.errors import SensorError
from ...core.model.recording import ChannelReadout
from ...core.model.sensor import Sensor
from ...core.skins import skin_presets
from ...core.skins.channel_readouts import MagneticReadout, net_force_of
from ...core.skins.magnetic_skin import FULL_SCALE, Magnetometers, Magnets, magnetic_skin
from ..properties import magnetic_properties
from ..session import units
from . import body_poses


def with_channels(obj, sensor: Sensor, to_body: tuple[np.ndarray, np.ndarray], depsgraph) -> Sensor:
    """Return a sensor with the read-out that its object's settings choose.

    Parameters
    ----------
    obj : Object
    sensor : Sensor
        Of the object.
    to_body : (3, 3) and (3,) float
        A point x of the object is at the product of the first with x, plus the second, in the frame of the sensor's body, m.
    depsgraph : Depsgraph

    Raises
    ------
    SensorError
        There are no magnets or magnetometers, or they make no skin.
    """
    kind = obj.palpate.readout.kind
    if kind == "NONE" or not sensor.readout:
        return sensor
    if kind == magnetic_properties.NET_FORCE:
        return replace(sensor, channels=net_force_of(sensor.texels))
    try:
        return replace(sensor, channels=_magnetic(obj, sensor, to_body, depsgraph))
    except SensorError as error:
        raise SensorError(f"Channels of sensor '{obj.name}': {error}") from error


def _magnetic(obj, sensor: Sensor, to_body: tuple[np.ndarray, np.ndarray], depsgraph) -> ChannelReadout:
    own, texels = obj.palpate.readout, sensor.texels
    if own.kind == magnetic_properties.PLACED:
        magnets, chips = _placed(obj, to_body, depsgraph)
        thickness = units.as_typed(own.thickness)
    else:
        preset = skin_presets.preset_named(own.kind.lower())
        skin = skin_presets.placed(preset, texels)
        magnets = Magnets(skin.magnets, skin.moments)
        chips = Magnetometers(skin.magnetometers, skin.axes, FULL_SCALE, np.zeros(skin.magnetometers.shape))
        thickness = preset.thickness
    stiffness = units.as_typed(own.shear_stiffness) or sensor.parameters.k
    return MagneticReadout(magnetic_skin(texels, magnets, chips, thickness), texels, stiffness)


def _placed(obj, to_body: tuple[np.ndarray, np.ndarray], depsgraph) -> tuple[Magnets, Magnetometers]:
    """Return the magnets and magnetometers of a sensor's collection, in the frame of its body."""
    own = obj.palpate.readout
    if own.collection is None:
        raise SensorError("no collection has its magnets: choose one under Readout, or use Place Magnetic Skin.")
    linear, offset = to_body
    inverse = np.linalg.inv(body_poses.world_matrix(obj, depsgraph))
    found: dict[str, list] = {"MAGNET": [], "MAGNETOMETER": []}
    for part in magnetic_properties.parts(obj):
        matrix = inverse @ body_poses.world_matrix(part, depsgraph)
        turned, place = linear @ matrix[:3, :3], linear @ matrix[:3, 3] + offset
        lengths = np.linalg.norm(turned, axis=0)
        if not (np.isfinite(place).all() and np.isfinite(turned).all() and (lengths > 0.0).all()):
            raise SensorError(f"'{part.name}' has a scale of zero, or a NaN or infinite location: correct it.")
        found[part.palpate.magnetic.part].append((part.palpate.magnetic, place, (turned / lengths).T))
    for kind, what in (("MAGNET", "magnet"), ("MAGNETOMETER", "magnetometer")):
        if not found[kind]:
            raise SensorError(
                f"its collection '{own.collection.name}' has no {what}: give an empty in it this part "
                "(Physics › Palpate Magnet), or use Place Magnetic Skin."
            )
    magnets, chips = found["MAGNET"], found["MAGNETOMETER"]
    return Magnets(
        place=np.array([place for _, place, _ in magnets]),
        moment=np.array([units.as_typed(part.moment) * axes[2] for part, _, axes in magnets]),
    ), Magnetometers(
        place=np.array([place for _, place, _ in chips]),
        axes=np.array([axes for _, _, axes in chips]),
        full_scale=np.array([units.as_typed(part.full_scale) for part, _, _ in chips]),
        offset=np.array([[units.as_typed(value) for value in part.zero_field] for part, _, _ in chips]),
    )
