# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes a rig from logs and answers: ``rig.toml`` and CSV files in SI units, and in comments what was taken for what."""

from __future__ import annotations

import fnmatch
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...errors import FileError
from ...io.csv_table import LARGEST_NUMBER
from ...io.file_writing import atomic_write, writable_folder, write_text
from ...io.hidden_folder import FileList
from ...jobs import Job, Progress
from ..dataset.column_names import POSE, QUANTITIES, Column
from ..dataset.rig import FORMAT, Rig, read_rig
from ..dataset.second_logger import at_times
from .answers import Answers, RecordingAnswer
from .clock_alignment import clock_shift
from .column_behaviour import LEAST_CONTACT, contact_of, correlation, finite, is_unordered, missing_code
from .column_meaning import SINCE_1970
from .guess import toml_value
from .log_table import FEWEST_ROWS, LogFile, LogTable, with_distinct_names

RIG_NAME = "rig.toml"
LONGEST_PAUSE = 10.0
"""Pause between two samples, in usual steps, from which on it is mentioned."""
LARGEST_MOTION, LARGEST_FORCE, SMALLEST_MOTION = 1.5, 1e4, 1e-7
"""Metres and newtons beyond which a unit must be wrong: rigs for touch move by less and press with less than a ton."""
FOLLOWS = 0.5
"""Correlation of a response with the stimulus from which on there is contact, however large the noise from sample to sample."""
SECOND_LOGGER = "_readings"
"""End of the name of a second logger's CSV file."""
DIGITS = 10
"""Significant digits of the numbers in the CSV files."""


@dataclass(frozen=True)
class NewRig:
    """Files of a new rig.

    Attributes
    ----------
    path : Path
        Of the rig.
    rig : Rig
        As read from that file.
    notes : tuple of str
        Remarks for the user, a sentence each; they stand in the rig as comments, too.
    """

    path: Path
    rig: Rig
    notes: tuple[str, ...]


def write_rig(logs: Sequence[LogFile], answers: Answers, folder: str | os.PathLike) -> Job[NewRig]:
    """Write a rig.

    Parameters
    ----------
    logs : sequence of LogFile
    answers : Answers
    folder : path
        Created if it is missing. The rig of an earlier call in it is replaced.

    Yields
    ------
    Progress
        Before each recording.

    Raises
    ------
    PalpateError
        The answers and the logs do not fit together, a unit must be wrong, a recording shows no contact, time stamps cannot be
        used, or a file cannot be written. An earlier rig is then as it was.
    """
    logs = with_distinct_names(logs, [file for one in answers.recordings for file in one.files])
    folder = writable_folder(folder, create=True)
    recordings = [one for one in answers.recordings if one.use != "leave out"]
    if not recordings:
        raise FileError("All recordings are to be left out: keep at least one.")
    names = _file_names(recordings, folder, logs)
    by_name = {log.name: log for log in logs}
    files = FileList(folder)
    with files.new_files("rig") as new:
        notes: list[str] = []
        trials = []
        for number, recording in enumerate(recordings, start=1):
            yield Progress(recording.name, number, len(recordings) + 1)
            tables = [_columns_of(by_name, file, answers, notes) for file in recording.files]
            trials.append(_trial(recording, tables, names[recording.name], new, notes))
        text = _rig_text(answers, trials, notes)
        write_text(new / RIG_NAME, text)
        rig = read_rig(new / RIG_NAME)
        files.replace(new, {"rig": [*sorted(new.glob("*.csv")), new / RIG_NAME]})
    return NewRig(folder / RIG_NAME, rig, tuple(dict.fromkeys(notes)))


