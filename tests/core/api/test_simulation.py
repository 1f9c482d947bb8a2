# SPDX-License-Identifier: GPL-3.0-or-later
"""What ``simulate`` returns: weights at rest, paths of bodies, several sensors, sensors on bodies; and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest
from solver_scenes import cube_on_pad

import palpate as pp
from palpate.core.solver.simulation import run

WEIGHT = 9.81


def pad(**more):
    return pp.Sensor.grid(**{"rows": 14, "columns": 6, "pitch": 4e-3, "k": 1000.0, "mus": 0.435, **more})


def cube(**more):
    return pp.Body.box(0.05, **{"mass": 1.0, "position": (0, 0, 0.0255), **more})


@pytest.fixture(scope="module")
def at_rest():
    return pp.simulate(pad(), cube(), duration=2.0, fps=60)


def test_a_box_at_rest_weighs_its_weight(at_rest):
    assert at_rest.normal_force[-1].sum() == pytest.approx(WEIGHT, abs=1e-4)
    assert at_rest.time == pytest.approx(np.arange(121) / 60)
    assert at_rest.normal_force.shape == at_rest.reading.shape == (121, 84)
    assert at_rest.shear.shape == (121, 84, 2)
    assert at_rest["pad"].net_force[-1] == pytest.approx([0.0, 0.0, -WEIGHT], abs=1e-4)
    assert at_rest.poses["box"].shape == (121, 7)


def test_numbers_are_those_of_the_scenario():
    """The same scene, put together from the parts of core, gives the same forces and poses."""
    expected = run(cube_on_pad(mass=1.0, frames=13, fps=60.0, dt=None, gap=5e-4, mus=0.435))
    found = pp.simulate(pad(pitch=3.4e-3), cube(), duration=0.2)
    assert found.normal_force == pytest.approx(expected.sensors["pad"].normal_force, rel=1e-9, abs=1e-12)
    assert found.poses["box"] == pytest.approx(expected.poses[:, 1], rel=1e-9, abs=1e-12)


def test_a_moved_body_presses_as_deep_as_its_path():
    depth = np.linspace(0.0, 1e-3, 31)
    path = np.column_stack([np.zeros((31, 2)), 0.025 - depth])
    found = pp.simulate(pad(cn=0.0), cube(mass=None), motion=path, fps=30)
    assert len(found) == 31
    assert found.normal_force.sum(axis=1) == pytest.approx(72 * 1000.0 * depth, abs=1e-9)
    timed = pp.Body.box(0.05, path_of_motion=(np.arange(31) / 30, path))
    assert (pp.simulate(pad(cn=0.0), timed, fps=30).normal_force == found.normal_force).all()


def test_a_path_from_a_file(tmp_path):
    rows = [f"{i / 30:.9f},0,0,{0.025 - 1e-3 * i / 30:.12f}" for i in range(31)]
    (tmp_path / "press.csv").write_text("time,x,y,z\n" + "\n".join(rows) + "\n", encoding="utf-8")
    found = pp.simulate(pad(cn=0.0), pp.Body.box(0.05, path_of_motion=tmp_path / "press.csv"), fps=30)
    assert found.normal_force[-1].sum() == pytest.approx(72.0, abs=1e-6)


def test_several_sensors_share_a_weight():
    left, right = pad(name="left", position=(-0.0125, 0, 0)), pad(name="right", position=(0.0125, 0, 0))
    found = pp.simulate([left, right], [cube()], duration=1.0)
    assert found.sensors == ("left", "right")
    sums = [found[name].normal_force[-1].sum() for name in found.sensors]
    assert sums == pytest.approx([WEIGHT / 2, WEIGHT / 2], abs=1e-4)
    with pytest.raises(pp.PalpateError, match=r"name one, as recording\['left'\]"):
        _ = found.normal_force
    with pytest.raises(pp.PalpateError, match=r"no sensor 'rigth' \(did you mean 'right'\?\)"):
        found["rigth"]


def test_a_sensor_on_a_body_moves_with_it():
    """A pad under a box that falls onto a fixed table carries the weight of the box; the pad's normals point down."""
    box = cube(position=(0, 0, 0.0255))
    below = pad(name="sole", body=box, position=(0, 0, -0.025), quaternion=(0, 1, 0, 0))
    table = pp.Body.box((0.2, 0.2, 0.02), position=(0, 0, -0.01), name="table")
    found = pp.simulate(below, table, duration=1.5)
    assert found.normal_force[-1].sum() == pytest.approx(WEIGHT, abs=1e-4)
    assert found.poses["box"][-1, 2] == pytest.approx(0.025 - WEIGHT / (84 * 1000.0), abs=1e-6)
    assert below.world_pose()[0] == pytest.approx([0, 0, 0.0005])


def test_a_moved_sensor_presses_on_a_fixed_body():
    path = np.column_stack([np.zeros((11, 2)), np.linspace(0.0, 1e-3, 11)])
    table = pp.Body.box(0.2, position=(0, 0, 0.1), name="ceiling")
    found = pp.simulate(pad(cn=0.0), table, motion={"pad": path}, fps=20)
    assert found.normal_force[-1].sum() == pytest.approx(84.0, abs=1e-9)


def test_equal_names_of_bodies_get_numbers():
    found = pp.simulate(pad(), [cube(position=(0, 0, 1.0)), cube(position=(0, 0, 2.0))], duration=0.05)
    assert list(found.poses) == ["box", "box 2", "pad"]


