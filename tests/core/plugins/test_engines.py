# SPDX-License-Identifier: GPL-3.0-or-later
"""Plug-ins for engines: what a missing or old one says, and a cube on a slope where the engine is installed."""

from __future__ import annotations

import importlib
import sys

import numpy as np
import pytest
from exported_sensors import pad

from palpate.core.errors import PalpateError, ParameterError
from palpate.core.simulators.warp.engine import require_engine


def test_an_engine_that_is_missing_or_old_is_one_sentence(monkeypatch):
    with pytest.raises(PalpateError, match=r"needs no_engine, which is not installed: run 'pip install no-engine'\.$"):
        require_engine("no_engine", "no-engine", (1, 0))
    with pytest.raises(PalpateError, match=r"numpy is version .* needs 99\.0 or later: run 'pip install --upgrade numpy'\.$"):
        require_engine("numpy", "numpy", (99, 0))
    assert require_engine("numpy", "numpy", (1, 0)) is np
    monkeypatch.setitem(sys.modules, "mjlab", None)
    monkeypatch.delitem(sys.modules, "palpate.plugins.mjlab", raising=False)
    with pytest.raises(PalpateError, match="needs mjlab, which is not installed: run 'pip install mjlab'"):
        importlib.import_module("palpate.plugins.mjlab")


def test_newton_that_is_missing_is_one_sentence(monkeypatch):
    monkeypatch.setitem(sys.modules, "newton", None)
    from palpate.plugins.newton import SensorTouch

    with pytest.raises(PalpateError, match="needs newton, which is not installed: run 'pip install newton'"):
        SensorTouch(None, pad(4, 4), 1e-3, sensing_shapes="a", counterpart_shapes="b")


def plates_on_pads(newton, warp, tilt, **other):
    """Return a model of two worlds, each with a plate of 1 kg that touches a pad."""
    cfg = newton.ModelBuilder.ShapeConfig(density=0.0, has_shape_collision=False)
    world, moment = newton.ModelBuilder(), 1e-3
    world.add_shape_box(-1, hx=0.05, hy=0.05, hz=0.01, cfg=cfg, label="pad")
    inertia = warp.mat33(moment, 0.0, 0.0, 0.0, moment, 0.0, 0.0, 0.0, moment)
    body = world.add_body(xform=warp.transform((0.0, 0.0, 0.01), warp.quat_identity()), mass=1.0, inertia=inertia)
    world.add_shape_box(body, hx=0.05, hy=0.05, hz=0.01, cfg=cfg, label="plate")
    builder = newton.ModelBuilder()
    builder.add_world(world)
    builder.add_world(world)
    model = builder.finalize(device="cpu")
    model.set_gravity((0.0, -9.81 * np.sin(tilt), -9.81 * np.cos(tilt)))
    return model


@pytest.mark.long("Newton compiles its solver")
def test_a_plate_on_a_slope_in_newton():
    """Newton's poses are float32: 2e-9 m of a height of 10 mm, times the stiffness of all texels, is 1e-4 N."""
    newton = pytest.importorskip("newton", reason="the engine of this plug-in: pip install newton")
    import warp

    from palpate.plugins.newton import SensorTouch

    model, dt = plates_on_pads(newton, warp, np.radians(10.0)), 5e-4
    item = pad(8, 8, k=1000.0, cn=10.0, sigma0=1000.0, sigma1=10.0)
    touch = SensorTouch(model, item, dt, sensing_shapes="pad", counterpart_shapes=["pl?te"])
    assert len(touch.sensing_indices) == 2 and "2 environments" in repr(touch)
    solver = newton.solvers.SolverSemiImplicit(model)
    now, after = model.state(), model.state()
    for step in range(3000):
        now.clear_forces()
        touch.update(now)
        solver.step(now, after, None, None, dt)
        now, after = after, now
        if step == 2000:
            before = now.body_q.numpy()[:, :3].copy()
    texels, force = touch.texels.numpy(), touch.wrench.numpy()[:, 0, :3]
    assert touch.contact.numpy().all()
    assert force == pytest.approx(np.array([[0.0, 1.7035, 9.6610]] * 2), abs=1e-4)
    # The plate rests tilted by 5 mrad, and so do the normals of its contacts: their sum is less by the share of the shear.
    tilt = 2.0 * np.arcsin(now.body_q.numpy()[0, 3])
    normal = 9.6610 * np.cos(tilt) - 1.7035 * np.sin(tilt)
    assert texels[:, :, 0].sum(axis=1) == pytest.approx([normal] * 2, abs=1e-4)
    assert np.abs(texels[:, :, 1:].sum(axis=1)).max(axis=1) == pytest.approx([1.7035] * 2, abs=1e-3)
    assert np.abs(now.body_q.numpy()[:, :3] - before).max() < 1e-6
    with pytest.raises(ParameterError, match="sensing_shapes 'hand' is no shape of the model: .* pad, plate"):
        SensorTouch(model, item, dt, sensing_shapes="hand", counterpart_shapes="plate")