def _file_names(recordings: Sequence[RecordingAnswer], folder: Path, logs: Sequence[LogFile]) -> dict[str, str]:
    """Return the name of each recording's CSV file, without its ending; neither it nor that of a second logger is a log."""
    found: dict[str, str] = {}
    files: set[str] = set()
    for recording in recordings:
        if recording.name in found:
            raise FileError(f"Two recordings are called '{recording.name}': give each a name of its own.")
        plain = "".join(c if c.isalnum() or c in "-_." else "_" for c in recording.name).strip(".") or "recording"
        while not files.isdisjoint(own := {f"{plain}{end}.csv".lower() for end in ("", SECOND_LOGGER)}):
            plain += "_"
        found[recording.name] = plain
        files |= own
    for log in logs:
        for name in (RIG_NAME, *(f"{one}{end}.csv" for one in found.values() for end in ("", SECOND_LOGGER))):
            if (folder / name).exists() and log.path.exists() and os.path.samefile(folder / name, log.path):
                raise FileError(f"'{log.path}' is read and would be overwritten: write the rig into another folder.")
    return found


# --- one recording


def _columns_of(logs: Mapping[str, LogFile], file: str, answers: Answers, notes: list[str]) -> dict[str, np.ndarray]:
    """Return the columns of a file by the names and in the units of a rig, on one clock."""
    log = logs.get(file)
    if log is None:
        raise FileError(f"The answers name the file '{file}', which was not given: give it, or remove its [[recording]].")
    logger = next((one for one in answers.loggers if any(fnmatch.fnmatchcase(file, pattern) for pattern in one.files)), None)
    if logger is None:
        raise FileError(f"No [[logger]] of the answers has the file '{file}': add its name to files of one.")
    tables: dict[str, tuple[LogTable, dict[str, np.ndarray]]] = {}
    for quantity, answer in logger.columns.items():
        for i, name in enumerate(answer.names if quantity != "time" else ()):
            found = _table_of(log.tables, name)
            if found is None:
                raise FileError(f"'{file}' has no column '{name}', which the answers name for {quantity}: check its name.")
            table, own = found
            values = table.columns[own]
            if answer.missing is None and (code := missing_code(values)) is not None:
                raise FileError(
                    f"'{own}' of '{file}' is {code:g} in {(values == code).mean():.0%} of its samples, and its neighbours are "
                    f"far away: write missing = {code} at {quantity} if no value was measured there, or missing = any other "
                    "number."
                )
            column = f"texel_{i}" if quantity == "texel" else quantity
            tables.setdefault(table.name, (table, {}))[1][column] = answer.in_si(quantity, values)
    if not tables:
        raise FileError(f"The answers use no column of '{file}': name its columns, or leave the file out.")
    clock = logger.columns.get("time")
    if clock is None:
        raise FileError(f"The answers name no time of '{log.name}': name its column, or write time = {{ rate = 100.0 }}.")
    parts = [
        _on_clock({"time": _time_of(log, table, clock, next(iter(columns))), **columns}, log, notes)
        for table, columns in tables.values()
    ]
    made = _on_one_clock(parts, log, notes)
    for quantity, answer in logger.columns.items():
        if answer.constant is not None:
            made[quantity] = np.full(len(made["time"]), answer.constant)
    load = next((made[one] for one in ("force", "depth", "z", "force_z") if one in made), None)
    if clock.rate and load is not None and is_unordered(load):
        order = np.argsort(load, kind="stable")
        notes.append(
            f"'{log.name}': its rows are points in no order; they were sorted by the load, and show no effect of time."
        )
        made = {name: column if name == "time" else column[order] for name, column in made.items()}
    return made


def _table_of(tables: Sequence[LogTable], name: str) -> tuple[LogTable, str] | None:
    """Return the table that has a column of a name, full or short, and its name in that table."""
    by_full = ((table, own) for table in tables for own in table.columns if table.full_name(own) == name)
    return next(by_full, None) or next(((table, name) for table in tables if name in table.columns), None)


def _time_of(log: LogFile, table: LogTable, clock: Column, column: str) -> np.ndarray:
    """Return the time stamps of a table, of which `column` is one, in seconds."""
    if clock.rate:
        return np.arange(table.sample_count) / clock.rate
    for name in clock.names:
        found = _table_of([table], name) or _table_of(log.tables, name)
        if found is None:
            continue
        values = found[0].columns[found[1]]
        if len(values) != table.sample_count:
            raise FileError(
                f"'{name}' of '{log.name}' has {len(values)} stamps for {table.sample_count} samples of '{column}': name the "
                "clock of these samples."
            )
        return clock.in_si("time", values)
    raise FileError(f"'{log.name}' has no column '{clock.names[0]}', which the answers name for time: check its name.")


