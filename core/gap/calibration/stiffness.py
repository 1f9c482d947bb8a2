# SPDX-License-Identifier: GPL-3.0-or-later
"""Stiffness of one texel from the compression of its foam (paper, Eq. 18 and Fig. 6)."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np

from ...errors import FileError, ParameterError
from ...io.text_table import read_columns
from ..dataset.column_names import GRAVITY
from ..fitting.intervals import Estimate, linear_estimates

AREAS = (1e-12, 1e6)
"""Least and largest area of a sensor or of a weight, m²: beyond it the unit is wrong or numbers overflow."""
STIFFENS = 0.05
"""Bend from which on a curve stiffens: smaller ones are within what a straight line is used for."""
LEAST_PRESSURE, DEAD_ZONE = 0.02, 0.02
"""Share of the largest pressure from which on the foam is in contact; share of the largest compression from which on a curve
begins late."""
MOST_TEXELS = 10**9
"""Most texels that may share an area or a force."""


@dataclass(frozen=True)
class FoamData:
    """A foam under load.

    Attributes
    ----------
    compression : (m,) float, metres
    pressure : (m,) float, Pa
    """

    compression: np.ndarray
    pressure: np.ndarray


@dataclass(frozen=True)
class StiffnessFit:
    """Two straight lines through foam measurements, and the stiffness of a texel that follows from each.

    Attributes
    ----------
    data : FoamData
    k : Estimate, N/m
        From the line through zero. The model needs this one, since its texels have no force at depth zero.
    k_offset : Estimate, N/m
        From the line with an offset.
    slope, slope_offset : float, Pa/m
    offset : Estimate, Pa
        Pressure of the second line at compression zero. If it is negative, the foam has a dead zone.
    dead_zone : float, metres
        Compression up to which the pressure is zero, by a parabola through the lower half of the curve; zero if there is none.
    bend : float
        Share that a square adds to the line at the largest compression; zero if its interval contains zero.
    is_turned : bool
        True if compressions and loads were negative, as testing machines write them, and were turned.
    """

    data: FoamData
    k: Estimate
    k_offset: Estimate
    slope: float
    slope_offset: float
    offset: Estimate
    dead_zone: float
    bend: float
    is_turned: bool

    @property
    def stiffens(self) -> bool:
        """True if the curve bends upwards: a straight line does not describe it, and the effect stiffening does."""
        return self.bend > STIFFENS


def texel_stiffness(pressure: float, area: float, texels: int, compression: float) -> float:
    """Return ``k = p A / (n x)``, N/m (Eq. 18).

    The paper prints 58.5 N/m for 9810 Pa, 0.00125 m², 84 texels and 2.5 mm; its inputs give 58.39.

    Parameters
    ----------
    pressure : float, Pa
    area : float, m²
        Of the whole sensor.
    texels : int
    compression : float, metres
    """
    if not AREAS[0] <= area <= AREAS[1]:
        raise ParameterError(f"The sensor's area is {area:g} m²: give a finite value above zero, in m².")
    if not 1 <= texels <= MOST_TEXELS:
        raise ParameterError(f"The number of texels is {texels}: give at least one and at most {MOST_TEXELS:g}.")
    if not (np.isfinite(compression) and compression > 0):
        raise ParameterError(f"The compression is {compression:g} m: give a finite value above zero.")
    if not np.isfinite(pressure):
        raise ParameterError(f"The pressure is {pressure:g} Pa: give a finite value.")
    return pressure * area / (texels * compression)


def read_foam(path: str | os.PathLike, weight_area: float | None = None) -> FoamData:
    """Read foam measurements: columns `compression` (m) and one of `pressure` (Pa), `force` (N) or `mass` (kg).

    Parameters
    ----------
    path : path
        See :mod:`...io.text_table` for other units.
    weight_area : float or None, m²
        Area on which the force or the mass rested.

    Raises
    ------
    FileError
        A column is missing, or `weight_area`, which forces and masses need, is not given.
    """
    columns = read_columns(path, {"compression": "m", "pressure": "Pa", "force": "N", "mass": "kg"})
    if "compression" not in columns:
        raise FileError(
            f"'{path}' has no column 'compression': write that word above its numbers, the unit in brackets if it is not m."
        )
    loads = [name for name in ("pressure", "force", "mass") if name in columns]
    if len(loads) != 1:
        raise FileError(f"'{path}' needs exactly one of the columns 'pressure', 'force' and 'mass'; it has {len(loads)}.")
    load = columns[loads[0]]
    if loads[0] != "pressure":
        if weight_area is None or not AREAS[0] <= weight_area <= AREAS[1]:
            raise FileError(
                f"'{path}' has a column '{loads[0]}': say on which area it rested (--weight-area), in m², finite and above 0."
            )
        load = load * (GRAVITY if loads[0] == "mass" else 1.0) / weight_area
    return FoamData(columns["compression"], load)


def fit_stiffness(data: FoamData, area: float, texels: int) -> StiffnessFit:
    """Fit both lines of Fig. 6 by least squares of the pressure.

    Parameters
    ----------
    data : FoamData
    area : float, m²
        Of the whole sensor.
    texels : int

    Raises
    ------
    ParameterError
        Area or number of texels is not above zero, there are not enough different compressions, or the pressure does not rise
        with the compression.
    """
    per_texel = texel_stiffness(1.0, area, texels, 1.0)
    x, p = np.asarray(data.compression, float), np.asarray(data.pressure, float)
    is_turned = bool(np.median(x) < 0.0 and np.median(p) <= 0.0)
    if is_turned:
        x, p = -x, -p
        data = FoamData(x, p)
    if len(np.unique(x)) < 2 or not np.any(x > 0):
        raise ParameterError("A stiffness needs measurements at two different compressions or more: add some.")
    (slope,) = linear_estimates(x[:, None], p)
    slope_offset, offset = linear_estimates(np.stack([x, np.ones_like(x)], axis=1), p)
    if slope.value <= 0 or slope_offset.value <= 0:
        raise ParameterError("The foam's pressure does not rise with its compression: check the columns and their signs.")
    lines = slope.scaled(per_texel), slope_offset.scaled(per_texel), slope.value, slope_offset.value, offset
    return StiffnessFit(data, *lines, *_beginning_and_bend(x, p), is_turned)


def _beginning_and_bend(x: np.ndarray, p: np.ndarray) -> tuple[float, float]:
    """Return the compression at which the pressure begins, zero if it is zero from the start, and the bend of the curve."""
    order = np.argsort(x)
    order = order[p[order] > LEAST_PRESSURE * p.max()]
    x, p = x[order], p[order]
    half = len(x) // 2
    if half < 4 or not np.ptp(x[:half]) > 0.0:
        return 0.0, 0.0
    # The root of the parabola through the lower half that is nearest below its second point.
    roots = np.roots(np.polyfit(x[:half], p[:half], 2))
    start = max((float(root.real) for root in roots if abs(root.imag) < 1e-12 and root.real <= x[1]), default=0.0)
    start = start if start > DEAD_ZONE * x.max() else 0.0
    steep, curved = linear_estimates(np.stack([x - start, (x - start) ** 2], axis=1), p)
    share = curved.value * (x.max() - start) / max(steep.value, 1e-300)
    return start, float(share) if curved.low > 0.0 or curved.high < 0.0 else 0.0
