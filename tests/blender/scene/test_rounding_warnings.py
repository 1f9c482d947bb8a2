# SPDX-License-Identifier: GPL-3.0-or-later
"""What 32 bits do to a scene: nothing at any unit scale, and a warning where they change forces."""

import bpy
import numpy as np
import pytest
from blender_scenes import ball, grid, keyframe, reading_of, scene_of

from palpate.addon.session import fcurves
from palpate.core.solver.simulation import run


def reading(size=1.0, unit_scale=1.0, away=0.0, interpolation="BEZIER"):
    """In an empty file, a ball pressed 2 mm deep into a pad, `size` times as large, `away` metres from the origin."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = scene_of(9)
    scene.unit_settings.scale_length = unit_scale
    units = size / unit_scale
    place = np.full(3, away / unit_scale / np.sqrt(3.0))
    pad = grid(location=place, size=0.05 * units)
    target = ball(location=place + (0.0, 0.0, 0.01 * units), radius=0.008 * units)
    pad.palpate.role, target.palpate.role = "SENSOR", "TARGET"
    pad.palpate.max_penetration, pad.palpate.x0 = 0.012 * size, 0.3 * size
    keyframe(target, "location", {1: target.location[:], 9: place + np.array((0.001, 0.0005, 0.006)) * units})
    for curve in fcurves.of_object(target):
        for point in curve.keyframe_points:
            point.interpolation = interpolation
    scene.frame_set(1)
    return reading_of(scene)


def forces(found):
    """The texels' forces, N; those of a scene `size` times as large are `size` times as large."""
    return run(found.scenario).sensors["Pad"].normal_force


@pytest.mark.parametrize("size", [1e-6, 1e-3, 10.0, 1e3])
def test_forces_are_the_same_at_every_unit_scale(size):
    """Unit scale, skin and Stribeck velocity are rounded to 24 bits each; depths are a tenth of what is rounded."""
    expected, found = reading(), reading(size, unit_scale=size)
    assert expected.warnings == found.warnings == ()
    usual = forces(expected)
    assert np.abs(forces(found) / size - usual).max() <= 1e-6 * usual.max()


def test_keyframes_that_blender_takes_for_equal_are_named():
    """Of a Bézier curve between keyframes that differ by less than 2⁻²³ units Blender shows the first until the second."""
    found = reading(1e-5)
    heights = found.scenario.bodies[1].motion.positions[:, 2]
    assert heights[0] == heights[-2] != heights[-1]
    (warning,) = found.warnings
    assert warning.startswith("Blender holds 'Ball' still between keyframes that differ by less than 1.2e-07 units")
    assert warning.endswith(".")


def test_equal_keyframes_and_a_deep_skin_are_not_named():
    assert reading(1e-5, interpolation="CONSTANT").warnings == ()
    assert reading(1e-2).warnings == ()


@pytest.mark.parametrize(("away", "least", "most"), [(100.0, 1e-4, 0.02), (1e3, 0.02, 0.3)])
def test_a_scene_far_from_the_origin_is_named_before_its_forces_are_wrong(away, least, most):
    """Rounded positions change the depth of a texel by 2⁻²⁴ of the distance, and the steps of a rounded path its damping."""
    usual = forces(reading()).sum(axis=1)
    found = reading(away=away)
    off = np.abs(forces(found).sum(axis=1) - usual).max() / usual.max()
    assert least < off < most
    if away < 200.0:
        assert found.warnings == ()
    else:
        (warning,) = found.warnings
        words = "'Ball' is 1 km from the origin, where Blender rounds positions to 0.06 mm and a skin is 12 mm"
        assert warning.startswith(words)


def test_the_distance_that_is_warned_of_follows_the_skin():
    """The same scene in a thousandth of the size is named a thousand times nearer."""
    assert reading(1e-3, away=0.1).warnings == ()
    (warning,) = reading(1e-3, away=1.0).warnings
    assert "from the origin" in warning
