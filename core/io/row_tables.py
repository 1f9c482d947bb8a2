# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows that are added one by one: in memory while they are few, in a temporary file when they become many.

The motion of a scene is kept in such tables while it is read, and the frames of a run while it is computed.
"""

from __future__ import annotations

import mmap
import os
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from ..errors import FileError, os_error_reason
from ..model.recording import CLIPPED, SENSOR_FIELDS, VALUES, Frame, Recording, SensorRecording, VectorReadings
from ..model.scenario import Scenario

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
        place, remedy = self._folder, "choose another folder"
        if place is None:
            place, remedy = Path(tempfile.gettempdir()), "name another folder in the environment variable TMPDIR"
        return FileError(
            f"{self._what} could not be kept in '{place}' ({os_error_reason(error)}): free some space there, or {remedy}."
        )


def motion_table(first: np.ndarray | float) -> RowTable:
    """Return a table for the motion of a scene, with its first row."""
    table = RowTable((float, np.shape(first)), "The motion of a long scene")
    table.append(first)
    return table


_VECTORS = ("net_force", "net_torque", "centre_of_pressure")


def row_type(bodies: int, texels: Mapping[str, int], channels: Mapping[str, VectorReadings]) -> np.dtype:
    """Return the type of a row: the arrays of one frame under the names that they have in ``recording.npz``.

    Parameters
    ----------
    bodies : int
    texels : mapping of str to int
        Number of texels by sensor name.
    channels : mapping of str to VectorReadings
        Of sensors that have such readings: some, for their size.
    """
    parts: list[tuple[Any, ...]] = [
        ("frames", "<i8"),
        ("times", "<f8"),
        ("poses", "<f8", (bodies, 7)),
        ("velocities", "<f8", (bodies, 6)),
    ]
    for i, (sensor, count) in enumerate(texels.items()):
        for name in SENSOR_FIELDS:
            shape = (3,) if name in _VECTORS else (count, 2) if name == "shear" else (count,)
            parts.append((f"sensor_{i}/{name}", "?" if name == "contact" else "<f8", shape))
        if sensor in channels:
            own = channels[sensor].values.shape[-2:]
            parts += [(f"sensor_{i}/{VALUES}", "<f8", own), (f"sensor_{i}/{CLIPPED}", "?", own)]
    return np.dtype(parts, align=True)


class FrameTable:
    """The frames of one run.

    Parameters
    ----------
    bodies : sequence of str
        Names of the bodies.
    texels : mapping of str to int
        Number of texels of each sensor that is read out, by its name.
    channels : mapping of str to VectorReadings
        As those of the frames, of sensors that have such readings.
    folder : Path, optional
        Where a long run keeps its frames, see :class:`.RowTable`.
    """

    def __init__(
        self,
        bodies: Sequence[str],
        texels: Mapping[str, int],
        channels: Mapping[str, VectorReadings] = MappingProxyType({}),
        folder: Path | None = None,
    ):
        self._bodies, self._sensors, self._channels = tuple(bodies), tuple(texels), channels
        self._units: dict[str, str] = {}
        kind = row_type(len(bodies), texels, channels)
        self._row = np.zeros(1, kind)
        self._parts = {name: self._row[name] for name in kind.names or ()}
        # All of a row but the number of the frame. As floats, the bytes of truth values and of gaps are finite.
        self._numbers = self._row.view(np.float64)[1:]
        self._table = RowTable(kind, "The frames of a long bake", folder)

    @classmethod
    def of(cls, scenario: Scenario, folder: Path | None = None) -> FrameTable:
        """Return a table for the frames of a scenario."""
        sensors = [sensor for sensor in scenario.sensors if sensor.readout]
        channels = {sensor.name: sensor.channels.no_frames() for sensor in sensors if sensor.channels is not None}
        texels = {sensor.name: len(sensor.texels) for sensor in sensors}
        return cls([body.name for body in scenario.bodies], texels, channels, folder)

    def append(self, frame: Frame) -> None:
        """Add one frame.

        Raises
        ------
        FileError
            The temporary file of a long run cannot be written.
        ValueError
            A number is not finite (a fault of the program, not of the user).
        """
        values = self._values(frame)
        for name, own in values.items():
            self._parts[name][0] = own
        if not np.isfinite(self._numbers).all():
            name = next((name for name, own in values.items() if not np.isfinite(own).all()), "frames")
            raise ValueError(f"'{name}' of frame {frame.frame} has values that are not finite")
        self._table.append(self._row)

    def recording(self, dt: float, digest: str, warnings: Sequence[str], step_reason: str) -> Recording:
        """Return all frames, with what else a :class:`.Recording` says; the arrays of a long one are views of the file.

        Raises
        ------
        FileError
            The temporary file cannot be written or read.
        """
        rows = self._table.rows()

        def part(name: str) -> np.ndarray:
            return rows[name].copy() if self._table.is_in_memory else rows[name]

        sensors = {}
        for i, name in enumerate(self._sensors):
            channels = self._channels.get(name)
            if channels is not None:
                channels = replace(channels, values=part(f"sensor_{i}/{VALUES}"), clipped=part(f"sensor_{i}/{CLIPPED}"))
            own = {key: part(f"sensor_{i}/{key}") for key in SENSOR_FIELDS}
            sensors[name] = SensorRecording(**own, channels=channels, unit=self._units.get(name, SensorRecording.unit))
        return Recording(
            **{name: part(name) for name in ("frames", "times", "poses", "velocities")},
            sensors=sensors,
            body_names=self._bodies,
            dt=dt,
            digest=digest,
            warnings=tuple(warnings),
            step_reason=step_reason,
        )

    def _values(self, frame: Frame) -> dict[str, Any]:
        values: dict[str, Any] = {
            "frames": frame.frame,
            "times": frame.time,
            "poses": frame.poses,
            "velocities": frame.velocities,
        }
        for i, sensor in enumerate(self._sensors):
            own = frame.sensors[sensor]
            self._units[sensor] = own.unit
            values |= {f"sensor_{i}/{name}": getattr(own, name) for name in SENSOR_FIELDS}
            if own.channels is not None:
                values |= {f"sensor_{i}/{VALUES}": own.channels.values, f"sensor_{i}/{CLIPPED}": own.channels.clipped}
        return values
