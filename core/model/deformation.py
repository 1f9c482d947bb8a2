# SPDX-License-Identifier: GPL-3.0-or-later
"""A surface that changes its shape over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import SceneError
from .recording import row_blocks


@dataclass(frozen=True)
class Deformation:
    """The shape of a surface over time, in the frame of its body.

    The shape is interpolated linearly between samples, and constant before the first and after the last.

    Attributes
    ----------
    times : (m,) float, seconds, increasing
    values : (m, n, c) float
        For a target the position of each vertex of its mesh, metres; for a sensor the position (m), normal and tangent of each
        texel.
    """

    times: np.ndarray
    values: np.ndarray

    def extended(self, time: float, values: np.ndarray) -> Deformation:
        """Return the deformation from the last sample to a new one.

        Earlier samples are left out, because the timeline only goes forward.
        """
        return Deformation(np.append(self.times[-1:], time), np.concatenate([self.values[-1:], values[None]]))

    def check(self, name: str, shape: tuple[int, ...]) -> None:
        """Raise :class:`SceneError` when the samples do not fit a surface of `shape` or are not finite."""
        if self.values.shape != (len(self.times), *shape):
            raise SceneError(
                f"'{name}' deforms with {self.values.shape[1]} vertices and has {shape[0]}: "
                "use modifiers that keep the number of vertices."
            )
        if not all(np.isfinite(self.values[rows]).all() for rows in row_blocks(self.values)):
            time = self.times[np.flatnonzero(~np.isfinite(self.values).all(axis=(1, 2)))[0]]
            raise SceneError(
                f"A vertex of '{name}' is NaN or infinite {time:g} s after the first frame: check what deforms it."
            )