@pytest.mark.long("mjlab and MuJoCo Warp compile their kernels")
def test_a_plate_on_a_pad_in_mjlab():
    pytest.importorskip("mjlab", reason="the engine of this plug-in: pip install mjlab")
    import mujoco
    from mjlab.entity import EntityCfg
    from mjlab.scene import Scene, SceneCfg
    from mjlab.sim import MujocoCfg, Simulation, SimulationCfg

    from palpate.plugins.mjlab import TouchSensorCfg

    def fixed():
        spec = mujoco.MjSpec()
        spec.worldbody.add_body(name="pad")
        return spec

    def plate():
        spec = mujoco.MjSpec()
        body = spec.worldbody.add_body(name="plate", pos=[0.0, 0.0, 0.01])
        body.add_freejoint()
        size = [0.05, 0.05, 0.01]
        body.add_geom(name="plate", type=mujoco.mjtGeom.mjGEOM_BOX, size=size, mass=1.0, contype=0, conaffinity=0)
        return spec

    item = pad(8, 8, k=1000.0, cn=10.0, sigma0=1000.0, sigma1=10.0)
    touch = TouchSensorCfg(name="touch", sensor=item, body="pad/pad", geoms=("plate/plate",))
    entities = {
        "pad": EntityCfg(spec_fn=fixed),
        "plate": EntityCfg(spec_fn=plate),
    }
    scene = Scene(SceneCfg(num_envs=2, entities=entities, sensors=(touch,)), "cpu")
    simulation = Simulation(2, SimulationCfg(mujoco=MujocoCfg(timestep=0.0005)), model=scene.compile(), device="cpu")
    scene.initialize(simulation.mj_model, simulation.model, simulation.data)
    simulation.forward()
    sums = []
    for step in range(2500):
        simulation.step()
        scene.update(0.0005)
        if step >= 2000:
            sums.append(scene["touch"].data.texels[:, :, 0].sum(dim=1).tolist())
    # Positions of 10 mm round to 9.3e-10 m in float32: of the depth's rate, times the damping of 64 texels, this is 1.2e-3 N.
    assert scene["touch"].data.contact.all()
    assert np.mean(sums, axis=0) == pytest.approx([9.81] * 2, abs=1e-4)
    assert np.abs(np.array(sums) - 9.81).max() < 2 * 9.3e-10 / 0.0005 * 64 * 10.0
    with pytest.raises(ParameterError, match="update the scene after each step"):
        scene["touch"].update(0.002)


def wrench_about(point, wrench, origin):
    """Force, and torque about a point, of a wrench (6,) about an origin."""
    return np.concatenate([wrench[:3], wrench[3:] + np.cross(origin - point, wrench[:3])])


