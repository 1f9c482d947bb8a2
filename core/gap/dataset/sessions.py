# SPDX-License-Identifier: GPL-3.0-or-later
"""Sessions: recordings of one sensor in a known order, whose times are put on one clock.

What a sensor remembers goes on from one recording of a session to the next. A rig names sessions, or its time stamps show that
one clock went on through all recordings.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import FileError
from ...io.input_files import is_number
from .trial import Trial

ONE_CLOCK = "one clock"
"""Name of the session of recordings whose time stamps go on."""
UNKNOWN_PAUSE = 1.0
"""Seconds between two recordings of a session if nothing says how long the pause was."""
LONGEST_TIME = 1e10
"""Seconds, three centuries: largest time of the start of a recording."""


@dataclass(frozen=True)
class TrialHistory:
    """What the rig says of a recording's place in time.

    Attributes
    ----------
    session : str
        Name of the session; empty if none is given.
    started : float or None, s
        When its first sample was taken.
    has_date : bool or None
        True if the start was given as a date rather than as seconds; None without a start.
    """

    session: str = ""
    started: float | None = None
    has_date: bool | None = None


def read_history(session: str, started: Any, where: str) -> TrialHistory:
    """Return what the words `session` and `started` of a [[trial]] say; `where` names the trial in messages.

    Raises
    ------
    FileError
        The start is no time, or there is one without a session.
    """
    if started is None:
        return TrialHistory(session)
    if not session:
        raise FileError(f'{where} has started and no session: write session = "NAME" on all recordings that belong together.')
    date = started
    if isinstance(started, str):
        with suppress(ValueError):
            date = datetime.fromisoformat(started.strip())
    if isinstance(date, datetime):
        return TrialHistory(session, _seconds_of(date), True)
    if not is_number(started) or abs(started) > LONGEST_TIME:
        raise FileError(f'started of {where} is {started!r:.60}: write seconds, or a date and time as "2026-05-04T09:30:00".')
    return TrialHistory(session, float(started), False)


def _seconds_of(date: datetime) -> float:
    """Seconds since 1970; a date without a zone counts as that of Greenwich, because only differences matter."""
    from datetime import UTC

    return (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()


def on_common_clocks(
    trials: Sequence[Trial], histories: Sequence[TrialHistory], clock: str | None, path: Path
) -> tuple[list[Trial], list[str]]:
    """Return the trials with the times of their sessions, in the given order, and remarks.

    A trial that belongs to no session keeps its distance to the first sample of all such trials.

    Parameters
    ----------
    trials : sequence of Trial
        With the times of their files.
    histories : sequence of TrialHistory
    clock : "absolute", "own" or None
        None: time stamps that go on are one clock.
    path : Path
        Of the rig, for messages.

    Raises
    ------
    FileError
        The recordings of a session overlap, or only some of them say when they started.
    """
    trials, said = list(trials), list[str]()
    names = list(dict.fromkeys(history.session for history in histories if history.session))
    if not names and clock != "own" and len(trials) > 1:
        goes_on = _go_on(trials) and not _is_mixed(trials)
        if clock == "absolute" and not goes_on:
            raise FileError(
                f"'{path.name}' has clock = \"absolute\", but two of its recordings overlap in time or have "
                'stimuli of different kinds: correct that, or write clock = "own".'
            )
        if goes_on:
            began = min(float(trial.time[0]) for trial in trials)
            if clock is None:
                said.append(
                    "The time stamps go on from recording to recording, so they are one session: what the sensor remembers "
                    'goes on, too (clock = "own" in the rig if each was recorded with a fresh sensor).'
                )
            return [replace(trial, time=trial.time - began, session=ONE_CLOCK) for trial in trials], said
    alone = [float(trial.time[0]) for trial, history in zip(trials, histories, strict=True) if not history.session]
    for i, history in enumerate(histories):
        if not history.session:
            trials[i] = replace(trials[i], time=trials[i].time - min(alone))
    for name in names:
        members = [i for i, history in enumerate(histories) if history.session == name]
        if _is_mixed([trials[i] for i in members]):
            raise FileError(
                f"Session '{name}' of '{path.name}' has recordings with a known force and others with a depth or a pose: "
                "give the two kinds sessions of their own."
            )
        starts, unknown = _starts([trials[i] for i in members], [histories[i] for i in members], clock, path)
        for i, start in zip(members, starts, strict=True):
            time = trials[i].time
            trials[i] = replace(trials[i], time=time - time[0] + start, session=name)
        if unknown and len(members) > 1:
            said.append(
                f"Nothing says how long the pauses of session '{name}' were: {UNKNOWN_PAUSE:g} s each were assumed; "
                "started says when a recording began."
            )
    return trials, said


def _go_on(trials: Sequence[Trial]) -> bool:
    """True if each trial begins after the one before it ended, in order of their beginnings."""
    order = sorted(trials, key=lambda trial: float(trial.time[0]))
    return all(after.time[0] > before.time[-1] for before, after in zip(order[:-1], order[1:], strict=True))


def _is_mixed(trials: Sequence[Trial]) -> bool:
    """True if forces are known in some trials and depths in others: no state of a sensor goes on between them."""
    return len({trial.stimulus == "force" for trial in trials}) > 1


def _starts(members: list[Trial], histories: list[TrialHistory], clock: str | None, path: Path) -> tuple[np.ndarray, bool]:
    """When the recordings of one session begin, in seconds since the first of them, and whether pauses were assumed."""
    name = histories[0].session
    given = [history.started for history in histories]
    if any(start is not None for start in given):
        if any(start is None for start in given) or len({history.has_date for history in histories}) > 1:
            raise FileError(
                f"Some recordings of session '{name}' in '{path.name}' have no started, or in another form: "
                "write it on all of them, as seconds or as dates."
            )
        starts = np.array(given, float)
        order = np.argsort(starts, kind="stable")
        for before, after in zip(order[:-1], order[1:], strict=True):
            ends = starts[before] + float(np.ptp(members[before].time))
            if starts[after] <= ends:
                raise FileError(
                    f"'{members[after].name}.csv' of session '{name}' starts {ends - starts[after]:.3g} s before "
                    f"'{members[before].name}.csv' has ended: correct started in '{path.name}'."
                )
        return starts - starts.min(), False
    if clock != "own" and _go_on(members):
        starts = np.array([float(trial.time[0]) for trial in members])
        return starts - starts.min(), False
    lengths = [float(np.ptp(trial.time)) + UNKNOWN_PAUSE for trial in members]
    return np.concatenate([[0.0], np.cumsum(lengths)[:-1]]), True
