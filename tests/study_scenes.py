# SPDX-License-Identifier: GPL-3.0-or-later
"""A small scene that studies vary: a ball over a pad of sixteen texels, and a box that is free."""

import trimesh
from solver_scenes import box, free_body, pad, shape

from palpate.core.model.body import Body, Motion
from palpate.core.model.scenario import Scenario, Target
from palpate.core.model.sensor import Sensor

BALL_RADIUS = 0.006
HEAD = 'format = "palpate-sweep/1"\nscene = "tiny.npz"\n'


def tiny_scene(with_box: bool = False) -> Scenario:
    """A ball over a pad, three frames at 50 frames per second."""
    ball = shape(trimesh.creation.icosphere(1, BALL_RADIUS))
    bodies = [Body("Pad", Motion.at_rest()), Body("Ball", Motion.at_rest((0, 0, 0.02)))]
    targets = [Target("Ball", 1, ball)]
    if with_box:
        bodies.append(free_body("Box", box(0.01, 0.01, 0.01), 0.05, (0, 0, 0.0049)))
        targets.append(Target("Box", 2, box(0.01, 0.01, 0.01)))
    return Scenario(tuple(bodies), (Sensor("Pad", 0, pad(4, 4)),), tuple(targets), 1, 3, 50.0, name="tiny")
