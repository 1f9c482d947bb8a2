# SPDX-License-Identifier: GPL-3.0-or-later
"""Warns where the 32 bits of Blender's numbers change forces: far from the origin, and in keyframes that are too near."""

from __future__ import annotations

import bpy
import numpy as np

from ...core.model.recording import row_blocks
from ...core.model.scenario import Scenario
from ..session import fcurves
from . import animation_fingerprint
from .drives import TARGET_PROPERTIES

FLOAT32_ROUNDING = 2.0**-24
"""Largest relative rounding of Blender's numbers."""
FLAT = 2.0**-23
"""Blender units. Where both keyframes of a Bézier curve and their handles differ by less, Blender takes the curve for constant
(FLT_EPSILON in its `fcurve_eval_keyframes_interpolate`) and jumps at the second keyframe."""
ROUNDING_SHARE = 0.001
"""Share of the thinnest skin's depth by which positions may be off without a warning. A ball that presses 2 mm deep into a skin
of 12 mm has this share 200 m from the origin; from 100 m to 1 km the largest error of its force grows from 0.6 % to 8 %."""
_LENGTHS = ("location", "delta_location", f"palpate.{TARGET_PROPERTIES['POSITION']}")
"""Properties in Blender units or metres."""


def distance_warnings(scenario: Scenario) -> tuple[str, ...]:
    """Return a warning for the body that is so far from the origin that rounding changes forces."""
    skin = _thinnest_skin(scenario)
    distances = {body.name: _largest_distance(body.motion.positions) for body in scenario.bodies}
    for target in scenario.targets:
        name = scenario.bodies[target.body].name
        distances[name] += float(np.linalg.norm(target.mesh.vertices, axis=1).max())
    name = max(distances, key=lambda body: distances[body])
    rounding = distances[name] * FLOAT32_ROUNDING
    if rounding < ROUNDING_SHARE * skin:
        return ()
    return (
        f"'{name}' is {distances[name] * 1e-3:.3g} km from the origin, where Blender rounds positions to "
        f"{rounding * 1e3:.2g} mm and a skin is {skin * 1e3:.3g} mm deep: move the scene to the origin, "
        "or its forces are inexact.",
    )


def keyframe_warnings(objects, scenario: Scenario, metres_per_unit: float) -> tuple[str, ...]:
    """Return a warning for each object that Blender holds still between keyframes that are too near to each other.

    Parameters
    ----------
    objects : iterable of Object
        The participants; what they depend on is looked at too.
    scenario : Scenario
    metres_per_unit : float
    """
    least = ROUNDING_SHARE * _thinnest_skin(scenario)
    if FLAT * max(metres_per_unit, 1.0) < least:
        return ()
    found = []
    for block in animation_fingerprint.related_data_blocks(objects):
        if isinstance(block, bpy.types.Object) and block.animation_data is not None:
            for curve in fcurves.of_object(block) or ():
                metres = 1.0 if curve.data_path.startswith("palpate.") else metres_per_unit
                if curve.data_path in _LENGTHS and _largest_flat_difference(curve) * metres >= least:
                    found.append(block.name)
                    break
    return tuple(
        f"Blender holds '{name}' still between keyframes that differ by less than {FLAT:.2g} units, and then it jumps: "
        "set a smaller Unit Scale and enlarge the scene in units, or make these keyframes linear."
        for name in found
    )


def _largest_flat_difference(curve) -> float:
    """Return by how many units an F-curve jumps at most where Blender takes it for constant between two keyframes."""
    points, largest = curve.keyframe_points, 0.0
    for k in range(len(points) - 1):
        before, after = points[k], points[k + 1]
        values = before.co[1], before.handle_right[1], after.handle_left[1], after.co[1]
        if before.interpolation == "BEZIER" and max(values) - min(values) < FLAT:
            largest = max(largest, abs(after.co[1] - before.co[1]))
    return largest


def _thinnest_skin(scenario: Scenario) -> float:
    """Return the smallest maximum penetration of a scenario's sensors, metres."""
    return min(sensor.parameters.max_penetration for sensor in scenario.sensors)


def _largest_distance(positions: np.ndarray) -> float:
    return max(float(np.linalg.norm(positions[rows], axis=1).max()) for rows in row_blocks(positions))
