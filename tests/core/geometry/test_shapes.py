# SPDX-License-Identifier: GPL-3.0-or-later
"""Shapes in closed form against a search along each line that knows nothing but the shape's distance function."""

import numpy as np
import pytest
from scipy.optimize import brentq

from palpate.core.compiled.kernels import kernel
from palpate.core.errors import ParameterError
from palpate.core.geometry import shapes

LENGTH = 20e-3
SHAPES = {
    "sphere": shapes.sphere(6e-3),
    "box": shapes.box((8e-3, 12e-3, 5e-3)),
    "capsule": shapes.capsule(4e-3, 9e-3),
    "plane": shapes.plane(),
}


@kernel
def entries(kind, size, starts, ways, found, axes, inside, bounds):
    for i in range(len(starts)):
        start, way = (starts[i, 0], starts[i, 1], starts[i, 2]), (ways[i, 0], ways[i, 1], ways[i, 2])
        found[i], axes[i] = shapes.shape_entry(kind, size, start, way)
        inside[i] = shapes.is_in_shape(kind, size, start)
        bounds[i] = shapes.shape_distance(kind, size, start)


@kernel
def normals(kind, size, axes, points, found):
    for i in range(len(points)):
        point = points[i, 0], points[i, 1], points[i, 2]
        found[i, 0], found[i, 1], found[i, 2] = shapes.shape_normal(kind, size, axes[i], point)


def distance(name, point):
    """Signed distance of points (..., 3) from a shape, written independently of the kernels."""
    x, y, z = np.moveaxis(np.asarray(point), -1, 0)
    if name == "sphere":
        return np.sqrt(x**2 + y**2 + z**2) - 6e-3
    if name == "plane":
        return z
    if name == "capsule":
        return np.sqrt(x**2 + y**2 + np.maximum(np.abs(z) - 4.5e-3, 0.0) ** 2) - 4e-3
    over = np.stack([np.abs(x) - 4e-3, np.abs(y) - 6e-3, np.abs(z) - 2.5e-3])
    return np.linalg.norm(np.maximum(over, 0.0), axis=0) + np.minimum(over.max(axis=0), 0.0)


def lines(seed, count=400):
    """Points and unit vectors, some of which lead along the axes."""
    draw = np.random.default_rng(seed)
    starts, ways = 6e-3 * draw.normal(size=(count, 3)), draw.normal(size=(count, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    ways[:60] = np.eye(3)[np.arange(60) % 3] * np.where(np.arange(60) % 2, 1.0, -1.0)[:, None]
    return starts, ways


def computed(shape, starts, ways, function=entries):
    found, axes = np.zeros(len(starts)), np.zeros(len(starts), np.int64)
    inside, bounds = np.zeros(len(starts), bool), np.zeros(len(starts))
    function(shape.kind, shape.size, starts, ways, found, axes, inside, bounds)
    return found, axes, inside, bounds


@pytest.mark.parametrize("name", SHAPES)
def test_a_line_enters_where_the_distance_becomes_zero(name):
    """The search ends within 1e-15 m of distance, where the surface is met at a slant within a thousand times as much."""
    starts, ways = lines(1)
    found, _, inside, bounds = computed(SHAPES[name], starts, ways)
    assert np.array_equal(inside, distance(name, starts) < 0.0)
    assert (bounds <= distance(name, starts) + 1e-15).all() or name == "box"
    assert (bounds <= np.maximum(distance(name, starts), 0.0) + 1e-15).all()
    along, met = np.linspace(0.0, LENGTH, 2001), 0
    for i in np.flatnonzero(~inside):
        below = np.flatnonzero(distance(name, starts[i] + along[:, None] * ways[i]) < 0.0)
        if len(below):
            ends = along[below[0] - 1], along[below[0]]
            expected = brentq(lambda s, i=i: distance(name, starts[i] + s * ways[i]), *ends, xtol=1e-15, rtol=1e-14)
            assert found[i] == pytest.approx(expected, abs=1e-12)
            met += 1
        elif 0.0 <= found[i] <= LENGTH:  # a graze between two steps of the search
            assert abs(distance(name, starts[i] + found[i] * ways[i])) < 1e-12
    assert met > 30


@pytest.mark.parametrize("name", SHAPES)
def test_the_normal_leads_straight_out(name):
    starts, ways = lines(2)
    found, axes, inside, _ = computed(SHAPES[name], starts, ways)
    met = ~inside & (found >= 0.0) & (found < LENGTH)
    points, out = starts[met] + found[met, None] * ways[met], np.zeros((met.sum(), 3))
    normals(SHAPES[name].kind, SHAPES[name].size, axes[met], points, out)
    assert np.linalg.norm(out, axis=1) == pytest.approx(1.0, abs=1e-11)
    assert distance(name, points + 1e-6 * out) == pytest.approx(1e-6, rel=1e-5)


@pytest.mark.parametrize("name", SHAPES)
def test_the_stand_in_is_closed_and_holds_a_shape_that_is_bounded(name):
    mesh = SHAPES[name].stand_in
    assert len(mesh.triangles) == 12
    extent = np.abs(mesh.vertices).max(axis=0)
    assert name == "plane" or (extent >= max(SHAPES[name].size)).all()


def test_sizes_that_are_none_are_refused():
    with pytest.raises(ParameterError, match=r"The sizes of a sphere are \(-1.0,\) m: give numbers above zero"):
        shapes.sphere(-1.0)
    with pytest.raises(ParameterError, match="The sizes of a capsule are"):
        shapes.capsule(1.0, float("nan"))
