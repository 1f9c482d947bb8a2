# SPDX-License-Identifier: GPL-3.0-or-later
"""Palpate inside another loop: forces on both bodies, probe lists that are read back, and the example in MuJoCo."""

from __future__ import annotations

import json
import runpy
import sys
from dataclasses import replace

import numpy as np
import pytest
from exported_sensors import ball, pad
from scipy.spatial.transform import Rotation
from solver_scenes import box

from palpate.core.effects.engine.registry import effect
from palpate.core.errors import PalpateError, ParameterError
from palpate.core.geometry.mesh import TriangleMesh
from palpate.core.simulators.pressed_sensor import PressedSensor
from palpate.core.simulators.probe_list import read_probe_list, write_probe_list

BOX = box(0.04, 0.04, 0.04)
K, DEPTH, OFFSET = 1000.0, 0.0004, np.array([0.004, -0.003, 0.02])


@pytest.mark.parametrize("turn", [Rotation.identity(), Rotation.from_rotvec([0.4, -1.1, 2.0])], ids=["level", "turned"])
def test_force_and_torque_are_those_of_springs(turn):
    """A box pressed into a flat pad: each texel under it carries k times the depth, wherever both stand in the world."""
    item = pad(name="Level")
    place = np.array([1.0, 2.0, -3.0])
    quaternion = np.roll(turn.as_quat(), 1)
    above, below = OFFSET + [0, 0, 0.001], OFFSET - [0, 0, DEPTH]
    poses = [(place + turn.apply(where), quaternion) for where in (above, below)]
    pressed = PressedSensor(item, BOX, 0.01, (place, quaternion), poses[0])
    contact = pressed.step((place, quaternion), poses[0])
    for _ in range(3):
        assert pressed.step((place, quaternion), poses[1], contact) is contact  # it stands still after the first step
    position = item.sensor.texels.position
    under = (np.abs(position[:, :2] - OFFSET[:2]) < 0.02).all(axis=1)
    assert 0 < under.sum() < len(under)
    assert contact.texels.normal_force == pytest.approx(np.where(under, K * DEPTH, 0.0), abs=1e-12)
    up = turn.apply([0.0, 0.0, 1.0])
    forces = contact.texels.normal_force[:, None] * up
    assert contact.force_on_target == pytest.approx(forces.sum(axis=0), abs=1e-10)
    # texels touch the lower side of the box, which is `DEPTH` below them: the arm along the force does not count
    arms = turn.apply(position) + place - poses[1][0]
    assert contact.torque_on_target == pytest.approx(np.cross(arms, forces).sum(axis=0), abs=1e-10)


@pytest.mark.parametrize("several", [False, True])
def test_a_target_whose_faces_point_inwards_is_turned(several):
    rest = np.array([1.0, 0.0, 0.0, 0.0])
    inside = TriangleMesh(BOX.vertices, BOX.triangles[:, ::-1])
    pressed = PressedSensor(pad(4, 4), BOX, 0.01)
    place = [0.0, 0.0, 0.02 - DEPTH], rest
    expected = pressed.step((np.zeros(3), rest), place).force_on_target
    with pytest.warns(UserWarning, match="faces of 'the target' point inwards"):
        turned = PressedSensor(pad(4, 4), [inside] if several else inside, 0.01)
    found = turned.step((np.zeros(3), rest), [place] if several else place).force_on_target
    assert np.abs(expected).max() > 0.1
    assert np.ravel(found) == pytest.approx(expected, abs=1e-12)


