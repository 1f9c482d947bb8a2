# SPDX-License-Identifier: GPL-3.0-or-later
"""Layout of the contact rows, which are all that the solver's inner loops read and write.

There is one row for each contact point and target that touch, in the frame of the sensor's body. :data:`LANES` rows make a
block, in which each column lies in one piece: row r of a pair is ``rows[block, COLUMN + lane]`` with ``block, lane = divmod(r,
LANES)``, counted from the pair's first block. A loop over the lanes then runs in vector registers, several rows at a time. Each
pair begins with a block of its own. The lanes that its last block leaves over are zero, which is a contact without force.
"""

from __future__ import annotations

import numpy as np

from ..compiled.kernels import inlined

LANES = 16
"""Rows in a block."""

# Columns. Three columns that follow one another hold a vector; its name is that of the first of them.
NORMAL = 0  # outward normal of the target
POINT = 3 * LANES  # contact point from the reference point of the sensor's body, m
BRISTLE = 6 * LANES  # bristle deflection, m
DEPTH = 9 * LANES  # m
KEEP, GAIN = 10 * LANES, 11 * LANES  # the step of the bristles: z(t + dt) = KEEP z + GAIN v
LIMIT = 12 * LANES  # largest |z|, m
# Written only where they are not the same for all contacts of a pair: the tangent of the normal law (N, N·s/m), the
# multiplier of the friction coefficients, and what is added to ct (N·s/m).
NORMAL_BIAS, NORMAL_SLOPE = 13 * LANES, 14 * LANES
FRICTION_SCALE, EXTRA_VISCOSITY = 15 * LANES, 16 * LANES
# What the readout writes over columns that only a step reads: friction (N), normal force (N), sliding speed (m/s), and the
# size of friction (N), when the whole force stands in the place of friction.
FRICTION, PUSH, SPEED, SIZE = KEEP, NORMAL_BIAS, NORMAL_SLOPE, FRICTION_SCALE
ROW = 17 * LANES
"""Numbers in a block."""


@inlined
def read_vector(rows: np.ndarray, block: int, column: int, lane: int) -> tuple[float, float, float]:
    """Return the vector that begins with a column."""
    return rows[block, column + lane], rows[block, column + LANES + lane], rows[block, column + 2 * LANES + lane]


@inlined
def write_vector(rows: np.ndarray, block: int, column: int, lane: int, x: float, y: float, z: float) -> None:
    """Write the vector that begins with a column."""
    rows[block, column + lane], rows[block, column + LANES + lane], rows[block, column + 2 * LANES + lane] = x, y, z
