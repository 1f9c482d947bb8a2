# SPDX-License-Identifier: GPL-3.0-or-later
"""A cube of 1 kg comes to rest on a sensor in Genesis, carried by Palpate's texels.

palpate sensor export sample_blends/weighing.blend --to probes --out sensors
python examples/genesis_loop.py sensors/Finger.json
"""

import sys

import genesis as gs
import numpy as np

import palpate as pp

DT = 0.0005
finger = pp.read_sensor(sys.argv[1])
gs.init(backend=gs.cpu, precision="64", logging_level="warning")
scene = gs.Scene(sim_options=gs.options.SimOptions(dt=DT), show_viewer=False)
start = finger.position + [0.0, 0.0, 0.0255]
cube = scene.add_entity(gs.morphs.Box(pos=tuple(start), size=(0.05,) * 3), material=gs.materials.Rigid(rho=1.0 / 0.05**3))
scene.build()
sensor_pose = finger.position, finger.quaternion  # the sensor stays where it is in the scene
cube_pose = cube.get_pos().numpy(), cube.get_quat().numpy()
pressed = pp.PressedSensor(finger, pp.Body.box(0.05), DT, sensor_pose, cube_pose)
for _ in range(2000):
    cube_pose = cube.get_pos().numpy(), cube.get_quat().numpy()  # poses in
    contact = pressed.step(sensor_pose, cube_pose)  # texel forces out
    cube.apply_links_external_wrench(force=contact.force_on_target, torque=contact.torque_on_target)  # wrench back
    scene.step()
print(f"on the cube {contact.force_on_target[2]:.6f} N, sum of {np.count_nonzero(contact.texels.contact)} texels ", end="")
print(f"{contact.texels.normal_force.sum():.6f} N, weight {1.0 * 9.81:.6f} N")
