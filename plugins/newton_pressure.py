# SPDX-License-Identifier: GPL-3.0-or-later
"""The pressure law of a sensor as a function of Warp, for Newton's hydroelastic contact."""

import warp as wp


@wp.struct
class PressureData:
    """Pressures of the sensor's shapes at multiples of a depth, and the stiffness of all other shapes.

    Attributes
    ----------
    pressure : (m,) float, Pa
        From depth zero.
    step : float, metres
    is_sensor : (shapes,) int
        One where the table holds.
    stiffness : (shapes,) float, Pa/m
        Newton's own ``shape_material_kh``.
    """

    pressure: wp.array(dtype=float)
    step: float
    is_sensor: wp.array(dtype=int)
    stiffness: wp.array(dtype=float)


@wp.func
def sensor_pressure(signed_depth: wp.float32, shape_idx: wp.int32, data: PressureData) -> wp.float32:
    """Return the pressure at a depth, negative inside; it falls on outside, as Newton asks for."""
    if data.is_sensor[shape_idx] == 0:
        return -data.stiffness[shape_idx] * signed_depth
    place = -signed_depth / data.step
    last = data.pressure.shape[0] - 2
    i = wp.clamp(int(wp.floor(place)), 0, last)
    return data.pressure[i] + (place - float(i)) * (data.pressure[i + 1] - data.pressure[i])
