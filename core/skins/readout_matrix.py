# SPDX-License-Identifier: GPL-3.0-or-later
"""Channels that are linear in what happens at several texels: a net force, barometers under rubber, multiplexed electrodes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import ParameterError


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
