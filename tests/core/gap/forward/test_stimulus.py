# SPDX-License-Identifier: GPL-3.0-or-later
"""What the texels of a rig meet, against geometry done by hand."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from solver_scenes import box, shape

from palpate.core.errors import PalpateError
from palpate.core.gap.dataset.rig import Indenter, Rig, grid_texels
from palpate.core.gap.dataset.trial import Trial
from palpate.core.gap.fitting.noise_floor import coverage
from palpate.core.gap.forward.closed_form_contact import shape_contact
from palpate.core.gap.forward.force_model import _equal_texels
from palpate.core.gap.forward.predictor import Model, Predictor
from palpate.core.gap.forward.stimulus import stimulus_of
from palpate.core.model.sensor_parameters import SensorParameters

RADIUS = 0.008
BALL = Indenter(shape(trimesh.creation.icosphere(2, RADIUS)), RADIUS)


def trial(position, quaternion=None, time=None, **changes):
    count = len(position)
    time = 0.02 * np.arange(count) if time is None else time
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)) if quaternion is None else quaternion
    values = dict(position=np.asarray(position, float), quaternion=turns, level=None, travel=np.zeros((count, 2)))
    values.update(reading=None, force=np.zeros((count, 3)))
    values.update(changes)
    return Trial("press", "fit", time, values.pop("stimulus", "pose"), **values)


def rig(indenter, one):
    return Rig("rig", grid_texels(14, 6, 0.0034, 0.0034), SensorParameters(), frozenset(), None, indenter, (one,))


@pytest.mark.parametrize("turned", [False, True])
def test_a_box_is_its_mesh(turned):
    """Closed form and the solver's contact search agree to rounding, for boxes smaller and larger than the pad, and askew.

    The normals of a turned box's texels point in all directions.
    """
    rng = np.random.default_rng(2)
    for edges in ((0.01, 0.015, 0.008), (0.04, 0.07, 0.02)):
        where = np.column_stack([*rng.uniform(-5e-3, 5e-3, (2, 40)), 0.5 * edges[2] - rng.uniform(-1e-3, 3e-3, 40)])
        turns = np.column_stack([np.ones(40), 0.08 * rng.normal(size=(40, 3))])
        turns /= np.linalg.norm(turns, axis=1)[:, None]
        one = trial(where, turns if turned else None)
        own = rig(Indenter(box(*edges), None, edges), one)
        if turned:
            normal = own.texels.normal + 0.5 * rng.normal(size=own.texels.normal.shape)
            own = replace(own, texels=replace(own.texels, normal=normal / np.linalg.norm(normal, axis=1)[:, None]))
        exact, plain = (stimulus_of(one, replace(own, indenter=replace(own.indenter, edges=size))) for size in (edges, None))
        differ = np.abs(plain.depth - exact.depth) > 1e-12  # where a segment just meets an edge, rounding decides
        assert differ.mean() < 1e-3 and exact.depth.max() > 1e-3
        for name in ("rate", "normal", "slide_speed"):
            np.testing.assert_allclose(getattr(plain, name)[~differ], getattr(exact, name)[~differ], atol=1e-9)


def test_depth_rate_and_slide_of_a_ball_are_those_of_geometry():
    time = np.linspace(0.0, 1.0, 201)
    path = np.column_stack([2e-3 * time, 1e-3 * time, RADIUS - 1e-3 - 5e-4 * time**2])
    one = trial(path, time=time)
    found = stimulus_of(one, rig(BALL, one))
    texels = grid_texels(14, 6, 0.0034, 0.0034)
    for texel in np.flatnonzero((found.depth > 0).all(axis=0)):
        offset = texels.position[texel, :2] - path[:, :2]
        height = np.sqrt(RADIUS**2 - (offset**2).sum(axis=1))  # of the surface below the centre
        normal = np.column_stack([offset, -height]) / RADIUS
        expected = (height - path[:, 2]) * height / RADIUS  # perpendicular to the surface (Eq. 4)
        np.testing.assert_allclose(found.depth[:, texel], expected, rtol=1e-12)
        velocity = np.column_stack([np.full(201, 2e-3), np.full(201, 1e-3), -1e-3 * time])
        inner = slice(1, -1)  # central differences are exact for a parabola, but not at its ends
        np.testing.assert_allclose(found.rate[inner, texel], (velocity * normal).sum(axis=1)[inner], rtol=1e-9)
        tangential = velocity - (velocity * normal).sum(axis=1)[:, None] * normal
        np.testing.assert_allclose(found.slip[inner, texel], tangential[inner], atol=1e-12)
        np.testing.assert_allclose(found.slide_speed[inner, texel], np.linalg.norm(tangential, axis=1)[inner], rtol=1e-7)


def test_a_turning_cylinder_rubs():
    """A flat end that turns about its axis slides at ω r and presses nothing in."""
    time = np.linspace(0.0, 0.5, 26)
    angle = 2.0 * time
    turns = np.column_stack([np.cos(angle / 2), 0 * time, 0 * time, np.sin(angle / 2)])
    one = trial(np.tile([0.0, 0.0, 0.004], (26, 1)), turns, time)
    cylinder = Indenter(shape(trimesh.creation.cylinder(0.007, 0.01, sections=128)))
    found = stimulus_of(one, rig(cylinder, one))
    away = np.linalg.norm(grid_texels(14, 6, 0.0034, 0.0034).position[:, :2], axis=1)
    inside = away < 0.0069
    np.testing.assert_allclose(found.depth[:, inside], 1e-3, rtol=1e-9)
    assert not found.depth[:, away > 0.0071].any()
    np.testing.assert_allclose(found.slide_speed[:, inside], np.tile(2.0 * away[inside], (26, 1)), atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(found.mean_slip[:, inside], axis=2), found.slide_speed[:, inside], atol=1e-9)
    assert np.abs(found.rate).max() < 1e-12


def test_slides_of_the_steps_add_up_to_the_path():
    """A ball that starts and stops between two samples has slid as far as its path is long."""
    time = 0.02 * np.arange(60)
    along = np.interp(time, [0.305, 0.695], [-2e-3, 2e-3])
    one = trial(np.column_stack([0 * along, along, np.full(60, RADIUS - 3e-3)]), time=time)
    found = stimulus_of(one, rig(BALL, one))
    (whole,) = np.nonzero((found.depth > 0).all(axis=0))
    assert len(whole)
    steps, normal = np.diff(one.position, axis=0)[:, None], found.normal[1:, whole]
    inward = (steps * normal).sum(axis=2, keepdims=True) * normal
    np.testing.assert_allclose(0.02 * found.mean_slip[1:, whole], steps - inward, atol=1e-15)


def test_a_block_that_turns_about_a_texel_does_not_slide_there():
    """Its origin is 0.1 m away, so that it moves and turns at once; the slip is second order in the step."""
    time = 0.02 * np.arange(51)
    texels = grid_texels(14, 6, 0.0034, 0.0034)
    pivot, arm = texels.position[40], np.stack([np.cos(time), np.sin(time), 0.0 * time], axis=1)
    turns = np.column_stack([np.cos(time / 2), 0.0 * time, 0.0 * time, np.sin(time / 2)])
    one = trial(pivot + 0.1 * arm + [0.0, 0.0, 4e-3], turns, time)
    found = stimulus_of(one, rig(Indenter(box(0.4, 0.4, 0.01), None, (0.4, 0.4, 0.01)), one))
    assert np.linalg.norm(0.02 * found.mean_slip[1:, 40].sum(axis=0)) < 1e-5


def test_depth_and_force_trials_load_all_texels_alike():
    time = 0.02 * np.arange(50)
    level = np.clip(np.sin(6 * time), 0, None) * 1e-3
    slide = np.column_stack([0.01 * time, 0 * time])
    one = trial(np.zeros((50, 3)), stimulus="depth", level=level, travel=slide)
    found = stimulus_of(one, rig(None, one))
    np.testing.assert_array_equal(found.depth, np.tile(level[:, None], (1, 84)))
    np.testing.assert_allclose(found.slip[level > 0], np.tile([0.01, 0.0, 0.0], (np.count_nonzero(level), 84, 1)), atol=1e-15)
    np.testing.assert_allclose(found.mean_slip, found.slip, atol=1e-15)
    pushed = stimulus_of(replace(one, stimulus="force"), rig(None, one))
    np.testing.assert_allclose(pushed.force_share.sum(axis=1), level)


def test_deeper_than_the_model_reaches_still_counts_and_right_through_is_refused():
    path = np.tile([0.0, 0.0, RADIUS - 0.015], (10, 1))
    one = trial(path)
    found = stimulus_of(one, rig(BALL, one))
    assert 0.012 < found.depth.max() < 0.015 and found.overpressed > 0
    through = trial(path - [0, 0, 1.0])
    hollow = Indenter(box(0.01, 0.01, 4.0))
    with pytest.raises(PalpateError, match="right through"):
        stimulus_of(through, rig(hollow, through))


def test_a_contact_that_is_never_broken_is_one_cycle():
    one = replace(trial(np.zeros((50, 3))), stimulus="depth", position=None, quaternion=None, level=np.full(50, 1e-3))
    found = coverage([Predictor(one, rig(None, one))])
    assert found.cycles == 1 and not found.unloading and found.longest_hold > 0.9


# --- closed forms


REACH = 2e-3


def drawn(seed, samples=40, texels=9):
    """Texels in all directions, and places of an indenter that touches some of them."""
    rng = np.random.default_rng(seed)
    position, outward = rng.normal(size=(texels, 3)) * 3e-3, rng.normal(size=(texels, 3))
    quaternion = rng.normal(size=(samples, 4))
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    return position, outward, rng.normal(size=(samples, 3)) * 4e-3, quaternion


@pytest.mark.parametrize("seed", range(3))
def test_a_sphere_is_met_where_the_segment_enters_it(seed):
    """At a distance of the radius from its centre: a quadratic equation for the length of the way from behind the texel."""
    position, outward, center, quaternion = drawn(seed)
    radius, base = 4e-3, position - REACH * outward
    depth, normal, point, most = shape_contact(center, quaternion, np.array([radius]), position, outward, REACH)
    offset = base - center[:, None]
    along, square = np.einsum("tnk,nk->tn", offset, outward), (offset**2).sum(axis=2)
    length = -along - np.sqrt(np.maximum(along**2 - square + radius**2, 0.0))
    inside = square < radius**2
    touched = (along**2 > square - radius**2) & (length >= 0.0) & (length <= REACH) & ~inside
    assert touched.sum() > 10 and most == inside.sum(axis=1).max()
    expected = (base + length[..., None] * outward)[touched]
    np.testing.assert_allclose(point[touched], expected, rtol=0, atol=1e-12)
    out = (expected - np.broadcast_to(center[:, None], point.shape)[touched]) / radius
    np.testing.assert_allclose(normal[touched], out, rtol=0, atol=1e-9)
    way = np.broadcast_to(outward, point.shape)[touched]
    np.testing.assert_allclose(depth[touched], (REACH - length[touched]) * np.abs((out * way).sum(axis=1)), rtol=0, atol=1e-12)
    assert not depth[~touched & ~inside].any()


def test_box_along_its_planes():
    """A segment along two pairs of planes: between them it meets the third, beside them it meets nothing."""
    position, outward = np.array([[0.0, 0.0, 0.0], [5e-3, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0]] * 2)
    center, straight = np.array([[0.0, 0.0, 2e-3]]), np.array([[1.0, 0.0, 0.0, 0.0]])
    depth, normal, _, most = shape_contact(center, straight, np.array([2e-3, 2e-3, 2.5e-3]), position, outward, REACH)
    np.testing.assert_allclose(depth, [[0.5e-3, 0.0]], rtol=0, atol=1e-18)
    np.testing.assert_array_equal(normal[0], [[0.0, 0.0, -1.0]] * 2)
    assert most == 0


def test_nothing_touched_keeps_texel_and_normal():
    position, outward, center, quaternion = drawn(7)
    for size in (np.full(1, 4e-3), np.full(3, 2e-3)):
        depth, normal, point, most = shape_contact(center + 1.0, quaternion, size, position, outward, REACH)
        assert not depth.any() and most == 0
        np.testing.assert_array_equal(normal, np.broadcast_to(-outward, normal.shape))
        np.testing.assert_array_equal(point, np.broadcast_to(position, point.shape))


# --- kernels


def test_equal_texels_are_equal_in_all_arrays():
    rng = np.random.default_rng(4)
    for _ in range(20):
        # Few different histories in each array, so that some are equal in the first and differ in the last.
        arrays = [rng.normal(size=(12, 3, *more))[:, rng.integers(0, 3, 15)] for more in ((), (), (3,))]
        arrays[0][rng.integers(12), rng.integers(15)] += 1e-6  # in one sample alone, as a texel that comes into contact there
        columns = rng.permutation(15)[:11]
        first, group = _equal_texels(arrays, columns)
        equal = np.array([[all((a[:, i] == a[:, j]).all() for a in arrays) for i in columns] for j in columns])
        np.testing.assert_array_equal(group[:, None] == group, equal)
        np.testing.assert_array_equal(first, [np.flatnonzero(group == number)[0] for number in range(group.max() + 1)])


@pytest.mark.parametrize("samples", [1024, 12288])
def test_texels_that_are_touched_at_different_times_are_not_equal(samples):
    """A raster: each texel for one sample, all at the same depth and speed."""
    raster = np.zeros((samples, 1024))
    raster[np.arange(1024) * (samples // 1024), np.arange(1024)] = 1e-3
    first, group = _equal_texels([raster, raster, raster], np.arange(1024))
    np.testing.assert_array_equal(first, np.arange(1024))
    np.testing.assert_array_equal(group, np.arange(1024))


def test_texels_that_are_never_touched_read_nothing():
    one = trial(np.tile([0.0, 0.0, 0.05], (20, 1)), force=np.zeros((20, 3)))
    predicted = Predictor(one, rig(Indenter(box(0.01, 0.01, 0.01), None, (0.01, 0.01, 0.01)), one)).predict(
        Model(SensorParameters())
    )
    assert not predicted.reading.any() and predicted.force is not None and not predicted.force.any()


@pytest.mark.parametrize("shift", [0.0, 1e-9])
@pytest.mark.parametrize("edges", [(0.012, 0.015, 0.01), None])
def test_friction_at_50_samples_per_second_is_that_of_short_steps(edges, shift):
    """A block or a ball slides 2 mm a sample over texels of 3.4 mm, which its edge or its flank meets in between.

    Steps of 0.5 ms are the reference; a height that varies by rounding changes nothing. Root mean squares are 0.8 % of the load
    for the ball and 1 % for the block; with means of two velocities they were 2.5 and 1.3 %.
    """
    p = replace(SensorParameters(), k=60.0, cn=0.6, sigma0=60.0, sigma1=0.6, mus=0.5, mud=0.4, x0=0.02, ct=0.01)
    shape_of = BALL if edges is None else Indenter(box(*edges), None, edges)

    def force_at(time):
        along = 0.1 * (np.clip(time - 0.2, 0.0, None) - np.clip(time - 0.5, 0.0, None)) - 0.015
        height = (RADIUS if edges is None else edges[2] / 2) - 2e-3 + shift * np.sin(1e3 * time)
        one = trial(np.column_stack([0.0 * time, along, height]), time=time)
        return Predictor(one, rig(shape_of, one)).predict(Model(p)).force

    short = force_at(5e-4 * np.arange(1601))[::40]
    sampled = force_at(0.02 * np.arange(41))
    assert np.sqrt(np.mean((sampled - short) ** 2)) < 0.015 * np.abs(short).max()
