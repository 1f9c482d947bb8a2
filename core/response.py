# SPDX-License-Identifier: GPL-3.0-or-later
"""Summaries of a recording: net forces, slip, the free moment, and ranges for common scales."""

from __future__ import annotations

import numpy as np

from .geometry.texels import Texels
from .model.recording import Recording, SensorFrame, SensorRecording
from .model.sensor_parameters import Painted, SensorParameters

SETTLED_CHANGE, SETTLED_SPAN = 0.05, 0.1
"""Forces are settled where their sum changes by no more than this share over this share of all frames in a row. The span is
twice as long as the turning point of an overshoot: the grippers of the samples, under force control, are within 5 % of their
largest force for 3 of 72 frames before it sinks by 10 %."""
LOADED = 0.5
"""Share of the median load from which a settled frame is worth a picture."""
AT_LIMIT = 0.9
"""Share of the friction limit above which a moving texel counts as slipping."""
CREEPING = 1e-6
"""Speed, m/s, up to which a texel at its limit still counts as sticking."""

ROUNDED_SHEAR = 1e-9
"""Of the shear of a texel over the largest normal force: less is rounding. A cube at rest on a level pad leaves 3e-16,
and a tilt of a microradian would give 1e-6."""


def net_shear(sensor: SensorRecording, texels: Texels) -> np.ndarray:
    """Return the sum of all texels' shear forces, in the frame of the sensor's body.

    Parameters
    ----------
    sensor : SensorRecording
        F frames of n texels.
    texels : Texels
        The n texels.

    Returns
    -------
    (F, 3) float, N
    """
    return sensor.shear[:, :, 0] @ texels.tangent + sensor.shear[:, :, 1] @ texels.bitangent


def mobilised_friction(sensor: SensorRecording, texels: Texels, mus: float) -> np.ndarray:
    """Return the mobilised share of static friction: ``|Σ shear| / (mus · Σ normal)``, zero without contact.

    Returns
    -------
    (F,) float
    """
    limit = mus * sensor.normal_force.sum(axis=1)
    shear = np.linalg.norm(net_shear(sensor, texels), axis=1)
    return np.divide(shear, limit, out=np.zeros_like(shear), where=limit > 0)


def slipping(sensor: SensorRecording | SensorFrame, parameters: SensorParameters, painted: Painted | None = None) -> np.ndarray:
    """Return which texels slip: they touch, move, and their friction is (almost) at its limit for their speed (Eq. 10).

    Parameters
    ----------
    sensor : SensorRecording or SensorFrame
    parameters : SensorParameters
    painted : Painted, optional
        Its friction scales the limit of each texel.

    Returns
    -------
    (F, n) or (n,) bool
    """
    from .laws.friction import stribeck_force

    found = np.asarray(sensor.contact, bool) & (sensor.slip > CREEPING)
    limit = stribeck_force(sensor.normal_force[found], sensor.slip[found], parameters)
    if painted is not None and painted.friction is not None:
        limit = limit * np.broadcast_to(painted.friction, found.shape)[found]
    found[found] = sensor.friction[found] >= AT_LIMIT * limit
    return found


def slip_share(sensor: SensorRecording, parameters: SensorParameters, painted: Painted | None = None) -> np.ndarray:
    """Return the share of the normal force that acts on slipping texels, 0 to 1; zero without contact.

    Returns
    -------
    (F,) float
    """
    return share_on(slipping(sensor, parameters, painted), sensor)


def share_on(chosen: np.ndarray, sensor: SensorRecording) -> np.ndarray:
    """Return the share (F,) of the normal force that acts on the texels that `chosen` (F, n) tells; zero without contact."""
    total = sensor.normal_force.sum(axis=1)
    own = np.where(chosen, sensor.normal_force, 0.0).sum(axis=1)
    return np.divide(own, total, out=np.zeros_like(total), where=total > 0)


def free_moment(sensor: SensorRecording | SensorFrame) -> np.ndarray:
    """Return the net torque about the centre of pressure instead of the body's origin, in the body's frame.

    Returns
    -------
    (F, 3) or (3,) float, N·m
    """
    return sensor.net_torque - np.cross(sensor.centre_of_pressure, sensor.net_force)


