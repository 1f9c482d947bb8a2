# SPDX-License-Identifier: GPL-3.0-or-later
"""A plate of 1 kg comes to rest on a sensor in 16 environments of mjlab, carried by Palpate's texels.

pip install mjlab '.[warp]'    # in a checkout
palpate sensor export sample_blends/weighing.blend --to probes --out sensors    # in a Python with bpy
python examples/mjlab_touch.py sensors/Finger.json
"""

import sys

import mujoco
from mjlab.entity import EntityCfg
from mjlab.scene import Scene, SceneCfg
from mjlab.sim import MujocoCfg, Simulation, SimulationCfg

import palpate as pp
from palpate.plugins.mjlab import TouchSensorCfg

finger = pp.read_sensor(sys.argv[1])


def fixed() -> mujoco.MjSpec:
    """Return the body that carries the sensor."""
    spec = mujoco.MjSpec()
    spec.worldbody.add_body(name="pad")
    return spec


def plate() -> mujoco.MjSpec:
    """Return a free plate, which MuJoCo's own contact leaves alone."""
    spec, top = mujoco.MjSpec(), float(finger.sensor.texels.position[:, 2].max())
    body = spec.worldbody.add_body(name="plate", pos=[0.0, 0.0, top + 0.0102])
    body.add_freejoint()
    box = mujoco.mjtGeom.mjGEOM_BOX
    body.add_geom(name="plate", type=box, size=[0.025, 0.025, 0.01], mass=1.0, contype=0, conaffinity=0)
    return spec


touch = TouchSensorCfg(name="touch", sensor=finger, body="finger/pad", geoms=("plate/plate",))
entities = {"finger": EntityCfg(spec_fn=fixed), "plate": EntityCfg(spec_fn=plate)}
device = "cuda:0" if sys.argv[2:] == ["gpu"] else "cpu"
scene = Scene(SceneCfg(num_envs=16, entities=entities, sensors=(touch,)), device)
model = scene.compile()
simulation = Simulation(16, SimulationCfg(mujoco=MujocoCfg(timestep=0.0005)), model=model, device=device)
scene.initialize(simulation.mj_model, simulation.model, simulation.data)
simulation.forward()
for _ in range(2000):
    simulation.step()
    scene.update(0.0005)
data = scene["touch"].data
print(f"sums of {data.contact[0].sum()} texels {data.texels[:, :, 0].sum(dim=1).min():.4f} to ", end="")
print(f"{data.texels[:, :, 0].sum(dim=1).max():.4f} N, weight {1.0 * 9.81:.4f} N")
