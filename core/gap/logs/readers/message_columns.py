# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages of one topic as a table: a column for each number in them.

``wrench.force.x`` is the number x of the part force of the part wrench. Lists of numbers are ``data_0``, ``data_1``, …; the
parts of a list of parts are named after what they are called, as the frames of transforms are. Times are those of the headers,
where the messages have them, else those at which messages were recorded.
"""

from __future__ import annotations

from array import array
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..log_table import FEWEST_ROWS, MOST_COLUMNS, LogTable, cleaned, require_size

TIME = "time"
"""Column of the time of a message, in seconds."""
LONGEST_LIST = 4096
"""Numbers of a list; longer ones are pictures or sound."""
DEEPEST = 8
"""Parts within parts of a message."""
PICTURES = (
    *("Image", "CompressedImage", "CompressedVideo", "RawImage", "RawAudio", "LaserScan", "OccupancyGrid"),
    *("Log", "DiagnosticArray", "ParameterEvent"),
)
"""Types of messages that hold no measurements of touch."""
NUMBER_TYPES = (int, float, np.number, np.bool_)
_POINT_KINDS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
_LARGEST_DIFFERENCE = 10.0
"""Seconds between the times of headers and of the recorder, above which the headers are not believed."""


def is_picture(kind: str) -> bool:
    """Return True for types of messages that are not read."""
    return kind.replace(".", "/").rpartition("/")[2] in PICTURES


class TopicColumns:
    """Collects the numbers of the messages of one topic.

    Parameters
    ----------
    topic : str
    path : Path
        Of the log, for messages.
    """

    def __init__(self, topic: str, path: Path):
        self._topic, self._path, self._number_count = topic, path, 0
        self._columns: dict[str, tuple[array[int], array[float]]] = defaultdict(lambda: (array("Q"), array("d")))
        """Rows and numbers of each column: not every message has all of them."""
        self._recorded, self._stamps = array("d"), array("d")

    def add(self, message: Any, nanoseconds: int) -> None:
        """Take the numbers of a message that was recorded at a time."""
        for name, number in _numbers(message, "", 0):
            rows, numbers = self._columns[name]
            rows.append(len(self._recorded))
            numbers.append(number)
            self._number_count += 1
            if len(self._columns) > MOST_COLUMNS:
                break
        require_size(self._number_count, len(self._columns), self._path)
        self._recorded.append(nanoseconds * 1e-9)
        self._stamps.append(_stamp(message))

    def table(self) -> tuple[LogTable | None, str]:
        """Return the table, None if there are too few messages, and what is said about its times."""
        count = len(self._recorded)
        if count < FEWEST_ROWS or not self._columns:
            return None, ""
        require_size(count * len(self._columns), len(self._columns), self._path)
        time, stamps, said = np.array(self._recorded), np.array(self._stamps), ""
        if np.isfinite(stamps).all() and np.ptp(stamps) > 0.0:
            difference = float(np.abs((stamps - stamps[0]) - (time - time[0])).max())
            if difference > _LARGEST_DIFFERENCE:
                said = (
                    f"'{self._path.name}': the times in the headers of {self._topic} differ by up to {difference:.3g} s from "
                    "those of the recorder, which were taken."
                )
            time = time if said else stamps
        columns = {TIME: time}
        for name, (rows, numbers) in self._columns.items():
            if name != TIME:
                columns[name] = np.full(count, np.nan)
                columns[name][np.array(rows)] = cleaned(np.array(numbers))
        return LogTable(self._topic, columns, {TIME: "s"}), said


def _stamp(message: Any) -> float:
    """Return the time in the header of a message, or in that of its first part, in seconds; NaN without one."""
    header = _part(message, "header")
    if header is None:
        parts = _part(message, "transforms")
        header = _part(parts[0], "header") if isinstance(parts, list | tuple | np.ndarray) and len(parts) else None
    stamp = _part(header, "stamp") if header is not None else _part(message, "timestamp")
    seconds = _part(stamp, "sec", "secs")
    nanoseconds = _part(stamp, "nanosec", "nsec", "nsecs")
    if not isinstance(seconds, int | np.integer) or not isinstance(nanoseconds, int | np.integer):
        return np.nan
    return float(seconds) + 1e-9 * float(nanoseconds)


def _parts(message: Any) -> Mapping[str, Any]:
    """Return the parts of a message by their names; none of a number or a text."""
    if isinstance(message, Mapping):
        return message
    if not is_dataclass(message):
        return {}
    # constants of a message's type are no measurements; rosbags marks them so, and the name of the type
    return {item.name: getattr(message, item.name) for item in fields(message) if "ClassVar" not in str(item.type)}


def _part(message: Any, *names: str) -> Any:
    parts = _parts(message)
    return next((parts[name] for name in names if parts.get(name) is not None), None)


def _numbers(message: Any, before: str, depth: int) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a message and their names; times in headers and texts are left out."""
    if depth == 0 and is_dataclass(message) and hasattr(message, "point_step"):
        yield from _points(message)
        return
    for name, value in _parts(message).items() if depth <= DEEPEST else ():
        full, is_list = f"{before}{name}", isinstance(value, list | tuple)
        if name in ("header", "stamp", "layout"):
            continue
        if isinstance(value, NUMBER_TYPES):
            yield full, _as_float(value)
        elif isinstance(value, np.ndarray) or is_list and value and isinstance(value[0], NUMBER_TYPES):
            is_plain = all(isinstance(one, NUMBER_TYPES) for one in value) if is_list else value.dtype.kind in "iufb"
            if len(value) <= LONGEST_LIST and is_plain:
                yield from ((f"{full}_{i}", _as_float(number)) for i, number in enumerate(np.ravel(value)))
        elif is_list:
            for i, part in enumerate(value[:LONGEST_LIST]):
                called = _part(part, "child_frame_id", "name")
                own = called if isinstance(called, str) and called else f"{full}_{i}"
                yield from _numbers(part, f"{own}.", depth + 1)
        else:
            yield from _numbers(value, f"{full}.", depth + 1)


def _as_float(number: Any) -> float:
    """A number of a message; NaN for one that is too large."""
    try:
        return float(number)
    except OverflowError:
        return np.nan


def _points(message: Any) -> Iterator[tuple[str, float]]:
    """Yield the fields of the points of a ``PointCloud2``."""
    used = [field for field in message.fields if field.datatype in _POINT_KINDS and field.count == 1]
    order = ">" if message.is_bigendian else "<"
    kind = np.dtype(
        {
            "names": [field.name for field in used],
            "formats": [order + _POINT_KINDS[field.datatype] for field in used],
            "offsets": [field.offset for field in used],
            "itemsize": message.point_step,
        }
    )
    points = np.frombuffer(bytes(message.data), kind)
    if len(points) <= LONGEST_LIST:
        for name in kind.names or ():
            yield from ((f"{name}_{i}", float(number)) for i, number in enumerate(points[name]))
