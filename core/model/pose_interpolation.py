# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses of keyframed bodies between the samples of their motion."""

from __future__ import annotations

import numpy as np

from ..geometry.rotations import quaternion_product, quaternions_from_vectors, rotation_vectors
from .motion import Motion


def poses_at(motion: Motion, times: np.ndarray, interpolation: str = "linear") -> tuple[np.ndarray, np.ndarray]:
    """Interpolate a motion; it is held before its first and after its last sample, and samples are met exactly.

    ``linear``: linear in position, constant angular velocity.

    ``smooth``: a cubic in position and a cumulative cubic Bézier curve of rotations (Kim, Kim and Shin, SIGGRAPH 1995), with
    continuous velocity. The velocity at a sample is that of the parabola through it and the two samples before. No later
    sample is needed, so the timeline, which receives a motion frame by frame, gives the same numbers as a bake.

    Parameters
    ----------
    motion : Motion
    times : (n,) float, seconds
    interpolation : str

    Returns
    -------
    positions : (n, 3) float, metres
    quaternions : (n, 4) float
    """
    if len(motion.times) == 1:
        n = len(times)
        return np.repeat(motion.positions, n, axis=0), np.repeat(motion.quaternions, n, axis=0)
    times = np.clip(times, motion.times[0], motion.times[-1])
    right = np.clip(np.searchsorted(motion.times, times, side="left"), 1, len(motion.times) - 1)
    left = right - 1
    share = ((times - motion.times[left]) / (motion.times[right] - motion.times[left]))[:, None]
    between = _smooth if interpolation == "smooth" else _linear
    positions, turned = between(motion, left, share)
    from_quaternion, to_quaternion = motion.quaternions[left], motion.quaternions[right]
    quaternions = np.where(share == 1.0, to_quaternion, np.where(share == 0.0, from_quaternion, turned))
    return np.where(share == 1.0, motion.positions[right], positions), quaternions


def _linear(motion: Motion, left: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    first = left.min(initial=len(motion.times))  # the times may be many between few samples
    samples = np.arange(first, left.max(initial=-1) + 1)
    turn = _turns(motion, samples)
    start, end = motion.positions[left], motion.positions[left + 1]
    positions = start + share * (end - start)
    if turn.any():
        turned = quaternion_product(quaternions_from_vectors(share * turn[left - first]), motion.quaternions[left])
    else:  # a share of no turn is none
        turned = quaternion_product(quaternions_from_vectors(turn), motion.quaternions[samples])[left - first]
    return positions, turned


def _smooth(motion: Motion, left: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    span, rest = (motion.times[left + 1] - motion.times[left])[:, None], 1.0 - share
    (v0, w0), (v1, w1) = _velocities(motion, left), _velocities(motion, left + 1)
    start, end = motion.positions[left], motion.positions[left + 1]
    # Bernstein polynomials; those of the rotation are their sums from the back.
    b1, b2, b3 = 3 * share * rest**2, 3 * share**2 * rest, share**3
    positions = start + b1 * (v0 * span / 3) + b2 * (end - start - v1 * span / 3) + b3 * (end - start)
    first, last = w0 * span / 3, w1 * span / 3
    from_start = quaternion_product(quaternions_from_vectors(first), motion.quaternions[left])
    to_end = quaternion_product(quaternions_from_vectors(-last), motion.quaternions[left + 1])
    middle = rotation_vectors(quaternion_product(to_end, _conjugate(from_start)))
    turned = motion.quaternions[left]
    for weight, turn in ((b1 + b2 + b3, first), (b2 + b3, middle), (b3, last)):
        turned = quaternion_product(quaternions_from_vectors(weight * turn), turned)
    return positions, turned


def _velocities(motion: Motion, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) velocities and angular velocities at samples: of the parabola through each and the two before.

    At the first sample, and at the second, it is the mean velocity between them.
    """
    last = np.maximum(at - 1, 0)  # intervals by their left ends
    before = np.maximum(at - 2, 0)
    h, g = ((motion.times[i + 1] - motion.times[i])[:, None] for i in (last, before))
    bend = h / (h + g)
    slopes = []
    for change in (lambda i: motion.positions[i + 1] - motion.positions[i], lambda i: _turns(motion, i)):
        slope = change(last) / h
        slopes.append(slope + bend * (slope - change(before) / g))
    return slopes[0], slopes[1]


def _turns(motion: Motion, left: np.ndarray) -> np.ndarray:
    """(n, 3) rotation vectors from samples to those that follow them."""
    return rotation_vectors(quaternion_product(motion.quaternions[left + 1], _conjugate(motion.quaternions[left])))


def _conjugate(quaternions: np.ndarray) -> np.ndarray:
    return quaternions * np.array([1.0, -1.0, -1.0, -1.0])
