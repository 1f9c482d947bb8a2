# SPDX-License-Identifier: GPL-3.0-or-later
"""MJCF of sensors, as MuJoCo itself reads and runs it."""

from __future__ import annotations

import numpy as np
import pytest
from exported_sensors import FLOAT32, ball, pad

from palpate.core.simulators.contact_translation import mujoco_contact
from palpate.core.simulators.formats import mjcf
from palpate.core.simulators.sensor_format import export_sensors

mujoco = pytest.importorskip("mujoco", reason="MuJoCo reads the MJCF: pip install mujoco")


def loaded(item, folder, extra=""):
    """Export a sensor and let MuJoCo compile it, with more bodies."""
    written = export_sensors([item], "mjcf", folder)
    text = written.files[0].read_text(encoding="utf-8").replace("</worldbody>", f"{extra}</worldbody>")
    return mujoco.MjModel.from_xml_string(text), written


def texels_in(model, name):
    """Return positions and frames of a sensor's texels in the frame of its body, from MuJoCo's own mesh."""
    index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_MESH, f"{name} texels")
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.mesh_quat[index])
    first, count = model.mesh_vertadr[index], model.mesh_vertnum[index]
    first_normal, normals = model.mesh_normaladr[index], model.mesh_normalnum[index]
    position = model.mesh_vert[first : first + count] @ turn.reshape(3, 3).T + model.mesh_pos[index]
    axes = model.mesh_normal[first_normal : first_normal + normals] @ turn.reshape(3, 3).T
    return position, axes.reshape(count, 3, 3)


@pytest.mark.parametrize("item", [pad(), pad(radius=0.02, name="Bent \u00e9 & <pad>"), ball()], ids=lambda item: item.name)
def test_mujoco_has_our_texels(item, tmp_path):
    model, _ = loaded(item, tmp_path)
    position, axes = texels_in(model, item.name)
    assert len(position) == len(item.sensor.texels) == model.sensor_dim[0] // 3
    assert np.abs(position - item.sensor.texels.position).max() < FLOAT32
    assert np.abs(axes[:, 0] - item.sensor.texels.normal).max() < FLOAT32
    assert np.abs(axes[:, 1] - item.sensor.texels.tangent).max() < FLOAT32
    assert np.abs(axes[:, 2] - item.sensor.texels.bitangent).max() < FLOAT32
    body = model.body(item.name)
    assert np.allclose(body.pos, item.position) and np.allclose(body.quat, item.quaternion)


def weighed(mass, folder, **parameters):
    """Let a box come to rest on a flat pad in MuJoCo; return its depth, the sensor's depths and the force that carries it."""
    item = pad(**parameters)
    item = type(item)(item.sensor, item.mesh)  # level, in the origin
    box = f'<body pos="0 0 0.0251"><freejoint/><geom name="box" type="box" size="0.03 0.03 0.025" mass="{mass}"/></body>'
    model, _ = loaded(item, folder, box)
    data = mujoco.MjData(model)
    for _ in range(3000):
        mujoco.mj_step(model, data)
    total = np.zeros(3)
    for number in range(data.ncon):
        wrench = np.zeros(6)
        mujoco.mj_contactForce(model, data, number, wrench)
        total += wrench[:3] @ data.contact[number].frame.reshape(3, 3)
    depths = data.sensordata[: len(item.sensor.texels)]
    return 0.025 - data.qpos[2], depths, abs(total[2]), item


def test_a_kilogram_sinks_in_as_far_as_on_ours(tmp_path):
    """The rule behind `solref`: (1 - d) g / (4 stiffness) is m g / (N k), which Palpate's texels give."""
    depth, depths, force, item = weighed(1.0, tmp_path)
    ours = 9.81 / (len(item.sensor.texels) * item.sensor.parameters.k)
    assert depth == pytest.approx(ours, rel=1e-4)  # it still settles by 1e-5 of the depth
    assert depths == pytest.approx(np.full(len(depths), ours), abs=FLOAT32)
    assert force == pytest.approx(9.81, rel=1e-4)
    assert item.sensor.parameters.k * depths.sum() == pytest.approx(9.81, rel=0.01)


def test_the_depth_of_another_mass_is_the_same_as_the_note_says(tmp_path):
    (light, *_, item), (heavy, *_) = weighed(0.5, tmp_path / "light"), weighed(2.0, tmp_path / "heavy")
    assert light == pytest.approx(heavy, rel=1e-3)
    assert "per mass" in " ".join(mjcf._notes(item, mujoco_contact(item)))


def test_a_body_that_is_not_convex_is_touched_where_it_is(tmp_path):
    """A ball rests in the middle of a hollow pad, 3 mm below the pad's convex hull."""
    item = pad(radius=-0.02, name="Hollow")
    item = type(item)(item.sensor, item.mesh)
    lowest = item.sensor.texels.position[np.argmin(np.linalg.norm(item.sensor.texels.position[:, :2], axis=1))]
    where = " ".join(map(str, lowest + [0.0, 0.0, 0.005 - 0.0005]))
    extra = f'<body pos="{where}"><freejoint/><geom type="sphere" size="0.005" mass="0.01"/></body>'
    model, written = loaded(item, tmp_path, extra)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.ncon > 0 and min(contact.dist for contact in data.contact) > -0.001
    deepest = data.sensordata[: len(item.sensor.texels)].max()
    assert deepest == pytest.approx(0.0005, abs=1e-4)  # the texel is not quite in the middle
    assert any("not convex" in note for note in written.notes)


def test_what_mujoco_cannot_express_is_in_the_file_too(tmp_path):
    item = ball()
    _, written = loaded(item, tmp_path)
    text = written.files[0].read_text(encoding="utf-8")
    assert written.notes and all(note in text for note in written.notes)
    assert any("painted k" in note for note in written.notes)


def test_the_error_of_the_contact_is_told(tmp_path):
    """A linear sensor has none, and its `solref` is that of its springs; one that stiffens has."""
    springs = pad()
    model, written = loaded(springs, tmp_path / "springs")
    law, texels = springs.sensor.parameters, len(springs.sensor.texels)
    geom = model.geom(f"{springs.name} collision")
    assert geom.solimp[:2] == pytest.approx(mjcf.IMPEDANCE)
    share = (1.0 - mjcf.IMPEDANCE) * texels / 4.0
    assert geom.solref == pytest.approx([-share * law.k, -share * law.cn], rel=1e-9)
    assert not any("of the largest force" in note for note in written.notes)
    _, written = loaded(pad(normal_law="hunt-crossley", k=3e4), tmp_path / "power")
    assert any("of the largest force" in note for note in written.notes)