def _on_clock(columns: dict[str, np.ndarray], log: LogFile, notes: list[str]) -> dict[str, np.ndarray]:
    """Return columns with a clock that rises: without samples that have no stamp, and with equal stamps spread."""
    name = log.name
    known = np.isfinite(columns["time"])
    if not known.all():
        notes.append(f"'{name}': {int((~known).sum())} samples without a time were left out.")
        columns = {key: column[known] for key, column in columns.items()}
    time = columns["time"]
    (back,) = np.nonzero(np.diff(time) < 0)
    if len(back):
        raise FileError(
            f"The time of '{name}' goes backwards after sample {back[0] + 1} ({time[back[0] + 1]:.10g} s after "
            f"{time[back[0]]:.10g} s): cut the file where the clock was reset, or sort it."
        )
    same = [(c[1:] == c[:-1]) | np.isnan(c[1:]) & np.isnan(c[:-1]) for c in columns.values()]
    is_twice = np.append(False, np.all(same, axis=0))
    if is_twice.any():
        notes.append(f"'{name}': {int(is_twice.sum())} samples that are there twice, with one stamp, were left out.")
        columns = {key: column[~is_twice] for key, column in columns.items()}
    share = float((np.diff(columns["time"]) == 0).mean())
    if share:
        columns["time"] = _spread(columns["time"])
        notes.append(f"'{name}': samples with equal stamps ({share:.1%}) were spread evenly up to the next stamp.")
    steps = np.diff(columns["time"])
    if len(steps) and steps.max() > LONGEST_PAUSE * (usual := float(np.median(steps))):
        notes.append(f"'{name}': the longest pause between two samples is {steps.max():.3g} s, the usual step {usual:.3g} s.")
    return columns


def _spread(time: np.ndarray) -> np.ndarray:
    """Return stamps of which equal ones are spread evenly up to the next; the last ones as densely as usual."""
    stamps, first, counts = np.unique(time, return_index=True, return_counts=True)
    if len(stamps) < 2:
        raise FileError("All time stamps are equal: write time = { rate = … } with the samples per second.")
    last = float(np.median(np.diff(stamps) / counts[:-1]) * counts[-1])
    return np.interp(np.arange(len(time)), np.append(first, len(time)), np.append(stamps, stamps[-1] + last))


def _on_one_clock(parts: list[dict[str, np.ndarray]], log: LogFile, notes: list[str]) -> dict[str, np.ndarray]:
    """Return the columns of tables with one clock at the times of the readings, or of what was sampled least."""
    if len(parts) == 1:
        return parts[0]
    texels = [part for part in parts if any(name.startswith("texel_") for name in part)]
    if len(texels) > 1:
        raise FileError(f"The texels of '{log.name}' are in {len(texels)} tables: give those of one table.")
    base = texels[0] if texels else min(parts, key=lambda part: len(part["time"]))
    inside = np.all([(base["time"] >= part["time"][0]) & (base["time"] <= part["time"][-1]) for part in parts], axis=0)
    if inside.sum() < 8:
        raise FileError(f"The topics of '{log.name}' have less than eight samples at the same time: record them together.")
    found = {name: column[inside] for name, column in base.items()}
    for part in parts:
        if part is not base:
            found |= at_times(part, found["time"])
            names = [name for name in base if name != "time"]
            notes.append(
                f"'{log.name}': {', '.join(sorted(set(part) - {'time'}))} (every {_step(part):.3g} s) were interpolated "
                f"at the times of {' … '.join(dict.fromkeys((names[0], names[-1])))} (every {_step(base):.3g} s)."
            )
    return found


def _step(part: Mapping[str, np.ndarray]) -> float:
    return float(np.median(np.diff(part["time"])))


# --- a trial and its files


