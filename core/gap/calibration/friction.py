# SPDX-License-Identifier: GPL-3.0-or-later
"""Friction of one texel from a force–velocity curve (paper, section 3.3.4, Fig. 7, which asks for such a fit).

In steady sliding the bristles of Eq. 9 are at rest and Eq. 13 becomes ``ft(v) = fn (mud + (mus - mud) exp(-v²/x0²)) + ct v``.
Such a curve identifies `mus`, `mud`, `x0` and `ct`. The stiffness and the damping of the bristles have an influence only where
the velocity changes: a recording with a `time` column that starts from rest identifies `sigma0` and `sigma1` as well.

The fit starts from the curve of steady sliding, whose values other than `x0` are linear, and refines all values by nonlinear
least squares. For a recording over time it starts from several stiffnesses of the bristles.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...errors import FileError, ParameterError
from ...io.text_table import read_columns
from ...laws.contact_law import contact_law
from ...laws.friction import friction_along_path, stribeck_force
from ...model.sensor_parameters import SensorParameters
from ..fitting.intervals import Estimate, linearised_estimates
from .stiffness import MOST_TEXELS

STEADY = ("mus", "mud", "x0", "ct")
DYNAMIC = (*STEADY, "sigma0", "sigma1")
NORMAL_FORCES = (1e-9, 1e9)
"""Least and largest normal force on a texel, N: beyond it the unit is wrong or numbers overflow."""
STIFFNESSES, BEST_STARTS = 16, 2
"""Number of stiffnesses of the bristles that are tried as they are, and of those from which the fit starts."""
DAMPING_SHARE = 0.01
"""Damping of the bristles in seconds, as a multiple of their stiffness, that is tried beside the given one."""


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
        Those given to the fit, with the fitted values.
    estimates : dict of Estimate
        By name: those of `STEADY`, or of `DYNAMIC` for a recording over time. An infinite interval means that the measurements
        do not depend on this value.
    residual : float, N
        Root mean square.
    """

    data: FrictionData
    normal_force: float
    parameters: SensorParameters
    estimates: dict[str, Estimate]
    residual: float

    @property
    def unidentifiable(self) -> list[str]:
        """Names of the values that these measurements do not identify: their interval is wider than twice the value."""
        return [name for name, e in self.estimates.items() if not e.high - e.low < 2 * max(abs(e.value), 1e-12)]


def steady_friction(velocity: np.ndarray, normal_force: float, parameters: SensorParameters) -> np.ndarray:
    """Return the friction of steady sliding (Eq. 9, 10, 13 with bristles at rest), N.

    At velocity zero it is the largest static friction.

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

    Between two samples the velocity is the mean of both, for which Eq. 9 is solved exactly.

    Parameters
    ----------
    time : (m,) float, seconds, increasing
    velocity : (m,) float, m/s
    normal_force : float, N
    parameters : SensorParameters
    """
    force = np.empty(len(time))
    friction_along_path(
        np.ascontiguousarray(time, float), np.ascontiguousarray(velocity, float), normal_force, contact_law(parameters), force
    )
    return force


def read_friction(path: str | os.PathLike, texels: int = 1) -> FrictionData:
    """Read a force–velocity curve: columns `velocity` (m/s) and `force` (N), and `time` (s) where the velocity changes.

    Parameters
    ----------
    path : path
        See :mod:`...io.text_table` for other units.
    texels : int
        Number of texels that shared the force; the curve of one texel is returned.

    Raises
    ------
    FileError
        A column is missing, there are too few lines, or the time does not increase.
    ParameterError
        The number of texels is not above zero.
    """
    return friction_data(read_columns(path, {"velocity": "m/s", "force": "N", "time": "s"}), texels, os.fspath(path))


def friction_data(columns: Mapping[str, np.ndarray], texels: int, source: str) -> FrictionData:
    """Return a curve from its columns, as :func:`read_friction` does; `source` is where they come from, for messages."""
    if not 1 <= texels <= MOST_TEXELS:
        raise ParameterError(f"The number of texels is {texels}: give at least one and at most {MOST_TEXELS:g}.")
    for name in ("velocity", "force"):
        if name not in columns:
            raise FileError(
                f"'{source}' has no column '{name}': write that word above its numbers, the unit in brackets if it is not SI."
            )
    if len(columns["force"]) < len(STEADY) + 1:
        raise FileError(f"'{source}' has {len(columns['force'])} lines: friction needs {len(STEADY) + 1} or more.")
    time = columns.get("time")
    if time is not None and not np.all(np.diff(time) > 0):
        line = int(np.argmin(np.diff(time) > 0)) + 2
        raise FileError(f"The time of '{source}' does not increase at measurement {line}: sort the lines and remove doubles.")
    return FrictionData(columns["velocity"], columns["force"] / texels, time)


