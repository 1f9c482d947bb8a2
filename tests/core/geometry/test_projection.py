# SPDX-License-Identifier: GPL-3.0-or-later
"""A surface seen from outside: what is in front shows, places can be read, and of a closed surface both sides are there."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from solver_scenes import shape

from palpate.core.geometry.texels import projection_of, texels_from_region

SIDE = 65  # pixels, so that one lies in the middle


def texels_of(solid, region=None):
    mesh = shape(solid, "Skin")
    return texels_from_region(mesh, np.ones(len(mesh.vertices), bool) if region is None else region(mesh.vertices))


def test_a_closed_surface_has_two_views_from_opposite_sides():
    """Of a flat ball, across its shortest axis; what is right in one view is left in the other."""
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.05)
    ball.vertices[:, 2] *= 0.5
    texels = texels_of(ball)
    views = projection_of(texels, SIDE)
    assert views.names == ("+Z", "−Z")
    mask = views.mask()
    assert mask.shape == (SIDE, 2 * SIDE + round(0.06 * SIDE))
    for axis, left, right in ((0, 1.0, -1.0), (1, 1.0, 1.0), (2, None, None)):
        image = views.image(texels.position[:, axis])
        first, second = image[:, :SIDE], image[:, -SIDE:]
        if left is None:
            assert first[32, 32] == pytest.approx(0.025, rel=0.02) and second[32, 32] == pytest.approx(-0.025, rel=0.02)
            continue
        across = (np.arange(SIDE) - 32) / 32 * 0.05  # metres from the middle
        for picture, sign, shown in ((first, left, mask[:, :SIDE]), (second, right, mask[:, -SIDE:])):
            want = sign * (across[None, :] if axis == 0 else across[:, None]) + np.zeros((SIDE, SIDE))
            assert np.abs(picture - want)[shown].max() < 1e-3  # a pixel is 1.6 mm: the facets' rim is not round
    # each view shows a disc, less the corners of a square
    assert mask[:, :SIDE].mean() == pytest.approx(np.pi / 4, abs=0.03)
    assert not mask[:, SIDE : SIDE + 3].any()


def test_what_is_in_front_hides_what_is_behind():
    """Two balls, one before the other along the axis of the view: the picture shows the near one at the middle."""
    near, far = (trimesh.creation.icosphere(subdivisions=3, radius=r) for r in (0.01, 0.03))
    near.vertices += [0.0, 0.0, 0.05]
    both = trimesh.util.concatenate([near, far])
    both.vertices[:, 2] *= 0.4  # shortest along z
    texels = texels_of(both)
    is_near = (texels.position[:, 2] > 0.4 * 0.035).astype(float)
    views = projection_of(texels, SIDE)
    assert views.names == ("+Z", "−Z")
    image = views.image(is_near)
    assert image[32, 32] == 1.0 and image[32, 4] == 0.0
    assert not image[:, -SIDE:].any()  # from behind, the far ball hides it
    share = (image[:, :SIDE] > 0.5).sum() / views.mask()[:, :SIDE].sum()
    assert share == pytest.approx(1 / 9, rel=0.1)


def test_a_dome_needs_one_view():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.05)
    texels = texels_of(ball, lambda v: v @ np.array([0.0, 0.6, 0.8]) > 0.02)
    views = projection_of(texels, SIDE)
    assert views.names == ("",) and max(views.mask().shape) == SIDE
    height = views.image(texels.position @ np.array([0.0, 0.6, 0.8]))
    assert height[height.shape[0] // 2, height.shape[1] // 2] == pytest.approx(0.05, rel=0.01)


def test_more_than_a_dome_is_seen_from_both_sides_of_where_it_points():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.05)
    views = projection_of(texels_of(ball, lambda v: v[:, 0] < 0.02), SIDE)
    assert views.names == ("−X", "+X")