def _trial(
    recording: RecordingAnswer, tables: list[dict[str, np.ndarray]], name: str, folder: Path, notes: list[str]
) -> list[str]:
    """Check a recording, write its files, and return the lines of its [[trial]]."""
    tables.sort(key=lambda table: any(one in table for one in ("x", "depth", "force")), reverse=True)
    tables[0] = _used_part(recording, tables[0])
    for table in tables:
        _check_sizes(table, recording.name)
    lines = ["[[trial]]", f'file = "{name}.csv"', f'use = "{recording.use}"']
    driven, answered = tables[0], tables[-1]
    start, second = float(driven["time"][0]), float(answered["time"][0])
    if answered is not driven:
        second = start if abs(second - start) < 86400.0 else second
        late, why = _lateness(recording, driven, answered, start - second)
        notes.append(f"'{recording.name}': {why}.")
        lines += [f"# {why}", f"readings = {toml_value({'file': f'{name}{SECOND_LOGGER}.csv', 'late': late})}"]
    _check_contact(answered, recording.name)
    _write_csv(folder / f"{name}.csv", driven, start)
    if answered is not driven:
        _write_csv(folder / f"{name}{SECOND_LOGGER}.csv", answered, second)
    stamp = f"times count from {start:.3f} s of the log's clock; " if abs(start) > 1e-9 else ""
    return [*lines, f"# {stamp}read from {', '.join(recording.files)}", ""]


