# SPDX-License-Identifier: GPL-3.0-or-later
"""1,024 environments press a box on a pad and drag it; two thresholds on the tactile readings are fitted that detect its slip.

python examples/slip_detector.py

Friction, stiffness, depth and speed differ between environments, and the detector knows none of them. Half of the environments
fit the thresholds, the other half test them.
"""

import time

import numpy as np

import palpate as pp

ENVIRONMENTS, STEPS, DT, PITCH = 1024, 150, 2e-3, 3.4e-3
BRISTLES, WINDOW = 1000.0, 5  # N/m of a texel; steps over which the growth of the shear is taken

start = time.perf_counter()
draw = np.random.default_rng(0)
mus, k = draw.uniform(0.2, 1.2, ENVIRONMENTS), draw.uniform(500.0, 2000.0, ENVIRONMENTS)
depth, speed = draw.uniform(1e-4, 5e-4, ENVIRONMENTS), draw.uniform(1e-3, 5e-3, ENVIRONMENTS)
pad = pp.Sensor.grid(14, 6, pitch=PITCH, k=1000.0, sigma0=BRISTLES, sigma1=1.0)
columns = {"mus": mus, "mud": 0.9 * mus, "k": k, "cn": 0.01 * k}
pressed = pp.PressedSensors(pad, pp.Body.box(0.1), ENVIRONMENTS, DT, parameters=columns)

still, poses = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), np.zeros((ENVIRONMENTS, 7))
poses[:, 3], poses[:, 2] = 1.0, 0.05 - depth
pressed.step(still, poses)
normal, shear, dragged = (np.zeros((STEPS, ENVIRONMENTS)) for _ in range(3))
for step in range(STEPS):
    poses[:, 0] += speed * DT
    found = pressed.step(still, poses)
    normal[step], dragged[step] = found.texels[:, :, 0].sum(axis=1), poses[:, 0]
    shear[step] = np.linalg.norm(found.texels[:, :, 1:].sum(axis=1), axis=1)

# A texel slips when its bristles are deflected by all that static friction holds.
slips = dragged[WINDOW:] > mus * k * depth / BRISTLES
load = shear[WINDOW:] / normal[WINDOW:]
growth = (shear[WINDOW:] - shear[:-WINDOW]) / shear[WINDOW:]


def balanced_accuracy(said, truth):
    """Return the mean of the shares of slip and of grip that are told rightly."""
    return 0.5 * (said[truth].mean() + (~said[~truth]).mean())


half = ENVIRONMENTS // 2
score, least_load, most_growth = max(
    (balanced_accuracy((load[:, :half] > a) & (growth[:, :half] < b), slips[:, :half]), a, b)
    for a in np.linspace(0.0, 0.5, 11)
    for b in np.geomspace(1e-3, 0.3, 25)
)
test = balanced_accuracy((load[:, half:] > least_load) & (growth[:, half:] < most_growth), slips[:, half:])
print(f"{ENVIRONMENTS} environments, {STEPS} steps of {len(pad.texels)} texels: {slips.mean():.0%} of the samples slip")
print(f"slip: shear above {least_load:.2f} of the normal force that grows by less than {most_growth:.1%} in 10 ms")
print(f"balanced accuracy {score:.1%} where it was fitted, {test:.1%} on the other {ENVIRONMENTS - half} environments")
print(f"{time.perf_counter() - start:.0f} s")
