# SPDX-License-Identifier: GPL-3.0-or-later
"""Contacts in closed form against a search along each segment that knows nothing but the indenter's distance function."""

import numpy as np
import pytest
from scipy.optimize import brentq

from palpate.core.gap.forward.closed_form_contact import box_contact, sphere_contact
from palpate.core.geometry.rotations import rotation_matrices

REACH = 2e-3
TOLERANCE = 1e-12
"""Of lengths in metres: the search along a segment ends within 1e-15 m, where the surface is met at a slant within a thousand
times as much."""


def drawn(seed, samples=40, texels=9):
    """Texels in all directions, and places of an indenter that touches some of them."""
    rng = np.random.default_rng(seed)
    position, outward = rng.normal(size=(texels, 3)) * 3e-3, rng.normal(size=(texels, 3))
    quaternion = rng.normal(size=(samples, 4))
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    return position, outward, rng.normal(size=(samples, 3)) * 4e-3, quaternion


def entered(distance, base, way):
    """Where a segment that begins outside first enters a convex shape, as a length; None if it does not, or begins inside."""
    if distance(base) < 0.0:
        return None
    lengths = np.linspace(0.0, REACH, 4001)
    inside = np.flatnonzero(distance(base + lengths[:, None] * way) < 0.0)
    if not len(inside):
        return None
    return brentq(lambda s: distance(base + s * way), lengths[inside[0] - 1], lengths[inside[0]], xtol=1e-15, rtol=1e-14)


def hold_against_search(contact, position, outward, distances):
    """Compare contacts with the search; return how many texels were touched."""
    depth, normal, point, _ = contact
    touched = 0
    for i, distance in enumerate(distances):
        for j, way in enumerate(outward):
            length = entered(distance, position[j] - REACH * way, way)
            if length is None:
                # A graze that the steps of the search miss is no deeper than its chord allows.
                grazes = depth[i, j] > 0.0 and distance(point[i, j] + 1e-9 * way) >= -1e-9
                starts_inside = distance(position[j] - REACH * way) < 0.0
                assert depth[i, j] == 0.0 or grazes or starts_inside
                continue
            touched += 1
            np.testing.assert_allclose(point[i, j], position[j] - (REACH - length) * way, rtol=0, atol=TOLERANCE)
            np.testing.assert_allclose(depth[i, j], (REACH - length) * abs(normal[i, j] @ way), rtol=0, atol=TOLERANCE)
            nearby = point[i, j] + 1e-7 * normal[i, j]
            np.testing.assert_allclose(distance(nearby), 1e-7, rtol=1e-6)  # the normal leads straight out
    return touched


@pytest.mark.parametrize("seed", range(3))
def test_sphere(seed):
    position, outward, center, _ = drawn(seed)
    found = sphere_contact(center, 4e-3, position, outward, REACH)
    distances = [lambda x, c=c: np.linalg.norm(x - c, axis=-1) - 4e-3 for c in center]
    assert hold_against_search(found, position, outward, distances) > 10
    inside = [sum(distance(x) < 0.0 for x in position - REACH * outward) for distance in distances]
    assert found[3] == max(inside)


@pytest.mark.parametrize("seed", range(3))
def test_box(seed):
    position, outward, center, quaternion = drawn(seed)
    half = 0.5 * np.array([4e-3, 6e-3, 9e-3])
    found = box_contact(center, quaternion, 2.0 * half, position, outward, REACH)
    frames = rotation_matrices(quaternion)
    distances = [lambda x, c=c, f=f: (np.abs((x - c) @ f) - half).max(axis=-1) for c, f in zip(center, frames, strict=True)]
    assert hold_against_search(found, position, outward, distances) > 10
    inside = [sum(distance(x) < 0.0 for x in position - REACH * outward) for distance in distances]
    assert found[3] == max(inside)


def test_box_along_its_planes():
    """A segment along two pairs of planes: between them it meets the third, beside them it meets nothing."""
    position, outward = np.array([[0.0, 0.0, 0.0], [5e-3, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0]] * 2)
    center, straight = np.array([[0.0, 0.0, 2e-3]]), np.array([[1.0, 0.0, 0.0, 0.0]])
    depth, normal, _, most = box_contact(center, straight, np.array([4e-3, 4e-3, 5e-3]), position, outward, REACH)
    np.testing.assert_allclose(depth, [[0.5e-3, 0.0]], rtol=0, atol=1e-18)
    np.testing.assert_array_equal(normal[0], [[0.0, 0.0, -1.0]] * 2)
    assert most == 0


def test_nothing_touched_keeps_texel_and_normal():
    position, outward, center, quaternion = drawn(7)
    for contact in (
        sphere_contact(center + 1.0, 4e-3, position, outward, REACH),
        box_contact(center + 1.0, quaternion, np.full(3, 4e-3), position, outward, REACH),
    ):
        depth, normal, point, most = contact
        assert not depth.any() and most == 0
        np.testing.assert_array_equal(normal, np.broadcast_to(-outward, normal.shape))
        np.testing.assert_array_equal(point, np.broadcast_to(position, point.shape))