def _used_part(recording: RecordingAnswer, table: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the part of a recording that the answers name: what was recorded before and after is left out."""
    if recording.begin is None and recording.end is None:
        return table
    since = table["time"] - table["time"][0]
    begin = -np.inf if recording.begin is None else recording.begin
    end = np.inf if recording.end is None else recording.end
    used = (since >= begin) & (since <= end)
    if np.count_nonzero(used) < FEWEST_ROWS:
        raise FileError(
            f"'{recording.name}' lasts {since[-1]:.6g} s and has fewer than {FEWEST_ROWS} samples from {max(begin, 0.0):g} s "
            f"to {min(end, since[-1]):g} s: write other seconds."
        )
    return {name: column[used] for name, column in table.items()}


def _lateness(
    recording: RecordingAnswer, driven: dict[str, np.ndarray], answered: dict[str, np.ndarray], apart: float
) -> tuple[float, str]:
    """Return how late the second clock is, by the zeros of both files, and why.

    What both loggers saw is compared: a force where the first one has it, else the motion.
    """
    if recording.late is not None:
        return recording.late + apart, f"the answers say that the second clock is {recording.late:.6g} s late"
    cause = next((driven[one] for one in ("force_z", "force", "depth", "z") if one in driven), None)
    answer = _response(answered)
    if cause is None or answer is None:
        raise FileError(
            f"The two files of '{recording.name}' need z, depth or force in one and texel or force_z in the other: name these "
            "columns."
        )
    found = clock_shift((driven["time"], cause), (answered["time"], answer))
    if min(driven["time"][0], answered["time"][0]) > SINCE_1970:
        seen = f" (changes agree best with {found.late:.2g} s)" if found and found.is_sure else ""
        return apart, f"the two clocks show the time of day and count as one{seen}: late = … in its [[recording]] shifts one"
    if found is None or not found.is_sure:
        best = "do not change" if found is None else f"agree best with a shift of {found.late:.4g} s ({found.quality})"
        raise FileError(
            f"The two files of '{recording.name}' {best}, which does not tell how late the second clock is: write late = … in "
            "seconds into its [[recording]], 0 if one computer stamped both."
        )
    why = f"the second clock is {found.late:.6g} s late, by the correlation of changes ({found.quality})"
    return round(found.late + apart, 6), why


def _response(table: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """Return one curve of all readings, counted from their medians and turned alike; without readings the force, if any."""
    names = [name for name in table if name.startswith("texel_")]
    if not names:
        return table.get("force_z")
    values = np.stack([table[name] - np.nanmedian(table[name]) for name in names], axis=1)
    low, high = np.nanmin(values, axis=0), np.nanmax(values, axis=0)
    return np.nanmean(values * np.where(-low > high, -1.0, 1.0), axis=1)


def _check_sizes(table: Mapping[str, np.ndarray], name: str) -> None:
    """Refuse values whose unit must be wrong."""
    wrong = "its unit in the answers must be wrong"
    known = {quantity: finite(column) for quantity, column in table.items() if np.isfinite(column).any()}
    for quantity, values in known.items():
        span, size, kind = float(np.ptp(values)), float(np.abs(values).max()), QUANTITIES.get(quantity)
        if kind == "m" and span > LARGEST_MOTION:
            raise FileError(f"{quantity} of '{name}' moves by {span:.4g} m: {wrong}, write mm or um.")
        if kind == "N" and size > LARGEST_FORCE:
            raise FileError(f"{quantity} of '{name}' reaches {size:.4g} N: {wrong}, write mN or g.")
    motion = max((np.ptp(values) for quantity, values in known.items() if quantity in (*POSE, "depth")), default=0.0)
    if 0.0 < motion < SMALLEST_MOTION:
        raise FileError(f"The motion of '{name}' spans {motion:.3g} m: {wrong}, write mm or m.")
    step = _step(table)
    if not 1e-6 <= step <= 5.0:
        raise FileError(f"The samples of '{name}' are {step:.3g} s apart: the unit of time in the answers must be wrong.")


def _check_contact(table: Mapping[str, np.ndarray], name: str) -> None:
    """Refuse a recording in which nothing answers, or nothing drives."""
    for group in (("depth", "force"), POSE):
        own = [finite(table[one]) for one in group if one in table]
        if own and not any(len(values) and np.ptp(values) > 0.0 for values in own):
            raise FileError(f"What drove the sensor does not change in '{name}': leave it out, or check which column it is.")
    responses = [column for quantity, column in table.items() if quantity.startswith(("texel_", "force_"))]
    best = max((contact_of(column) for column in responses), default=0.0)
    driver = next((table[one] for one in ("force", "depth", "z") if one in table), None)
    follows = 0.0 if driver is None else max((correlation(driver, column) for column in responses), default=0.0)
    if best < LEAST_CONTACT and follows < FOLLOWS:
        raise FileError(
            f"'{name}' shows no contact: its readings never leave their noise ({best:.1f} times, and {LEAST_CONTACT:g} would "
            f'be contact) and follow what drove the sensor by {follows:.2f}; write use = "leave out" at its [[recording]], or '
            "check which columns the readings are."
        )


def _write_csv(path: Path, table: Mapping[str, np.ndarray], start: float) -> None:
    """Write a table; the times count from `start`."""
    columns = {name: values - start if name == "time" else values for name, values in table.items()}
    large = [name for name, values in columns.items() if np.nanmax(np.abs(values), initial=0.0) > LARGEST_NUMBER]
    if large:
        raise FileError(f"{large[0]} of '{path.stem}' is too large for anything measured: check its unit in the answers.")
    with atomic_write(path) as temporary, open(temporary, "w", encoding="utf-8", newline="\n") as file:
        file.write(",".join(columns) + "\n")
        for row in zip(*columns.values(), strict=True):
            file.write(",".join("" if value != value else f"{value:.{DIGITS}g}" for value in row) + "\n")


# --- the rig


def _rig_text(answers: Answers, trials: Sequence[Sequence[str]], notes: Sequence[str]) -> str:
    """Return the rig, with the answers and their reasons as comments."""
    lines = [f'format = "{FORMAT}"', f"name = {toml_value(answers.name)}", "", "# Made from logs by `palpate rig new`, with"]
    lines += [f"#   {line}".rstrip() for line in answers.text.splitlines() if not line.startswith("#")]
    lines += [f"# {note}" for note in dict.fromkeys(notes)]
    for table, words in (("sensor", answers.sensor), ("indenter", answers.indenter)):
        if words:
            lines += ["", f"[{table}]", *(f"{word} = {toml_value(value)}" for word, value in words.items())]
    return "\n".join([*lines, "", *(line for trial in trials for line in trial)])
