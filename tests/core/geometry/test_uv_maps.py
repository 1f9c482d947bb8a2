# SPDX-License-Identifier: GPL-3.0-or-later
"""Tactile images on a mesh's own texture map: the right value in every pixel, and no seam where the map is cut."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.ndimage import map_coordinates

from palpate.core.errors import SensorError
from palpate.core.geometry.texture_maps import mapped_layout

AROUND, UP = 24, 9
RADIUS, HEIGHT = 0.02, 0.03


def tube(mirrored=False):
    """Return positions, triangles and corners' coordinates of a tube, cut along one line and into two islands across."""
    angle, height = (grid.ravel() for grid in np.meshgrid(2 * np.pi * np.arange(AROUND) / AROUND, np.linspace(0, HEIGHT, UP)))
    position = np.column_stack([RADIUS * np.cos(angle), RADIUS * np.sin(angle), height])
    triangles, uv = [], []
    for row in range(UP - 1):
        island = row >= UP // 2
        low, high = (0.55, 0.95) if island else (0.05, 0.45)
        first, last = (UP // 2, UP - 1) if island else (0, UP // 2)
        for column in range(AROUND):
            corners = [(row, column), (row, column + 1), (row + 1, column + 1), (row + 1, column)]
            number = [r * AROUND + c % AROUND for r, c in corners]
            place = [(0.05 + 0.9 * c / AROUND, low + (high - low) * (r - first) / (last - first)) for r, c in corners]
            if mirrored and island:
                place = [(1 - x, y) for x, y in place]
            for chosen in ((0, 1, 2), (0, 2, 3)):
                triangles.append([number[i] for i in chosen])
                uv.append([place[i] for i in chosen])
    return position, np.array(triangles), np.array(uv)


def sampled(picture, uv):
    """Return what a linear look-up, as that of an image node, gives at (n, 2) coordinates."""
    return map_coordinates(picture, uv.T[::-1] * np.array(picture.shape)[:, None] - 0.5, order=1)


def seams(triangles, uv):
    """Return, for edges that lie at two places of the map, their texels (e, 2) and both places (e, 2 sides, 2 ends, 2)."""
    seen, found = {}, []
    for corners, places in zip(triangles, uv):
        for i in range(3):
            ends = int(corners[i]), int(corners[(i + 1) % 3])
            place = places[[i, (i + 1) % 3]]
            if ends[::-1] in seen:
                other = seen[ends[::-1]][::-1]
                if not np.allclose(other, place):
                    found.append((ends, np.stack([place, other])))
            seen[ends] = place
    return np.array([ends for ends, _ in found]), np.array([places for _, places in found])


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("side", [64, 200])
def test_no_seam_is_seen_where_the_map_is_cut(mirrored, side):
    position, triangles, uv = tube(mirrored)
    layout = mapped_layout(triangles, uv, side, map_name="UVMap")
    values = 1.0 + np.sin(3 * np.arctan2(position[:, 1], position[:, 0])) * position[:, 2] / HEIGHT
    texels, places = seams(triangles, uv)
    assert len(texels) == AROUND + UP - 1
    picture = layout.image(values)
    shown = np.where(layout.mask(), picture, np.nan)
    share = np.linspace(0.0, 1.0, 41)[:, None, None]
    both = np.stack(
        [sampled(picture, ((1 - share) * p[0] + share * p[1]).reshape(-1, 2)) for p in places.transpose(1, 2, 0, 3)]
    )
    true = ((1 - share[..., 0]) * values[texels[:, 0]] + share[..., 0] * values[texels[:, 1]]).ravel()
    # where the edge is repeated, a look-up sees a slope that ends half a pixel early
    steepest = max(np.nanmax(np.abs(np.diff(shown, axis=axis))) for axis in (0, 1))
    assert np.abs(both[0] - both[1]).max() <= steepest < 20.0 / side  # half a pixel to either side
    assert np.abs(both - true).max() <= steepest


def test_every_pixel_has_the_value_of_its_place_on_the_surface():
    """Compared with trimesh's own barycentric coordinates, triangle by triangle."""
    position, triangles, uv = tube(mirrored=True)
    side = 96
    layout = mapped_layout(triangles, uv, side, map_name="UVMap")
    value = np.random.default_rng(0).normal(size=len(position))
    picture, mask = layout.image(value), layout.mask()
    nearest = mapped_layout(triangles, uv, side, map_name="UVMap", nearest=True).image(value)
    flat = np.concatenate([uv, np.zeros((*uv.shape[:2], 1))], axis=2)
    checked = 0
    for row, column in np.argwhere(np.ones_like(mask))[::7]:
        point = np.array([(column + 0.5) / side, (row + 0.5) / side, 0.0])
        weights = trimesh.triangles.points_to_barycentric(flat, np.tile(point, (len(flat), 1)))
        assert mask[row, column] == (weights > -1e-9).all(axis=1).any()
        (inside,) = np.nonzero((weights > 1e-9).all(axis=1))
        if len(inside) == 1:
            corner = triangles[inside[0]]
            assert picture[row, column] == pytest.approx(weights[inside[0]] @ value[corner])
            assert nearest[row, column] == value[corner[weights[inside[0]].argmax()]]
            checked += 1
    assert checked > 300
    np.testing.assert_array_equal(layout.image(np.column_stack([value, 2.0 * value])), picture[..., None] * [1.0, 2.0])


@pytest.mark.parametrize("nearest", [False, True])
def test_around_an_island_its_edge_goes_on(nearest):
    position, triangles, uv = tube()
    layout = mapped_layout(triangles, uv, 256, map_name="UVMap", nearest=nearest)
    picture, mask = layout.image(np.full(len(position), 3.0)), layout.mask()
    assert set(np.unique(picture)) <= {0.0, 3.0} or np.allclose(picture[picture != 0], 3.0)
    rim = (picture != 0) & ~mask
    distance = trimesh.proximity.cKDTree(np.argwhere(mask)).query(np.argwhere(~mask))[0]
    np.testing.assert_array_equal(rim[~mask][distance <= layout.margin - 1], True)
    assert not rim[~mask][distance > 1.5 * layout.margin + 2].any()  # a square of it at corners


def test_texels_that_no_pixel_can_show_are_counted():
    _, triangles, uv = tube()
    assert mapped_layout(triangles, uv, 256, map_name="UVMap").unresolved_texels() == 0
    assert mapped_layout(triangles, uv, 16, map_name="UVMap").unresolved_texels() > 50


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda uv: uv + 0.2, "reaches beyond"),
        (lambda uv: uv * 0, "no area"),
        (lambda uv: np.where(uv[..., 1:] > 0.5, uv - [0.0, 0.5], uv), "over one another"),
        (lambda uv: uv * np.nan, "reaches beyond"),
    ],
)
def test_a_map_of_no_use_is_one_sentence(change, words):
    _, triangles, uv = tube()
    with pytest.raises(SensorError, match=words) as found:
        mapped_layout(triangles, change(uv), 128, map_name="Lightmap", sensor="Tip")
    assert "'Lightmap'" in str(found.value) and "'Tip'" in str(found.value) and "unwrap" in str(found.value)
