# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths of bodies: poses at times, or one pose for each frame."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..core.io.csv_table import read_table
from ..core.model.body import Motion
from .arguments import ArgumentError, numbers, quaternion

POSITION, TURN = ("x", "y", "z"), ("qw", "qx", "qy", "qz")
LEVEL = (1.0, 0.0, 0.0, 0.0)

PathLike = ArrayLike | tuple[ArrayLike, ArrayLike] | str | os.PathLike[str]
"""Poses (m, 3) or (m, 7), one for each frame; times (m,) and poses; or a CSV file with time, x, y, z and qw, qx, qy, qz."""


@dataclass(frozen=True, eq=False)
class Path:
    """Poses of a body in the world.

    Attributes
    ----------
    times : (m,) float, seconds, or None
        None: one pose for each frame.
    positions : (m, 3) float, metres
    quaternions : (m, 4) float, (w, x, y, z)
    """

    times: np.ndarray | None
    positions: np.ndarray
    quaternions: np.ndarray

    def motion(self, fps: float) -> Motion:
        """Return the path as a motion of core."""
        times = np.arange(len(self.positions)) / fps if self.times is None else self.times - self.times[0]
        return Motion(times, self.positions, self.quaternions)

    def duration(self, fps: float) -> float:
        """Return the duration of the path, seconds; 0 for a body at rest."""
        return float(self.motion(fps).times[-1])


def standing(position: ArrayLike, turn: ArrayLike) -> Path:
    """Return the path of a body at rest."""
    return Path(None, numbers(position, (3,), "position")[None], quaternion(turn, "quaternion")[None])


def path_of(value: Any, argument: str, turn: ArrayLike = LEVEL) -> Path:
    """Return a path from a user's argument.

    Parameters
    ----------
    value : PathLike
    argument : str
        Its name, for messages.
    turn : (4,) float
        Orientation where `value` has positions only.
    """
    if isinstance(value, Path):
        return value
    if isinstance(value, str | os.PathLike):
        return _path_in_file(value, argument, turn)
    times = None
    if isinstance(value, tuple) and len(value) == 2 and np.ndim(value[1]) == 2:
        times, value = numbers(value[0], (-1,), f"the times of {argument}"), value[1]
    shape = _shape(value)
    columns = shape[1] if len(shape) == 2 else 0
    if shape and columns not in (3, 7):
        raise ArgumentError(f"{argument} has the shape {shape}: give m × 3 positions, or m × 7 with the quaternions.")
    poses = numbers(value, (-1, 7 if columns == 7 else 3), argument)
    if not len(poses):
        raise ArgumentError(f"{argument} has no pose: give one at least.")
    if times is not None and (len(times) != len(poses) or not (np.diff(times) > 0).all()):
        raise ArgumentError(
            f"{argument} has {len(poses)} poses and {len(times)} times: give each pose a time, in increasing order."
        )
    if columns != 7:
        return Path(times, poses, np.tile(quaternion(turn, "quaternion"), (len(poses), 1)))
    return Path(times, poses[:, :3], _unit(poses[:, 3:], argument))


def _shape(value: Any) -> tuple[int, ...]:
    """Return the shape of an array or of nested lists; that of a number where they are ragged or no numbers."""
    try:
        return np.shape(value)
    except ValueError:
        return ()


def _unit(turns: np.ndarray, argument: str) -> np.ndarray:
    """Return (m, 4) unit quaternions."""
    length = np.linalg.norm(turns, axis=1, keepdims=True)
    if not length.all():
        raise ArgumentError(f"{argument} has a quaternion of zeros at row {int(np.argmin(length))}: give (w, x, y, z).")
    return turns / length


def _path_in_file(file: str | os.PathLike[str], argument: str, turn: ArrayLike) -> Path:
    table = read_table(file)
    columns = dict(zip(table.names, table.values.T, strict=True))
    for name in ("time", *POSITION):
        if name not in columns:
            raise ArgumentError(f"{argument} is '{file}', which has no column '{name}': it needs time, x, y and z, in s and m.")
    names = [*POSITION, *(name for name in TURN if name in columns)]
    if len(names) not in (3, 7):
        raise ArgumentError(f"{argument} is '{file}', which has only some of the columns {', '.join(TURN)}: give all or none.")
    return path_of((columns["time"], np.stack([columns[name] for name in names], axis=1)), argument, turn)
