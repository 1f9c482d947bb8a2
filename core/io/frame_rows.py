# SPDX-License-Identifier: GPL-3.0-or-later
"""The frames of a run, in a file that only grows at its end: one row of fixed size per frame.

A run of a million frames is kept in it without growing in memory, and a checkpoint of it costs the same at any length: the rows
since the last one are brought onto the disk, and the SHA-256 of all rows so far is at hand.
"""

from __future__ import annotations

import mmap
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from ..model.recording import SENSOR_FIELDS, Frame, Recording, SensorRecording
from ..model.vector_readings import CLIPPED, VALUES, VectorReadings
from .growing_file import GrowingFile
from .regular_file import open_regular

IN_MEMORY_BYTES = 1 << 24
"""Largest recording that is read into memory; a larger one stays in its file, which is mapped."""
_BLOCK_BYTES = 1 << 22
"""Size of the rows that are looked at together."""
_VECTORS = ("net_force", "net_torque", "centre_of_pressure")
_SHARED = ("frames", "times", "poses", "velocities")
Channels = Mapping[str, VectorReadings]


def row_type(bodies: int, texels: Mapping[str, int], channels: Channels = MappingProxyType({})) -> np.dtype:
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


class FrameRows:
    """The rows of one run. Every method that touches the file raises OSError where the system refuses.

    Parameters
    ----------
    path : Path
        The file. It is made by :meth:`begin` or taken over by :meth:`restore`.
    bodies : sequence of str
        Names of the bodies.
    texels : mapping of str to int
        Number of texels of each sensor that is read out, by its name.
    channels : mapping of str to VectorReadings
        As those of the frames, of sensors that have such readings.
    """

    def __init__(self, path: Path, bodies: Sequence[str], texels: Mapping[str, int], channels: Channels = MappingProxyType({})):
        self._file = GrowingFile(path)
        self._bodies, self._sensors, self._channels = tuple(bodies), tuple(texels), channels
        self._type = row_type(len(bodies), texels, channels)
        self._row = np.zeros(1, self._type)
        self._parts = {name: self._row[name] for name in self._type.names or ()}
        # All of a row but the number of the frame. As floats, the bytes of truth values and of gaps are finite.
        self._numbers = self._row.view(np.float64)[1:]
        self._bytes = self._row.view(np.uint8).data

    def __len__(self) -> int:
        """Return how many frames were written."""
        return self._file.length // self._type.itemsize

    @property
    def row_bytes(self) -> int:
        """Size of a row."""
        return self._type.itemsize

    @property
    def sha256(self) -> str:
        """SHA-256 of all rows so far, 64 hexadecimal digits."""
        return self._file.sha256

    def begin(self) -> None:
        """Make the file, without frames."""
        self._file.begin()

    def restore(self, count: int, sha256: str) -> bool:
        """Take over the first `count` rows of a file, as :meth:`.GrowingFile.restore` does."""
        return self._file.restore(count * self._type.itemsize, sha256)

    def are_of(self, frames: Sequence[int], times: np.ndarray) -> bool:
        """Return whether the rows are those of some frames (n,), at some times (n,) s, and all of their numbers are finite."""
        self._file.flush()
        block = max(1, _BLOCK_BYTES // self._type.itemsize)
        with open_regular(self._file.path) as file:
            for first in range(0, len(frames), block):
                own = slice(first, first + block)
                rows = np.frombuffer(file.read(len(frames[own]) * self._type.itemsize), self._type)
                if rows["frames"].tolist() != list(frames[own]) or not np.array_equal(rows["times"], times[own]):
                    return False
                if not all(_finite(rows[name]) for name in self._type.names or ()):
                    return False
        return True

    def append(self, frame: Frame) -> None:
        """Write one more frame.

        Raises
        ------
        ValueError
            A number is not finite (a fault of the program, not of the user).
        """
        values = self._values(frame)
        self._parts["frames"][0] = frame.frame
        for name, own in values:
            self._parts[name][0] = own
        if not np.isfinite(self._numbers).all():
            name = next((name for name, own in values if not np.isfinite(own).all()), "frames")
            raise ValueError(f"'{name}' of frame {frame.frame} has values that are not finite")
        self._file.append(self._bytes)

    def flush(self) -> None:
        """Hand what was written to the operating system."""
        self._file.flush()

    def sync(self) -> None:
        """Bring what was written onto the disk."""
        self._file.sync()

    def close(self) -> None:
        """Close the file; what was read of it stays."""
        self._file.close()

    def frame(self, i: int) -> Frame:
        """Return the frame with index `i`."""
        self._file.flush()
        row = np.fromfile(self._file.path, self._type, 1, offset=i * self._type.itemsize)
        return self._recording(row, 0.0, "", (), "").at(int(row["frames"][0]))

    def recording(self, dt: float, digest: str, warnings: Sequence[str], step_reason: str) -> Recording:
        """Return all frames, with what else a :class:`.Recording` says.

        A recording above :data:`IN_MEMORY_BYTES` is a view of the file and cannot be changed. It stays valid when the file is
        removed.
        """
        self._file.flush()
        if self._file.length <= IN_MEMORY_BYTES:
            rows = np.fromfile(self._file.path, self._type, len(self))
            return _in_memory(self._recording(rows, dt, digest, warnings, step_reason))
        with open(self._file.path, "rb") as file:
            mapped = mmap.mmap(file.fileno(), self._file.length, access=mmap.ACCESS_READ)
        rows = np.frombuffer(mapped, self._type)
        return self._recording(rows, dt, digest, warnings, step_reason)

    def _values(self, frame: Frame) -> list[tuple[str, Any]]:
        values: list[tuple[str, Any]] = [("times", frame.time), ("poses", frame.poses), ("velocities", frame.velocities)]
        for i, sensor in enumerate(self._sensors):
            own = frame.sensors[sensor]
            values += [(f"sensor_{i}/{name}", getattr(own, name)) for name in SENSOR_FIELDS]
            if own.channels is not None:
                values += [(f"sensor_{i}/{VALUES}", own.channels.values), (f"sensor_{i}/{CLIPPED}", own.channels.clipped)]
        return values

    def _recording(self, rows: np.ndarray, dt: float, digest: str, warnings: Sequence[str], step_reason: str) -> Recording:
        return Recording(
            **{name: rows[name] for name in _SHARED},
            sensors={sensor: self._sensor(rows, i, sensor) for i, sensor in enumerate(self._sensors)},
            body_names=self._bodies,
            dt=dt,
            digest=digest,
            warnings=tuple(warnings),
            step_reason=step_reason,
        )

    def _sensor(self, rows: np.ndarray, i: int, sensor: str) -> SensorRecording:
        channels = self._channels.get(sensor)
        if channels is not None:
            channels = replace(channels, values=rows[f"sensor_{i}/{VALUES}"], clipped=rows[f"sensor_{i}/{CLIPPED}"])
        return SensorRecording(**{name: rows[f"sensor_{i}/{name}"] for name in SENSOR_FIELDS}, channels=channels)


def _in_memory(recording: Recording) -> Recording:
    """Return a recording whose arrays are laid out one by one, as those of ``recording.npz``."""
    for name in _SHARED:
        setattr(recording, name, getattr(recording, name).copy())
    for sensor in recording.sensors.values():
        for name in SENSOR_FIELDS:
            setattr(sensor, name, getattr(sensor, name).copy())
        if sensor.channels is not None:
            own = sensor.channels
            sensor.channels = replace(own, values=own.values.copy(), clipped=own.clipped.copy())
    return recording


def _finite(values: np.ndarray) -> bool:
    """Return whether all floats of an array, or of the fields of a structured one, are finite."""
    if values.dtype.names:
        return all(_finite(values[name]) for name in values.dtype.names)
    return values.dtype.kind != "f" or bool(np.isfinite(values).all())
