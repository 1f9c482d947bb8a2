# SPDX-License-Identifier: GPL-3.0-or-later
"""Channels that are linear in what happens at several texels: a net force, barometers under rubber, multiplexed electrodes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import ParameterError

LEAST_SINGULAR = 1e-9
"""Share of the largest singular value up to which a direction of loads was not recorded."""


@dataclass(frozen=True)
class ReadoutMatrix:
    """A linear map from loads of texels to channels.

    Attributes
    ----------
    matrix : (c, n·q) ndarray or scipy.sparse matrix, or None
        Channel per load, the q loads of a texel side by side. None: each load is a channel, and nothing is computed.
    offset : (c,) float or float
    """

    matrix: Any = None
    offset: np.ndarray | float = 0.0

    def channels(self, loads: np.ndarray) -> np.ndarray:
        """Return the channels, (T, c) float.

        Parameters
        ----------
        loads : (T, n) or (T, n, q) float
            Forces, or displacements, of the texels.

        Raises
        ------
        ParameterError
            The matrix has another number of columns.
        """
        flat = loads.reshape(len(loads), -1)
        if self.matrix is None:
            return flat if np.isscalar(self.offset) and self.offset == 0.0 else flat + self.offset
        if self.matrix.shape[1] != flat.shape[1]:
            raise ParameterError(
                f"The read-out has {self.matrix.shape[1]} columns and the texels have {flat.shape[1]} loads: make them agree."
            )
        found: np.ndarray = np.asarray((self.matrix @ flat.T).T) + self.offset
        return found


@dataclass(frozen=True)
class FittedReadout:
    """A read-out that was fitted.

    Attributes
    ----------
    readout : ReadoutMatrix
    standard_error : (c, n·q) float
        Infinite where the recordings do not determine a coefficient.
    determined : (n·q,) bool
        Loads whose coefficients the recordings determine.
    residual : (c,) float
        Standard deviation of what is left of each channel.
    """

    readout: ReadoutMatrix
    standard_error: np.ndarray
    determined: np.ndarray
    residual: np.ndarray


def net_force_readout(normal: np.ndarray) -> ReadoutMatrix:
    """Return the read-out of a pad on a load cell: three channels, the sum of the texels' normal forces along their normals.

    Parameters
    ----------
    normal : (n, 3) float
        Unit vectors out of the sensor; a pressed texel is pushed against its own.
    """
    return ReadoutMatrix(-np.asarray(normal, float).T)


def fit_readout_matrix(loads: np.ndarray, readings: np.ndarray) -> FittedReadout:
    """Fit a read-out by least squares; of what the recordings do not determine, the smallest coefficients are taken.

    Parameters
    ----------
    loads : (T, n) or (T, n, q) float
    readings : (T, c) float
        Samples with a missing channel are left out.

    Raises
    ------
    ParameterError
        The lengths differ, or there are fewer samples than loads recorded at once.
    """
    flat = np.asarray(loads, float).reshape(len(loads), -1)
    readings = np.asarray(readings, float)
    if readings.ndim != 2 or len(readings) != len(flat):
        raise ParameterError(
            f"{len(flat)} samples of loads and readings of the shape {readings.shape} do not fit: give (T, c)."
        )
    known = np.isfinite(readings).all(axis=1) & np.isfinite(flat).all(axis=1)
    flat, readings = flat[known], readings[known]
    if len(flat) < 3:
        raise ParameterError(f"{len(flat)} samples have all loads and readings: a read-out needs at least 3.")
    mean, level = flat.mean(axis=0), readings.mean(axis=0)
    left, size, right = np.linalg.svd(flat - mean, full_matrices=False)
    kept = size > LEAST_SINGULAR * max(float(size[0]), 1e-300)
    left, size, right = left[:, kept], size[kept], right[kept]
    freedom = len(flat) - int(kept.sum()) - 1
    if freedom < 1:
        raise ParameterError(f"{len(flat)} samples do not determine {int(kept.sum())} coefficients of a channel: record more.")
    matrix = (right.T @ ((left.T @ (readings - level)) / size[:, None])).T
    rest = readings - level - (flat - mean) @ matrix.T
    residual = np.sqrt(np.sum(rest**2, axis=0) / freedom)
    projected = np.sum(right**2, axis=0)  # 1 for a load that the recordings tell from all others
    determined = projected > 1.0 - 1e-6
    spread = np.sqrt(np.sum((right / size[:, None]) ** 2, axis=0))
    error = np.where(determined, residual[:, None] * spread, np.inf)
    return FittedReadout(ReadoutMatrix(matrix, level - matrix @ mean), error, determined, residual)