@pytest.mark.slow("Warp compiles the kernels")
def test_poses_go_to_the_sensor_and_wrenches_to_the_engines():
    """Two worlds, a target's body and the sensor's; the engines' arrays in float32, the sensor's in float64."""
    wp = pytest.importorskip("warp", reason="Warp runs the kernels: pip install warp-lang")
    from scipy.spatial.transform import Rotation

    from palpate.plugins import engine_kernels as kernels

    draw = np.random.default_rng(2)
    place, turn = draw.standard_normal((2, 3, 3)).astype(np.float32), Rotation.random(6, draw)
    quaternion = turn.as_quat().reshape(2, 3, 4).astype(np.float32)  # (x, y, z, w)
    matrix = turn.as_matrix().reshape(2, 3, 3, 3).astype(np.float32)
    wrench, centre = draw.standard_normal((2, 1, 6)), draw.standard_normal((2, 3, 3)).astype(np.float32)
    poses, force = wp.zeros((2, 2, 7), dtype=wp.float64, device="cpu"), wp.array(wrench, dtype=wp.float64, device="cpu")
    given = [wp.array(one, dtype=kind, device="cpu") for one, kind in (
        (place, wp.vec3), (np.roll(quaternion, 1, axis=2), wp.quat), (place, wp.vec3), (matrix, wp.mat33),
    )]  # fmt: skip
    geoms, xipos = wp.array([2], dtype=int, device="cpu"), wp.array(centre, dtype=wp.vec3, device="cpu")
    wp.launch(kernels.write_mujoco_poses, dim=(2, 2), inputs=[1, geoms, *given, poses], device="cpu")
    expected = np.concatenate([place, np.roll(quaternion, 1, axis=2)], axis=2)[:, [1, 2]]
    sign = np.sign((poses.numpy()[..., 3:] * expected[..., 3:]).sum(axis=2, keepdims=True))  # of either sign alike
    assert np.abs(poses.numpy()[..., :3] - expected[..., :3]).max() == 0.0
    assert np.abs(sign * poses.numpy()[..., 3:] - expected[..., 3:]).max() < 1e-6
    applied = wp.array(np.ones((2, 3, 6)), dtype=wp.spatial_vector, device="cpu")
    inputs = [1, geoms, xipos, poses, force, applied]
    wp.launch(kernels.write_mujoco_wrenches, dim=2, inputs=inputs, device="cpu")
    for world in range(2):
        found, origin = applied.numpy()[world], place[world, 2].astype(float)
        assert found[0] == pytest.approx(np.ones(6))
        assert found[2] == pytest.approx(wrench_about(centre[world, 2], wrench[world, 0], origin), abs=1e-5)
        assert found[1] == pytest.approx(-wrench_about(centre[world, 1], wrench[world, 0], origin), abs=1e-5)

    # Newton: shapes at their bodies, apart from the second world's sensor, which belongs to none.
    frame = np.concatenate([place, quaternion], axis=2).reshape(6, 7)
    none = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]] * 6)
    body_q, com = wp.array(frame, dtype=wp.transform, device="cpu"), wp.array(centre.reshape(6, 3), dtype=wp.vec3, device="cpu")
    transforms = none.copy()
    transforms[4] = frame[4]
    shapes = wp.array([[1, 2], [4, 5]], dtype=int, device="cpu")
    bodies = wp.array([0, 1, 2, 3, -1, 5], dtype=int, device="cpu")
    fixed = wp.array(transforms, dtype=wp.transform, device="cpu")
    wp.launch(kernels.write_newton_poses, dim=(2, 2), inputs=[shapes, bodies, fixed, body_q, poses], device="cpu")
    assert poses.numpy() == pytest.approx(expected, abs=1e-6)
    body_f = wp.zeros(6, dtype=wp.spatial_vector, device="cpu")
    inputs = [shapes, bodies, com, body_q, poses, force, body_f]
    wp.launch(kernels.add_newton_wrenches, dim=(2, 1), inputs=inputs, device="cpu")
    centres = place.reshape(6, 3) + turn.apply(centre.reshape(6, 3))
    for body, row, sign in ((2, 0, 1.0), (1, 0, -1.0), (5, 1, 1.0)):
        origin = place[row, 2].astype(float)
        assert body_f.numpy()[body] == pytest.approx(sign * wrench_about(centres[body], wrench[row, 0], origin), abs=1e-4)
    assert not body_f.numpy()[[0, 3, 4]].any()
