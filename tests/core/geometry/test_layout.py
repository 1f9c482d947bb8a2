# SPDX-License-Identifier: GPL-3.0-or-later
"""Texels become pictures: grids are found by topology, everything else gets a valid texture map."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.ndimage import map_coordinates
from scipy.spatial.transform import Rotation

from palpate.core.geometry import texture_maps
from palpate.core.geometry.grid_layout import GridLayout, grid_layout
from palpate.core.geometry.mesh import TriangleMesh, checked_mesh, vertex_normals
from palpate.core.geometry.texels import texels_from_region
from palpate.core.geometry.texture_maps import UVLayout, uv_layout

DIAGONALS = ("same", "other", "alternating", "diamond", "random")


def grid_mesh(rows, columns, diagonals="same", seed=0):
    """Return grid coordinates (n, 2) as (column, row), triangles and quads of a grid, wound anticlockwise."""
    row, column = np.indices((rows, columns)).reshape(2, -1)
    index = np.arange(rows * columns).reshape(rows, columns)
    quads = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], axis=-1)
    i, j = np.indices(quads.shape[:2])
    turned = {
        "same": np.zeros(i.shape, bool),
        "other": np.ones(i.shape, bool),
        "alternating": (i + j) % 2 == 0,
        "diamond": (i + j) % 2 == 1,
        "random": np.random.default_rng(seed).random(i.shape) < 0.5,
    }[diagonals].ravel()
    a, b, c, d = quads.reshape(-1, 4).T
    first = np.where(turned, [a, b, d], [a, b, c]).T
    second = np.where(turned, [b, c, d], [a, c, d]).T
    return np.column_stack([column, row]), np.concatenate([first, second]), quads.reshape(-1, 4)


def flat(places, pitch=(0.0034, 0.0034)):
    """Return positions in z = 0, centred on the origin."""
    centred = (places - places.max(axis=0) / 2) * pitch
    return np.column_stack([centred, np.zeros(len(places))])


def normals_of(position, triangles):
    """Return unit vertex normals."""
    return vertex_normals(TriangleMesh(position, triangles))


def compact(position, triangles):
    """Leave out vertices without a triangle."""
    used, triangles = np.unique(triangles, return_inverse=True)
    return np.asarray(position, float)[used], triangles.reshape(-1, 3)


def shuffled(rng, position, triangles, quads):
    """Renumber the vertices, reorder the faces and begin each at another corner; return old number of each vertex too."""
    old = rng.permutation(len(position))
    new = np.argsort(old)
    turn = (np.arange(3) + rng.integers(0, 3, len(triangles))[:, None]) % 3
    triangles = np.take_along_axis(new[triangles], turn, axis=1)[rng.permutation(len(triangles))]
    quads = None if quads is None else new[quads][rng.permutation(len(quads))]
    return position[old], triangles, quads, old


# --- grids


@pytest.mark.parametrize("with_quads", [False, True])
@pytest.mark.parametrize("diagonals", DIAGONALS)
@pytest.mark.parametrize("size", [(2, 2), (2, 5), (5, 2), (3, 3), (3, 4), (9, 9), (14, 6), (6, 14)])
def test_flat_pad_in_any_order(size, diagonals, with_quads):
    rng = np.random.default_rng(sum(size))
    for seed in range(4):
        places, triangles, quads = grid_mesh(*size, diagonals, seed)
        position, triangles, quads, old = shuffled(rng, flat(places), triangles, quads if with_quads else None)
        layout, along = grid_layout(position, normals_of(position, triangles), triangles, quads)
        assert isinstance(layout, GridLayout) and layout.shape == size
        np.testing.assert_array_equal(np.column_stack([layout.column, layout.row]), places[old])
        np.testing.assert_allclose(along, np.tile([1.0, 0, 0], (len(position), 1)), atol=1e-12)


def test_row_and_column_zero_are_lowest_however_the_pad_is_turned():
    places, triangles, _ = grid_mesh(14, 6, "random")
    for degrees in (0, 20, -40, 90, 110, 180, 200, 270):
        position = Rotation.from_euler("z", degrees, degrees=True).apply(flat(places))
        layout, along = grid_layout(position, normals_of(position, triangles), triangles)
        assert layout.shape == ((14, 6) if degrees % 180 in (0, 20, 140) else (6, 14))
        order = np.lexsort([layout.column, layout.row])
        grid = position[order].reshape(*layout.shape, 3)
        assert (grid[:, 1:, 0] > grid[:, :-1, 0]).all() and (grid[1:, :, 1] > grid[:-1, :, 1]).all()
        assert (along[:, 0] > 0.7).all()


def bent(places, how):
    """Return positions of a grid on some surface."""
    x, y = (flat(places)[:, :2] / 0.0034).T
    return {
        "trough": np.column_stack([4 * np.sin(x / 4), y, -4 * np.cos(x / 4)]),
        "closed trough": np.column_stack([np.sin(x * 0.88), y, -np.cos(x * 0.88)]),
        "bowl": np.column_stack([x, y, 0.05 * (x**2 + y**2)]),
        "saddle": np.column_stack([x, 1.7 * y, 0.1 * x * y]),
        "sheared": np.column_stack([x + 0.9 * y, y, 0 * x]),
        "uneven": np.column_stack([np.sinh(x / 2), np.sinh(y / 4), 0.2 * np.sin(x + y)]),
        "globe": np.column_stack([np.cos(y / 6) * np.sin(x / 4), np.sin(y / 6), np.cos(y / 6) * np.cos(x / 4)]),
    }[how]


@pytest.mark.parametrize("how", ["trough", "closed trough", "bowl", "saddle", "sheared", "uneven", "globe"])
@pytest.mark.parametrize("diagonals", DIAGONALS)
def test_bent_pad_anywhere_in_space(how, diagonals):
    rng = np.random.default_rng(5)
    places, triangles, _ = grid_mesh(14, 8, diagonals)
    surface = bent(places, how) @ Rotation.random(rng=rng).as_matrix().T * 0.01 + rng.normal(size=3)
    results = []
    for _ in range(3):
        position, faces, _, old = shuffled(rng, surface, triangles, None)
        normal = normals_of(position, faces)
        layout, along = grid_layout(position, normal, faces)
        assert sorted(layout.shape) == [8, 14]
        np.testing.assert_allclose(np.linalg.norm(along, axis=1), 1.0)
        grid = np.empty(layout.shape, int)
        grid[layout.row, layout.column] = np.arange(len(position))
        # neighbours in the picture are neighbours in the grid that was drawn
        for step in (np.diff(places[old][grid], axis=0), np.diff(places[old][grid], axis=1)):
            np.testing.assert_array_equal(np.abs(step).sum(axis=-1), 1)
        column = np.gradient(position[grid], axis=1)
        row = np.gradient(position[grid], axis=0)
        assert ((np.cross(column, row) * normal[grid]).sum(axis=-1) > 0).all()
        np.testing.assert_allclose((along[grid] * column).sum(axis=-1), np.linalg.norm(column, axis=-1))
        numbers = np.empty((2, len(position)), int)
        numbers[:, old] = layout.row, layout.column
        results.append(numbers)
    np.testing.assert_array_equal(results[0], results[1])
    np.testing.assert_array_equal(results[0], results[2])


def test_upright_pad_has_rows_upwards_and_is_not_mirrored():
    places, triangles, _ = grid_mesh(4, 7)
    x, y, z = flat(places).T
    for position, normal in ((np.column_stack([z, x, y]), [1, 0, 0]), (np.column_stack([x, z, -y]), [0, 1, 0])):
        normals = normals_of(position, triangles)
        np.testing.assert_allclose(normals, np.tile(normal, (len(position), 1)), atol=1e-12)
        layout, along = grid_layout(position, normals, triangles)
        assert layout.shape == (4, 7)
        grid = np.empty(layout.shape, int)
        grid[layout.row, layout.column] = np.arange(len(position))
        upwards = position[grid[1, 0]] - position[grid[0, 0]]
        np.testing.assert_allclose(np.cross(along[0], upwards / np.linalg.norm(upwards)), normal, atol=1e-12)


def test_normals_decide_what_is_outside():
    places, triangles, _ = grid_mesh(5, 3)
    position = flat(places)
    layout, along = grid_layout(position, np.tile([0, 0, -1.0], (15, 1)), triangles)
    np.testing.assert_allclose(along, np.tile([1.0, 0, 0], (15, 1)), atol=1e-12)
    np.testing.assert_array_equal(layout.row, 4 - places[:, 1])
    np.testing.assert_array_equal(layout.column, places[:, 0])


def test_quads_decide_where_triangles_cannot():
    angle = np.arange(8) * np.pi / 4
    position = np.vstack([np.zeros(3), np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])])
    triangles = np.array([[0, 1 + i, 1 + (i + 1) % 8] for i in range(8)])
    normal = normals_of(position, triangles)
    assert grid_layout(position, normal, triangles) == (None, None)  # a disc is no grid, or two
    for corner in (0, 1):
        at = 1 + (corner + 2 * np.arange(4))
        quads = np.array([[0, 1 + (k - 2) % 8, k, 1 + k % 8] for k in at])
        layout, _ = grid_layout(position, normal, triangles, quads)
        assert layout.shape == (3, 3)
        corners = {(layout.row[k], layout.column[k]) for k in at}
        assert corners == {(0, 0), (0, 2), (2, 0), (2, 2)}


def test_quads_beyond_the_region_do_not_matter():
    places, triangles, quads = grid_mesh(4, 5, "random")
    position = flat(places)
    quads = np.vstack([quads, [[3, 4, -1, -1], [-1, 2, 1, 0]]])
    layout, _ = grid_layout(position, normals_of(position, triangles), triangles, quads)
    assert layout.shape == (4, 5)


def not_grids():
    """Yield names and meshes that have no rows and columns."""
    places, triangles, _ = grid_mesh(6, 7, "random")
    position = flat(places)
    middle = np.unique(triangles[(triangles == 17).any(axis=1)])
    hole = triangles[~np.isin(triangles, 17).any(axis=1)]
    assert len(middle) > 3
    yield "hole", position, hole
    yield "corner cut off", position, triangles[~np.isin(triangles, 0).any(axis=1)]
    yield "one triangle missing", position, triangles[:-1]
    yield "one triangle turned over", position, np.vstack([triangles[:-1], triangles[-1:, ::-1]])
    yield "one triangle", np.eye(3), np.array([[0, 1, 2]])
    yield (
        "strip of three triangles",
        np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 2, 0]]),
        np.array([[0, 1, 2], [1, 3, 2], [2, 3, 4]]),
    )
    ell = np.where((places[:, 0] < 3) | (places[:, 1] < 3))[0]
    yield "L", position, triangles[np.isin(triangles, ell).all(axis=1)]
    for name, mesh in (
        ("sphere", trimesh.creation.icosphere(subdivisions=2)),
        ("torus", trimesh.creation.torus(1, 0.3)),
        ("box", trimesh.creation.box()),
    ):
        yield name, np.array(mesh.vertices), np.array(mesh.faces)
    tube = np.arange(30).reshape(5, 6)
    around = np.roll(tube, -1, axis=1)
    cells = np.stack([tube[:-1], around[:-1], around[1:], tube[1:]], axis=-1).reshape(-1, 4)
    angle = np.arange(6) * np.pi / 3
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    position = np.column_stack([np.tile(ring, (5, 1)), np.repeat(np.arange(5), 6)])
    yield "tube", position, np.vstack([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])


@pytest.mark.parametrize(("position", "triangles"), [pytest.param(*rest, id=name) for name, *rest in not_grids()])
def test_no_grid_is_claimed(position, triangles):
    position, triangles = compact(position, triangles)
    assert grid_layout(position, normals_of(position, triangles), triangles) == (None, None)


def test_grid_picture():
    places, triangles, _ = grid_mesh(4, 3)
    position = flat(places)
    layout, _ = grid_layout(position, normals_of(position, triangles), triangles)
    value = position[:, 0] + 10 * position[:, 1]
    picture = layout.image(value)
    assert picture.shape == layout.shape == (4, 3) and picture.dtype == np.float64
    assert picture[0, 0] == value.min() and picture[-1, -1] == value.max()
    many = layout.image(np.column_stack([value, -value]))
    np.testing.assert_array_equal(many, np.stack([picture, -picture], axis=-1))
    assert layout.mask().all()
    uv = layout.uv()
    assert ((uv > 0) & (uv < 1)).all()
    np.testing.assert_array_equal(picture[(uv[:, 1] * 4).astype(int), (uv[:, 0] * 3).astype(int)], value)
    np.testing.assert_array_equal(layout.corner_uv, uv[triangles])
    with_four = GridLayout(1, 2, np.zeros(2, int), np.arange(2))
    assert with_four.corner_uv.shape == (0, 3, 2)


# --- texture maps


def cap(subdivisions=3, height=0.3):
    """Return a patch of a sphere."""
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions)
    keep = (mesh.vertices[:, 2] > height)[mesh.faces].all(axis=1)
    return compact(mesh.vertices, mesh.faces[keep])


def surfaces():
    """Yield a name, vertices, triangles and whether the surface can be flattened in one piece."""
    sphere = trimesh.creation.icosphere(subdivisions=2)
    torus = trimesh.creation.torus(1, 0.3, major_sections=12, minor_sections=7)
    places, triangles, _ = grid_mesh(5, 9, "random")
    pad = flat(places, (1, 1))
    hole = triangles[~np.isin(triangles, 20).any(axis=1)]
    size = len(pad)
    yield "cap", *cap(), True
    yield "sphere", np.array(sphere.vertices), np.array(sphere.faces), False
    yield "torus", np.array(torus.vertices), np.array(torus.faces), False
    yield "box", np.array(trimesh.creation.box().vertices), np.array(trimesh.creation.box().faces), False
    yield "pad with a hole", pad, hole, True
    yield "two pads", np.vstack([pad, pad + [12, 1, 0]]), np.vstack([triangles, triangles + size]), True
    yield "two storeys", np.vstack([pad, pad + [0.3, 0.2, 1]]), np.vstack([triangles, triangles + size]), False
    yield "back to back", np.vstack([pad, pad - [0, 0, 1]]), np.vstack([triangles, triangles[:, ::-1] + size]), False
    yield "one triangle", np.array([[0, 0, 0], [1, 0, 0.2], [0.3, 2, 0.0]]), np.array([[0, 1, 2]]), True
    turn = places[:, 0] * 1.1
    screw = np.column_stack([(2 + places[:, 1]) * np.cos(turn), (2 + places[:, 1]) * np.sin(turn), places[:, 0] * 0.5])
    yield "winding stair", screw, triangles[:, ::-1], False
    fold = np.column_stack([np.abs(pad[:, 0]), pad[:, 1], pad[:, 0]])
    yield "fold", fold, triangles, True
    thin = np.vstack([pad, [[10, 0, 0], [11, 0, 0], [12, 0, 0]]])
    yield "triangle without area", thin, np.vstack([triangles, [[size, size + 1, size + 2]]]), True


SURFACES = [pytest.param(*rest, id=name) for name, *rest in surfaces()]


def lay_out(position, triangles, seed=3):
    """Return a shuffled, turned copy of a surface with its texture map."""
    rng = np.random.default_rng(seed)
    position, triangles = compact(position, triangles)
    position, triangles, _, _ = shuffled(rng, position @ Rotation.random(rng=rng).as_matrix().T, triangles, None)
    normal = normals_of(position, triangles)
    layout, along = uv_layout(position, normal, triangles)
    assert isinstance(layout, UVLayout)
    assert along.shape == position.shape
    return position, triangles, normal, layout, along


def corner_pixels(layout):
    """Return (m, 3, 2) pixel coordinates, whole numbers at the centres."""
    return layout.corner_uv * (layout.width, layout.height) - 0.5


def weights_at(corners, points):
    """Return (m, p, 3) weights of all points in all triangles, by solving for them."""
    matrix = np.concatenate([corners.transpose(0, 2, 1), np.ones((len(corners), 1, 3))], axis=1)
    right = np.column_stack([points, np.ones(len(points))]).T
    return (np.linalg.inv(matrix) @ right).transpose(0, 2, 1)


@pytest.mark.parametrize(("position", "triangles", "in_one_piece"), SURFACES)
def test_map_is_valid(position, triangles, in_one_piece):
    position, triangles, normal, layout, along = lay_out(position, triangles)
    assert (layout.cell == 0) == in_one_piece
    assert layout.corner_uv.shape == (len(triangles), 3, 2)
    np.testing.assert_array_equal(layout.triangles, triangles)
    for texel, uv in enumerate(layout.uv()):
        assert (layout.corner_uv[triangles == texel] == uv).all(axis=1).any()
    assert layout.shape == (layout.height, layout.width) and max(layout.shape) <= 2048
    corners = corner_pixels(layout)
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    assert edges.min() >= (3 if in_one_piece else 6) - 1e-9  # texels are pixels apart
    assert (corners >= 2 - 1e-9).all() and (corners <= np.array([layout.width, layout.height]) - 3 + 1e-9).all()

    solid = np.linalg.det(corners[:, 1:] - corners[:, :1]) > 1e-6  # more than a line on the map
    size = np.linalg.norm(np.cross(*(position[triangles[:, k]] - position[triangles[:, 0]] for k in (1, 2))), axis=1)
    assert solid[size > 1e-9].all()  # none flipped: the area is positive
    points = np.random.default_rng(0).random((4000, 2)) * (layout.width, layout.height) - 0.5
    inside = (weights_at(corners[solid], points) > 1e-9).all(axis=-1).sum(axis=0)
    assert inside.max() == 1  # and none over another
    np.testing.assert_allclose(np.linalg.norm(along, axis=1), 1.0)
    across = along - (along * normal).sum(axis=1)[:, None] * normal
    assert (np.linalg.norm(across, axis=1) > 0.02).all()


@pytest.mark.parametrize(("position", "triangles", "in_one_piece"), SURFACES)
def test_constant_field_never_bleeds(position, triangles, in_one_piece):
    position, triangles, _, layout, _ = lay_out(position, triangles)
    picture = layout.image(np.full(len(position), 7.0))
    mask = layout.mask()
    assert mask.any() and not mask.all()
    np.testing.assert_allclose(picture[mask], 7.0, rtol=1e-14)
    assert (np.isclose(picture, 7.0, rtol=1e-14) | (picture == 0.0)).all()
    rng = np.random.default_rng(1)
    corners = corner_pixels(layout)
    weights = rng.dirichlet([0.3, 0.3, 0.3], size=(len(triangles), 40))  # often near the rim
    points = np.concatenate([(weights @ corners).reshape(-1, 2), corners.reshape(-1, 2)])
    looked_up = map_coordinates(picture, points.T[::-1], order=1)  # linear between the centres of pixels, as Blender does
    np.testing.assert_allclose(looked_up, 7.0, rtol=1e-12)
    # every pixel within two of the surface is filled
    near = points[:, None, :] + 2 * np.array([[np.cos(a), np.sin(a)] for a in np.arange(8) * np.pi / 4])
    pixel = np.round(near.reshape(-1, 2)).astype(int)
    close = np.linalg.norm(pixel - np.repeat(points, 8, axis=0), axis=1) <= 2
    x, y = pixel[close].T
    assert (picture[y, x] != 0).all()


def test_flattened_map_keeps_shape_and_handedness():
    position, triangles = cap(height=0.8)
    position = position * [3.0, 1.0, 1.0]
    for matrix in (np.eye(3), Rotation.from_euler("z", 0.4).as_matrix()):
        moved = position @ matrix.T
        layout, along = uv_layout(moved, normals_of(moved, triangles), triangles)
        np.testing.assert_allclose(along, np.tile(matrix[:, 0], (len(moved), 1)), atol=0.02)
        pixels = layout.uv() * (layout.width, layout.height)
        expected = position[:, :2] - position[0, :2]
        fit, *_ = np.linalg.lstsq(expected, pixels - pixels[0], rcond=None)
        assert fit[0, 0] > 0 and abs(fit[0, 1]) < 0.05 * fit[0, 0]  # +u along +x
        assert abs(fit[1, 1] / fit[0, 0] - 1) < 0.05  # v to the left of it, at the same scale
        assert layout.width > 2 * layout.height


@pytest.mark.parametrize("subdivisions", [0, 1, 2])
def test_cells_of_an_atlas_are_filled_as_if_each_were_searched(subdivisions):
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions)
    layout, _ = uv_layout(mesh.vertices, mesh.vertex_normals, mesh.faces)
    assert layout.cell
    pixel, triangle, weights, inside = layout._pixels
    assert len(np.unique(pixel)) == len(pixel)
    order = np.argsort(pixel)
    searched = texture_maps.rasterise(corner_pixels(layout), *layout.shape)
    np.testing.assert_array_equal(searched[0], pixel[order])
    np.testing.assert_array_equal(searched[3], inside[order])
    np.testing.assert_array_equal(searched[1][searched[3]], triangle[order][searched[3]])
    np.testing.assert_allclose(searched[2][searched[3]], weights[order][searched[3]], atol=1e-12)


def test_many_texels_stay_within_the_largest_picture():
    mesh = trimesh.creation.icosphere(subdivisions=5)
    for repeats in (1, 4):
        position = np.vstack([mesh.vertices + [3 * i, 0, 0] for i in range(repeats)])
        triangles = np.vstack([mesh.faces + i * len(mesh.vertices) for i in range(repeats)])
        layout = texture_maps._atlas(position, triangles)
        corners = corner_pixels(layout)
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        if len(triangles) <= 69192:
            assert max(layout.shape) <= 2048
        assert edges.min() >= (6 if repeats == 1 else 3) - 1e-9


def test_a_few_tiny_triangles_do_not_blow_up_the_picture():
    rng = np.random.default_rng(4)
    places, triangles, _ = grid_mesh(20, 20)
    position = flat(places, (1, 1)) + np.column_stack([0.2 * rng.random((400, 2)), np.zeros(400)])
    position[1] = position[0] + [1e-4, 0, 0]  # neighbours
    triangles = triangles[:-1]
    layout, _ = uv_layout(position, np.tile([0, 0, 1.0], (400, 1)), triangles)
    assert layout.cell == 0 and layout.width * layout.height < 60 * len(triangles)


def test_one_tiny_flipped_triangle_needs_an_atlas():
    places, triangles, _ = grid_mesh(20, 20)
    position = flat(places, (1, 1))
    triangles = triangles[:-1]
    assert uv_layout(position, np.tile([0, 0, 1.0], (400, 1)), triangles)[0].cell == 0
    position[41, 0] = 2 - 1e-3  # past its neighbour, by less than a pixel
    position[42, 0] = 2 - 2e-3
    assert uv_layout(position, np.tile([0, 0, 1.0], (400, 1)), triangles)[0].cell > 0


# --- texels of a painted region


def test_painted_block_of_a_bigger_mesh_is_a_grid():
    places, triangles, quads = grid_mesh(9, 9, "random")
    mesh, _ = checked_mesh(flat(places), triangles, "plate", quads)
    block = (places[:, 0] >= 2) & (places[:, 0] < 8) & (places[:, 1] >= 1) & (places[:, 1] < 5)
    texels = texels_from_region(mesh, block)
    assert texels.layout.shape == (4, 6)
    np.testing.assert_array_equal(texels.vertex, np.flatnonzero(block))
    np.testing.assert_array_equal(texels.layout.column, places[block, 0] - 2)
    np.testing.assert_array_equal(texels.layout.row, places[block, 1] - 1)
    np.testing.assert_allclose(texels.tangent, np.tile([1.0, 0, 0], (24, 1)), atol=1e-12)
    np.testing.assert_allclose(texels.bitangent, np.tile([0, 1.0, 0], (24, 1)), atol=1e-12)

    block[0] = True  # a stray vertex spans no face
    assert texels_from_region(mesh, block).layout.shape == (4, 6)
    block[places[:, 1] == 7] = block[(places[:, 1] == 6)] = True  # a second patch
    assert isinstance(texels_from_region(mesh, block).layout, UVLayout)
