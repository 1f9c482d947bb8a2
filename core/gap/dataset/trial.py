# SPDX-License-Identifier: GPL-3.0-or-later
"""One recording of a rig."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np

from ...errors import FileError
from ...io.schema import Name, Switch, wanted

FAULT_KINDS = {
    "sign": "the other sign",
    "unit": "a wrong unit",
    "reversed-channels": "channels in another order",
    "swapped-channels": "swapped channels",
    "clock-shift": "clocks of stimulus and response that are shifted",
    "repeated-samples": "repeated samples",
    "stuck-logger": "a stuck logger",
    "saturated-converter": "a converter at its rail",
}
"""Kinds of faults, in words."""


@dataclass(frozen=True)
class Trial:
    """One recording.

    Attributes
    ----------
    name : str
        Of its file, without the suffix.
    use : "fit" or "check"
    time : (T,) float, seconds, increasing
        Since the first sample of its session, or of the rig's first recording.
    stimulus : "pose", "depth" or "force"
    position, quaternion : (T, 3), (T, 4) float, or None
        Of the indenter in the sensor's frame. With a known force they say where it acts; z has no meaning then.
    level : (T,) float or None
        Depth of all texels (m), or force that all texels share (N).
    slide : (T, 2) float, metres
        Travel of the surface along the sensor's x and y; zero if none was recorded.
    reading : (T, n) float or None, the sensor's unit
        NaN if a value is missing.
    force : (T, 3) float or None, newtons
        Net force on the sensor; NaN if a component is missing.
    session : str
        Name of the session in which the sensor's state goes on from recording to recording; empty if it belongs to none.
    tared : bool
        True if the responses of its first sample were subtracted from all its responses.
    factor, zero : str or float
        Numbers of this recording by which its readings differ from those of the sensor: they are multiplied (about the sensor's
        zero) and shifted. Of recordings without readings it is the net force that is multiplied. Free numbers have a name.
    force_zero : str or (3,) float, newtons
        What the force sensor shows without load; a name if it is free.
    contact_height : str or float, metres
        How much higher the sensor's surface is than poses or depths say: contact begins earlier by as much. A name if it is
        free. Without meaning in a recording with a known force.
    probe : str
        Name of the probe that pressed; empty for the rig's indenter.
    repeats : str
        Name of a group of recordings of the same stimulus; empty if it belongs to none.
    temperature : pair of (m,) float, or None
        Times (s, on the clock of `time`) and temperatures of the sensor (°C); None if none were recorded.
    height_start : float, metres
        Where the fit of a free contact height starts; contacts are described with this height.
    """

    name: str
    use: str
    time: np.ndarray
    stimulus: str
    position: np.ndarray | None
    quaternion: np.ndarray | None
    level: np.ndarray | None
    slide: np.ndarray
    reading: np.ndarray | None
    force: np.ndarray | None
    session: str = ""
    tared: bool = False
    factor: str | float = 1.0
    zero: str | float = 0.0
    force_zero: str | tuple[float, ...] = (0.0, 0.0, 0.0)
    contact_height: str | float = 0.0
    height_start: float = 0.0
    probe: str = ""
    repeats: str = ""
    temperature: tuple[np.ndarray, np.ndarray] | None = None

    @property
    def step(self) -> float:
        """Median time between samples, seconds."""
        return float(np.median(np.diff(self.time)))

    @property
    def responses(self) -> list[np.ndarray]:
        """Readings and net forces, those of both that were recorded."""
        return [part for part in (self.reading, self.force) if part is not None]

    @property
    def changes(self) -> bool:
        """True if any channel of the responses has two different values."""
        return any((np.fmax.reduce(part, axis=0) > np.fmin.reduce(part, axis=0)).any() for part in self.responses)


def runs(flag: np.ndarray) -> list[tuple[int, int]]:
    """Return the first sample of each run in which a flag (T,) is set, and the sample after its end."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flag, [False]]).astype(int))).reshape(-1, 2)
    return [(int(a), int(b)) for a, b in edges]


FREE = "free"
"""What a rig writes for a number that is fitted."""
SHARED_HEIGHT = "all"
"""Name of the contact height that all recordings share."""
LARGEST_HEIGHT = 1.0
"""Largest contact height, in metres: a larger one was given in millimetres."""
LARGEST_NUMBER = 1e6
"""Largest factor of a recording, whose inverse is the smallest, and largest zero."""

_Free = Literal["free"]
_Height = Annotated[float, wanted('write "free", or a number in metres', ge=-LARGEST_HEIGHT, le=LARGEST_HEIGHT)]
_Factor = Annotated[float, wanted('write "free" or a number above zero', ge=1.0 / LARGEST_NUMBER, le=LARGEST_NUMBER)]
_Zero = Annotated[float, wanted('write "free" or a number', ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]
_Newtons = Annotated[float, msgspec.Meta(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]
_Force = Annotated[tuple[_Newtons, ...], wanted('write "free", or three numbers in newtons', min_length=3, max_length=3)]


@dataclass(frozen=True)
class TrialWords:
    """The words of a [[trial]]; :class:`.Trial` says what they mean."""

    file: Any = None
    use: Literal["fit", "check"] = "fit"
    name: Any = None
    session: Name = ""
    started: Any = None
    tared: Switch = False
    specimen: Name = ""
    factor: _Free | _Factor = 1.0
    zero: _Free | _Zero = 0.0
    force_zero: _Free | _Force = (0.0, 0.0, 0.0)
    contact_height: _Free | _Height | None = None
    probe: Any = None
    repeats: Name = ""
    readings: Annotated[Mapping[str, Any], wanted('write { file = "readings.csv", late = 0.0 }')] | None = None

    def own_numbers(self, where: str) -> dict[str, Any]:
        """Return the own numbers of the trial; in the place of free ones the name that the recordings of a specimen share.

        Raises
        ------
        FileError
            It has a specimen and no free number.
        """
        numbers = {word: getattr(self, word) for word in ("factor", "zero", "force_zero", "contact_height")}
        if self.specimen and FREE not in numbers.values():
            raise FileError(f'{where} has a specimen and no free number: write factor = "free" or zero = "free".')
        name = self.specimen or Path(str(self.file)).stem
        return {word: name if value == FREE else value for word, value in numbers.items()}


@dataclass(frozen=True)
class SensorHeight:
    """The contact height of all recordings, from the rig's [sensor]."""

    contact_height: _Free | _Height = 0.0


def check_free_heights(trials: Sequence[Trial], path: Path) -> None:
    """Raise FileError for a contact height that is free, if none of the recordings that share it is fitted."""
    fitted = {trial.contact_height for trial in trials if trial.use == "fit"}
    for trial in trials:
        if isinstance(trial.contact_height, str) and trial.contact_height not in fitted:
            raise FileError(
                f"The contact_height of '{trial.name}.csv' in '{path.name}' is free, and no recording with the same one has "
                'use = "fit": give it as a number, or fit one recording of its specimen.'
            )
