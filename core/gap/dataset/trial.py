# SPDX-License-Identifier: GPL-3.0-or-later
"""One recording of a rig."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np

from ...errors import FileError
from ...io.input_files import is_number
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
UNLOADED_SHARE = 0.03
"""Share of the largest load of a trial up to which a texel counts as unloaded, and a weight as lifted: the zero of load cells
drifts."""


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
    travel : (T, 2) float, metres
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
    travel: np.ndarray
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

    @property
    def stays_pressed(self) -> np.ndarray:
        """(T - 1,) bool: True where a known force presses at both ends of the step from a sample to the next."""
        assert self.level is not None
        pressed = self.level > UNLOADED_SHARE * self.level.max(initial=0.0)
        return pressed[1:] & pressed[:-1]

    def later(self, seconds: float) -> Trial:
        """Return the recording with its samples and temperatures later by a time, seconds."""
        temperature = self.temperature and (self.temperature[0] + seconds, self.temperature[1])
        return replace(self, time=self.time + seconds, temperature=temperature)

    def without(self, rows: np.ndarray) -> Trial:
        """Return the recording without its responses in some samples, (T,) bool."""
        parts = [None if part is None else np.where(rows[:, None], np.nan, part) for part in (self.reading, self.force)]
        return replace(self, reading=parts[0], force=parts[1])

    def part(self, rows: slice) -> Trial:
        """Return the recording with some of its samples only."""
        names = ("time", "position", "quaternion", "level", "travel", "reading", "force")
        parts: dict[str, Any] = {name: getattr(self, name)[rows] for name in names if getattr(self, name) is not None}
        return replace(self, **parts)


def columns_at(wanted: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return columns (T,) or (T, c) at other times; before the first sample and after the last one they are as these."""
    return np.ascontiguousarray(np.apply_along_axis(lambda column: np.interp(wanted, time, column), 0, values))


