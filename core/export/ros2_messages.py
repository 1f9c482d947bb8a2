# SPDX-License-Identifier: GPL-3.0-or-later
"""ROS 2 messages as bytes, without ROS: the package rosbags knows their definitions and their encoding in CDR."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any

import numpy as np

POINT_CLOUD = "sensor_msgs/msg/PointCloud2"
IMAGE = "sensor_msgs/msg/Image"
WRENCH = "geometry_msgs/msg/WrenchStamped"
POINT = "geometry_msgs/msg/PointStamped"
TRANSFORMS = "tf2_msgs/msg/TFMessage"

_UINT8, _FLOAT32 = 2, 7
_FIELD_TYPES = {"|u1": _UINT8, "<f4": _FLOAT32}


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


def point_cloud(time: int, frame: str, points: np.ndarray) -> bytes:
    """Return a ``PointCloud2``.

    Parameters
    ----------
    time : int, nanoseconds
    frame : str
    points : (n,) structured array
        Its fields, float32 or uint8, become the fields of the points; x, y and z are among them.
    """
    kinds = points.dtype.fields or {}
    about = ((name, offset, _FIELD_TYPES[kind.str], 1) for name, (kind, offset, *_) in kinds.items())
    fields = [_part("sensor_msgs/msg/PointField", *one) for one in about]
    data = np.frombuffer(points.tobytes(), np.uint8)
    return _message(
        POINT_CLOUD, _header(time, frame), 1, len(points), fields, False, points.dtype.itemsize, points.nbytes, data, True
    )


def image(time: int, frame: str, pixels: np.ndarray) -> bytes:
    """Return an ``Image`` of one float32 channel (``32FC1``); `pixels` is (height, width), the top row first."""
    data = np.frombuffer(np.ascontiguousarray(pixels, "<f4").tobytes(), np.uint8)
    return _message(IMAGE, _header(time, frame), *pixels.shape, "32FC1", 0, 4 * pixels.shape[1], data)


def wrench(time: int, frame: str, force: np.ndarray, torque: np.ndarray) -> bytes:
    """Return a ``WrenchStamped`` of a force (N) and a torque (N·m), (3,) each."""
    return _message(WRENCH, _header(time, frame), _part("geometry_msgs/msg/Wrench", _vector(force), _vector(torque)))


def point(time: int, frame: str, position: np.ndarray) -> bytes:
    """Return a ``PointStamped`` at a position, (3,) m."""
    return _message(POINT, _header(time, frame), _part("geometry_msgs/msg/Point", *map(float, position)))


def transforms(time: int, parent: str, children: Sequence[str], poses: np.ndarray) -> bytes:
    """Return a ``TFMessage`` with the pose of each child frame, (b, 7): origin in metres and quaternion (w, x, y, z)."""
    stamped = []
    for child, (x, y, z, qw, qx, qy, qz) in zip(children, poses, strict=True):
        turned = _part("geometry_msgs/msg/Quaternion", float(qx), float(qy), float(qz), float(qw))
        pose = _part("geometry_msgs/msg/Transform", _vector((x, y, z)), turned)
        stamped.append(_part("geometry_msgs/msg/TransformStamped", _header(time, parent), child, pose))
    return _message(TRANSFORMS, stamped)
