# SPDX-License-Identifier: GPL-3.0-or-later
"""The hand of the sample scene: a closed skin without gaps to the fingers that feel, which it follows."""

from collections import Counter

import bpy
import numpy as np
import pytest

from palpate.sample_blends import hand, hand_surface


def test_a_surface_net_of_two_balls_is_closed_faces_outwards_and_lies_on_them():
    chain = np.array([(0.0, 0.0, 0.0, 5.0), (12.0, 3.0, 0.0, 3.0)])
    vertices, quads = hand_surface.surface_net(hand_surface.tapered(chain), (-8, -8, -8), (18, 10, 8), 1.0)
    edges = Counter((int(a), int(b)) for quad in quads for a, b in zip(quad, np.roll(quad, -1), strict=True))
    assert set(edges.values()) == {1} and set(edges) == {(b, a) for a, b in edges}
    assert np.abs(hand_surface.tapered(chain)(vertices)).max() < 0.02
    a, b, c, d = (vertices[quads[:, i]] for i in range(4))
    volume = sum(np.einsum("ij,ij->i", p, np.cross(q, r)).sum() for p, q, r in ((a, b, c), (a, c, d))) / 6.0
    samples = np.random.default_rng(1).uniform((-8, -8, -8), (18, 10, 8), (200_000, 3))
    inside = (hand_surface.tapered(chain)(samples) < 0.0).mean() * 26 * 18 * 16
    assert volume == pytest.approx(inside, rel=0.02)


def test_a_union_is_at_most_a_quarter_of_its_width_lower_than_its_parts_and_only_where_they_are_equally_near():
    ball, near, far = (hand_surface.tapered(np.array([(x, 0, 0, 2.0), (x, 0, 1, 2.0)], float)) for x in (0.0, 3.0, 20.0))
    points = np.random.default_rng(2).uniform(-5.0, 25.0, (1000, 3))
    for other in (near, far):
        least = np.minimum(ball(points), other(points))
        blended = hand_surface.union([ball, other], 2.0)(points)
        assert (blended <= least + 1e-12).all() and (blended >= least - 0.5 - 1e-12).all()
        clear = np.abs(ball(points) - other(points)) >= 2.0
        assert 0 < clear.sum() < len(points)
        assert blended[clear] == pytest.approx(least[clear], abs=1e-12) and (blended < least - 1e-6).any()


@pytest.mark.long("models a hand")
def test_the_skin_follows_the_fingers_and_stays_at_the_wrist(scene):
    index, thumb, _ = hand.bodies(scene)
    skin = scene.objects["Hand"]

    def shape() -> np.ndarray:
        found = skin.evaluated_get(bpy.context.evaluated_depsgraph_get())
        return np.array([v.co for v in found.data.vertices])

    before = shape()
    assert before == pytest.approx(np.array([v.co for v in skin.data.vertices]), abs=1e-4)  # nothing moves at first
    index.location.x -= 5.0
    bpy.context.view_layer.update()
    moved = before[:, 0] - shape()[:, 0]
    # where the finger's own mesh begins it moves as the finger does, so that no gap opens
    root = np.array([index.matrix_world @ v.co for v in index.data.vertices])[: 28 * 3] + (5.0, 0.0, 0.0)
    near = np.linalg.norm(before[:, None] - root, axis=2).min(axis=1) < 2.0
    assert near.sum() > 50 and moved[near].min() > 4.9
    assert np.abs(moved[before[:, 1] > 120.0]).max() < 1e-4
    assert np.abs(moved[np.linalg.norm(before - np.array(thumb.location), axis=1) < 60.0]).max() < 1e-4
