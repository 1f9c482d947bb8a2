# SPDX-License-Identifier: GPL-3.0-or-later
"""Friction of one texel from a force–velocity curve (paper, section 3.3.4, Fig. 7; the fit that it calls for and leaves out).

Sliding steadily, the bristles of Eq. 9 stand still and Eq. 13 becomes ``ft(v) = fn (mud + (mus - mud) exp(-v²/x0²)) + ct v``:
such a curve tells `mus`, `mud`, `x0` and `ct`. The bristles' stiffness and damping show only where the velocity changes; a
recording with a `time` column, started from rest, tells `sigma0` and `sigma1` as well.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...errors import FileError, ParameterError
from ...io.csv_table import read_columns
from ...laws.contact import friction_along_path, parameter_row, stribeck_force
from ...model.sensor_parameters import SensorParameters
from ..fitting.regression import Estimate, intervals

STEADY = ("mus", "mud", "x0", "ct")
DYNAMIC = (*STEADY, "sigma0", "sigma1")


@dataclass(frozen=True)
class FrictionData:
    """Friction of one texel while something slides over it.

    Attributes
    ----------
    velocity : (m,) float, m/s
    force : (m,) float, N
        Friction on the texel, along the velocity.
    time : (m,) float, seconds, or None
        Increasing; the surfaces are at rest before the first sample. None: every sample is steady sliding.
    """

    velocity: np.ndarray
    force: np.ndarray
    time: np.ndarray | None = None


@dataclass(frozen=True)
class FrictionFit:
    """Fitted friction.

    Attributes
    ----------
    data : FrictionData
    normal_force : float, N
        Per texel.
    parameters : SensorParameters
        Those given to the fit with the fitted values put in.
    estimates : dict of Estimate
        By name: those of `STEADY`, or of `DYNAMIC` for a recording over time. An infinite interval says that the measurements
        do not tell this value.
    residual : float, N
        Root mean square.
    """

    data: FrictionData
    normal_force: float
    parameters: SensorParameters
    estimates: dict[str, Estimate]
    residual: float

    @property
    def untold(self) -> list[str]:
        """Names of the values that these measurements cannot tell: their interval is wider than twice the value."""
        return [name for name, e in self.estimates.items() if not e.high - e.low < 2 * max(abs(e.value), 1e-12)]


def steady_friction(velocity: np.ndarray, normal_force: float, parameters: SensorParameters) -> np.ndarray:
    """Return the friction of steady sliding (Eq. 9, 10, 13 with resting bristles), N; at rest what it takes to begin.

    Parameters
    ----------
    velocity : (m,) float, m/s
    normal_force : float, N
    parameters : SensorParameters
    """
    v = np.asarray(velocity, float)
    return np.where(v < 0, -1.0, 1.0) * stribeck_force(np.full(v.shape, normal_force), v, parameters) + parameters.ct * v


def friction_over_time(time: np.ndarray, velocity: np.ndarray, normal_force: float, parameters: SensorParameters) -> np.ndarray:
    """Return the friction of Eq. 9 and 13 along a velocity, from rest, N.

    Between samples the velocity is the mean of its ends, for which Eq. 9 is solved exactly.

    Parameters
    ----------
    time : (m,) float, seconds, increasing
    velocity : (m,) float, m/s
    normal_force : float, N
    parameters : SensorParameters
    """
    force = np.empty(len(time))
    friction_along_path(
        np.ascontiguousarray(time, float), np.ascontiguousarray(velocity, float), normal_force, parameter_row(parameters), force
    )
    return force


def read_friction(path: str | os.PathLike, texels: int = 1) -> FrictionData:
    """Read a force–velocity curve: columns `velocity` (m/s) and `force` (N), and `time` (s) where the velocity changes.

    Parameters
    ----------
    path : path
        See :mod:`.csv_table` for other units.
    texels : int
        How many texels shared the force; the curve returned is that of one.

    Raises
    ------
    FileError
        A column is missing, there are too few lines, or the time does not increase.
    """
    columns = read_columns(path, {"velocity": "m/s", "force": "N", "time": "s"})
    for name in ("velocity", "force"):
        if name not in columns:
            raise FileError(
                f"'{path}' has no column '{name}': write that word above its numbers, the unit in brackets if it is not SI."
            )
    if len(columns["force"]) < len(STEADY) + 1:
        raise FileError(f"'{path}' has {len(columns['force'])} lines: friction needs {len(STEADY) + 1} or more.")
    time = columns.get("time")
    if time is not None and not np.all(np.diff(time) > 0):
        line = int(np.argmin(np.diff(time) > 0)) + 2
        raise FileError(f"The time of '{path}' does not increase at measurement {line}: sort the lines and remove doubles.")
    return FrictionData(columns["velocity"], columns["force"] / texels, time)


def fit_friction(data: FrictionData, normal_force: float, parameters: SensorParameters | None = None) -> FrictionFit:
    """Fit Eq. 13 to a force–velocity curve, or to a recording over time.

    Parameters
    ----------
    data : FrictionData
    normal_force : float, N
        On one texel.
    parameters : SensorParameters, optional
        What is not fitted, and where the fit of `sigma0` and `sigma1` starts.

    Raises
    ------
    ParameterError
        The normal force is not above zero, or everything was measured at one velocity.
    """
    if not (np.isfinite(normal_force) and normal_force > 0):
        raise ParameterError(f"The normal force is {normal_force:g} N: give a value above zero.")
    if np.ptp(np.abs(data.velocity)) == 0:
        raise ParameterError("A friction curve needs measurements at different velocities: add some.")
    start = parameters or SensorParameters()
    steady = _steady_start(data, normal_force)
    names = STEADY if data.time is None else DYNAMIC
    if data.time is not None:
        steady |= {"sigma0": start.sigma0, "sigma1": start.sigma1}
    return _refine(data, normal_force, start, names, steady)


def _steady_start(data: FrictionData, normal_force: float) -> dict[str, float]:
    """Values for the curve of steady sliding: for each `x0` the other three are linear, and none is below zero."""
    from scipy.optimize import nnls

    speed = np.abs(data.velocity)
    along = np.where(data.velocity < 0, -1.0, 1.0) * data.force
    best: tuple[float, float, np.ndarray] | None = None
    for x0 in np.geomspace(speed[speed > 0].min() / 3, speed.max() * 3, 200):
        columns = np.stack([np.full_like(speed, normal_force), normal_force * np.exp(-((speed / x0) ** 2)), speed], axis=1)
        values, misfit = nnls(columns, along)
        if best is None or misfit < best[0]:
            best = misfit, float(x0), values
    assert best is not None
    _, x0, (mud, more, ct) = best
    return {"mus": mud + more, "mud": mud, "x0": x0, "ct": ct}


def _with(base: SensorParameters, values: dict[str, float]) -> SensorParameters:
    changes: dict[str, Any] = dict(values)
    return replace(base, **changes)


def _refine(
    data: FrictionData, normal_force: float, base: SensorParameters, names: tuple[str, ...], start: dict[str, float]
) -> FrictionFit:
    """Nonlinear least squares from `start`, in values of order one; mus is searched as mud plus what it is above it."""
    from scipy.optimize import least_squares

    weight = max(normal_force, 1e-12)
    speed = max(float(np.abs(data.velocity).max()), 1e-12)
    scale = {"mus": 1.0, "mud": 1.0, "x0": speed, "ct": weight / speed, "sigma0": base.sigma0, "sigma1": max(base.sigma1, 1e-6)}
    scales = np.array([scale[name] for name in names])

    def values_of(q: np.ndarray) -> np.ndarray:
        values = q * scales
        values[0] += values[1]
        return values

    def predicted(values: np.ndarray) -> np.ndarray:
        law = _with(base, dict(zip(names, map(float, values), strict=True)))
        if data.time is None:
            return steady_friction(data.velocity, normal_force, law)
        return friction_over_time(data.time, data.velocity, normal_force, law)

    first = np.array([start[name] for name in names])
    first[0] -= first[1]
    low = np.array([0.0, 0.0, 1e-3, 0.0, 1e-4, 0.0][: len(names)])
    found = least_squares(
        lambda q: (predicted(values_of(q)) - data.force) / weight,
        np.clip(first / scales, low + 1e-9, None),
        bounds=(low, np.inf),
        x_scale="jac",
        xtol=1e-14,
        ftol=1e-14,
        gtol=1e-14,
    )
    values = values_of(found.x)
    freedom = len(data.force) - len(names)
    residual = predicted(values) - data.force
    # From the searched values to the named ones: mus = (mus - mud) + mud.
    change = np.diag(scales)
    change[0, 1] = scales[1]
    covariance = np.linalg.pinv(found.jac.T @ found.jac, rcond=1e-14) * (residual @ residual) / weight**2 / max(freedom, 1)
    spread = np.sqrt(np.clip(np.diag(change @ covariance @ change.T), 0.0, None))
    flat = np.linalg.norm(found.jac, axis=0) < 1e-9 * np.linalg.norm(found.jac)  # a value that nothing depends on
    spread[flat] = np.inf
    estimates = dict(zip(names, intervals(values, spread, freedom), strict=True))
    return FrictionFit(
        data,
        normal_force,
        _with(base, {name: estimate.value for name, estimate in estimates.items()}),
        estimates,
        float(np.sqrt(np.mean(residual**2))),
    )
