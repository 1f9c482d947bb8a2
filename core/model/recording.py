# SPDX-License-Identifier: GPL-3.0-or-later
"""The results of a run: per frame and texel, per frame and sensor, per frame and body.

The arrays of a long recording may be views of a file (:mod:`..io.row_tables`, :mod:`..io.recording_npz`). What goes through
all frames therefore goes block by block (:meth:`Recording.blocks`), and memory does not grow with the number of frames.
"""

from __future__ import annotations

import hashlib
import mmap
from collections.abc import Iterator, Sequence
from dataclasses import Field, dataclass, field, fields, is_dataclass, replace
from typing import Any, Protocol

import numpy as np

from ..errors import counted

AXES = ("x", "y", "z")
VALUES, CLIPPED = "channels/values", "channels/clipped"
"""Names of both arrays of a sensor in files."""


@dataclass(frozen=True)
class VectorReadings:
    """Readings of several channels for each place where something is measured.

    Attributes
    ----------
    values : (T, k, c) float
        At one frame (k, c).
    clipped : (T, k, c) bool
        Channels beyond their range.
    unit : str
    names : (c,) tuple of str
        Of the channels of each place.
    place : (k, 3) float, m, or None
        In the frame of the sensor's body.
    """

    values: np.ndarray
    clipped: np.ndarray
    unit: str = "T"
    names: tuple[str, ...] = AXES
    place: np.ndarray | None = None

    def part(self, frames: int | slice) -> VectorReadings:
        """Return some of the frames, or one, by their indices; the arrays are views."""
        return replace(self, values=self.values[frames], clipped=self.clipped[frames])

    def said(self) -> str:
        """Return a sentence about clipped channels, empty if there are none."""
        places = np.argwhere(self.clipped.any(axis=0))
        if not len(places):
            return ""
        frames = int(self.clipped.any(axis=(1, 2)).sum())
        first = f"channel {self.names[places[0][1]]} of magnetometer {places[0][0]}"
        more = f" and {counted(len(places) - 1, 'other channel')}" if len(places) > 1 else ""
        return f"{first}{more}: beyond the range in {counted(frames, 'frame')}, and clipped there."


BLOCK_BYTES = 1 << 22
"""Bytes of a recording that are worked on at once: large enough for numpy, small beside everything else in memory."""


@dataclass
class SensorArrays:
    """Forces and readings of a sensor: at one frame (:class:`SensorFrame`) or at F frames (:class:`SensorRecording`).

    Forces act **on the sensor** and are given in the frame of the sensor's body. The shapes are those of one frame; arrays of a
    recording have a leading axis of length F.

    Attributes
    ----------
    normal_force : (n,) float, N
        Force along the surface normal of the target (paper, Eq. 8). Only the effect adhesion makes it negative.
    shear : (n, 2) float, N
        Components of the whole force along the x and y axes of the texel. On a flat sensor the shear of all texels adds up to
        the tangential part of `net_force`, apart from rounding.
    friction : (n,) float, N
        Magnitude of the friction force (Eq. 13), which is tangential to the target's surface. It never exceeds the limit
        of friction.
    depth : (n,) float, m
        Penetration, perpendicular to the target's surface (Eq. 4).
    slip : (n,) float, m/s
        Relative tangential speed (Eq. 6).
    contact : (n,) bool
    reading : (n,) float, in `unit`
    net_force : (3,) float, N
    net_torque : (3,) float, N·m
        About the origin of the sensor's body.
    centre_of_pressure : (3,) float, m
        Force-weighted mean of the contact points; zero without contact.
    channels : VectorReadings or None
        Readings of several channels, of a sensor that has such a read-out.
    unit : str
        The sensor's, of its reading.
    """

    normal_force: np.ndarray
    shear: np.ndarray
    friction: np.ndarray
    depth: np.ndarray
    slip: np.ndarray
    contact: np.ndarray
    reading: np.ndarray
    net_force: np.ndarray
    net_torque: np.ndarray
    centre_of_pressure: np.ndarray
    channels: VectorReadings | None = None
    unit: str = "N"


SENSOR_FIELDS = tuple(item.name for item in fields(SensorArrays) if item.name not in ("channels", "unit"))
"""Names of the arrays that every sensor has, in the order in which files hold them."""


