# SPDX-License-Identifier: GPL-3.0-or-later
"""The contact of a sensor in MuJoCo's and Newton's terms: forces against Palpate's, in MuJoCo itself and in Warp."""

import json

import numpy as np
import pytest

import palpate as pp
from palpate.core.simulators.contact_translation import force_curve, mujoco_contact, newton_contact

DEPTH, TEXELS = 0.004, 84
STIFFENING = {
    "polynomial": {"name": "stiffening", "depth": 0.004},
    "exponential": {"name": "stiffening", "form": "exponential", "depth": 0.002},
    "foam": {"name": "stiffening", "form": "foam", "depth": 0.006},
}
FORMULA = {
    "polynomial": lambda d: d * (1.0 + d / 0.004),
    "exponential": lambda d: 0.002 * np.expm1(d / 0.002),
    "foam": lambda d: d / (1.0 - (d / 0.006) ** 2),
}


def pad(*effects, **parameters):
    return pp.Sensor.grid(14, 6, pitch=3.4e-3, **{"k": 58.5, **parameters}).with_effects(*effects)


def test_the_curve_is_the_law_of_all_texels():
    curve = force_curve(pad(), DEPTH)
    assert curve.force == pytest.approx(TEXELS * 58.5 * curve.depth, rel=1e-12)
    assert curve.damping == pytest.approx(np.full(len(curve.depth), TEXELS * 0.585), rel=1e-9)
    assert curve.depth[-1] == DEPTH and curve.area == pytest.approx(TEXELS * 3.4e-3**2 * 65 / 84, rel=1e-9)
    assert force_curve(pad()).depth[-1] == 0.006  # half the maximum penetration


@pytest.mark.parametrize("form", FORMULA)
def test_stiffening_is_part_of_it_and_effects_with_a_memory_are_named(form):
    curve = force_curve(pad(STIFFENING[form], "creep", "noise"), DEPTH)
    assert curve.force == pytest.approx(TEXELS * 58.5 * FORMULA[form](curve.depth), rel=1e-9, abs=1e-12)
    assert curve.left_out == ("creep", "noise")
    assert any("left out: creep, noise." in note for note in newton_contact(pad("creep", "noise"), DEPTH).notes)


def test_painted_texels_count_by_their_factor():
    from dataclasses import replace

    from palpate.core.model.sensor_parameters import Painted

    sensor = pad()
    painted = replace(sensor, sensor=replace(sensor.sensor, painted=Painted(k=np.linspace(0.5, 1.5, TEXELS) ** 2)))
    share = np.mean(np.linspace(0.5, 1.5, TEXELS) ** 2)
    assert force_curve(painted, DEPTH).force == pytest.approx(share * force_curve(sensor, DEPTH).force, rel=1e-12)


