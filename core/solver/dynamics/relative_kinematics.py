# SPDX-License-Identifier: GPL-3.0-or-later
"""What all contacts of a pair of sensor and target have in common: one relative motion, one law (kernels)."""

from __future__ import annotations

from ...compiled.kernels import inlined, kernel


@kernel
def relative_motion(a, b, twist, position, rotation, motion):
    """How the points of body `b` move relative to body `a`, in the axes of `a`: ``v = U + W p`` (Eq. 3), written into `motion`.

    `p` is a point's place from the reference point of `a`. One motion serves all contacts of a pair.
    """
    for k in range(3):
        motion[k] = 0.0
        for m in range(3):
            motion[3 + 3 * k + m] = 0.0
    for i in range(3):
        u = twist[b, i] - twist[a, i]
        for j in range(3):
            u += twist[b, 3 + 3 * i + j] * (position[a, j] - position[b, j])
            w = twist[b, 3 + 3 * i + j] - twist[a, 3 + 3 * i + j]
            for k in range(3):
                for m in range(3):
                    motion[3 + 3 * k + m] += rotation[a, i, k] * w * rotation[a, j, m]
        for k in range(3):
            motion[k] += rotation[a, i, k] * u


@kernel
def motion_values(motion):
    """The twelve numbers of a motion as a tuple: the compiler keeps them in registers, which it may not do with an array's."""
    return (
        motion[0], motion[1], motion[2], motion[3], motion[4], motion[5],
        motion[6], motion[7], motion[8], motion[9], motion[10], motion[11],
    )  # fmt: skip


@kernel
def pair_law(parameters, pair):
    """A pair's parameters as a tuple, for the same reason."""
    return (
        parameters[pair, 0], parameters[pair, 1], parameters[pair, 2], parameters[pair, 3],
        parameters[pair, 4], parameters[pair, 5], parameters[pair, 6], parameters[pair, 7],
        parameters[pair, 8], parameters[pair, 9],
    )  # fmt: skip


@kernel
def point_law(p, painted, point):
    """A sensor's parameters with the multipliers of one of its contact points; `p` itself where nothing is painted."""
    if len(painted) == 0:
        return p
    k, friction = painted[point, 0], painted[point, 1]
    return (p[0] * k, p[1] * k, p[2], p[3], p[4], p[5], p[6] * friction, p[7] * friction, p[8], p[9])


@inlined
def velocity_at(px, py, pz, motion):
    """Velocity of the target at a contact point relative to the sensor, in the axes of the sensor's body."""
    return (
        motion[0] + motion[3] * px + motion[4] * py + motion[5] * pz,
        motion[1] + motion[6] * px + motion[7] * py + motion[8] * pz,
        motion[2] + motion[9] * px + motion[10] * py + motion[11] * pz,
    )
