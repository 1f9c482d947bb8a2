# SPDX-License-Identifier: GPL-3.0-or-later
"""A cube of 1 kg comes to rest on a sensor in MuJoCo, carried by Palpate's texels.

palpate sensor export sample_blends/weighing.blend --to probes --out sensors
python examples/mujoco_loop.py sensors/Finger.json
"""

import sys

import mujoco
import numpy as np

import palpate as pp

XML = """<mujoco><option timestep="0.0005"/><worldbody><body name="cube" pos="{} {} {}">
<freejoint/><geom type="box" size="0.025 0.025 0.025" mass="1"/></body></worldbody></mujoco>"""
finger = pp.read_sensor(sys.argv[1])
model = mujoco.MjModel.from_xml_string(XML.format(*finger.position + [0.0, 0.0, 0.0255]))
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
cube = data.body("cube")
sensor_pose = finger.position, finger.quaternion  # the sensor stays where it is in the scene
pressed = pp.PressedSensor(finger, pp.Body.box(0.05), model.opt.timestep, sensor_pose, (cube.xpos, cube.xquat))
for _ in range(2000):
    mujoco.mj_step1(model, data)  # poses in
    contact = pressed.step(sensor_pose, (cube.xpos, cube.xquat))  # texel forces out
    data.qfrc_applied[:] = 0.0  # wrench back
    mujoco.mj_applyFT(model, data, contact.force_on_target, contact.torque_on_target, cube.xpos, cube.id, data.qfrc_applied)
    mujoco.mj_step2(model, data)
print(f"on the cube {contact.force_on_target[2]:.6f} N, sum of {np.count_nonzero(contact.texels.contact)} texels ", end="")
print(f"{contact.texels.normal_force.sum():.6f} N, weight {1.0 * 9.81:.6f} N")