def pressed_in_mujoco(contact, mass, loads):
    """Return the depths at which a box of a mass rests under loads, and the model."""
    mujoco = pytest.importorskip("mujoco", reason="the simulator: pip install mujoco")
    solimp = " ".join(map(repr, contact.solimp))
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option cone="elliptic" timestep="0.0005" gravity="0 0 0"/>
      <worldbody>
        <geom type="plane" size="1 1 .1" priority="1" solref="{contact.solref[0]} {contact.solref[1]}" solimp="{solimp}"/>
        <body pos="0 0 0.02"><freejoint/><geom type="box" size=".02 .02 .02" mass="{mass}"/></body>
      </worldbody></mujoco>""")
    data, depths = mujoco.MjData(model), []
    for load in loads:
        data.xfrc_applied[1, 2] = -load
        model.dof_damping[:] = 5.0  # N·s/m: it comes to rest sooner, at the same depth
        mujoco.mj_step(model, data, 6000)
        assert np.abs(data.qvel).max() < 1e-5, "the box rests"
        depths.append(0.02 - data.qpos[2])
    return np.array(depths), model


@pytest.mark.parametrize(
    "sensor, mass, bounds",
    [
        (pad(), 1.0, (1e-6, 1e-6)),
        (pad(), 0.2, (1e-6, 1e-6)),
        (pad(STIFFENING["polynomial"]), 1.0, (0.001, 0.004)),
        (pad(STIFFENING["exponential"]), 1.0, (0.002, 0.015)),
        (pad(STIFFENING["foam"]), 1.0, (0.004, 0.03)),
        (pad(k=3e3, normal_law="hunt-crossley"), 1.0, (0.006, 0.02)),
    ],
)
def test_a_box_in_mujoco_rests_at_the_depth_that_palpates_force_has(sensor, mass, bounds):
    """MuJoCo's own force is the one of our formula to 1e-4, and Palpate's to the stated error of the translation."""
    contact, curve = mujoco_contact(sensor, DEPTH, mass), force_curve(sensor, DEPTH)
    assert contact.error.rms <= bounds[0] and contact.error.largest <= bounds[1]
    loads = np.array([0.1, 0.3, 0.6, 0.9]) * curve.force[-1]
    depths, _ = pressed_in_mujoco(contact, mass, loads)
    assert contact.force(depths) == pytest.approx(loads, rel=1e-4)
    difference = np.interp(depths, curve.depth, curve.force) - loads
    assert np.abs(difference).max() <= (contact.error.largest + 1e-4) * curve.force[-1]


def test_a_box_in_mujoco_oscillates_as_on_the_texels():
    """Without damping: √(K/m), of which the impedance of 0.01 leaves 98 % with four contacts, √(1 / (1 + 4 · 0.01 / 0.99))."""
    mujoco = pytest.importorskip("mujoco", reason="the simulator: pip install mujoco")
    stiffness = TEXELS * 58.5
    _, model = pressed_in_mujoco(mujoco_contact(pad(), DEPTH), 1.0, [])
    model.geom_solref[0, 1], model.dof_damping[:] = -1e-9, 0.0
    data, height = mujoco.MjData(model), []
    data.qpos[2], data.xfrc_applied[1, 2] = 0.02 - 0.0021, -0.002 * stiffness
    for _ in range(4000):
        mujoco.mj_step(model, data)
        height.append(data.qpos[2] - (0.02 - 0.002))
    height = np.array(height)
    up = np.flatnonzero((height[:-1] < 0) & (height[1:] >= 0))
    assert len(up) > 10
    assert 2 * np.pi / (np.diff(up).mean() * 5e-4) == pytest.approx(np.sqrt(stiffness / 1.04), rel=0.005)


def test_a_moving_contact_is_damped_as_the_texels():
    contact = mujoco_contact(pad(), DEPTH, mass=0.5, contacts=1)
    assert contact.damping(np.array([0.001, 0.003])) == pytest.approx(TEXELS * 0.585, rel=1e-9)
    assert contact.damping_error.largest < 1e-9 < mujoco_contact(pad(STIFFENING["foam"]), DEPTH).damping_error.largest


@pytest.mark.parametrize("form", FORMULA)
def test_newtons_table_gives_palpates_forces_in_warp(form):
    """Newton's function at depths inside, and outside where it has to fall on; other shapes keep their stiffness."""
    wp = pytest.importorskip("warp", reason="the extra of this plug-in: pip install warp-lang")
    from palpate.plugins.newton_pressure import PressureData, sensor_pressure

    @wp.kernel(enable_backward=False)
    def evaluate(depth: wp.array(dtype=float), shape: int, data: PressureData, found: wp.array(dtype=float)):
        i = wp.tid()
        found[i] = sensor_pressure(depth[i], shape, data)

    sensor = pad(STIFFENING[form])
    contact, curve = newton_contact(sensor, DEPTH), force_curve(sensor, DEPTH)
    data = PressureData()
    data.pressure, data.step = wp.array(contact.pressure, dtype=float, device="cpu"), contact.step
    data.is_sensor = wp.array([0, 1], dtype=int, device="cpu")
    data.stiffness = wp.array([7.0, 8.0], dtype=float, device="cpu")

    def pressure(depth, shape):
        found = wp.zeros(len(depth), dtype=float, device="cpu")
        inputs = [wp.array(-np.asarray(depth), dtype=float, device="cpu"), shape, data, found]
        wp.launch(evaluate, dim=len(depth), inputs=inputs, device="cpu")
        return found.numpy().astype(float)

    force = pressure(curve.depth, 1) * curve.area
    difference = np.abs(force - curve.force).max() / curve.force[-1]
    assert difference <= contact.error.largest + 2e-6 and contact.error.largest < 5e-4  # float32 rounds by 6e-8 of each factor
    assert (np.diff(pressure(np.linspace(-0.003, 0.006, 50), 1)) > 0).all()
    assert pressure([0.0], 1)[0] == 0.0
    assert pressure([-0.001, 0.002], 0) == pytest.approx([-0.007, 0.014], rel=1e-6)


def test_both_are_written_with_their_errors(tmp_path):
    written = pp.export_sensor(pad(STIFFENING["foam"], "creep"), "contact", tmp_path)
    (path,) = written.files
    content = json.loads(path.read_text(encoding="utf-8"))
    contact, pressure = pp.mujoco_contact(pad(STIFFENING["foam"])), pp.newton_contact(pad(STIFFENING["foam"]))
    assert content["mujoco"]["solref"] == list(contact.solref) and content["mujoco"]["error"]["rms"] == contact.error.rms
    assert content["newton"]["pressure"] == pressure.pressure.tolist() and content["newton"]["step"] == pressure.step
    assert written.notes[0] == f"'pad' in MuJoCo: {contact.error}; damping: {contact.damping_error}."
    assert any("left out: creep" in note for note in written.notes)


@pytest.mark.parametrize(
    "words, message",
    [
        ({"depth": 0.013}, "depth of sensor 'pad' is 0.013 m: give one above zero, up to its maximum penetration, 0.012 m"),
        ({"depth": -1.0}, "depth"),
        ({"mass": 0.0}, "mass"),
        ({"contacts": 0}, "contacts"),
    ],
)
def test_a_value_out_of_range_is_one_sentence(words, message):
    with pytest.raises(pp.PalpateError, match=message):
        pp.mujoco_contact(pad(), **words)


def test_a_fitted_sensor_is_exported_without_blender(tmp_path, capsys):
    """As palpate gap leaves it: a sensor.toml. A name that it has not is refused."""
    from palpate.commands import main

    pad(STIFFENING["polynomial"]).save(tmp_path / "sensor.toml")
    command = ["sensor", "export", str(tmp_path / "sensor.toml"), "--to", "contact", "--out", str(tmp_path / "out")]
    assert main(command) == 0
    printed = capsys.readouterr()
    assert printed.out.strip() == str(tmp_path / "out" / "pad.contact.json")
    content = json.loads((tmp_path / "out" / "pad.contact.json").read_text(encoding="utf-8"))
    assert content["mujoco"]["solref"] == list(pp.mujoco_contact(pad(STIFFENING["polynomial"])).solref)
    assert f"note: 'pad' in Newton: {pp.newton_contact(pad(STIFFENING['polynomial'])).error}." in printed.err
    assert main([*command, "--sensor", "thumb"]) != 0
    assert "There is no sensor 'thumb'" in capsys.readouterr().err
