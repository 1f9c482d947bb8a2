# SPDX-License-Identifier: GPL-3.0-or-later
"""Weights on a pad: what lies still weighs m g, whatever it lies on."""

from __future__ import annotations

import numpy as np
from solver_scenes import GRAVITY, cube_on_pad, pad

from palpate.core.geometry.rotations import rotation_matrices
from palpate.core.model.scenario import Scenario
from palpate.core.solver.simulation import run

GRIDS = {"14x6": (14, 6), "32x32": (32, 32), "100x100": (100, 100)}
SIDE = 0.0442
"""Longer side of every pad, metres: 14 texels with a pitch of 3.4 mm."""


def weighing(grid: str, mass: float) -> Scenario:
    """A cube that covers the pad; k 1000 and cn 10 on 14 × 6, and as much for the whole of a finer pad."""
    rows, columns = GRIDS[grid]
    share = 84 / (rows * columns)
    texels = pad(rows, columns, SIDE / (max(rows, columns) - 1))
    dt = 1e-4 if grid == "14x6" else 1e-3
    return cube_on_pad(mass, texels=texels, k=1000.0 * share, cn=10.0 * share, frames=24, dt=dt)


def weight_error(grid: str, mass: float) -> tuple[float, int]:
    """Relative error of the sum of normal forces after a second, and how many texels feel nothing."""
    sensor = run(weighing(grid, mass)).sensors["pad"]
    total = sensor.normal_force[-1].sum()
    return abs(total / (mass * GRAVITY) - 1.0), int((sensor.normal_force[-1] <= 0.0).sum())


def tilted(seconds: float, dt: float = 1e-3) -> tuple[float, float, float, float, float]:
    """Section 5.1.2 of the paper: 1 kg on a 14 × 6 pad that is tilted by 10°.

    Returns
    -------
    along : float, newtons
        Force on the pad along its slope, at the end.
    shear : float, newtons
        The same as the sum of the texels' shear.
    friction : float, newtons
        Sum of the texels' friction forces.
    lean : float, radians
        By how much more than the pad the cube is tilted.
    creep : float, metres
        Largest distance of the cube from where it was after 10 s.
    """
    scenario = cube_on_pad(1.0, tilt=10.0, frames=int(seconds) + 1, fps=1.0, dt=dt, sigma0=1e3, sigma1=10.0, x0=0.01)
    recording = run(scenario)
    sensor, positions = recording.sensors["pad"], recording.poses[10:, 1, :3]
    normals = rotation_matrices(recording.poses[-1, :, 3:])[:, :, 2]
    return (
        abs(float(sensor.net_force[-1, 1])),
        float(np.linalg.norm(sensor.shear[-1].sum(axis=0))),
        float(sensor.friction[-1].sum()),
        float(np.arcsin(np.linalg.norm(np.cross(normals[0], normals[1])))),
        float(np.linalg.norm(positions - positions[0], axis=1).max()),
    )
