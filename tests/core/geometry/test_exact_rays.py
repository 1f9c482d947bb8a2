# SPDX-License-Identifier: GPL-3.0-or-later
"""Segment queries: a million random ones against independent ray libraries, those through edges, and slivers."""

import numpy as np
import pytest
from oracles.rays import NONE, compare, entries, leaks, solids

from palpate.core.geometry.mesh import TriangleMesh

SOLIDS = solids()


@pytest.mark.parametrize("name", SOLIDS)
def test_a_million_random_segments_agree_with_embree_and_trimesh(name):
    """Six solids, 170,000 each. Embree works in single precision, so positions are compared with 1e-4; trimesh's double
    precision decides where that is not enough; and our position is that of the plane of the triangle met, to rounding."""
    result = compare(name, SOLIDS[name], 170_000)
    assert result["met"] > 50_000
    assert result["wrong"] == 0
    assert result["doubtful"] < 20
    assert result["off"] < 1e-13


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("name", SOLIDS)
def test_segments_through_edges_and_vertices_never_leak(name, scale):
    """At any size, turned, and moved by some times its size, so that shared corners are anything but round numbers."""
    for seed in range(4):
        through, tried = leaks(SOLIDS[name], scale, np.array([0.3, -7.0, 2.1]) * seed, seed)
        assert tried > 200
        assert through == 0


def test_slivers_never_answer_even_when_aimed_at():
    """Put into the tree past the check that leaves them out (a mesh may fold up while it deforms): corners on one line up to
    rounding, corners that coincide, and all three the same."""
    rng = np.random.default_rng(3)
    ball, n = SOLIDS["ball"], 2000
    a, b = rng.normal(size=(2, n, 3))
    c = a + rng.random((n, 1)) * (b - a)
    one, two, three = len(ball.vertices) + np.arange(3 * n).reshape(3, n)
    slivers = np.vstack([np.stack(corners, axis=1) for corners in ((one, two, three), (one, two, two), (three, three, three))])
    bad = TriangleMesh(np.vstack([ball.vertices, a, b, c]), np.vstack([ball.triangles, slivers]))
    aims = np.vstack([a + rng.random((n, 1)) * (b - a), c])
    vectors = rng.normal(size=aims.shape)
    plain, triangle = entries(bad, aims - vectors, 2 * vectors)
    clean, _ = entries(ball, aims - vectors, 2 * vectors)
    assert (clean < NONE).sum() > 500
    assert (triangle < len(ball.triangles)).all()
    assert np.array_equal(plain, clean)
