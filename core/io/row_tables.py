# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows that are added one by one: in memory while they are few, in a temporary file when they become many.

The motion of a scene is kept in such tables while it is read, and the frames of a run while it is computed.
"""

from __future__ import annotations

import mmap
import os
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import DTypeLike

from ..errors import FileError, os_error_reason
from ..model.recording import CLIPPED, SENSOR_FIELDS, VALUES, Frame, Recording
from .recording_npz import sensor_members

IN_MEMORY_BYTES = 1 << 24
"""Bytes of a table that stay in memory: hours of animation of a rigid body."""


class RowTable:
    """A table that grows row by row, so a long scene and its bake need no more memory than a short one.

    The temporary file has no name, and is gone when the table and its arrays are.

    Parameters
    ----------
    kind : dtype
        Of a row; that of an array is ``(float, shape)``.
    what : str
        What the rows are, for messages, as in "The motion of a long scene".
    folder : Path, optional
        Where the temporary file lies. Default: where :func:`tempfile.gettempdir` says.
    """

    def __init__(self, kind: DTypeLike, what: str, folder: Path | None = None):
        self._kind, self._what, self._folder = np.dtype(kind), what, folder
        self._count = 0
        place = None if folder is None else str(folder)
        self._file = tempfile.SpooledTemporaryFile(IN_MEMORY_BYTES, prefix="palpate-", dir=place)  # noqa: SIM115

    def __len__(self) -> int:
        """Return the number of rows."""
        return self._count

    @property
    def is_in_memory(self) -> bool:
        """Return True if the rows so far are in memory."""
        return self._count * self._kind.itemsize <= IN_MEMORY_BYTES

    def append(self, row: np.ndarray | float) -> None:
        """Add one row; raises FileError if the temporary file cannot be written."""
        try:
            self._file.write(np.asarray(row, self._kind.base).tobytes())
        except OSError as error:
            raise self._error(error) from error
        self._count += 1

    def rows(self) -> np.ndarray:
        """Return all rows, (rows, …) of the type; a view of the temporary file, which cannot be changed, if there is one.

        Raises
        ------
        FileError
            As :meth:`append`.
        """
        try:
            self._file.flush()
            if self.is_in_memory:
                self._file.seek(0)
                content = self._file.read()
                self._file.seek(0, os.SEEK_END)
                return np.frombuffer(content, self._kind).copy()
            mapped = mmap.mmap(self._file.fileno(), 0, access=mmap.ACCESS_READ)
        except OSError as error:
            raise self._error(error) from error
        return np.frombuffer(mapped, self._kind)

    def _error(self, error: OSError) -> FileError:
        place = self._folder or tempfile.gettempdir()
        remedy = "choose another folder" if self._folder else "name another folder in the environment variable TMPDIR"
        return FileError(
            f"{self._what} could not be kept in '{place}' ({os_error_reason(error)}): free some space there, or {remedy}."
        )


def motion_table(first: np.ndarray | float) -> RowTable:
    """Return a table for the motion of a scene, with its first row."""
    table = RowTable((float, np.shape(first)), "The motion of a long scene")
    table.append(first)
    return table


class FrameTable:
    """The frames of one run.

    Parameters
    ----------
    bodies : sequence of str
        Names of the bodies.
    folder : Path, optional
        Where a long run keeps its frames, see :class:`.RowTable`.
    """

    def __init__(self, bodies: Sequence[str], folder: Path | None = None):
        self._bodies, self._folder = tuple(bodies), folder
        self._first: Frame | None = None

    def append(self, frame: Frame) -> None:
        """Add one frame.

        Raises
        ------
        FileError
            The temporary file of a long run cannot be written.
        ValueError
            A number is not finite (a fault of the program, not of the user).
        """
        members = {
            "frames": np.array(frame.frame),
            "times": np.array(frame.time),
            "poses": frame.poses,
            "velocities": frame.velocities,
            **sensor_members(frame.sensors.values()),
        }
        if self._first is None:
            kind = np.dtype([(name, array.dtype, array.shape) for name, array in members.items()], align=True)
            self._first = frame
            self._row = np.zeros(1, kind)
            self._table = RowTable(kind, "The frames of a long bake", self._folder)
        for name, array in members.items():
            if not np.isfinite(array).all():
                raise ValueError(f"'{name}' of frame {frame.frame} has values that are not finite")
            self._row[name] = array
        self._table.append(self._row)

    def recording(self, dt: float, digest: str, warnings: Sequence[str], step_reason: str) -> Recording:
        """Return all frames, one at least, with what else a :class:`.Recording` says.

        The arrays of a long one are views of the file.

        Raises
        ------
        FileError
            The temporary file cannot be written or read.
        """
        assert self._first is not None
        rows = self._table.rows()
        members = {name: rows[name].copy() if self._table.is_in_memory else rows[name] for name in rows.dtype.names or ()}
        found = Recording.stack([self._first], self._bodies, dt, digest, warnings, step_reason)
        for i, (name, sensor) in enumerate(found.sensors.items()):
            own = {key: members[f"sensor_{i}/{key}"] for key in SENSOR_FIELDS}
            if sensor.channels is not None:
                values, clipped = members[f"sensor_{i}/{VALUES}"], members[f"sensor_{i}/{CLIPPED}"]
                own["channels"] = replace(sensor.channels, values=values, clipped=clipped)
            found.sensors[name] = replace(sensor, **own)
        return replace(found, **{name: members[name] for name in ("frames", "times", "poses", "velocities")})