class ChannelReadout(Protocol):
    """Computes several signed channels from what happens at a sensor's texels, as those of :mod:`..skins.channel_readouts` do.

    It is a dataclass of plain data.
    """

    def no_frames(self) -> VectorReadings:
        """Return the channels of a recording without frames: their number, unit, names and places."""

    def channels(self, recorded: SensorArrays) -> VectorReadings:
        """Return the channels at the frames of a recording; a frame has the same bits in a recording of any length."""


@dataclass
class SensorFrame(SensorArrays):
    """One sensor at one frame."""


@dataclass
class Frame:
    """All sensors and all bodies at one frame.

    Attributes
    ----------
    frame : int
    time : float, seconds since the first frame
    sensors : dict of str to SensorFrame
        By sensor name; pads are not in it.
    poses : (b, 7) float
        Origin (m) and orientation quaternion (w, x, y, z) of each body's frame, in the world.
    velocities : (b, 6) float
        Linear velocity of the centre of mass (m/s) and angular velocity (rad/s), in the world.
    """

    frame: int
    time: float
    sensors: dict[str, SensorFrame]
    poses: np.ndarray
    velocities: np.ndarray


@dataclass
class SensorRecording(SensorArrays):
    """The frames of one sensor stacked: every array has a leading axis of length F."""

    def at(self, i: int) -> SensorFrame:
        """Return the recorded frame with index `i`."""
        return SensorFrame(**self._values(i))

    def part(self, frames: slice) -> SensorRecording:
        """Return some of the frames, by their indices; the arrays are views."""
        return SensorRecording(**self._values(frames))

    def _values(self, frames: int | slice) -> dict[str, Any]:
        channels = None if self.channels is None else self.channels.part(frames)
        return {name: getattr(self, name)[frames] for name in SENSOR_FIELDS} | {"channels": channels, "unit": self.unit}

    def arrays(self) -> list[np.ndarray]:
        """Return all arrays with an axis of length F."""
        own = [] if self.channels is None else [self.channels.values, self.channels.clipped]
        return [getattr(self, name) for name in SENSOR_FIELDS] + own

    @classmethod
    def stack(cls, frames: Sequence[SensorFrame]) -> SensorRecording:
        """Return the recording of frames that are given in order."""
        arrays = {name: np.stack([getattr(frame, name) for frame in frames]) for name in SENSOR_FIELDS}
        own = [frame.channels for frame in frames if frame.channels is not None]
        if not own:
            return cls(**arrays, unit=frames[0].unit)
        values, clipped = np.stack([one.values for one in own]), np.stack([one.clipped for one in own])
        return cls(**arrays, channels=replace(own[0], values=values, clipped=clipped), unit=frames[0].unit)


