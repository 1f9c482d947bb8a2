# SPDX-License-Identifier: GPL-3.0-or-later
"""A plate of 1 kg comes to rest on a sensor in 16 worlds of Newton, carried by Palpate's texels.

pip install newton '.[warp]'    # in a checkout
palpate sensor export sample_blends/weighing.blend --to probes --out sensors    # in a Python with bpy
python examples/newton_touch.py sensors/Finger.json
"""

import sys

import newton
import warp as wp

import palpate as pp
from palpate.plugins.newton import SensorTouch

finger, dt = pp.read_sensor(sys.argv[1]), 5e-4
top = float(finger.sensor.texels.position[:, 2].max())
# Newton's own contact is off: Palpate's texels carry the plate.
shape = newton.ModelBuilder.ShapeConfig(density=0.0, has_shape_collision=False)
world = newton.ModelBuilder()
world.add_shape_box(-1, hx=0.01, hy=0.02, hz=0.01, cfg=shape, label="finger")
moments = wp.mat33(2.4e-4, 0.0, 0.0, 0.0, 2.4e-4, 0.0, 0.0, 0.0, 4.2e-4)  # kg·m², of a plate of 50 × 50 × 20 mm
plate = world.add_body(xform=wp.transform((0.0, 0.0, top + 0.0102), wp.quat_identity()), mass=1.0, inertia=moments)
world.add_shape_box(plate, hx=0.025, hy=0.025, hz=0.01, cfg=shape, label="plate")
builder = newton.ModelBuilder()
for _ in range(16):
    builder.add_world(world)
model = builder.finalize()
touch = SensorTouch(model, finger, dt, sensing_shapes="finger", counterpart_shapes="plate")
solver = newton.solvers.SolverSemiImplicit(model)
now, after = model.state(), model.state()
for _ in range(2000):
    now.clear_forces()
    touch.update(now)
    solver.step(now, after, None, None, dt)
    now, after = after, now
sums = touch.texels.numpy()[:, :, 0].sum(axis=1)
print(f"sums of {touch.contact.numpy()[0].sum()} texels {sums.min():.4f} to {sums.max():.4f} N, weight {1.0 * 9.81:.4f} N")
