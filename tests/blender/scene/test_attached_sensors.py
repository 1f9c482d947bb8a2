# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of a parent's body: sensors that ride on a free or keyframed object, several of them on one."""

import bpy
import numpy as np
import pytest
from blender_scenes import ball, cube, grid, keyframe, play_to, reading_of, scenario_of, scene_of, start_of

from palpate.addon.session import transforms
from palpate.addon.timeline import live_cache
from palpate.core.errors import SceneError
from palpate.core.solver.simulation import run


def on(parent, part):
    """Parent an object where it is, as Ctrl P does."""
    bpy.context.view_layer.update()
    part.parent = parent
    part.matrix_parent_inverse = parent.matrix_world.inverted()
    part.palpate.body = "PARENT"


def box_on_soles(frames=24):
    """A free box of 0.2 kg with two small soles under it stands on a table, tilted poses and scales included."""
    scene = scene_of(frames)
    box = cube("Box", (0.0, 0.0, 0.0), 0.04, rotation=(0.0, 0.0, 0.4))
    box.scale = (1.0, 1.0, 0.5)
    box.palpate.role, box.palpate.body, box.palpate.mass = "TARGET", "FREE", 0.2
    soles = []
    for number, x in enumerate((-0.012, 0.012)):
        sole = grid(f"Sole {number}", (x, 0.0, -0.0105), 4, 4, 0.014)
        sole.rotation_euler = (np.pi, 0.0, 0.0)
        on(box, sole)
        sole.palpate.role, sole.palpate.k, sole.palpate.cn = "SENSOR", 400.0, 4.0
        soles.append(sole)
    table = cube("Table", (0.0, 0.0, -0.0206), 0.02)
    table.scale = (10.0, 10.0, 1.0)
    table.palpate.role = "TARGET"
    return scene, box, soles, table


def test_two_soles_carry_a_free_box():
    scene, box, soles, _ = box_on_soles()
    reading = reading_of(scene)
    scenario = reading.scenario
    assert [body.name for body in scenario.bodies] == ["Box", "Table"]
    assert [sensor.body for sensor in scenario.sensors] == [0, 0]
    assert reading.sensor_objects(scene) == soles
    recording = run(scenario)
    forces = [recording.sensors[sole.name].normal_force[-1].sum() for sole in soles]
    assert sum(forces) == pytest.approx(0.2 * 9.81, rel=1e-3)
    assert forces[0] == pytest.approx(forces[1], rel=0.02)


def test_texels_of_a_part_are_where_blender_shows_them():
    scene, box, soles, _ = box_on_soles()
    box.location = (0.1, -0.2, 0.3)
    box.rotation_euler = (0.3, 0.5, -0.4)
    bpy.context.view_layer.update()
    scenario = start_of(scene).scenario
    body = scenario.bodies[0].motion
    rotation = transforms.rotation(body.quaternions[0])
    for sensor, sole in zip(scenario.sensors, soles, strict=True):
        there = body.positions[0] + sensor.texels.position @ rotation.T
        shown = [sole.matrix_world @ sole.data.vertices[v].co for v in sensor.texels.vertex]
        assert np.abs(there - np.array(shown)).max() < 1e-7


def test_a_part_of_something_that_takes_no_part_follows_it():
    pad, stick = grid(), ball("Stick", (0.0, 0.0, -0.02))
    target = ball()
    pad.palpate.role, target.palpate.role = "SENSOR", "TARGET"
    on(stick, pad)
    keyframe(stick, "location", {1: stick.location[:], 10: (0.0, 0.0, -0.01)})
    scenario = scenario_of(scene_of(10))
    assert [body.name for body in scenario.bodies] == ["Pad", "Ball"]
    assert scenario.bodies[0].motion.positions[-1][2] - scenario.bodies[0].motion.positions[0][2] == pytest.approx(0.01)


def test_a_part_never_touches_its_own_body():
    scene, _, soles, table = box_on_soles(2)
    soles[0].location.z += 0.003  # into the box, facing outwards
    table.location.z = -1.0
    recording = run(scenario_of(scene))
    assert all(not recording.sensors[sole.name].contact.any() for sole in soles)


def test_a_part_that_moves_on_its_parent_is_refused():
    scene, _, soles, _ = box_on_soles(4)
    keyframe(soles[0], "location", {1: soles[0].location[:], 4: (-0.012, 0.0, -0.0205)})
    with pytest.raises(SceneError, match="'Sole 0' moves on its parent"):
        scenario_of(scene)


def test_playing_a_free_body_moves_its_parts_and_does_not_start_anew():
    scene, box, soles, _ = box_on_soles(6)
    box.location.z = 0.005
    scene.frame_set(1)
    assert sorted(play_to(scene, 6).frames) == [1, 2, 3, 4, 5, 6]
    scene.frame_set(3)
    assert sorted(live_cache.get(scene).frames) == [1, 2, 3, 4, 5, 6]
    assert box.location.z < 0.005
