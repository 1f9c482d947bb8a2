# SPDX-License-Identifier: GPL-3.0-or-later
"""Proposal for logs: guesses, each with its reason."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...errors import FileError
from ..dataset.column_names import FORCE, POSE, PRESSURES, READING_UNITS, TURN
from .answers import Use
from .column_behaviour import LEAST_CONTACT, contact_of, correlation, is_clock, is_force, is_unnamed, is_unordered, missing_code
from .column_meaning import (
    Family,
    Meaning,
    families,
    is_rate,
    is_since_1970,
    meaning_of,
    name_and_unit,
    time_unit,
    unit_of,
)
from .guess import UNKNOWN, Guess, Proposal
from .log_table import FEWEST_ROWS, FRAMES, LogFile, LogTable, with_distinct_names

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
ONE_TEXEL_PITCH = 0.01
"""Metres of a single texel, all of whose area shares what presses: its size has no influence."""
FLAT = "it presses all texels alike, as a plate does: for a ball write x, y and z instead, and [indenter]"
"""Of a depth."""
MOST_NAMED = 12
"""Names in a sentence."""
CHECK_EVERY = 3
"""One recording in so many is proposed for `check`, as whole recordings; of two recordings the second."""

Columns = dict[str, Guess]
"""Sources of the quantities of a logger."""


def propose(logs: Sequence[LogFile], name: str = "rig") -> Proposal:
    """Return the proposal for some logs.

    Parameters
    ----------
    logs : sequence of LogFile
        The files of one measurement; several become trials.
    name : str
        Of the rig.

    Raises
    ------
    FileError
        There are no logs, two have the same name, one is shorter than a recording, or there are files of more than two kinds.
    """
    if not logs:
        raise FileError("No logs are given: name at least one file.")
    logs = with_distinct_names(logs)
    for log in logs:
        if max(table.sample_count for table in log.tables) < FEWEST_ROWS and log.kind != FRAMES:
            raise FileError(
                f"'{log.path.name}' has less than {FEWEST_ROWS} samples, and a recording needs as many: leave it out."
            )
    loggers = [_Logger(group, number) for number, group in enumerate(_groups(logs))]
    found = [one.columns() for one in loggers]
    _keep_one_sensor(loggers, found)
    _choose_stimulus(loggers, found)
    _say_what_lacks(loggers, found)
    guesses = [Guess("", "name", name), *_sensor(loggers, found)]
    for logger, columns in zip(loggers, found, strict=True):
        guesses.append(Guess("logger", "files", [log.name for log in logger.logs], number=logger.number))
        guesses += columns.values()
    notes = [note for log in logs for note in log.notes]
    notes += [note for logger, columns in zip(loggers, found, strict=True) for note in logger.left_out(columns)]
    return Proposal((*guesses, *_recordings(loggers)), tuple(dict.fromkeys(notes)))


# --- which files belong together


def _groups(logs: Sequence[LogFile]) -> list[list[LogFile]]:
    """Return the files by kind: those that share most of their columns."""
    found: list[list[LogFile]] = []
    for log in logs:
        own = _names_of(log)
        for group in found:
            other = _names_of(group[0])
            least = 1.0 if is_unnamed([*own, *other]) else SAME_COLUMNS  # numbers of columns are no names that two files share
            if len(own & other) >= least * len(own | other):
                group.append(log)
                break
        else:
            found.append([log])
    if len(found) > 2:
        kinds = "; ".join(f"'{group[0].name}' and {len(group) - 1} others" for group in found[:4])
        raise FileError(
            f"The logs have {len(found)} kinds of columns ({kinds}): give those of one sensor, of at most two loggers."
        )
    return found


def _names_of(log: LogFile) -> set[str]:
    return {table.full_name(name) for table in log.tables for name in table.columns}


def _recordings(loggers: Sequence[_Logger]) -> list[Guess]:
    first = loggers[0].logs
    found = []
    for i, log in enumerate(first):
        use: Use = "check" if i % CHECK_EVERY == CHECK_EVERY - 1 or len(first) == 2 and i == 1 else "fit"
        files, reason = [log.name], ""
        if len(loggers) == 2:
            other, reason = _partner(log, loggers[1].logs, len(first) == 1)
            files.append(other)
        words = {"name": (log.stem, ""), "files": (files, reason), "use": (use, "")}
        found += [Guess("recording", word, value, why, number=i, of=log.name) for word, (value, why) in words.items()]
    return found


def _partner(log: LogFile, others: Sequence[LogFile], is_alone: bool) -> tuple[str, str]:
    """Return the name of the file of the other logger that belongs to a file, and why."""
    numbers = re.findall(r"\d+", log.stem)
    same = [other for other in others if re.findall(r"\d+", other.stem) == numbers]
    if len(others) == 1 and is_alone:
        return others[0].name, "one file of each logger"
    if len(same) == 1 and numbers:
        return same[0].name, f"both files have the number {' '.join(numbers)} in their names"
    return UNKNOWN, "which file of the other logger belongs to it is not known, write its name"


# --- which column is what


class _Logger:
    """The columns of one logger: their names over all tables, and their values in all of its files."""

    def __init__(self, logs: Sequence[LogFile], number: int):
        self.logs, self.number = logs, number
        self.tables = _with_clocks(logs)
        self.names = [table.full_name(name) for table in self.tables for name in table.columns]
        self.units = {table.full_name(name): unit for table in self.tables for name, unit in table.units.items()}
        self.meanings = {name: self._meaning(name) for name in self.names}
        self.missing = {name: code for name in self.names if (code := self._missing_code(name)) is not None}
        self.families: list[Family] = []
        self.candidates: dict[str, list[str]] = {}

    def _meaning(self, full: str) -> Meaning:
        table, _, short = full.rpartition("/")
        found = meaning_of(short)
        if not found.quantity or found.weight == 1:  # the topic or the group may say more
            longer = meaning_of(f"{table.rpartition('/')[2]} {short}") if table else found
            found = longer if longer.weight > found.weight else found
        return replace(found, unit=self.units.get(full, found.unit) or found.unit)

    def guess(self, quantity: str, value: Any, reason: str, is_thin: bool = False) -> Guess:
        """Return a guess about a quantity of this logger."""
        return Guess("logger.columns", quantity, value, reason, is_thin, self.number, self.logs[0].name)

    def values(self, full: str, log: LogFile | None = None) -> np.ndarray:
        """Return the values of a column in one file, or in all of them."""
        parts = [values for one in ([log] if log else self.logs) if len(values := _values(one.tables, full))]
        found = np.concatenate(parts) if parts else np.zeros(0)
        return np.where(found == self.missing[full], np.nan, found) if full in self.missing else found

    def _missing_code(self, full: str) -> float | None:
        codes = (missing_code(_values(log.tables, full)) for log in self.logs)
        return next((code for code in codes if code is not None), None)

    def span(self, full: str) -> float:
        """Return how far the values of a column reach, without the outermost thousandth."""
        known = self.values(full)[np.isfinite(self.values(full))]
        return float(np.ptp(np.percentile(known, [0.1, 99.9]))) if len(known) else 0.0

    def beginning(self, full: str) -> tuple[float, float, bool]:
        """Return the value at the beginning, how far the values leave it on the side on which they do so most, and whether they
        rest there at an end of their range, as without contact.
        """
        zeros, ways, rests = [], [], []
        for log in self.logs:
            values = self.values(full, log)
            values = values[np.isfinite(values)]
            if len(values):
                start = float(np.median(values[: max(8, int(BEGINNING * len(values)))]))
                low, high = np.percentile(values, [0.5, 99.5]) - start
                is_end = min(-low, high) <= AT_AN_END * (high - low)
                zeros.append(start)
                ways.append(float(high if high > -low else low))
                rests.append(is_end and (np.abs(values - start) <= AT_REST * (high - low)).mean() >= RESTS)
        return (zeros[0], max(ways, key=abs), all(rests)) if zeros else (0.0, 0.0, False)

    def columns(self) -> Columns:
        """Return the likely source of each quantity."""
        for name, meaning in self.meanings.items():
            if meaning.quantity and (self.span(name) > 0.0 or meaning.quantity in (*POSE, *TURN, *FORCE)):
                self.candidates.setdefault(meaning.quantity, []).append(name)
        found = {"time": self._time()}
        taken = {name for names in self.candidates.values() for name in names} | set(found["time"].columns)
        others = [name for name in self.names if name not in taken and name.rpartition("/")[2] not in taken]
        others = [name for name in others if not is_rate(self.meanings[name].unit)]
        no_clocks = [name for name in others if not self._rises(name, strictly=True)]
        self.families = families(no_clocks or others, self._follows)
        for group in (POSE, TURN, FORCE):
            found |= self._vector(group)
        for quantity in ("depth", "force", "slide_x", "slide_y", "temperature"):
            if names := self.candidates.get(quantity):
                found[quantity] = self._one(quantity, names)
        if self.families:
            found["texel"] = self._texel()
        return {quantity: self._with_missing(guess) for quantity, guess in found.items()}

    def _with_missing(self, guess: Guess) -> Guess:
        """Return a guess that says what its columns have where a value is missing, if they seem to have a number there."""
        for name in guess.columns:
            if name in self.missing:
                code = self.missing[name]
                return guess.but(f"{code:g} is where a value is missing, because its neighbours are far away", missing=code)
        return guess

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

    def _time(self) -> Guess:
        named = self.candidates.pop("time", [])
        rising = [name for name in named if self._rises(name)] or [
            name for name in self.names if self._rises(name, strictly=True)
        ]
        if not rising and named:
            unit = time_unit(self.values(named[0], self.logs[0]), self.meanings[named[0]].unit)[0]
            reason = "of its name, but it falls: cut the file where the clock was reset, or name another column"
            return self.guess("time", {"name": named[0], "unit": unit}, reason, is_thin=True)
        driver = self.driver()
        reason = ""
        if self.logs[0].kind == FRAMES:
            reason = (
                "each file is a frame without a time, in the order of the load; where rows are samples, name the files instead"
            )
        elif driver is not None and all(map(self._counts_rows, rising)) and self._is_unordered(driver):
            reason = "the load jumps from row to row and no column is a clock: these are points, which are sorted by the load"
        if reason:
            return self.guess("time", {"rate": 1.0}, reason, is_thin=True)
        if not rising:
            return self.guess("time", {"name": UNKNOWN}, "no column rises like a clock; write its name, or { rate = … } in Hz")
        best = max(rising, key=lambda name: (self.meanings[name].weight, name.rpartition("/")[2] == "time"))
        unit, reason, is_thin = time_unit(self.values(best, self.logs[0]), self.meanings[best].unit)
        short = best.rpartition("/")[2]
        is_of_each = len(self.tables) > 1 and all(short in table.columns for table in self.tables)
        is_only_named = {name.rpartition("/")[2] for name in rising} == {short} and self.meanings[best].quantity == "time"
        if is_of_each:
            is_thin = False
        elif not is_only_named:
            reason = f"{reason}; it is the column that rises like a clock"
            is_only_date = len(rising) == 1 and is_since_1970(self.values(best, self.logs[0]), unit)
            is_thin = is_thin or not is_only_date
        return self.guess("time", {"name": short if is_of_each else best, "unit": unit}, reason, is_thin)

    def _is_unordered(self, name: str) -> bool:
        return all(is_unordered(self.values(name, log)) for log in self.logs)

    def _rises(self, name: str, strictly: bool = False) -> bool:
        return all(is_clock(self.values(name, log), strictly) for log in self.logs if len(self.values(name, log)))

    def _counts_rows(self, name: str) -> bool:
        """Return whether a column only counts the rows."""
        return self.meanings[name].quantity != "time" and all(
            len(self.values(name, log)) and set(np.diff(self.values(name, log))) == {1.0} for log in self.logs
        )

    def _vector(self, group: Sequence[str]) -> Columns:
        """Return the columns of a vector: all from one table and of one way of naming, the one that says most."""
        named: dict[tuple[str, str], dict[str, str]] = {}
        for quantity in group:
            for name in self.candidates.get(quantity, []):
                table, _, short = name.rpartition("/")
                stem = re.sub(r"[xyzwXYZW](?=[^A-Za-z]*$|[ _(\[].*$)", "", name_and_unit(short)[0], count=1)
                named.setdefault((table, stem), {}).setdefault(quantity, name)
        moving = [own for own in named.values() if any(self.span(name) > 0.0 for name in own.values())]
        if not moving:
            return {}
        best = max(moving, key=lambda own: (len(own), sum(self.meanings[name].weight for name in own.values())))
        found = {quantity: self._one(quantity, [best[quantity]]) for quantity in group if quantity in best}
        for other in moving:
            if other is not best and len(other) == len(best):
                why = f"'{next(iter(other.values()))}' could be meant as well"
                return {quantity: one.but(why, is_thin=True) for quantity, one in found.items()}
        return found

    def _one(self, quantity: str, names: Sequence[str]) -> Guess:
        """Return a quantity of a single column, with its unit."""
        name = max(names, key=lambda one: self.meanings[one].weight)
        stated = self.meanings[name].unit
        is_length = quantity in ("x", "y", "z", "depth", "slide_x", "slide_y")
        is_ros = name.startswith("/") and self.logs[0].kind != "table of text" and not stated
        if is_ros and is_length or is_ros and quantity in FORCE:
            unit, reason, is_thin = "m" if is_length else "N", "ROS says so", False
        elif is_length:
            group = [one for one in POSE if quantity in POSE for one in self.candidates.get(one, [])] or [name]
            unit, reason, is_thin = unit_of("m", stated, max(self.span(one) for one in group))
        elif quantity.startswith("q"):
            unit, reason, is_thin = "", "of its name", False
        elif quantity == "temperature":
            unit, reason, is_thin = unit_of("°C", stated, float(np.nanmedian(self.values(name, self.logs[0]))))
        else:
            unit, reason, is_thin = unit_of("N", stated, self.span(name))
        is_thin = is_thin or self.meanings[name].weight == 1 and not set(POSE) <= set(self.candidates)
        value = {"name": name, **({"unit": unit} if unit else {})}
        found = self.guess(quantity, value, reason, is_thin)
        others = [one for one in names if one != name]
        return found.but(f"'{others[0]}' could be meant as well", is_thin=True) if others else found

    def _texel(self) -> Guess:
        best, *others = self.families
        units = {self.meanings[name].unit for name in best.columns}
        unit = units.pop() if len(units) == 1 else ""
        what = f"{len(best.columns)} columns differ by a number" if len(best.columns) > 1 else "its name is a word for readings"
        rivals = [one for one in others if len(one.columns) > 2]
        if rivals:
            listed_ones = ", ".join(f"{listed(one.columns)}: {one.follows:.2f}" for one in rivals[:MOST_NAMED])
            what = f"{what}; they follow the load by {best.follows:.2f}, others that could be meant: {listed_ones}"
        is_clear = best.is_named and not any(one.is_named for one in rivals)
        value = _texel_words(best.columns) | ({"unit": unit} if unit else {})
        return self.guess("texel", value, what, not is_clear)

    def answers_of(self, name: str) -> float:
        """Return how far a column leaves its noise from sample to sample, in units of that."""
        return max(contact_of(self.values(name, log)) for log in self.logs)

    def described(self) -> str:
        """Return the columns for a question; how far those without a name reach is all that tells them apart."""
        if not is_unnamed(self.names):
            return listed(self.names)
        found = []
        for name in self.names[:MOST_NAMED]:
            low, high = np.nanpercentile(self.values(name), [0.1, 99.9])
            code = f", missing = {self.missing[name]}" if name in self.missing else ""
            found.append(f"{name}: {low:.4g} to {high:.4g}{code}" if low < high else f"{name}: {low:.4g}{code}")
        return ", ".join(found)

    def left_out(self, found: Columns) -> list[str]:
        """Return a sentence about the columns that nothing is made of."""
        used = {name for one in found.values() for name in one.columns}
        rest = [name for name in self.names if name not in used and name.rpartition("/")[2] not in used]
        return [f"'{self.logs[0].name}': not used: {listed(rest)}."] if rest else []


def _values(tables: Sequence[LogTable], full: str) -> np.ndarray:
    """Return the values of a column by its full name; none if no table has it."""
    return next(
        (table.columns[name] for table in tables for name in table.columns if table.full_name(name) == full), np.zeros(0)
    )


def _with_clocks(logs: Sequence[LogFile]) -> tuple[LogTable, ...]:
    """Return the tables without those that are shorter than the ones with a clock and have none: settings, and results of fits.

    In a table that is not the longest a column has to be called a time: a planned path rises like a clock, too.
    """
    tables = logs[0].tables
    longest = max(table.sample_count for table in tables)
    lengths = {
        table.sample_count
        for table in tables
        for name in table.columns
        if all(is_clock(values) for log in logs if len(values := _values(log.tables, table.full_name(name))))
        and (table.sample_count == longest or meaning_of(name).quantity == "time")
    }
    kept = tuple(table for table in tables if table.sample_count in lengths)
    return kept if kept and len(tables) > 1 else tables


def _texel_words(names: tuple[str, ...]) -> dict[str, Any]:
    """Return the names of texels as a pattern with a number, where they are one."""
    first, last = names[0], names[-1]
    for number in re.finditer(r"[1-9]\d*|0(?!\d)", first):
        pattern, start = first[: number.start()] + "{}" + first[number.end() :], int(number[0])
        if first != last and [pattern.replace("{}", str(start + i)) for i in range(len(names))] == list(names):
            return {"name": pattern, "first": start, "count": len(names)}
    return {"names": list(names)}


# --- what drove the sensor, and what answered


def _keep_one_sensor(loggers: Sequence[_Logger], found: Sequence[Columns]) -> None:
    """Of two loggers without names of columns the one with more of them has the texels."""
    if len(loggers) == 2 and all("texel" in own and is_unnamed(one.names) for one, own in zip(loggers, found, strict=True)):
        del found[min((0, 1), key=lambda i: len(loggers[i].names))]["texel"]


def _choose_stimulus(loggers: Sequence[_Logger], found: Sequence[Columns]) -> None:
    """Keep one stimulus: a pose, else a depth, else a force; and turn signs as a rig has them."""
    owner = {quantity: i for i, own in enumerate(found) for quantity in own}
    if set(POSE) <= set(owner):
        _drop(found, ("depth",))
        _force_is_response(loggers, found, owner)
    elif "depth" in owner or "z" in owner:
        _motion(loggers, found, owner, "depth" if "depth" in owner else "z")
        _force_is_response(loggers, found, owner)
    elif "texel" in owner and ("force" in owner or "force_z" in owner):
        i = owner["force" if "force" in owner else "force_z"]
        own = found[i]["force" if "force" in owner else "force_z"]
        _drop(found, (*POSE, *TURN, *FORCE))
        found[i]["force"] = _load(loggers[i], replace(own, word="force"))
    for columns in found:
        if "texel" in columns and (unit := columns["texel"].value.get("unit")) in READING_UNITS:
            columns["texel"] = columns["texel"].but(f"{unit} becomes newtons")


def _motion(loggers: Sequence[_Logger], found: Sequence[Columns], owner: Mapping[str, int], quantity: str) -> None:
    """Take one axis for a depth, or for the height of an indenter at a place where most texels never answer."""
    i = owner[quantity]
    own = found[i][quantity]
    _drop(found, (*POSE, *TURN))
    zero, way, _ = loggers[i].beginning(own.value["name"])
    silent = _silent_texels(loggers, found, owner)
    if quantity == "z" and silent:
        for axis in "xy":
            why = "of the indenter in the sensor's frame, m; a number where it does not move"
            found[i][axis] = loggers[i].guess(axis, 0.0, why, is_thin=True)
        why = f"it is one axis, and {silent} never answer: something smaller than the sensor presses"
        found[i]["z"] = _turned(own.but(why, is_thin=True), way > 0.0)
        return
    if quantity == "z":
        own = own.but(f"it is one axis, taken from where it begins; {FLAT}", is_thin=True, **({"zero": zero} if zero else {}))
    elif silent:
        own = own.but(f"{silent} never answer, and a depth is that of all texels; {FLAT}", is_thin=True)
    found[i]["depth"] = replace(_turned(own, way < 0.0), word="depth")


def _load(logger: _Logger, own: Guess) -> Guess:
    """Return a known force with its sign and, where the log shows it without load, its zero."""
    values = logger.values(own.value["name"])
    if own.value["unit"] in PRESSURES:
        own = replace(
            own.but(area=UNKNOWN), reason="the unit is that of the file; fill in the area on which the pressure acts, in m²"
        )
    if own.value["unit"] == UNKNOWN or is_force(values):  # a recording may begin under load
        return own
    zero, way, rests = logger.beginning(own.value["name"])
    if not rests:
        return _turned(own.but("nothing shows it without load, so no zero is subtracted"), bool(np.nanmedian(values) < 0.0))
    if abs(zero) > ZERO_SHARE * abs(way):
        own = own.but(f"it is {zero:.4g} without load, which is subtracted", is_thin=True, zero=zero)
    return _turned(own, way < 0.0)


def _turned(own: Guess, is_turned: bool, reason: str = "") -> Guess:
    return own.but(reason, factor=-1.0) if is_turned else own


def _silent_texels(loggers: Sequence[_Logger], found: Sequence[Columns], owner: Mapping[str, int]) -> str:
    """Return how many texels do not answer where others do, in words; empty if that is not most of them."""
    if "texel" not in owner:
        return ""
    i = owner["texel"]
    names = found[i]["texel"].columns
    answered = np.array([loggers[i].answers_of(name) for name in names]) >= LEAST_CONTACT
    count = int((~answered).sum())
    return f"{count} of {len(names)} texels" if answered.any() and count > len(names) / 2 else ""


def _drop(found: Sequence[Columns], quantities: Sequence[str]) -> None:
    for own in found:
        for quantity in quantities:
            own.pop(quantity, None)


def _force_is_response(loggers: Sequence[_Logger], found: Sequence[Columns], owner: Mapping[str, int]) -> None:
    """A force beside a motion is the net force on the sensor: it points down when something presses from above."""
    if "force_z" not in owner and "force" in owner:
        own = found[owner["force"]]
        own["force_z"] = replace(own.pop("force"), word="force_z")
    _drop(found, ("force",))
    for logger, own in zip(loggers, found, strict=True):
        if "force_z" in own:
            name = own["force_z"].value["name"]
            _, way, rests = logger.beginning(name)
            if (way if rests else float(np.nanmedian(logger.values(name)))) > 0.0:
                why = "turned: it rises under load, and the force on the sensor points down"
                own |= {axis: _turned(own[axis], True, why) for axis in FORCE if axis in own}


def _say_what_lacks(loggers: Sequence[_Logger], found: Sequence[Columns]) -> None:
    """Ask for what no column seems to be."""
    owner = {quantity for own in found for quantity in own}
    if not owner & {"depth", "force"} and not set(POSE) <= owner:
        i = next((i for i, own in enumerate(found) if "texel" not in own), 0)
        why = f"nothing looks like what drove the sensor; depth, force or x y z ({loggers[i].described()})"
        found[i]["depth"] = loggers[i].guess("depth", {"name": UNKNOWN, "unit": "m"}, why, is_thin=True)
    if not owner & {"texel", "force_z"}:
        why = f"nothing looks like readings; name the column of each texel ({loggers[-1].described()})"
        found[-1]["texel"] = loggers[-1].guess("texel", {"names": [UNKNOWN]}, why, is_thin=True)


def _sensor(loggers: Sequence[_Logger], found: Sequence[Columns]) -> list[Guess]:
    """Return the guesses about [sensor] and [indenter]."""
    texels = next((own["texel"] for own in found if "texel" in own), None)
    is_pose = any(set(POSE) <= set(own) for own in found)
    count = len(texels.columns) if texels else 1
    grid, reason = _grid_of(count, loggers)
    is_free = not is_pose and count == 1
    grid["pitch"] = [ONE_TEXEL_PITCH if is_free else UNKNOWN] * 2
    reason += "; its size has no influence here" if is_free else ", and the pitch along x and y in metres"
    guesses = [Guess("sensor", "grid", grid, reason)]
    if texels is not None:
        unit = texels.value.get("unit", "")
        why = "of the readings" if unit else "no unit is stated; any name will do"
        guesses.append(Guess("sensor", "unit", "N" if unit in READING_UNITS else unit or "counts", why))
    if any("depth" in own and "zero" in own["depth"].value or "x" in own and own["x"].value == 0.0 for own in found):
        why = "where contact begins is fitted, because the motion only tells where it began"
        guesses.append(Guess("sensor", "contact_height", "free", why))
    if is_pose:
        why = "what presses: a ball of this radius (m); or { box = [x, y, z] }, { cylinder = [radius, height] }"
        guesses.append(Guess("indenter", "shape", {"sphere": UNKNOWN}, why))
    return guesses


def _grid_of(count: int, loggers: Sequence[_Logger]) -> tuple[dict[str, Any], str]:
    for one in loggers:
        for table in one.tables:
            for rows, across in table.grids.values():
                if rows * across == count:
                    return {"rows": rows, "columns": across}, f"the array has {rows} rows and {across} columns"
    if count == 1:
        return {"rows": 1, "columns": 1}, "one texel"
    return {"rows": UNKNOWN, "columns": UNKNOWN}, f"{count} texels; their rows and columns"


def listed(names: Sequence[str]) -> str:
    """Return names for a sentence; those that differ by their last number are one, and of many the first are named."""
    families: dict[str, list[str]] = {}
    for name in names:
        families.setdefault(re.sub(r"\d+(?=\D*$)", "#", name), []).append(name)
    found = [own[0] if len(own) == 1 else f"{own[0]} … {own[-1]}" for own in families.values()]
    return ", ".join(found[:MOST_NAMED]) + (f" and {len(found) - MOST_NAMED} more" if len(found) > MOST_NAMED else "")
