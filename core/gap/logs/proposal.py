# SPDX-License-Identifier: GPL-3.0-or-later
"""What logs seem to be: a proposal of answers, each with the reason for it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...errors import FileError, counted
from .answers import UNKNOWN, Answers, ColumnAnswer, LoggerAnswer, RecordingAnswer, Repeated, Use
from .column_meaning import (
    READING_UNITS,
    Family,
    Meaning,
    families,
    force_unit,
    is_since_1970,
    length_unit,
    meaning_of,
    name_and_unit,
    temperature_unit,
    time_unit,
)
from .log_table import FEWEST_ROWS, FRAMES, LogFile, LogTable, with_distinct_names
from .unnamed_columns import (
    ONE_ROW_PITCH,
    contact_of,
    correlation,
    is_force,
    is_steady,
    is_unnamed,
    is_unordered,
    names_of_what_drove,
)

POSE, TURN, FORCE = ("x", "y", "z"), ("qw", "qx", "qy", "qz"), ("force_x", "force_y", "force_z")
BEGINNING = 0.05
"""Share of a recording at its beginning whose median counts as the value without load."""
AT_AN_END, AT_REST, RESTS = 0.05, 0.03, 0.05
"""A load is zero at its beginning if that is so near to an end of its range, and so large a share (the third) of the samples is
within so much of it."""
ZERO_SHARE = 0.02
"""Share of its range by which a known force must be off zero without load, for a zero to be proposed."""
SAME_COLUMNS = 0.5
"""Share of the columns of two files that both have, from which on they are of one kind: settings that were saved with them, and
topics that were silent, differ from file to file; two loggers share no more than the name of the time."""
ANSWERS = 6.0
"""Texels answer if they leave their noise by so many times it."""
FLAT = "it presses all texels alike, as a plate does: for a ball write x, y and z instead, and [indenter]"
"""Of a depth."""
MOST_NAMED = 12
"""Names in a sentence."""
CHECK_EVERY = 3
"""One recording in so many is proposed for `check`, as whole recordings; of two recordings the second."""


def propose(logs: Sequence[LogFile], name: str = "rig") -> Answers:
    """Return what some logs seem to be.

    Parameters
    ----------
    logs : sequence of LogFile
        The files of one measurement; several become trials.
    name : str
        Of the rig.

    Raises
    ------
    FileError
        There are no logs, two have the same name, or there are files of more than two kinds.
    """
    if not logs:
        raise FileError("No logs are given: name at least one file.")
    logs = with_distinct_names(logs)
    groups = _loggers(logs)
    columns = [_Columns(group) for group in groups]
    _name_by_behaviour(columns)
    found = [one.answers() for one in columns]
    _choose_stimulus(columns, found)
    _say_what_lacks(columns, found)
    loggers = tuple(LoggerAnswer(tuple(log.name for log in group), own) for group, own in zip(groups, found, strict=True))
    sensor, indenter, why, unsure = _sensor(columns, found)
    notes = [note for log in logs for note in log.notes]
    notes += [note for one in columns for note in one.left_out(found[columns.index(one)])]
    return Answers(name, sensor, indenter, loggers, _recordings(groups), why, unsure, tuple(dict.fromkeys(notes)))


# --- which files belong together


def _loggers(logs: Sequence[LogFile]) -> list[list[LogFile]]:
    """Return the files by kind: those that share most of their columns."""
    found: list[list[LogFile]] = []
    for log in logs:
        own = _column_names(log)
        for group in found:
            other = _column_names(group[0])
            least = 1.0 if is_unnamed([*own, *other]) else SAME_COLUMNS  # numbers of columns are no names that two files share
            if len(own & other) >= least * len(own | other):
                group.append(log)
                break
        else:
            found.append([log])
    if len(found) == 1 and len(logs) > 1 and is_unnamed([name for t in logs[0].tables for name in t.columns]):
        apart: dict[tuple[str, ...], list[LogFile]] = {}
        for log in logs:
            apart.setdefault(tuple(re.findall(r"[A-Za-z]+", log.stem)), []).append(log)
        parts = list(apart.values())
        numbers = [sorted(re.findall(r"\d+", log.stem) for log in part) for part in parts]
        if len(parts) == 2 and numbers[0] == numbers[1]:  # without names of columns, those of the files tell the loggers
            found = parts
    if len(found) > 2:
        kinds = "; ".join(f"'{group[0].name}' and {len(group) - 1} others" for group in found[:4])
        raise FileError(
            f"The logs have {len(found)} kinds of columns ({kinds}): give those of one sensor, of at most two loggers."
        )
    return found


def _column_names(log: LogFile) -> set[str]:
    return {table.full_name(name) for table in log.tables for name in table.columns}


def _recordings(groups: Sequence[Sequence[LogFile]]) -> tuple[RecordingAnswer, ...]:
    first = groups[0]
    uses: list[Use] = [
        "check" if len(first) > 1 and (i % CHECK_EVERY == CHECK_EVERY - 1 or len(first) == 2 and i == 1) else "fit"
        for i in range(len(first))
    ]
    if len(groups) == 1:
        return tuple(RecordingAnswer(log.stem, (log.name,), use) for log, use in zip(first, uses))
    others = list(groups[1])
    found = []
    for log, use in zip(first, uses):
        other, why = _partner(log, others, len(first) == len(groups[1]), first)
        files = (log.name, UNKNOWN if other is None else other.name)
        found.append(RecordingAnswer(log.stem, files, use, why=why, sure=other is not None))
    return tuple(found)


def _partner(
    log: LogFile, others: list[LogFile], is_complete: bool, all_first: Sequence[LogFile]
) -> tuple[LogFile | None, str]:
    """Return the file of the other logger that belongs to a file, and why."""
    if len(others) == 1 and len(all_first) == 1:
        return others[0], "one file of each logger"
    numbers = re.findall(r"\d+", log.stem)
    same = [other for other in others if re.findall(r"\d+", other.stem) == numbers]
    if len(same) == 1 and numbers:
        return same[0], f"both files have the number {' '.join(numbers)} in their names"
    words = set(re.findall(r"[a-z]+|\d+", log.stem.lower()))
    ranked = sorted(others, key=lambda other: -len(words & set(re.findall(r"[a-z]+|\d+", other.stem.lower()))))
    if len(ranked) > 1 and is_complete:
        counts = [len(words & set(re.findall(r"[a-z]+|\d+", other.stem.lower()))) for other in ranked]
        if counts[0] > counts[1]:
            return ranked[0], "their names have the most in common"
    return None, "which file of the other logger belongs to it is not known, write its name"


# --- which column is what


class _Columns:
    """The columns of one logger: their names over all tables, and their values in all of its files."""

    def __init__(self, logs: Sequence[LogFile]):
        self.logs = logs
        self.tables = logs[0].tables
        self.names = [table.full_name(name) for table in self.tables for name in table.columns]
        self.units = {table.full_name(name): unit for table in self.tables for name, unit in table.units.items()}
        self.meanings = {name: self._meaning(name) for name in self.names}
        self.families: list[Family] = []
        self.candidates: dict[str, list[str]] = {}
        self.behaviours: dict[str, str] = {}
        """Why unnamed columns are what they are taken for."""
        self.is_unnamed_sensor = False
        self.has_texels = True

    def _meaning(self, full: str) -> Meaning:
        table, _, short = full.rpartition("/")
        found = meaning_of(short)
        if not found.quantity or found.weight == 1:  # the topic or the group may say more
            longer = meaning_of(f"{table.rpartition('/')[2]} {short}") if table else found
            found = longer if longer.weight > found.weight else found
        return replace(found, unit=self.units.get(full, found.unit) or found.unit)

    def values(self, full: str, log: LogFile | None = None) -> np.ndarray:
        """Return the values of a column in one file, or in all of them."""
        chosen = self.logs if log is None else [log]
        parts = [
            table.columns[name]
            for one in chosen
            for table in one.tables
            for name in table.columns
            if table.full_name(name) == full
        ]
        return np.concatenate(parts) if parts else np.zeros(0)

    def span(self, full: str) -> float:
        """Return how far the values of a column reach, without the outermost thousandth."""
        known = self.values(full)[np.isfinite(self.values(full))]
        return float(np.ptp(np.percentile(known, [0.1, 99.9]))) if len(known) else 0.0

    def rests_at_its_beginning(self, full: str) -> bool:
        """Return whether a load begins at an end of its range and stays there for a while, as without contact."""
        for log in self.logs:
            values = self.values(full, log)
            values = values[np.isfinite(values)]
            if not len(values):
                continue
            low, high = np.percentile(values, [0.5, 99.5])
            start = float(np.median(values[: max(8, int(BEGINNING * len(values)))]))
            is_end = min(start - low, high - start) <= AT_AN_END * (high - low)
            if not is_end or (np.abs(values - start) <= AT_REST * (high - low)).mean() < RESTS:
                return False
        return True

    def deviation(self, full: str) -> tuple[float, float]:
        """Return the value without load, and how far the values leave it on the side on which they do so most."""
        zeros, ways = [], []
        for log in self.logs:
            values = self.values(full, log)
            values = values[np.isfinite(values)]
            if len(values):
                zeros.append(float(np.median(values[: max(8, int(BEGINNING * len(values)))])))
                low, high = np.percentile(values, [0.5, 99.5]) - zeros[-1]
                ways.append(float(high if high > -low else low))
        return (zeros[0], max(ways, key=abs)) if zeros else (0.0, 0.0)

    def answers(self) -> dict[str, ColumnAnswer]:
        """Return what each quantity seems to come from."""
        self._leave_out_what_has_no_clock()
        for name, meaning in self.meanings.items():
            if meaning.quantity and (self.span(name) > 0.0 or meaning.quantity in (*POSE, *TURN, *FORCE)):
                self.candidates.setdefault(meaning.quantity, []).append(name)
        found: dict[str, ColumnAnswer] = {"time": self._time()}
        taken = {name for names in self.candidates.values() for name in names} | set(self.clocks(found["time"]))
        self.families = families([name for name in self.names if name not in taken], self._follows)
        for group in (POSE, TURN, FORCE):
            found |= self._vector(group)
        for quantity in ("depth", "force", "slide_x", "slide_y", "temperature"):
            if names := self.candidates.get(quantity):
                found[quantity] = self._one(quantity, names)
        if self.families and self.has_texels:
            found["texel"] = self._texel()
        return found

    @property
    def texels(self) -> tuple[str, ...]:
        """The columns that are taken for texels."""
        return self.families[0].columns if self.families else ()

    def driver(self) -> str | None:
        """Return the column that seems to press: a force, else a depth or a height; None if no column does."""
        for quantity in ("force", "force_z", "depth", "z"):
            moving = [name for name in self.candidates.get(quantity, []) if self.span(name) > 0.0]
            if moving:
                return max(moving, key=lambda name: self.meanings[name].weight)
        return None

    def _follows(self, name: str) -> float:
        """Return the correlation of a column with what presses, over all files, without its sign."""
        driver = self.driver()
        if driver is None:
            return 0.0
        found = []
        for log in self.logs:
            load, values = self.values(driver, log), self.values(name, log)
            if len(load) > FEWEST_ROWS < len(values):  # topics have other rates
                load = np.interp(np.linspace(0.0, 1.0, len(values)), np.linspace(0.0, 1.0, len(load)), load)
                found.append(correlation(load, values))
        return float(np.median(found)) if found else 0.0

    def _leave_out_what_has_no_clock(self) -> None:
        """Forget tables that are shorter than those with a clock and have none: settings, and results of fits.

        In a table that is not the longest a column has to be called a time: a planned path rises like a clock, too.
        """
        if len(self.tables) < 2:
            return
        longest = max(table.sample_count for table in self.tables)
        clocks = {
            table.name: [
                full
                for full in map(table.full_name, table.columns)
                if self._rises(full) and (table.sample_count == longest or self.meanings[full].quantity == "time")
            ]
            for table in self.tables
        }
        lengths = {table.sample_count for table in self.tables if clocks[table.name]}
        kept = [table for table in self.tables if clocks[table.name] or table.sample_count in lengths]
        if kept:
            self.tables = tuple(kept)
            self.names = [table.full_name(name) for table in kept for name in table.columns]
            self.meanings = {name: self.meanings[name] for name in self.names}

    def _time(self) -> ColumnAnswer:
        names = self.candidates.pop("time", [])
        rising = [name for name in names if self._rises(name)] or [
            name for name in self.names if self._rises(name, strictly=True)
        ]
        if not rising and names:
            unit = time_unit(self.values(names[0], self.logs[0]), self.meanings[names[0]].unit)[0]
            return ColumnAnswer((names[0],), unit, why="of its name")
        if self.logs[0].kind == FRAMES:
            return ColumnAnswer((), rate=1.0, why="each file is a frame without a time, in the order of the load", sure=False)
        driver = self.driver()
        unordered = driver is not None and all(is_unordered(self.values(driver, log)) for log in self.logs)
        if unordered and all(self._counts_rows(name) for name in rising):
            why = "the load jumps from row to row and no column is a clock: these are points, which are sorted by the load"
            return ColumnAnswer((), rate=1.0, why=why, sure=False)
        if not rising:
            return ColumnAnswer(
                (UNKNOWN,), why="no column rises like a clock; write its name, or { rate = … } in Hz", sure=False
            )
        shorts = {name.rpartition("/")[2] for name in rising}
        best = max(rising, key=lambda name: (self.meanings[name].weight, name.rpartition("/")[2] == "time"))
        unit, why, sure = time_unit(self.values(best, self.logs[0]), self.meanings[best].unit)
        short = best.rpartition("/")[2]
        per_table = len(self.tables) > 1 and all(short in table.columns for table in self.tables)
        self.candidates.pop("time", None)
        repeats, share = self._repeats(best)
        is_named = self.meanings[best].quantity == "time" and (per_table or len(shorts) == 1)
        why = why if is_named else f"{why}; it is the column that rises like a clock"
        if share:
            why = f"{why}; {share:.0%} of the stamps repeat, which looks as if they were coarser than the samples"
        counts_from_1970 = len(rising) == 1 and self.span(best) > 0.0 and is_since_1970(self.values(best, self.logs[0]), unit)
        return ColumnAnswer(
            (short if per_table else best,),
            unit,
            why=why,
            sure=(sure and (is_named or counts_from_1970) or per_table) and not share,
            repeated=repeats,
        )

    def clocks(self, time: ColumnAnswer) -> list[str]:
        """Return the columns that are the clock, and unnamed ones that rise with it."""
        if UNKNOWN in time.names or not time.names:
            return []
        own = [name for name in self.names if name in time.names or name.rpartition("/")[2] in time.names]
        if len(own) == 1 and is_unnamed(self.names):
            clock = self.values(own[0], self.logs[0])
            own += [name for name in self.names if name != own[0] and is_steady(clock, self.values(name, self.logs[0]))]
        return own

    def _repeats(self, name: str) -> tuple[Repeated, float]:
        steps = np.concatenate([np.diff(self.values(name, log)) for log in self.logs])
        share = float((steps == 0).mean()) if len(steps) else 0.0
        return ("spread", share) if share > 0.02 else ("mean" if share else "refuse", 0.0)

    def _rises(self, name: str, strictly: bool = False) -> bool:
        for log in self.logs:
            values = self.values(name, log)
            if not len(values):
                continue  # not in this file
            steps = np.diff(values[np.isfinite(values)])
            if len(steps) < 7 or (steps < 0).any() or not steps.any() or (strictly and (steps == 0).mean() > 0.3):
                return False
        return True

    def _counts_rows(self, name: str) -> bool:
        """Return whether a column only counts the rows."""
        return self.meanings[name].quantity != "time" and all(
            len(self.values(name, log)) and set(np.diff(self.values(name, log))) == {1.0} for log in self.logs
        )

    def _vector(self, group: Sequence[str]) -> dict[str, ColumnAnswer]:
        """Return the columns of a vector: all from one table and of one way of naming, the one that says most."""
        families: dict[tuple[str, str], dict[str, str]] = {}
        for quantity in group:
            for name in self.candidates.get(quantity, []):
                table, _, short = name.rpartition("/")
                stem = (
                    ""
                    if name in self.behaviours
                    else re.sub(r"[xyzwXYZW](?=[^A-Za-z]*$|[ _(\[].*$)", "", name_and_unit(short)[0], count=1)
                )
                families.setdefault((table, stem), {}).setdefault(quantity, name)
        families = {key: own for key, own in families.items() if any(self.span(name) > 0.0 for name in own.values())}
        if not families:
            return {}
        best = max(families.values(), key=lambda own: (len(own), sum(self.meanings[name].weight for name in own.values())))
        others = [own for own in families.values() if own is not best and len(own) == len(best)]
        found = {quantity: self._one(quantity, [best[quantity]]) for quantity in group if quantity in best}
        if others:
            other = next(iter(others[0].values()))
            found = {
                quantity: replace(one, sure=False, why=f"{one.why}; '{other}' could be meant as well")
                for quantity, one in found.items()
            }
        return found

    def _one(self, quantity: str, names: Sequence[str]) -> ColumnAnswer:
        """Return a quantity of a single column, with its unit."""
        name = max(names, key=lambda one: self.meanings[one].weight)
        stated = self.meanings[name].unit
        if quantity in ("x", "y", "z", "depth", "slide_x", "slide_y"):
            group = [one for one in POSE if quantity in POSE for one in self.candidates.get(one, [])] or [name]
            unit, why, sure = length_unit(max(self.span(one) for one in group), stated)
        elif quantity.startswith("q"):
            unit, why, sure = "", "of its name", True
        elif quantity == "temperature":
            unit, why, sure = temperature_unit(self.values(name, self.logs[0]), stated)
        else:
            unit, why, sure = force_unit(stated, self.span(name))
            if quantity in FORCE and self._is_ros(name):
                unit, why, sure = "N", "ROS says so", True
        if self._is_ros(name) and not stated and quantity in (*POSE, "slide_x", "slide_y"):
            unit, why, sure = "m", "ROS says so", True
        if name in self.behaviours:
            why = f"{self.behaviours[name]}; {why}"
        weak = self.meanings[name].weight == 1 and not set(POSE) <= set(self.candidates)
        if len(names) > 1:
            other = next(one for one in names if one != name)
            why, sure = f"{why}; '{other}' could be meant as well", False
        return ColumnAnswer((name,), unit, why=why, sure=sure and not weak)

    def _is_ros(self, name: str) -> bool:
        return name.startswith("/") and self.logs[0].kind != "table of text"

    def _texel(self) -> ColumnAnswer:
        best, *others = self.families
        units = {self.meanings[name].unit for name in best.columns}
        unit = units.pop() if len(units) == 1 else ""
        what = f"{len(best.columns)} columns differ by a number" if len(best.columns) > 1 else "its name is a word for readings"
        what = f"the {counted(len(best.columns), 'column')} beside the clock" if self.is_unnamed_sensor else what
        rivals = [one for one in others if len(one.columns) > 2]
        if rivals:
            listed_ones = ", ".join(f"{listed(one.columns)}: {one.follows:.2f}" for one in rivals[:MOST_NAMED])
            what = f"{what}; they follow the load by {best.follows:.2f}, others that could be meant: {listed_ones}"
        is_clear = not rivals or best.is_named and not any(one.is_named for one in rivals)
        return ColumnAnswer(best.columns, unit, why=what, sure=(best.is_named or self.is_unnamed_sensor) and is_clear)

    def answers_of(self, name: str) -> float:
        """Return how far a column leaves its noise from sample to sample, in units of that."""
        return max(contact_of(self.values(name, log)) for log in self.logs)

    def left_out(self, found: Mapping[str, ColumnAnswer]) -> list[str]:
        """Return a sentence about the columns that nothing is made of."""
        used = {name for one in found.values() for name in one.names}
        rest = [name for name in self.names if name not in used and name.rpartition("/")[2] not in used]
        if not rest:
            return []
        return [f"'{self.logs[0].name}': not used: {listed(rest)}."]


# --- what drove the sensor, and what answered


def _name_by_behaviour(columns: Sequence[_Columns]) -> None:
    """Of two loggers whose columns have no names, say which was the sensor, and what the columns of the other one are."""
    if len(columns) != 2 or not all(is_unnamed(one.names) for one in columns):
        return
    driver, sensor = sorted(columns, key=lambda one: len(one.names))
    if len(driver.names) == len(sensor.names):
        return
    clocks = driver.clocks(driver.answers()["time"])
    driver.candidates.clear()
    found = names_of_what_drove({name: driver.values(name) for name in driver.names if name not in clocks})
    if not found:
        return
    for name in driver.names:
        quantity, why = found.get(name, ("", ""))
        driver.meanings[name] = Meaning(quantity, "", 2 if quantity else 0)
        driver.behaviours[name] = why
    driver.has_texels = False
    sensor.is_unnamed_sensor = True


def _choose_stimulus(columns: Sequence[_Columns], found: list[dict[str, ColumnAnswer]]) -> None:
    """Keep one stimulus in the answers: a pose, else a depth, else a force; and turn signs as a rig has them."""
    owner = {quantity: i for i, own in enumerate(found) for quantity in own}
    has_texels = "texel" in owner
    if set(POSE) <= set(owner):
        _drop(found, ("depth",))
        _force_is_response(columns, found, owner)
    elif "depth" in owner or "z" in owner:
        i = owner["depth" if "depth" in owner else "z"]
        own = found[i].pop("z") if "depth" not in owner else found[i]["depth"]
        _drop(found, (*POSE, *TURN))
        zero, way = columns[i].deviation(own.names[0])
        silent = _silent_texels(columns, found, owner)
        if "depth" not in owner and silent:
            _press_at_a_place(found[i], replace(own, sure=False), silent, way)
            _force_is_response(columns, found, owner)
            _read_in_newtons(found)
            return
        if "depth" not in owner:
            own = replace(own, zero=zero, sure=False, why=f"{own.why}; it is one axis, taken from where it begins; {FLAT}")
        elif silent:
            own = replace(own, sure=False, why=f"{own.why}; {silent} never answer, and a depth is that of all texels; {FLAT}")
        found[i]["depth"] = replace(own, factor=-1.0 if way < 0.0 else 1.0)
        _force_is_response(columns, found, owner)
    elif has_texels and ("force" in owner or "force_z" in owner):
        _drop(found, (*POSE, *TURN))
        i = owner["force" if "force" in owner else "force_z"]
        own = found[i]["force"] if "force" in owner else found[i].pop("force_z")
        _drop(found, FORCE)
        zero, way = columns[i].deviation(own.names[0])
        why = own.why
        if is_force(columns[i].values(own.names[0])):
            zero, way = 0.0, abs(way)  # a recording may begin under load
        elif not columns[i].rests_at_its_beginning(own.names[0]):
            zero, way = 0.0, float(np.nanmedian(columns[i].values(own.names[0])))
            why = f"{why}; nothing shows it without load, so no zero is subtracted"
        is_off = abs(zero) > ZERO_SHARE * abs(way)
        why = f"{why}; it is {zero:.4g} without load, which is subtracted" if is_off else why
        own = replace(
            own, factor=-1.0 if way < 0.0 else 1.0, zero=zero if is_off else 0.0, why=why, sure=own.sure and not is_off
        )
        found[i]["force"] = own
    _read_in_newtons(found)


def _silent_texels(columns: Sequence[_Columns], found: Sequence[Mapping[str, ColumnAnswer]], owner: Mapping[str, int]) -> str:
    """Return how many texels do not answer where others do, in words; empty if that is not most of them."""
    if "texel" not in owner:
        return ""
    own = columns[owner["texel"]]
    names = found[owner["texel"]]["texel"].names
    follow = np.array([own.answers_of(name) for name in names])
    count = int((follow < ANSWERS).sum())
    return f"{count} of {len(names)} texels" if (follow >= ANSWERS).any() and count > len(names) / 2 else ""


def _press_at_a_place(own: dict[str, ColumnAnswer], axis: ColumnAnswer, silent: str, way: float) -> None:
    """Make one axis the height of an indenter at a place, because most texels never answer."""
    where = "of the indenter in the sensor's frame, m; a number where it does not move"
    own["x"] = ColumnAnswer((), constant=0.0, why=where, sure=False)
    own["y"] = ColumnAnswer((), constant=0.0, why=where, sure=False)
    why = f"{axis.why}; it is one axis, and {silent} never answer: something smaller than the sensor presses"
    own["z"] = replace(axis, factor=1.0 if way < 0.0 else -1.0, why=why)


def _drop(found: list[dict[str, ColumnAnswer]], quantities: Sequence[str]) -> None:
    for own in found:
        for quantity in quantities:
            own.pop(quantity, None)


def _force_is_response(columns: Sequence[_Columns], found: list[dict[str, ColumnAnswer]], owner: Mapping[str, int]) -> None:
    """A force beside a motion is the net force on the sensor: it points down when something presses from above."""
    if "force_z" not in owner and "force" in owner:
        found[owner["force"]]["force_z"] = found[owner["force"]].pop("force")
    else:
        _drop(found, ("force",))
    for i, own in enumerate(found):
        if "force_z" in own:
            name = own["force_z"].names[0]
            rests = columns[i].rests_at_its_beginning(name)
            way = columns[i].deviation(name)[1] if rests else float(np.nanmedian(columns[i].values(name)))
            if way > 0.0:
                why = "turned: it rises under load, and the force on the sensor points down"
                for quantity in FORCE:
                    if quantity in own:
                        own[quantity] = replace(own[quantity], factor=-1.0, why=f"{own[quantity].why}; {why}")


def _read_in_newtons(found: list[dict[str, ColumnAnswer]]) -> None:
    for own in found:
        if "texel" in own and own["texel"].unit in READING_UNITS:
            own["texel"] = replace(own["texel"], why=f"{own['texel'].why}; {own['texel'].unit} becomes newtons")


def _say_what_lacks(columns: Sequence[_Columns], found: list[dict[str, ColumnAnswer]]) -> None:
    """Ask for what no column seems to be."""
    owner = {quantity for own in found for quantity in own}
    names, others = listed(columns[0].names), listed(columns[-1].names)
    if not owner & {"depth", "force"} and not set(POSE) <= owner:
        own = ColumnAnswer(
            (UNKNOWN,), "m", why=f"nothing looks like what drove the sensor; depth, force or x y z ({names})", sure=False
        )
        found[0]["depth"] = own
    if not owner & {"texel", "force_z"}:
        own = ColumnAnswer((UNKNOWN,), why=f"nothing looks like readings; name the column of each texel ({others})", sure=False)
        found[-1]["texel"] = own


def _sensor(
    columns: Sequence[_Columns], found: Sequence[Mapping[str, ColumnAnswer]]
) -> tuple[dict[str, Any], dict[str, Any], dict[str, str], frozenset[str]]:
    """Return [sensor] and [indenter], why, and which words are not sure."""
    texels = next((own["texel"] for own in found if "texel" in own), None)
    is_pose = any(set(POSE) <= set(own) for own in found)
    count = len(texels.names) if texels else 1
    rows, across, reason, unsure = _grid_of(count, columns)
    if any(one.is_unnamed_sensor for one in columns) and not is_pose:
        rows, across, reason, unsure = 1, count, f"{counted(count, 'channel')} in one row, as no log has their places", set()
    is_free = not is_pose and (count == 1 or not unsure and rows == 1)
    pitch: Any = [ONE_ROW_PITCH, ONE_ROW_PITCH] if is_free else [UNKNOWN, UNKNOWN]
    why = {"grid": reason + ("; its size has no influence here" if is_free else "; pitch along x and y in metres")}
    sensor: dict[str, Any] = {"grid": {"rows": rows, "columns": across, "pitch": pitch}}
    if texels is not None:
        unit = texels.unit
        sensor["unit"] = "N" if unit in READING_UNITS else unit or "counts"
        why["unit"] = "of the readings" if unit else "no unit is stated; any name will do"
    if any("depth" in own and own["depth"].zero or "x" in own and own["x"].constant is not None for own in found):
        sensor["contact_height"] = "free"
        why["contact_height"] = "where contact begins is fitted, because the motion only tells where it began"
    indenter: dict[str, Any] = {}
    if is_pose:
        indenter = {"shape": {"sphere": UNKNOWN}}
        why["shape"] = "what presses: a ball of this radius (m); or { box = [x, y, z] }, { cylinder = [radius, height] }"
    return sensor, indenter, why, frozenset(unsure)


def _grid_of(count: int, columns: Sequence[_Columns]) -> tuple[int, int, str, set[str]]:
    for one in columns:
        for table in one.tables:
            for rows, across in table.grids.values():
                if rows * across == count:
                    return rows, across, f"the array has {rows} rows and {across} columns", set()
    if count == 1:
        return 1, 1, "one texel", set()
    rows = max(i for i in range(1, int(count**0.5) + 1) if count % i == 0)
    return count // rows, rows, f"{count} texels; the number of rows is a guess", {"grid"}


def listed(names: Sequence[str]) -> str:
    """Return names for a sentence; those that differ by their last number are one, and of many the first are named."""
    families: dict[str, list[str]] = {}
    for name in names:
        families.setdefault(re.sub(r"\d+(?=\D*$)", "#", name), []).append(name)
    found = [own[0] if len(own) == 1 else f"{own[0]} … {own[-1]}" for own in families.values()]
    return ", ".join(found[:MOST_NAMED]) + (f" and {len(found) - MOST_NAMED} more" if len(found) > MOST_NAMED else "")


def table_of(tables: Sequence[LogTable], name: str) -> tuple[LogTable, str] | None:
    """Return the table that has a column of a name, full or short, and its name in that table."""
    for table in tables:
        for own in table.columns:
            if table.full_name(own) == name:
                return table, own
    for table in tables:
        if name in table.columns:
            return table, name
    return None