def peak_force(recording: Recording) -> float:
    """Return the largest normal force of any texel at any frame, N; one newton without any contact."""
    sensors = (sensor for part in recording.blocks() for sensor in part.sensors.values())
    peak = max((float(sensor.normal_force.max(initial=0.0)) for sensor in sensors), default=0.0)
    return peak if peak > 0 else 1.0


def peak_shear(recording: Recording) -> float:
    """Return the largest shear force of any texel at any frame, N; zero where there is none beyond rounding."""
    sensors = (sensor for part in recording.blocks() for sensor in part.sensors.values())
    peak = max((float(np.linalg.norm(sensor.shear, axis=2).max(initial=0.0)) for sensor in sensors), default=0.0)
    return peak if peak > ROUNDED_SHEAR * peak_force(recording) else 0.0


def rounded_limit(value: float) -> float:
    """Return the next number of the form 1, 1.5, 2, 2.5, 3, 4, 5, 6 or 8 × 10ⁿ at or above `value`, for the end of a scale."""
    power = 10.0 ** np.floor(np.log10(value))
    for step in (1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10):
        if value <= step * power * (1 + 1e-9):
            return float(step * power)
    raise AssertionError("every decade ends at ten")


def scale_limit(peak: float) -> float:
    """Return the end of a scale: a round number at least 5 % above the largest value."""
    return rounded_limit(1.05 * peak)


def peak_frame(recording: Recording) -> int:
    """Return the number of the frame with the largest sum of the normal forces of all sensors."""
    return int(recording.frames[_total_force(recording).argmax()])


def settled_frame(recording: Recording) -> int:
    """Return the number of the frame at which settled forces are largest: not an impact, but what comes to rest after it.

    Among frames with nearly the same load it is the middle one. Where no loaded frame is settled it is :func:`peak_frame`.
    """
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    total = _total_force(recording)
    if not total.max() > 0.0:
        return peak_frame(recording)
    span = 2 * max(1, round(0.5 * SETTLED_SPAN * len(total))) + 1
    largest, smallest = maximum_filter1d(total, span, mode="nearest"), minimum_filter1d(total, span, mode="nearest")
    in_steady_span = (
        maximum_filter1d((largest - smallest <= SETTLED_CHANGE * largest).astype(float), span, mode="nearest") > 0.0
    )
    typical = float(np.median(total[total > SETTLED_CHANGE * total.max()]))
    settled = in_steady_span & (total >= LOADED * typical)
    if not settled.any():
        return peak_frame(recording)
    (best,) = np.nonzero(settled & (total >= (1.0 - SETTLED_CHANGE) * total[settled].max()))
    return int(recording.frames[best[len(best) // 2]])


def _total_force(recording: Recording) -> np.ndarray:
    """Return the sum of the normal forces of all texels, (F,) float, N."""
    parts = (sum(sensor.normal_force.sum(axis=1) for sensor in part.sensors.values()) for part in recording.blocks())
    return np.concatenate([np.asarray(part, dtype=float) for part in parts])


def choose_frames(recording: Recording, count: int) -> np.ndarray:
    """Return up to `count` frame numbers, evenly spread over the time in which the forces change (or over all of it).

    Returns
    -------
    (c,) int, increasing
    """
    peak = peak_force(recording)
    changes = np.zeros(len(recording.frames), dtype=bool)
    for sensor in recording.sensors.values():
        forces = np.concatenate([sensor.normal_force[:, :, None], sensor.shear], axis=2)
        step = np.abs(np.diff(forces, axis=0)).max(axis=(1, 2), initial=0.0) > 1e-3 * peak
        changes[1:] |= step
        changes[:-1] |= step
    indices = np.flatnonzero(changes) if changes.any() else np.arange(len(recording.frames))
    first, span = indices[0], indices[-1] - indices[0] + 1
    count = min(count, span)
    return recording.frames[first + ((np.arange(count) + 0.5) * span / count).astype(int)]
