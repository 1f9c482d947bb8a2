# SPDX-License-Identifier: GPL-3.0-or-later
"""Proposal for logs: guesses, each with its reason."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...errors import FileError
from ..dataset.column_names import FORCE, LOG_UNITS, NUMBER, POSE, PRESSURES, QUANTITIES, READING_UNITS, SLIDE, TURN, numbered
from .column_behaviour import LEAST_CONTACT, contact_of, correlation, finite, is_clock, is_force, is_unordered, missing_code
from .column_meaning import RATE, SINCE_1970, Family, families, meaning_in, meaning_of, name_and_unit, time_unit, unit_of
from .guess import UNKNOWN, Guess, Proposal
from .log_table import FEWEST_ROWS, LogFile, LogTable, with_distinct_names

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
        if max(table.sample_count for table in log.tables) < FEWEST_ROWS and not log.has_frames:
            raise FileError(
                f"'{log.path.name}' has less than {FEWEST_ROWS} samples, and a recording needs as many: leave it out."
            )
    loggers = [_Logger(group, number) for number, group in enumerate(_groups(logs))]
    if len(loggers) == 2 and all("texel" in one.found and _is_unnamed(one.names) for one in loggers):
        # of two loggers without names of columns the one with more of them has the texels
        del min(loggers, key=lambda one: len(one.names)).found["texel"]
    _choose_stimulus(loggers)
    _say_what_lacks(loggers)
    guesses = [Guess("", "name", name), *_sensor(loggers)]
    notes = [note for log in logs for note in log.notes]
    for logger in loggers:
        guesses.append(Guess("logger", "files", [log.name for log in logger.logs], number=logger.number))
        guesses += logger.found.values()
        if rest := logger.names_but({name for one in logger.found.values() for name in one.columns}):
            notes.append(f"'{logger.logs[0].name}': not used: {listed(rest)}.")
    return Proposal((*guesses, *_recordings(loggers)), tuple(dict.fromkeys(notes)))


# --- which files belong together


def _groups(logs: Sequence[LogFile]) -> list[list[LogFile]]:
    """Return the files by kind: those that share most of their columns."""
    found: list[list[LogFile]] = []
    for log in logs:
        own = set(log.columns)
        for group in found:
            other = set(group[0].columns)
            least = 1.0 if _is_unnamed(own | other) else SAME_COLUMNS  # numbers of columns are no names that two files share
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


def _recordings(loggers: Sequence[_Logger]) -> list[Guess]:
    first = loggers[0].logs
    found = []
    for i, log in enumerate(first):
        use = "check" if i % CHECK_EVERY == CHECK_EVERY - 1 or len(first) == 2 and i == 1 else "fit"
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


def _is_unnamed(names: Iterable[str]) -> bool:
    """Return True if the columns of a table have no names but numbers."""
    return all(re.fullmatch(r"column_\d+", name) for name in names)


class _Logger:
    """The columns of one logger: their names over all tables, their values in all of its files, and what they seem to be.

    `found` has the likely source of each quantity, `missing` the number that columns have where a value is missing.
    """

    def __init__(self, logs: Sequence[LogFile], number: int):
        self.logs, self.number = logs, number
        self._files = [log.columns for log in logs]
        self.tables = self._with_clocks()
        self.names = [table.full_name(name) for table in self.tables for name in table.columns]
        units = {table.full_name(name): unit for table in self.tables for name, unit in table.units.items()}
        self.meanings = {}
        self.missing: dict[str, float] = {}
        self.candidates: dict[str, list[str]] = {}
        for name in self.names:
            table, _, short = name.rpartition("/")
            self.meanings[name] = meaning = meaning_in(table, short, units.get(name, ""))
            codes = (code for values in self.parts(name) if (code := missing_code(values)) is not None)
            if (code := next(codes, None)) is not None:
                self.missing[name] = code
            if meaning.quantity and (self.span(name) > 0.0 or meaning.quantity in (*POSE, *TURN, *FORCE)):
                self.candidates.setdefault(meaning.quantity, []).append(name)
        self.found = self._columns()

    def _with_clocks(self) -> tuple[LogTable, ...]:
        """Return the tables without those that are shorter than the ones with a clock and have none: settings, results of fits.

        In a table that is not the longest a column has to be called a time: a planned path rises like a clock, too.
        """
        tables = self.logs[0].tables
        longest = max(table.sample_count for table in tables)
        lengths = {
            table.sample_count
            for table in tables
            for name in table.columns
            if all(is_clock(file[full]) for file in self._files if (full := table.full_name(name)) in file)
            and (table.sample_count == longest or meaning_of(name).quantity == "time")
        }
        kept = tuple(table for table in tables if table.sample_count in lengths)
        return kept if kept and len(tables) > 1 else tables

    def guess(self, quantity: str, value: Any, reason: str, is_thin: bool = False) -> Guess:
        """Return a guess about a quantity of this logger."""
        return Guess("logger.columns", quantity, value, reason, is_thin, self.number, self.logs[0].name)

    def names_but(self, taken: set[str]) -> list[str]:
        """Return the names of the columns but for some that are known by their full or short names."""
        return [name for name in self.names if not taken & {name, name.rpartition("/")[2]}]

    def parts(self, full: str) -> list[np.ndarray]:
        """Return the values of a column in each file; none in a file without it."""
        files = [file.get(full, np.zeros(0)) for file in self._files]
        return [np.where(values == self.missing.get(full, np.nan), np.nan, values) for values in files]

    def values(self, full: str) -> np.ndarray:
        """Return the values of a column in all files."""
        return np.concatenate(self.parts(full))

    def span(self, full: str) -> float:
        """Return how far the values of a column reach, without the outermost thousandth."""
        known = finite(self.values(full))
        return float(np.ptp(np.percentile(known, [0.1, 99.9]))) if len(known) else 0.0

    def beginning(self, full: str) -> tuple[float, float, bool]:
        """Return the value at the beginning, how far the values leave it on the side on which they do so most, and whether they
        rest there at an end of their range, as without contact.
        """
        zeros, ways, rests = [], [], []
        for values in filter(len, map(finite, self.parts(full))):
            start = float(np.median(values[: max(8, int(BEGINNING * len(values)))]))
            low, high = np.percentile(values, [0.5, 99.5]) - start
            is_end = min(-low, high) <= AT_AN_END * (high - low)
            zeros.append(start)
            ways.append(float(high if high > -low else low))
            rests.append(is_end and (np.abs(values - start) <= AT_REST * (high - low)).mean() >= RESTS)
        return (zeros[0], max(ways, key=abs), all(rests)) if zeros else (0.0, 0.0, False)

    def _columns(self) -> dict[str, Guess]:
        """Return the likely source of each quantity."""
        found = {"time": self._time()}
        others = self.names_but({name for names in self.candidates.values() for name in names} | set(found["time"].columns))
        others = [name for name in others if not RATE.search(self.meanings[name].unit)]
        no_clocks = [name for name in others if not self._rises(name, strictly=True)]
        texels = families(no_clocks or others, self._follows)
        for group in (POSE, TURN, FORCE):
            found |= self._vector(group)
        for quantity in ("depth", "force", *SLIDE, "temperature"):
            if names := self.candidates.get(quantity):
                found[quantity] = self._one(quantity, names)
        if texels:
            found["texel"] = self._texel(*texels)
        for quantity, guess in found.items():
            if coded := [name for name in guess.columns if name in self.missing]:
                code = self.missing[coded[0]]
                why = f"{code:g} is where a value is missing, because its neighbours are far away"
                found[quantity] = guess.but(why, missing=code)
        return found

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
        for load, values in zip(self.parts(driver), self.parts(name), strict=True):
            if len(load) > FEWEST_ROWS < len(values):  # topics have other rates
                load = np.interp(np.linspace(0.0, 1.0, len(values)), np.linspace(0.0, 1.0, len(load)), load)
                found.append(correlation(load, values))
        return float(np.median(found)) if found else 0.0

    def _time(self) -> Guess:
        named = self.candidates.pop("time", [])
        rising = [name for name in named if self._rises(name)]
        rising = rising or [name for name in self.names if self._rises(name, strictly=True)]
        if not rising and named:
            unit = time_unit(self.parts(named[0])[0], self.meanings[named[0]].unit)[0]
            reason = "of its name, but it falls: cut the file where the clock was reset, or name another column"
            return self.guess("time", {"name": named[0], "unit": unit}, reason, is_thin=True)
        if self.logs[0].has_frames:
            reason = (
                "each file is a frame without a time, in the order of the load; where rows are samples, name the files instead"
            )
            return self.guess("time", {"rate": 1.0}, reason, is_thin=True)
        driver = self.driver()
        if driver is not None and all(map(self._counts_rows, rising)) and all(map(is_unordered, self.parts(driver))):
            reason = "the load jumps from row to row and no column is a clock: these are points, which are sorted by the load"
            return self.guess("time", {"rate": 1.0}, reason, is_thin=True)
        if not rising:
            return self.guess("time", {"name": UNKNOWN}, "no column rises like a clock; write its name, or { rate = … } in Hz")
        best = max(rising, key=lambda name: (self.meanings[name].weight, name.rpartition("/")[2] == "time"))
        unit, reason, is_thin = time_unit(self.parts(best)[0], self.meanings[best].unit)
        short = best.rpartition("/")[2]
        is_of_each = len(self.tables) > 1 and all(short in table.columns for table in self.tables)
        is_only_named = {name.rpartition("/")[2] for name in rising} == {short} and self.meanings[best].quantity == "time"
        if is_of_each:
            is_thin = False
        elif not is_only_named:
            reason = f"{reason}; it is the column that rises like a clock"
            is_since_1970 = np.nanmin(self.parts(best)[0]) * LOG_UNITS["s"][unit] > SINCE_1970
            is_thin = is_thin or len(rising) > 1 or not is_since_1970
        return self.guess("time", {"name": short if is_of_each else best, "unit": unit}, reason, is_thin)

    def _rises(self, name: str, strictly: bool = False) -> bool:
        return all(is_clock(values, strictly) for values in self.parts(name) if len(values))

    def _counts_rows(self, name: str) -> bool:
        """Return whether a column only counts the rows."""
        return self.meanings[name].quantity != "time" and all(set(np.diff(one)) == {1.0} for one in self.parts(name))

    def _vector(self, group: Sequence[str]) -> dict[str, Guess]:
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
        rivals = [next(iter(own.values())) for own in moving if own is not best and len(own) == len(best)]
        return {quantity: _with_rivals(one, rivals) for quantity, one in found.items()}

    def _one(self, quantity: str, names: Sequence[str]) -> Guess:
        """Return a quantity of a single column, with its unit."""
        name = max(names, key=lambda one: self.meanings[one].weight)
        stated, weight, kind = self.meanings[name].unit, self.meanings[name].weight, QUANTITIES[quantity]
        group = [one for axis in POSE for one in self.candidates.get(axis, [])] if quantity in POSE else [name]
        is_heat = quantity == "temperature"
        size = float(np.nanmedian(self.parts(name)[0])) if is_heat else max(map(self.span, group))
        is_topic = name.startswith("/") and self.tables[0].name != ""
        if not kind:
            unit, reason, is_thin = "", "of its name", False
        elif is_topic and not stated and (kind == "m" or quantity in FORCE):
            unit, reason, is_thin = kind, "ROS says so", False
        else:
            unit, reason, is_thin = unit_of(kind, stated, size)
        is_thin = is_thin or weight == 1 and not set(POSE) <= set(self.candidates)
        found = self.guess(quantity, {"name": name, **({"unit": unit} if unit else {})}, reason, is_thin)
        return _with_rivals(found, [one for one in names if one != name])

    def _texel(self, best: Family, *others: Family) -> Guess:
        units = {self.meanings[name].unit for name in best.columns}
        unit = units.pop() if len(units) == 1 else ""
        what = f"{len(best.columns)} columns differ by a number" if len(best.columns) > 1 else "its name is a word for readings"
        rivals = [one for one in others if len(one.columns) > 2]
        if rivals:
            listed_ones = ", ".join(f"{listed(one.columns)}: {one.follows:.2f}" for one in rivals[:MOST_NAMED])
            what = f"{what}; they follow the load by {best.follows:.2f}, others that could be meant: {listed_ones}"
        is_clear = best.is_named and not any(one.is_named for one in rivals)
        return self.guess("texel", _texel_words(best.columns) | ({"unit": unit} if unit else {}), what, not is_clear)

    def described(self) -> str:
        """Return the columns for a question; how far those without a name reach is all that tells them apart."""
        if not _is_unnamed(self.names):
            return listed(self.names)
        found = []
        for name in self.names[:MOST_NAMED]:
            low, high = np.nanpercentile(self.values(name), [0.1, 99.9])
            code = f", missing = {self.missing[name]}" if name in self.missing else ""
            found.append(f"{name}: {low:.4g} to {high:.4g}{code}" if low < high else f"{name}: {low:.4g}{code}")
        return ", ".join(found)


def _with_rivals(own: Guess, rivals: Sequence[str]) -> Guess:
    return own.but(f"'{rivals[0]}' could be meant as well", is_thin=True) if rivals else own


def _texel_words(names: tuple[str, ...]) -> dict[str, Any]:
    """Return the names of texels as a pattern with a number, where they are one."""
    first, last = names[0], names[-1]
    for number in re.finditer(r"[1-9]\d*|0(?!\d)", first):
        pattern, start = first[: number.start()] + NUMBER + first[number.end() :], int(number[0])
        if first != last and numbered(pattern, start, len(names)) == names:
            return {"name": pattern, "first": start, "count": len(names)}
    return {"names": list(names)}


# --- what drove the sensor, and what answered


def _owners(loggers: Sequence[_Logger]) -> dict[str, _Logger]:
    """Return the logger that has each quantity."""
    return {quantity: one for one in loggers for quantity in one.found}


def _choose_stimulus(loggers: Sequence[_Logger]) -> None:
    """Keep one stimulus: a pose, else a depth, else a force; and turn signs as a rig has them."""
    owner = _owners(loggers)
    if set(POSE) <= set(owner):
        _drop(loggers, ("depth",))
    elif "depth" in owner or "z" in owner:
        _motion(loggers, "depth" if "depth" in owner else "z")
    elif "texel" in owner and ("force" in owner or "force_z" in owner):
        word = "force" if "force" in owner else "force_z"
        own = owner[word].found[word]
        _drop(loggers, (*POSE, *TURN, *FORCE))
        owner[word].found["force"] = _load(owner[word], replace(own, word="force"))
    if owner.keys() & {"depth", "z"}:
        _force_is_response(loggers)
    for one in loggers:
        if "texel" in one.found and (unit := one.found["texel"].value.get("unit")) in READING_UNITS:
            one.found["texel"] = one.found["texel"].but(f"{unit} becomes newtons")


def _motion(loggers: Sequence[_Logger], quantity: str) -> None:
    """Take one axis for a depth, or for the height of an indenter at a place where most texels never answer."""
    logger = _owners(loggers)[quantity]
    own = logger.found[quantity]
    _drop(loggers, (*POSE, *TURN))
    zero, way, _ = logger.beginning(own.value["name"])
    silent = _silent_texels(loggers)
    if quantity == "z" and silent:
        for axis in "xy":
            why = "of the indenter in the sensor's frame, m; a number where it does not move"
            logger.found[axis] = logger.guess(axis, 0.0, why, is_thin=True)
        why = f"it is one axis, and {silent} never answer: something smaller than the sensor presses"
        logger.found["z"] = _turned(own.but(why, is_thin=True), way > 0.0)
        return
    if quantity == "z":
        own = own.but(f"it is one axis, taken from where it begins; {FLAT}", is_thin=True, **({"zero": zero} if zero else {}))
    elif silent:
        own = own.but(f"{silent} never answer, and a depth is that of all texels; {FLAT}", is_thin=True)
    logger.found["depth"] = replace(_turned(own, way < 0.0), word="depth")


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


def _turned(own: Guess, is_turned: bool) -> Guess:
    return own.but(factor=-1.0) if is_turned else own


def _silent_texels(loggers: Sequence[_Logger]) -> str:
    """Return how many texels do not answer where others do, in words; empty if that is not most of them."""
    logger = _owners(loggers).get("texel")
    if logger is None:
        return ""
    names = logger.found["texel"].columns
    count = sum(max(map(contact_of, logger.parts(name))) < LEAST_CONTACT for name in names)
    return f"{count} of {len(names)} texels" if len(names) > count > len(names) / 2 else ""


def _drop(loggers: Sequence[_Logger], quantities: Sequence[str]) -> None:
    for one in loggers:
        for quantity in quantities:
            one.found.pop(quantity, None)


def _force_is_response(loggers: Sequence[_Logger]) -> None:
    """A force beside a motion is the net force on the sensor: it points down when something presses from above."""
    owner = _owners(loggers)
    if "force_z" not in owner and "force" in owner:
        own = owner["force"].found
        own["force_z"] = replace(own.pop("force"), word="force_z")
    _drop(loggers, ("force",))
    for logger in loggers:
        own = logger.found
        if "force_z" in own:
            name = own["force_z"].value["name"]
            _, way, rests = logger.beginning(name)
            if (way if rests else float(np.nanmedian(logger.values(name)))) > 0.0:
                why = "turned: it rises under load, and the force on the sensor points down"
                own |= {axis: own[axis].but(why, factor=-1.0) for axis in FORCE if axis in own}


def _say_what_lacks(loggers: Sequence[_Logger]) -> None:
    """Ask for what no column seems to be."""
    owner = set(_owners(loggers))
    if not owner & {"depth", "force"} and not set(POSE) <= owner:
        logger = next((one for one in loggers if "texel" not in one.found), loggers[0])
        why = f"nothing looks like what drove the sensor; depth, force or x y z ({logger.described()})"
        logger.found["depth"] = logger.guess("depth", {"name": UNKNOWN, "unit": "m"}, why, is_thin=True)
    if not owner & {"texel", "force_z"}:
        logger = loggers[-1]
        why = f"nothing looks like readings; name the column of each texel ({logger.described()})"
        logger.found["texel"] = logger.guess("texel", {"names": [UNKNOWN]}, why, is_thin=True)


def _sensor(loggers: Sequence[_Logger]) -> list[Guess]:
    """Return the guesses about [sensor] and [indenter]."""
    found = [one.found for one in loggers]
    texels = next((own["texel"] for own in found if "texel" in own), None)
    is_pose = any(set(POSE) <= set(own) for own in found)
    count = len(texels.columns) if texels else 1
    shapes = [shape for one in loggers for table in one.tables for shape in table.grids.values()]
    shape = next((shape for shape in shapes if shape[0] * shape[1] == count), None)
    if shape is None:
        rows, columns = (1, 1) if count == 1 else (UNKNOWN, UNKNOWN)
        reason = "one texel" if count == 1 else f"{count} texels; their rows and columns"
    else:
        rows, columns = shape
        reason = f"the array has {rows} rows and {columns} columns"
    is_free = not is_pose and count == 1
    grid = {"rows": rows, "columns": columns, "pitch": [ONE_TEXEL_PITCH if is_free else UNKNOWN] * 2}
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


def listed(names: Sequence[str]) -> str:
    """Return names for a sentence; those that differ by their last number are one, and of many the first are named."""
    families: dict[str, list[str]] = {}
    for name in names:
        families.setdefault(re.sub(r"\d+(?=\D*$)", "#", name), []).append(name)
    found = [own[0] if len(own) == 1 else f"{own[0]} … {own[-1]}" for own in families.values()]
    return ", ".join(found[:MOST_NAMED]) + (f" and {len(found) - MOST_NAMED} more" if len(found) > MOST_NAMED else "")
