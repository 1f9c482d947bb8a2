# SPDX-License-Identifier: GPL-3.0-or-later
"""The frames of a run, one row each, from which its recording is made without a second copy of a long one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from ..model.recording import SENSOR_FIELDS, Frame, Recording, SensorRecording
from ..model.scenario import Scenario
from ..model.vector_readings import CLIPPED, VALUES, VectorReadings
from .row_table import RowTable

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
            sensors[name] = SensorRecording(**{key: part(f"sensor_{i}/{key}") for key in SENSOR_FIELDS}, channels=channels)
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
            values |= {f"sensor_{i}/{name}": getattr(own, name) for name in SENSOR_FIELDS}
            if own.channels is not None:
                values |= {f"sensor_{i}/{VALUES}": own.channels.values, f"sensor_{i}/{CLIPPED}": own.channels.clipped}
        return values