@dataclass
class Recording:
    """A finished run.

    Attributes
    ----------
    frames : (F,) int
    times : (F,) float, seconds
    sensors : dict of str to SensorRecording
    body_names : tuple of str
    poses : (F, b, 7) float
    velocities : (F, b, 6) float
    dt : float, seconds
        The substep that was used.
    step_reason : str
        Why this substep was used, in words for the user.
    digest : str
        :meth:`.Scenario.digest` of the scenario that was solved.
    warnings : tuple of str
        What the user should know (a texel bottomed out, a mesh was repaired), one sentence each.
    """

    frames: np.ndarray
    times: np.ndarray
    sensors: dict[str, SensorRecording]
    body_names: tuple[str, ...]
    poses: np.ndarray
    velocities: np.ndarray
    dt: float
    digest: str = ""
    warnings: tuple[str, ...] = field(default=())
    step_reason: str = ""

    @classmethod
    def stack(
        cls,
        frames: list[Frame],
        body_names: Sequence[str],
        dt: float,
        digest: str = "",
        warnings: Sequence[str] = (),
        step_reason: str = "",
    ) -> Recording:
        """Return the recording of frames that are given in order."""
        sensors = {name: SensorRecording.stack([frame.sensors[name] for frame in frames]) for name in frames[0].sensors}
        return cls(
            frames=np.array([frame.frame for frame in frames]),
            times=np.array([frame.time for frame in frames]),
            sensors=sensors,
            body_names=tuple(body_names),
            poses=np.stack([frame.poses for frame in frames]),
            velocities=np.stack([frame.velocities for frame in frames]),
            dt=dt,
            digest=digest,
            warnings=tuple(warnings),
            step_reason=step_reason,
        )

    def at(self, frame: int) -> Frame:
        """Return one recorded frame by its frame number; raises KeyError when it was not recorded."""
        (found,) = np.nonzero(self.frames == frame)
        if len(found) == 0:
            raise KeyError(frame)
        i = int(found[0])
        return Frame(
            frame=frame,
            time=float(self.times[i]),
            sensors={name: sensor.at(i) for name, sensor in self.sensors.items()},
            poses=self.poses[i],
            velocities=self.velocities[i],
        )

    def part(self, frames: slice) -> Recording:
        """Return some of the frames, by their indices; the arrays are views."""
        return replace(
            self,
            frames=self.frames[frames],
            times=self.times[frames],
            poses=self.poses[frames],
            velocities=self.velocities[frames],
            sensors={name: sensor.part(frames) for name, sensor in self.sensors.items()},
        )

    def blocks(self) -> Iterator[Recording]:
        """Yield the recording in parts of :data:`BLOCK_BYTES` or less, in order; each has a frame at least."""
        arrays = [array for sensor in self.sensors.values() for array in sensor.arrays()]
        arrays += [self.poses, self.velocities]
        row = max(sum(array.nbytes for array in arrays) // max(1, len(self.frames)), *(array.strides[0] for array in arrays))
        count = max(1, BLOCK_BYTES // max(1, row))
        for begin in range(0, len(self.frames), count):
            yield self.part(slice(begin, begin + count))
            for array in arrays:
                release_pages(array)


def row_blocks(array: np.ndarray) -> Iterator[slice]:
    """Yield slices that cover the rows of an array, each of :data:`BLOCK_BYTES` in its file or memory, or of a single row."""
    rows = max(1, BLOCK_BYTES // max(1, abs(array.strides[0])))
    for begin in range(0, len(array), rows):
        yield slice(begin, min(begin + rows, len(array)))
        release_pages(array)


def release_pages(array: np.ndarray) -> None:
    """Let go of the memory that holds what was read of a mapped file; the array stays as it is, and others are left alone."""
    base: object = array
    while isinstance(base, np.ndarray) and base.base is not None:
        base = base.base
    if isinstance(base, memoryview):
        base = base.obj
    if isinstance(base, mmap.mmap) and hasattr(mmap, "MADV_DONTNEED") and not array.flags.writeable:
        base.madvise(mmap.MADV_DONTNEED)  # what is asked for again comes from the file


IF_GIVEN = "if given"
"""Key of the metadata of a field that counts only if it is not None. What lacks it has the hash from before there was such a
field."""


def digest_of(value: object) -> str:
    """Return a hash of a description, the same in every process and on every platform.

    The names of fields and their order count. Checkpoints and bakes keep the hash of their scenario, so after a field has been
    renamed or moved, an unfinished bake starts again from its first frame.

    Parameters
    ----------
    value : object
        A dataclass, or a tuple of dataclasses. Their fields hold numbers, texts, arrays, dictionaries and again dataclasses.
    """
    digest = hashlib.sha256(b"palpate-scenario/1")
    _feed(digest, value)
    return digest.hexdigest()


_known_fields: dict[Any, tuple[Field[Any], ...] | None] = {}


def _fields_of(value: Any) -> tuple[Field[Any], ...] | None:
    """Return the fields of a dataclass, None for another value; looked up by its type, as a scenario has hundreds of values."""
    kind = type(value)
    if kind not in _known_fields:
        _known_fields[kind] = fields(kind) if is_dataclass(kind) else None
    return _known_fields[kind]


def stated_fields(value: Any) -> list[Field[Any]]:
    """Return the fields of a dataclass that count for its hash and stand in its file."""
    own = _fields_of(value) or ()
    return [item for item in own if IF_GIVEN not in item.metadata or getattr(value, item.name) is not None]


def _feed(digest: hashlib._Hash, value: Any) -> None:
    """Hash dataclasses field by field, arrays with type and shape, and everything else by its representation."""
    if _fields_of(value) is not None:
        for item in stated_fields(value):
            digest.update(item.name.encode())
            _feed(digest, getattr(value, item.name))
    elif isinstance(value, tuple | list):
        digest.update(f"[{len(value)}".encode())
        for item in value:
            _feed(digest, item)
    elif isinstance(value, dict):
        _feed(digest, sorted(value.items()))
    elif isinstance(value, np.ndarray):
        array = np.ascontiguousarray(value)
        digest.update(f"{array.dtype.str}{array.shape}".encode())
        for rows in row_blocks(array) if array.nbytes > BLOCK_BYTES else (...,):
            digest.update(array[rows].tobytes())
    else:
        digest.update(repr(value).encode())