def runs(flag: np.ndarray) -> list[tuple[int, int]]:
    """Return the first sample of each run in which a flag (T,) is set, and the sample after its end."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flag, [False]]).astype(int))).reshape(-1, 2)
    return [(int(a), int(b)) for a, b in edges]


FREE = "free"
"""Word in a rig for a number that is fitted."""
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


def check_free_heights(trials: Sequence[Trial], path: Path) -> None:
    """Raise FileError for a contact height that is free, if none of the recordings that share it is fitted."""
    fitted = {trial.contact_height for trial in trials if trial.use == "fit"}
    for trial in trials:
        if isinstance(trial.contact_height, str) and trial.contact_height not in fitted:
            raise FileError(
                f"The contact_height of '{trial.name}.csv' in '{path.name}' is free, and no recording with the same one has "
                'use = "fit": give it as a number, or fit one recording of its specimen.'
            )


# Sessions: recordings of one sensor in a known order, whose times are put on one clock. What a sensor remembers goes on from
# one recording of a session to the next. A rig names sessions, or its time stamps show that one clock went on.

ONE_CLOCK = "one clock"
"""Name of the session of recordings whose time stamps go on."""
UNKNOWN_PAUSE = 1.0
"""Seconds between two recordings of a session if nothing says how long the pause was."""
LONGEST_TIME = 1e10
"""Seconds, three centuries: largest time of the start of a recording, and largest shift of two clocks."""


Start = float | datetime | None
"""When the first sample of a recording was taken: seconds, a date with a zone, or unknown."""


def read_start(session: str, started: Any, where: str) -> Start:
    """Return the start from the words `session` and `started` of a [[trial]]; `where` names the trial in messages.

    Raises
    ------
    FileError
        The start is no time, or there is one without a session.
    """
    if started is None:
        return None
    if not session:
        raise FileError(f'{where} has started and no session: write session = "NAME" on all recordings that belong together.')
    date = started
    if isinstance(started, str):
        with suppress(ValueError):
            date = datetime.fromisoformat(started.strip())
    if isinstance(date, datetime):  # without a zone it counts as that of Greenwich, because only differences matter
        return date.replace(tzinfo=date.tzinfo or UTC)
    if not is_number(started) or abs(started) > LONGEST_TIME:
        raise FileError(f'started of {where} is {started!r:.60}: write seconds, or a date and time as "2026-05-04T09:30:00".')
    return float(started)


def on_common_clocks(
    trials: Sequence[Trial], starts: Sequence[Start], clock: str | None, path: Path
) -> tuple[list[Trial], list[str]]:
    """Return the trials with the times of their sessions, in the given order, and remarks.

    A trial that belongs to no session keeps its distance to the first sample of all such trials.

    Parameters
    ----------
    trials, starts : sequence of Trial, sequence of Start
        With the times of their files.
    clock : "absolute", "own" or None
        None: time stamps that go on are one clock.
    path : Path
        Of the rig, for messages.

    Raises
    ------
    FileError
        The recordings of a session overlap, or only some of them say when they started.
    """
    notes: list[str] = []
    names = list(dict.fromkeys(trial.session for trial in trials if trial.session))
    goes_on = not names and clock != "own" and len(trials) > 1 and _go_on(trials) and not is_mixed(trials)
    if clock == "absolute" and not names and len(trials) > 1 and not goes_on:
        raise FileError(
            f"'{path.name}' has clock = \"absolute\", but two of its recordings overlap in time or have "
            'stimuli of different kinds: correct that, or write clock = "own".'
        )
    if goes_on and clock is None:
        notes.append(
            "The time stamps go on from recording to recording, so they are one session: what the sensor remembers "
            'goes on, too (clock = "own" in the rig if each was recorded with a fresh sensor).'
        )
    began = min((float(trial.time[0]) for trial in trials if not trial.session), default=0.0)
    placed = [
        trial if trial.session else replace(trial.later(-began), session=ONE_CLOCK if goes_on else "") for trial in trials
    ]
    for name in names:
        members = [i for i, trial in enumerate(trials) if trial.session == name]
        own = [trials[i] for i in members]
        if is_mixed(own):
            raise FileError(
                f"Session '{name}' of '{path.name}' has recordings with a known force and others with a depth or a pose: "
                "give the two kinds sessions of their own."
            )
        begins, unknown = _begins(own, [starts[i] for i in members], clock, path)
        for i, trial, begin in zip(members, own, begins, strict=True):
            placed[i] = trial.later(-trial.time[0]).later(begin)
        if unknown and len(members) > 1:
            notes.append(
                f"Nothing says how long the pauses of session '{name}' were: {UNKNOWN_PAUSE:g} s each were assumed; "
                "started says when a recording began."
            )
    return placed, notes


def _go_on(trials: Sequence[Trial]) -> bool:
    """True if each trial begins after the one before it ended, in order of their beginnings."""
    order = sorted(trials, key=lambda trial: float(trial.time[0]))
    return all(after.time[0] > before.time[-1] for before, after in pairwise(order))


def is_mixed(trials: Sequence[Trial]) -> bool:
    """Return True if forces are known in some trials and depths in others: no state of a sensor goes on between them."""
    return len({trial.stimulus == "force" for trial in trials}) > 1


def _begins(members: list[Trial], starts: list[Start], clock: str | None, path: Path) -> tuple[np.ndarray, bool]:
    """When the recordings of one session begin, in seconds since the first of them, and whether pauses were assumed."""
    name = members[0].session
    if any(start is not None for start in starts):
        if len({type(start) for start in starts}) > 1:
            raise FileError(
                f"Some recordings of session '{name}' in '{path.name}' have no started, or in another form: "
                "write it on all of them, as seconds or as dates."
            )
        begins = np.array([start.timestamp() if isinstance(start, datetime) else start for start in starts], float)
        for before, after in pairwise(np.argsort(begins, kind="stable")):
            ends = begins[before] + float(np.ptp(members[before].time))
            if begins[after] <= ends:
                raise FileError(
                    f"'{members[after].name}.csv' of session '{name}' starts {ends - begins[after]:.3g} s before "
                    f"'{members[before].name}.csv' has ended: correct started in '{path.name}'."
                )
    elif clock != "own" and _go_on(members):
        begins = np.array([float(trial.time[0]) for trial in members])
    else:
        lengths = [float(np.ptp(trial.time)) + UNKNOWN_PAUSE for trial in members]
        return np.concatenate([[0.0], np.cumsum(lengths)[:-1]]), True
    return begins - begins.min(), False
