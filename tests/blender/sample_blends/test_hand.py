# SPDX-License-Identifier: GPL-3.0-or-later
"""The hand of the sample scene: a closed skin without gaps to the fingers that feel, which it follows."""

import bpy
import numpy as np
import pytest

from palpate.sample_blends import hand


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
