# SPDX-License-Identifier: GPL-3.0-or-later
"""Readings that a second logger recorded, by a clock of its own.

::

    [[trial]]
    file = "press_0.csv"                                                  # what drove the sensor
    readings = { file = "press_0_readings.csv", late = 12.453 }

`late` is how many seconds more the second clock shows at the same moment. The columns of the first file are interpolated at the
times of the second.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from ...errors import FileError
from ...io.schema import wanted
from .missing_samples import bridged

TURN = {"qw", "qx", "qy", "qz"}
LARGEST_SHIFT = 1e10
"""Seconds."""


@dataclass(frozen=True)
class SecondLogger:
    """The file of a second logger, by its name in the rig.

    Attributes
    ----------
    file : object
        As the rig writes it; it is checked where it is opened.
    late : float, s
        The second clock's time of an event minus the first one's.
    """

    file: Any = None
    late: Annotated[float, wanted("write seconds", ge=-LARGEST_SHIFT, le=LARGEST_SHIFT)] = 0.0


def joined(
    first: Mapping[str, np.ndarray], second: Mapping[str, np.ndarray], late: float, files: tuple[Path, Path]
) -> dict[str, np.ndarray]:
    """Return the columns of two loggers at the times of the second, on the clock of the first.

    Parameters
    ----------
    first, second : mapping of str to (T,) ndarray
        With checked `time`, in seconds.
    late : float, s
    files : (Path, Path)
        For messages.

    Raises
    ------
    FileError
        A column is in both, or the recordings do not overlap.
    """
    for name in second:
        if name != "time" and name in first:
            raise FileError(f"Both '{files[0].name}' and '{files[1].name}' have a column '{name}': remove one of them.")
    time = second["time"] - late
    inside = (time >= first["time"][0]) & (time <= first["time"][-1])
    if inside.sum() < 8:
        raise FileError(
            f"'{files[0].name}' and '{files[1].name}' have {int(inside.sum())} samples at the same time with late = {late:g} "
            "s: check late, it is the time of the second clock minus that of the first."
        )
    first = with_steady_signs(first)
    found = {name: interpolated(first["time"], column, time[inside]) for name, column in first.items() if name != "time"}
    return {"time": time[inside], **found, **{name: column[inside] for name, column in second.items() if name != "time"}}


def with_steady_signs(columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return columns in which ``qw qx qy qz`` do not jump between the two quaternions of a rotation."""
    found = dict(columns)
    if set(columns) >= TURN:
        turns = np.stack([columns[name] for name in sorted(TURN)])
        flips = np.where((turns[:, 1:] * turns[:, :-1]).sum(axis=0) < 0.0, -1.0, 1.0)
        sign = np.concatenate([[1.0], np.cumprod(flips)])
        found |= {name: columns[name] * sign for name in TURN}
    return found


def interpolated(time: np.ndarray, values: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return values at other times; missing within gaps that are too long to be interpolated (:mod:`.missing_samples`)."""
    values = bridged(time, values)
    right = np.clip(np.searchsorted(time, wanted), 1, len(time) - 1)
    share = (wanted - time[right - 1]) / (time[right] - time[right - 1])
    before, after = values[right - 1], values[right]
    found: np.ndarray = np.where(share == 0.0, before, np.where(share == 1.0, after, (1.0 - share) * before + share * after))
    return found
