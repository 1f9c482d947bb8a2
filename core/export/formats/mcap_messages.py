# SPDX-License-Identifier: GPL-3.0-or-later
"""MCAP: one file with ROS 2 messages over simulated time, which Foxglove, rerun and ROS 2 open; ROS is not needed."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import imported
from ...figures.figure_style import FigureStyle
from ...figures.quantities import Quantity
from ...geometry.grid_layout import GridLayout
from ...io.bake_reader import Bake
from ...io.file_writing import atomic_write
from ...io.recording_npz import described
from ...jobs import Job
from ...model.recording import Recording, VectorReadings
from ..exporter import Exporter, sensor_progress

POINT_CLOUD = "sensor_msgs/msg/PointCloud2"
IMAGE = "sensor_msgs/msg/Image"
WRENCH = "geometry_msgs/msg/WrenchStamped"
POINT = "geometry_msgs/msg/PointStamped"
TRANSFORMS = "tf2_msgs/msg/TFMessage"

_FIELD_TYPES = {"|u1": 2, "<f4": 7}
"""UINT8 and FLOAT32 of a ``PointField``."""


@cache
def _store() -> Any:
    """Return the messages of ROS 2 Humble, which Rolling has unchanged."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)


def definition(name: str) -> str:
    """Return the definition of a message with those of all messages in it, as in MCAP's schemas of encoding ``ros2msg``."""
    text, _ = _store().generate_msgdef(name, ros_version=2)
    return str(text)


def _part(name: str, *values: Any) -> Any:
    return _store().types[name](*values)


def _header(time: int, frame: str) -> Any:
    """Return a ``std_msgs/Header``; the time is in nanoseconds."""
    return _part("std_msgs/msg/Header", _part("builtin_interfaces/msg/Time", *divmod(time, 1_000_000_000)), frame)


def _vector(values: Iterable[float]) -> Any:
    return _part("geometry_msgs/msg/Vector3", *map(float, values))


def _message(kind: str, *values: Any) -> bytes:
    return bytes(_store().serialize_cdr(_part(kind, *values), kind))


def point_cloud(header: Any, points: np.ndarray) -> bytes:
    """Return a ``PointCloud2`` with the fields, float32 or uint8, of a structured array (n,), x, y and z among them."""
    kinds = points.dtype.fields or {}
    about = ((name, offset, _FIELD_TYPES[kind.str], 1) for name, (kind, offset, *_) in kinds.items())
    fields = [_part("sensor_msgs/msg/PointField", *one) for one in about]
    data = np.frombuffer(points.tobytes(), np.uint8)
    return _message(POINT_CLOUD, header, 1, len(points), fields, False, points.dtype.itemsize, points.nbytes, data, True)


def image(header: Any, pixels: np.ndarray) -> bytes:
    """Return an ``Image`` of one float32 channel (``32FC1``); `pixels` is (height, width), the top row first."""
    data = np.frombuffer(np.ascontiguousarray(pixels, "<f4").tobytes(), np.uint8)
    return _message(IMAGE, header, *pixels.shape, "32FC1", 0, 4 * pixels.shape[1], data)


def transforms(time: int, parent: str, children: Sequence[str], poses: np.ndarray) -> bytes:
    """Return a ``TFMessage`` with the pose of each child frame, (b, 7): origin in metres and quaternion (w, x, y, z)."""
    stamped = []
    for child, (x, y, z, qw, qx, qy, qz) in zip(children, poses, strict=True):
        turned = _part("geometry_msgs/msg/Quaternion", float(qx), float(qy), float(qz), float(qw))
        pose = _part("geometry_msgs/msg/Transform", _vector((x, y, z)), turned)
        stamped.append(_part("geometry_msgs/msg/TransformStamped", _header(time, parent), child, pose))
    return _message(TRANSFORMS, stamped)


WORLD = "world"
"""Frame of the world."""
_TEXEL = [*((name, "<f4") for name in ("normal_force", "shear_x", "shear_y", "reading", "depth", "slip")), ("contact", "u1")]
"""Fields of a texel in the point cloud, behind its position."""