def fit_friction(data: FrictionData, normal_force: float, parameters: SensorParameters | None = None) -> FrictionFit:
    """Fit Eq. 13 to a force–velocity curve, or to a recording over time.

    Parameters
    ----------
    data : FrictionData
    normal_force : float, N
        On one texel.
    parameters : SensorParameters, optional
        Values that are not fitted, and start values of `sigma0` and `sigma1`.

    Raises
    ------
    ParameterError
        The normal force is not above zero, or all velocities are equal.
    """
    if not NORMAL_FORCES[0] <= normal_force <= NORMAL_FORCES[1]:
        raise ParameterError(
            f"The normal force is {normal_force:g} N: give a value above zero, "
            f"from {NORMAL_FORCES[0]:g} to {NORMAL_FORCES[1]:g} N."
        )
    if np.ptp(np.abs(data.velocity)) == 0:
        raise ParameterError("A friction curve needs measurements at different velocities: add some.")
    start = parameters or SensorParameters()
    steady = _steady_start(data, normal_force)
    starts = [steady] if data.time is None else _dynamic_starts(data, normal_force, start, steady)
    return min((_refine(data, normal_force, start, values) for values in starts), key=lambda one: one.residual)


def _dynamic_starts(
    data: FrictionData, normal_force: float, base: SensorParameters, steady: dict[str, Any]
) -> list[dict[str, Any]]:
    """Start values with several stiffnesses of the bristles: the given one, and those that fit best among many as they are.

    The misfit has a local minimum where bristles are so soft that they never slip, and another where they are so stiff that
    they slip at once. A stiffness shows if bristles reach the level of friction within the travel, but not within one sample.
    """
    assert data.time is not None
    given = steady | {"sigma0": base.sigma0, "sigma1": base.sigma1}
    step = np.abs(data.velocity[1:]) * np.diff(data.time)
    if not step.any():
        return [given]
    level = max(steady["mus"], 1e-6) * normal_force
    softest, stiffest = level / float(step.sum()), level / float(step[step > 0].min())
    stiffnesses = np.geomspace(softest, max(stiffest, 10.0 * softest), STIFFNESSES).tolist()
    tried = [steady | {"sigma0": a, "sigma1": b} for a in stiffnesses for b in (base.sigma1, DAMPING_SHARE * a)]
    tried.sort(key=lambda values: float((_residual(data, normal_force, replace(base, **values)) ** 2).sum()))
    return [given, *tried[:BEST_STARTS]]


def _residual(data: FrictionData, normal_force: float, parameters: SensorParameters) -> np.ndarray:
    """Friction less the measured one, N."""
    if data.time is None:
        return steady_friction(data.velocity, normal_force, parameters) - data.force
    return friction_over_time(data.time, data.velocity, normal_force, parameters) - data.force


def _steady_start(data: FrictionData, normal_force: float) -> dict[str, Any]:
    """Return start values from the curve of steady sliding: given `x0`, the others follow by non-negative least squares."""
    from scipy.optimize import nnls

    speed = np.abs(data.velocity)
    along = np.where(data.velocity < 0, -1.0, 1.0) * data.force
    fits = []
    for x0 in np.geomspace(speed[speed > 0].min() / 3, speed.max() * 3, 200):
        columns = np.stack([np.full_like(speed, normal_force), normal_force * np.exp(-((speed / x0) ** 2)), speed], axis=1)
        fits.append((float(x0), *nnls(columns, along)))
    x0, (mud, rise, ct), _ = min(fits, key=lambda fit: fit[2])
    return {"mus": mud + rise, "mud": mud, "x0": x0, "ct": ct}


def _refine(data: FrictionData, normal_force: float, base: SensorParameters, start: dict[str, Any]) -> FrictionFit:
    """Return the fit by nonlinear least squares from start values."""
    from scipy.optimize import least_squares

    names = STEADY if data.time is None else DYNAMIC
    weight, speed = normal_force, max(float(np.abs(data.velocity).max()), 1e-12)
    units = {"mus": 1.0, "mud": 1.0, "x0": speed, "ct": weight / speed, "sigma0": base.sigma0, "sigma1": max(base.sigma1, 1e-6)}
    low = np.array([0.0, 0.0, 1e-3, 0.0, 1e-4, 0.0][: len(names)])
    # The variables are the values in units of order one; in the place of mus its excess over mud, which is not negative.
    to_values = np.diag([units[name] for name in names])
    to_values[0, 1] = 1.0
    first = np.linalg.solve(to_values, [start[name] for name in names])

    def with_values(values: np.ndarray) -> SensorParameters:
        changes: dict[str, Any] = dict(zip(names, values.tolist(), strict=True))
        return replace(base, **changes)

    found = least_squares(
        lambda variables: _residual(data, normal_force, with_values(to_values @ variables)) / weight,
        np.maximum(first, low + 1e-9),
        bounds=(low, np.inf),
        x_scale="jac",
        **dict.fromkeys(("xtol", "ftol", "gtol"), 1e-14),
    )
    values = to_values @ found.x
    residual = _residual(data, normal_force, with_values(values))
    estimates = dict(zip(names, linearised_estimates(values, found.jac, to_values, residual, weight), strict=True))
    return FrictionFit(data, normal_force, with_values(values), estimates, float(np.sqrt(np.mean(residual**2))))