def test_effects_act_on_readings():
    plain = pp.simulate(pad(), cube(), duration=0.1)
    shifted = pp.simulate(pad().with_effects({"name": "offset", "offset": 0.5}), cube(), duration=0.1)
    assert (shifted.normal_force == plain.normal_force).all()
    assert shifted.reading == pytest.approx(plain.reading + 0.5)


def test_progress_is_told_and_an_exception_stops_the_run():
    seen = []

    def stop(step):
        seen.append((step.done, step.total))
        if step.done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        pp.simulate(pad(), cube(), duration=0.5, progress=stop)
    assert seen == [(1, 31), (2, 31), (3, 31)]


REFUSED = [
    (lambda: pad(pitch=4), "pitch makes sensor 'pad' 52 m large: lengths are in metres"),
    (lambda: pad(rows=2.5), "rows is 2.5: give a whole number"),
    (lambda: pad(pitch=(1e-3, 1e-3, 1e-3)), r"pitch has the shape \(3,\): give 2 numbers"),
    (lambda: pad(k=float("nan")), "k of sensor 'pad' is nan: give it a value above zero"),
    (lambda: pad(sigm0=1.0), r"called 'sigm0' \(did you mean 'sigma0'\?\)"),
    (lambda: pad(stiffness=1.0), "no parameter 'stiffness' of a sensor: it is called 'k'"),
    (lambda: pad(quaternion=(0, 0, 0, 0)), "quaternion is zero"),
    (lambda: pad(body="table"), "body is 'table': give a Body"),
    (lambda: pad().with_effects("crepe"), r"no effect 'crepe' \(did you mean 'creep'\?\)"),
    (lambda: cube(mass=0), "mass is 0: give a finite number above zero"),
    (lambda: cube(postion=1), r"no argument 'postion'"),
    (lambda: pp.Body.box(50, mass=1.0), "size makes body 'box' 50 m large: lengths are in metres"),
    (lambda: pp.Body.sphere("big"), "radius is 'big': give a number"),
    (lambda: pp.Body.sphere(0.1, mass=1.0, path_of_motion=np.zeros((3, 3))), "a mass, so that forces move it, and a path"),
    (lambda: pp.Body.from_mesh((np.zeros((3, 3)), [[0, 1, 2]])), "All faces of 'body' have zero area"),
    (lambda: pp.Body.sphere(1e-9), "radius makes body 'sphere' only 2e-09 m large: lengths are in metres"),
    (lambda: pp.Body.from_mesh((np.eye(3), np.zeros((0, 3), int))), "'body' has no faces"),
    (lambda: pp.Body.from_mesh((np.eye(3), [[0, 1, 7]])), "refers to a vertex that does not exist"),
    (lambda: pp.Body.from_mesh(np.eye(3)), "mesh is array.*: give a file"),
    (lambda: pp.Body.from_mesh("none.stl"), "There is no mesh file 'none.stl'"),
    (lambda: pp.Sensor.from_mesh((np.eye(3), [[0, 1, 2]]), region=[4]), "region has vertex 4: the mesh has 3, from 0 to 2"),
    (lambda: pp.Sensor.from_mesh((np.eye(3), [[0, 1, 2]]), region=[0.5]), "region has the shape"),
    (lambda: pp.simulate(pad(), cube(), duration=0), "duration is 0: give a finite number above zero"),
    (lambda: pp.simulate(pad(), cube()), "duration is missing"),
    (lambda: pp.simulate(pad(), cube(), duration=1e9), "duration makes 60000000000 frames"),
    (lambda: pp.simulate(pad(), cube(), duration=1, gravity=9.81), r"gravity has the shape \(\): give 3 numbers"),
    (lambda: pp.simulate(pad(), [], duration=1), "bodies is empty: give one at least"),
    (lambda: pp.simulate([pad(), pad()], cube(), duration=1), "sensors has two that are called 'pad'"),
    (lambda: pp.simulate(cube(), pad(), duration=1), "sensors has <Body 'box'.*: give a Sensor"),
    (
        lambda: pp.simulate(pad(), cube(), motion=np.zeros((3, 2))),
        r"motion of 'box' has the shape \(3, 2\): give m × 3 positions",
    ),
    (lambda: pp.simulate(pad(), cube(), motion={"bex": [[0, 0, 0]]}), r"called 'bex' \(did you mean 'box'\?\)"),
    (lambda: pp.simulate(pad(), cube(), motion=([0, 0], [[0, 0, 0]] * 2)), "give each pose a time, in increasing order"),
    (lambda: pp.simulate(pad(), cube(), motion=[[0, 0, np.nan]]), r"motion of 'box' is NaN or infinite at \[0, 2\]"),
    (lambda: pp.PressedSensor("pad", cube(), 1e-3), "sensor is 'pad': give a Sensor"),
    (lambda: pp.PressedSensor(pad(), "cube", 1e-3), "target is 'cube': give a Body"),
    (lambda: pp.PressedSensors(pad(), cube(), 0, 1e-3), "environments is 0: give a whole number above zero"),
]


@pytest.mark.parametrize(("call", "message"), REFUSED, ids=[message for _, message in REFUSED])
def test_a_wrong_argument_is_named_in_one_sentence(call, message):
    with pytest.raises(pp.PalpateError, match=message) as refused:
        call()
    text = str(refused.value)
    assert "\n" not in text and text.endswith((".", "?"))


def test_a_body_with_faces_that_point_inwards_is_turned():
    box = pp.Body.box(0.05)
    with pytest.warns(UserWarning, match="faces of 'lump' point inwards"):
        inverted = pp.Body.from_mesh((box.mesh.vertices, box.mesh.triangles[:, ::-1]), name="lump")
    assert (inverted.mesh.triangles == box.mesh.triangles).all()