def write_mcap(bake: Bake, folder: Path, style: FigureStyle) -> Job[list[Path]]:
    """Write ``palpate.mcap``, whose tactile images show the quantity of the style."""
    for package in ("mcap.writer", "rosbags"):
        imported(package, "MCAP", "run 'pip install mcap rosbags'")
    from mcap.well_known import Profile
    from mcap.writer import CompressionType, Writer

    path = folder / "palpate.mcap"
    with atomic_write(path) as temporary, open(temporary, "wb") as file:
        writer = Writer(file, chunk_size=1 << 20, compression=CompressionType.ZSTD)
        writer.start(profile=Profile.ROS2, library="palpate")
        output = _Output(writer, bake, style.shown)
        names, frames = list(bake.texels), len(bake.recording.frames)
        done = 0
        for part in bake.recording.blocks():
            yield sensor_progress(bake, names[done * len(names) // frames])
            output.write(part)
            done += len(part.frames)
        output.describe()
        writer.finish()
    return [path]


class _Output:
    """Channels of a file, and what goes into them."""

    def __init__(self, writer: Any, bake: Bake, shown: Quantity):
        self._writer, self._bake, self._shown = writer, bake, shown
        self._schemas: dict[str, int] = {}
        recording = bake.recording
        self._bodies = _frame_names(recording.body_names)
        carriers = {name: manifest.body for name, manifest in bake.manifests.items()}
        others = {name: name if name != WORLD else f"{name}_" for name in bake.texels}  # of a sensor whose body is not known
        self._frames = {name: self._bodies.get(carriers.get(name, ""), other) for name, other in others.items()}
        self._topics = topic_names(bake.texels)
        kinds = {"texels": POINT_CLOUD, "tactile_image": IMAGE, "wrench": WRENCH, "centre_of_pressure": POINT}
        self._transforms = self._channel("/tf", TRANSFORMS)
        self._channels = {
            name: {what: self._channel(f"{topic}/{what}", kind) for what, kind in kinds.items()}
            for name, topic in self._topics.items()
        }
        self._points = {name: _points_at(texels.position, _TEXEL) for name, texels in bake.texels.items()}
        for name, recorded in recording.sensors.items():
            if recorded.channels is not None:
                self._channels[name]["channels"] = self._channel(f"{self._topics[name]}/channels", POINT_CLOUD)

    def _channel(self, topic: str, kind: str) -> int:
        if kind not in self._schemas:
            self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", definition(kind).encode())
        return int(self._writer.register_channel(topic, "cdr", self._schemas[kind]))

    def write(self, part: Recording) -> None:
        """Write some of the frames."""
        for i, seconds in enumerate(part.times):
            time = round(float(seconds) * 1e9)
            poses = transforms(time, WORLD, list(self._bodies.values()), part.poses[i])
            self._message(self._transforms, time, int(part.frames[i]), poses)
            for name, recorded in part.sensors.items():
                own, header, points = recorded.at(i), _header(time, self._frames[name]), self._points[name]
                for field in ("normal_force", "reading", "depth", "slip", "contact"):
                    points[field] = getattr(own, field)
                points["shear_x"], points["shear_y"] = own.shear.T
                texels = self._bake.texels[name]
                picture = texels.layout.image(self._shown.values(own, texels))[::-1]
                wrench = _part("geometry_msgs/msg/Wrench", _vector(own.net_force), _vector(own.net_torque))
                centre = _part("geometry_msgs/msg/Point", *map(float, own.centre_of_pressure))
                content = {
                    "texels": point_cloud(header, points),
                    "tactile_image": image(header, picture),
                    "wrench": _message(WRENCH, header, wrench),
                    "centre_of_pressure": _message(POINT, header, centre),
                }
                if own.channels is not None:
                    content["channels"] = point_cloud(header, _vector_points(own.channels))
                for what, message in content.items():
                    self._message(self._channels[name][what], time, int(part.frames[i]), message)

    def _message(self, channel: int, time: int, frame: int, message: bytes) -> None:
        self._writer.add_message(channel, time, message, time, max(0, frame))

    def describe(self) -> None:
        """Attach what does not change: where the texels of each sensor are, units and parameters."""
        recording = self._bake.recording
        self._writer.add_metadata("palpate", {"digest": recording.digest, "dt": repr(recording.dt)})
        for name, texels in self._bake.texels.items():
            grid = texels.layout if isinstance(texels.layout, GridLayout) else None
            content = {
                "sensor": name,
                "frame": self._frames[name],
                "unit": self._bake.parameters[name].unit,
                "tactile_image": [self._shown.name, self._shown.unit_of(recording.sensors[name])],
                "parameters": asdict(self._bake.parameters[name]),
                **{key: getattr(texels, key).tolist() for key in ("position", "normal", "tangent", "area")},
                **({} if grid is None else {"row": grid.row.tolist(), "column": grid.column.tolist()}),
            }
            channels = recording.sensors[name].channels
            if channels is not None:
                content["channels"] = described(channels)
            text = json.dumps(content, allow_nan=False).encode()
            self._writer.add_attachment(0, 0, f"{self._topics[name][1:]}.json", "application/json", text)


def _points_at(positions: np.ndarray, fields: list[tuple[str, str]]) -> np.ndarray:
    """Return the points of a cloud at (n, 3) positions, whose other fields are zero."""
    points = np.zeros(len(positions), [*((axis, "<f4") for axis in "xyz"), *fields])
    points["x"], points["y"], points["z"] = positions.T
    return points


def _vector_points(channels: VectorReadings) -> np.ndarray:
    """Return the points of a cloud where channels are measured, with a field ``channel_<name>`` for each."""
    own = [f"channel_{name}" for name in channels.names]
    places = np.zeros((len(channels.values), 3)) if channels.place is None else channels.place
    points = _points_at(places, [(name, "<f4") for name in own])
    for name, values in zip(own, channels.values.T, strict=True):
        points[name] = values
    return points


def topic_names(sensors: Iterable[str]) -> dict[str, str]:
    """Return a topic for each sensor. ROS allows letters, digits and underscores between slashes, and no digit first."""
    found: dict[str, str] = {}
    for name in sensors:
        plain = re.sub(r"[^A-Za-z0-9_]", "_", name)
        plain = re.sub(r"__+", "_", f"sensor_{plain}" if not plain[:1].isalpha() else plain)
        topic, number = f"/{plain}", 2
        while topic in found.values():
            topic, number = f"/{plain}_{number}", number + 1
        found[name] = topic
    return found


def _frame_names(bodies: Iterable[str]) -> dict[str, str]:
    """Return the name of the frame of each body, its own; that of the world is taken."""
    names: dict[str, str] = {}
    for body in bodies:
        frame = body
        while frame == WORLD or frame in names.values():
            frame += "_"
        names[body] = frame
    return names


EXPORTER = Exporter("mcap", write_mcap)