def test_poses_that_are_none_are_refused():
    item = pad(4, 4)
    rest = (np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
    with pytest.raises(ParameterError, match="The step is 0 s"):
        PressedSensor(item, BOX, 0.0, rest, rest)
    pressed = PressedSensor(item, BOX, 0.01, rest, (OFFSET, rest[1]))
    for bad in (([np.nan, 0, 0], rest[1]), (rest[0], np.zeros(4)), (np.zeros(2), rest[1])):
        with pytest.raises(ParameterError, match="The pose of the target is not a position"):
            pressed.step(rest, bad)


@pytest.mark.parametrize("item", [pad(5, 4, normal_law="hunt-crossley"), ball()], ids=["grid", "no grid"])
def test_a_probe_list_is_the_sensor(item, tmp_path):
    item = replace(item, sensor=replace(item.sensor, effects=(effect("creep", amount=0.2, time=1.5),)))
    write_probe_list(tmp_path / "pad.json", item)
    back = read_probe_list(tmp_path / "pad.json")
    assert back.sensor.settings_digest == item.sensor.settings_digest  # parameters, painted factors and effects
    assert np.array_equal(back.sensor.texels.local_frames, item.sensor.texels.local_frames)
    assert np.array_equal(back.sensor.texels.area, item.sensor.texels.area)
    assert type(back.sensor.texels.layout) is type(item.sensor.texels.layout)
    assert np.array_equal(back.sensor.texels.layout.uv(), item.sensor.texels.layout.uv())
    assert np.array_equal(back.faces, item.faces) and np.array_equal(back.quaternion, item.quaternion)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"format": "palpate-probes/9"}, "Its format is 'palpate-probes/9'"),
        ({"sensor": 3}, "The name in the file is 3"),
        ({"position": [[0, 0, 0], [1, 0, 0]]}, "It has 2 texels"),
        ({"position": "far"}, "'position' is not a list of numbers"),
        ({"normal": [[0, 0, 1]]}, "'normal' is missing or has another size"),
        ({"tangent": [[0.0, 0.0, 1.0]] * 16}, "not orthogonal unit vectors"),
        ({"area": [1e400] * 16}, "NaN or infinite"),
        ({"area": [-1.0] * 16}, "below zero"),
        ({"row": [0] * 16}, "make no grid"),
        ({"faces": [[0, 1, 99]]}, "does not exist"),
        ({"parameters": {"k": -1.0}}, "k of sensor 'Pad'"),
        ({"parameters": {"stickiness": 1.0}}, "'stickiness' in parameters"),
        ({"effects": [{"name": "telepathy"}]}, "no effect 'telepathy'"),
        ({"frame": None}, "It has no frame"),
    ],
)
def test_a_damaged_list_is_one_sentence(change, says, tmp_path):
    path = tmp_path / "pad.json"
    write_probe_list(path, pad(4, 4))
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(PalpateError, match=says) as caught:
        read_probe_list(path)
    assert "\n" not in str(caught.value) and str(caught.value).startswith("'pad.json': ")


@pytest.mark.parametrize("text", ["", "{", "[]", "[" * 100000, "\xff"])
def test_what_is_no_list_is_one_sentence(text, tmp_path):
    path = tmp_path / "pad.json"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(PalpateError, match="is not (JSON|a probe list)"):
        read_probe_list(path)


@pytest.mark.long("a cube that comes to rest in MuJoCo's loop")
def test_the_example_weighs_a_cube_in_mujoco(repository, tmp_path, monkeypatch, capsys):
    """In MuJoCo's loop the force on the cube is what the sensor reads, and its weight."""
    pytest.importorskip("mujoco", reason="MuJoCo moves the cube: pip install mujoco")
    item = pad()
    write_probe_list(tmp_path / "pad.json", replace(item, quaternion=np.array([1.0, 0.0, 0.0, 0.0])))
    monkeypatch.setattr(sys, "argv", ["mujoco_loop.py", str(tmp_path / "pad.json")])
    runpy.run_path(str(repository / "examples" / "mujoco_loop.py"))
    assert capsys.readouterr().out == "on the cube 9.810000 N, sum of 84 texels 9.810000 N, weight 9.810000 N\n"


@pytest.mark.long("loads that come to rest in MuJoCo's loop")
def test_the_side_by_side_example_has_its_table_and_picture(repository, tmp_path, capsys):
    """Under the load for which MuJoCo's contact is made both read the weight; under another only Palpate does."""
    pytest.importorskip("mujoco", reason="MuJoCo moves the loads: pip install mujoco")
    from palpate.core.simulators.formats.mjcf import write_mjcf

    item = replace(pad(), quaternion=np.array([1.0, 0.0, 0.0, 0.0]))
    write_probe_list(tmp_path / "Pad.json", item)
    write_mjcf(item, tmp_path / "Pad", "Pad")
    example = runpy.run_path(str(repository / "examples" / "mujoco_side_by_side.py"))
    example["main"].__globals__.update(LOADS=example["LOADS"][:2], SETTLING=0.4)
    example["main"](str(tmp_path / "Pad"), str(tmp_path / "picture.png"))
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in capsys.readouterr().out.splitlines()[2:]]
    sums = [[float(number) for number in row[1].split("·")] for row in rows]
    assert [row[0] for row in rows] == ["cube of 1 kg", "cube of 0.5 kg"]
    assert sums[0][0] == pytest.approx(9.81, abs=0.02)
    assert sums[0][1] == pytest.approx(9.81, abs=0.2), "MuJoCo's contact is still coming to rest after 0.4 s"
    assert sums[1][0] == pytest.approx(4.905, abs=0.02) and sums[1][1] > 9.0
    assert (tmp_path / "picture.png").stat().st_size > 20_000
