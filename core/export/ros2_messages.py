# SPDX-License-Identifier: GPL-3.0-or-later
"""ROS 2 messages as bytes, without ROS: their definitions, and their encoding in CDR.

CDR (OMG, *Common Data Representation*, version 1, little-endian, as ``rmw`` writes it) puts each number at a multiple of its
own size, counted from the end of a header of four bytes; a text is its length with the closing zero, and its bytes. The
definitions are those of ``common_interfaces`` and ``geometry2`` (ROS 2 Humble to Rolling), without their comments.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

_TIME = "int32 sec\nuint32 nanosec\n"
_HEADER = "builtin_interfaces/Time stamp\nstring frame_id\n"
_VECTOR = "float64 x\nfloat64 y\nfloat64 z\n"
_QUATERNION = "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n"
_POINT_FIELD = (
    "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\nuint8 FLOAT32=7\n"
    "uint8 FLOAT64=8\nstring name\nuint32 offset\nuint8 datatype\nuint32 count\n"
)
_STAMPED = {"std_msgs/Header": _HEADER, "builtin_interfaces/Time": _TIME}
_TRANSFORM = "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"

POINT_CLOUD = "sensor_msgs/msg/PointCloud2"
IMAGE = "sensor_msgs/msg/Image"
WRENCH = "geometry_msgs/msg/WrenchStamped"
POINT = "geometry_msgs/msg/PointStamped"
TRANSFORMS = "tf2_msgs/msg/TFMessage"

_DEFINITIONS: dict[str, tuple[str, dict[str, str]]] = {
    POINT_CLOUD: (
        "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\nbool is_bigendian\n"
        "uint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n",
        {**_STAMPED, "sensor_msgs/PointField": _POINT_FIELD},
    ),
    IMAGE: (
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\nuint8[] data\n",
        _STAMPED,
    ),
    WRENCH: (
        "std_msgs/Header header\ngeometry_msgs/Wrench wrench\n",
        {
            **_STAMPED,
            "geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n",
            "geometry_msgs/Vector3": _VECTOR,
        },
    ),
    POINT: ("std_msgs/Header header\ngeometry_msgs/Point point\n", {**_STAMPED, "geometry_msgs/Point": _VECTOR}),
    TRANSFORMS: (
        "geometry_msgs/TransformStamped[] transforms\n",
        {
            "geometry_msgs/TransformStamped": (
                "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"
            ),
            **_STAMPED,
            "geometry_msgs/Transform": _TRANSFORM,
            "geometry_msgs/Vector3": _VECTOR,
            "geometry_msgs/Quaternion": _QUATERNION,
        },
    ),
}

_UINT8, _FLOAT32 = 2, 7
_FIELD_TYPES = {"|u1": _UINT8, "<f4": _FLOAT32}


def definition(name: str) -> str:
    """Return the definition of a message with those of all messages in it, as in MCAP's schemas of encoding ``ros2msg``."""
    text, parts = _DEFINITIONS[name]
    return text + "".join(f"{'=' * 80}\nMSG: {part}\n{content}" for part, content in parts.items())


class _Encoder:
    """The bytes of one message."""

    def __init__(self) -> None:
        self._bytes = bytearray(b"\x00\x01\x00\x00")  # little-endian, no options

    def number(self, kind: str, *values: float) -> None:
        """Append numbers of one kind of :mod:`struct`, the first at a multiple of their size."""
        self._bytes += b"\0" * (-(len(self._bytes) - 4) % struct.calcsize(kind))
        self._bytes += struct.pack(f"<{len(values)}{kind}", *values)

    def text(self, text: str) -> None:
        """Append a text."""
        encoded = text.encode() + b"\0"
        self.number("I", len(encoded))
        self._bytes += encoded

    def data(self, content: bytes) -> None:
        """Append a sequence of bytes."""
        self.number("I", len(content))
        self._bytes += content

    def header(self, time: int, frame: str) -> None:
        """Append a ``std_msgs/Header``; the time is in nanoseconds."""
        self.number("i", time // 1_000_000_000)
        self.number("I", time % 1_000_000_000)
        self.text(frame)

    def message(self) -> bytes:
        """Return the whole message."""
        return bytes(self._bytes)


def point_cloud(time: int, frame: str, points: np.ndarray) -> bytes:
    """Return a ``PointCloud2``.

    Parameters
    ----------
    time : int, nanoseconds
    frame : str
    points : (n,) structured array
        Its fields, float32 or uint8, become the fields of the points; x, y and z are among them.
    """
    encoder = _Encoder()
    encoder.header(time, frame)
    encoder.number("I", 1, len(points))
    fields = points.dtype.fields or {}
    encoder.number("I", len(fields))
    for name, (kind, offset, *_) in fields.items():
        encoder.text(name)
        encoder.number("I", offset)
        encoder.number("B", _FIELD_TYPES[kind.str])
        encoder.number("I", 1)
    encoder.number("?", False)
    encoder.number("I", points.dtype.itemsize, points.nbytes)
    encoder.data(points.tobytes())
    encoder.number("?", True)
    return encoder.message()


def image(time: int, frame: str, pixels: np.ndarray) -> bytes:
    """Return an ``Image`` of one float32 channel (``32FC1``); `pixels` is (height, width), the top row first."""
    encoder = _Encoder()
    encoder.header(time, frame)
    encoder.number("I", *pixels.shape)
    encoder.text("32FC1")
    encoder.number("B", 0)
    encoder.number("I", 4 * pixels.shape[1])
    encoder.data(np.ascontiguousarray(pixels, "<f4").tobytes())
    return encoder.message()


def wrench(time: int, frame: str, force: np.ndarray, torque: np.ndarray) -> bytes:
    """Return a ``WrenchStamped`` of a force (N) and a torque (N·m), (3,) each."""
    encoder = _Encoder()
    encoder.header(time, frame)
    encoder.number("d", *force, *torque)
    return encoder.message()


def point(time: int, frame: str, position: np.ndarray) -> bytes:
    """Return a ``PointStamped`` at a position, (3,) m."""
    encoder = _Encoder()
    encoder.header(time, frame)
    encoder.number("d", *position)
    return encoder.message()


def transforms(time: int, parent: str, children: Sequence[str], poses: np.ndarray) -> bytes:
    """Return a ``TFMessage`` with the pose of each child frame, (b, 7): origin in metres and quaternion (w, x, y, z)."""
    encoder = _Encoder()
    encoder.number("I", len(children))
    for child, (x, y, z, qw, qx, qy, qz) in zip(children, poses, strict=True):
        encoder.header(time, parent)
        encoder.text(child)
        encoder.number("d", x, y, z, qx, qy, qz, qw)
    return encoder.message()
