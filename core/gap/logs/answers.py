# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known about logs: which column is what, in which unit, which files belong together. A TOML file says
it, or a proposal.

An answer that only seems to be true has :attr:`ColumnAnswer.sure` False until a person has confirmed it; what nobody can know
from the logs is :data:`UNKNOWN` until it is filled in.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ...errors import FileError
from ...io.sensor_toml import known_words
from ...io.toml_file import checked_name, is_number, read_toml
from ..dataset.column_names import QUANTITIES
from .column_meaning import LOG_UNITS, PRESSURES

FORMAT = "palpate-log-answers/1"
UNKNOWN = "?"
USES = ("fit", "check", "leave out")
REPEATED = ("refuse", "spread", "mean")
"""What is done where time stamps repeat: they are evenly spread up to the next stamp, or their samples are averaged."""
_COLUMN_WORDS = {"name", "unit", "factor", "zero"}
_OWN_WORDS = {"time": {"rate", "repeated"}, "force": {"area"}, "texel": {"names", "first", "count"}}


@dataclass(frozen=True)
class ColumnAnswer:
    """Where a quantity comes from.

    Attributes
    ----------
    names : tuple of str
        The columns: one, or those of all texels in order. Those of a table of several are ``TABLE/COLUMN``; without the
        table, a name means the column of every table that has it.
    unit : str
        Empty for texels whose unit is the sensor's own.
    factor, zero : float
        The value is (number − zero) · factor, in the unit.
    area : float, m²
        On which a pressure acts that becomes a force; 0 if it is none.
    rate : float, Hz
        Of a clock without a column; 0 if it has one.
    repeated : str
        One of :data:`REPEATED`.
    why : str
        Why this is proposed.
    sure : bool
    """

    names: tuple[str, ...]
    unit: str = ""
    factor: float = 1.0
    zero: float = 0.0
    area: float = 0.0
    rate: float = 0.0
    repeated: str = "refuse"
    why: str = ""
    sure: bool = True


@dataclass(frozen=True)
class LoggerAnswer:
    """One kind of files: `files` are their names, `columns` where each quantity comes from."""

    files: tuple[str, ...]
    columns: dict[str, ColumnAnswer]


@dataclass(frozen=True)
class RecordingAnswer:
    """One trial: a file, or one of each of two loggers.

    Attributes
    ----------
    name : str
    files : tuple of str
    use : str
        One of :data:`USES`.
    late, uncertainty : float or None, s
        How much later the clock of the second logger shows the same event. None: as the correlation says.
    why : str
    sure : bool
    begin, end : float or None, s
        What is used of the file that has what drove the sensor, counted from its first sample. None: all of it.
    """

    name: str
    files: tuple[str, ...]
    use: str
    late: float | None = None
    uncertainty: float | None = None
    why: str = ""
    sure: bool = True
    begin: float | None = None
    end: float | None = None


@dataclass(frozen=True)
class Answers:
    """All of it.

    Attributes
    ----------
    name : str
    sensor : dict
        The words of the rig's [sensor].
    indenter : dict
        Those of its [indenter]; empty if there is none.
    loggers, recordings : tuple
    why : dict of str to str
        Why words of [sensor] and [indenter] are proposed.
    unsure : frozenset of str
        Those of them that a person has to confirm.
    notes : tuple of str
        What was left out of the logs.
    """

    name: str
    sensor: dict[str, Any]
    indenter: dict[str, Any]
    loggers: tuple[LoggerAnswer, ...]
    recordings: tuple[RecordingAnswer, ...]
    why: dict[str, str] = field(default_factory=dict)
    unsure: frozenset[str] = frozenset()
    notes: tuple[str, ...] = ()

    def open_questions(self) -> Iterator[str]:
        """Yield what is not known, or not sure, a sentence each."""
        for where, words in (("sensor", self.sensor), ("indenter", self.indenter)):
            for word, value in words.items():
                if has_unknown(value):
                    yield f"{word} of [{where}] is not known: {self.why.get(word, 'fill it in')}."
                elif word in self.unsure:
                    yield f"{word} of [{where}] is {value!r}, because {self.why[word]}."
        for logger in self.loggers:
            for quantity, column in logger.columns.items():
                if has_unknown(list(column.names)) or column.unit == UNKNOWN:
                    yield f"{quantity} of '{logger.files[0]}' is not known: {column.why}."
                elif not column.sure:
                    unit = f" in {column.unit}" if column.unit else ""
                    yield f"{quantity} is '{column.names[0] if column.names else column.rate}'{unit}, because {column.why}."
        for recording in self.recordings:
            if not recording.sure:
                yield f"'{recording.name}': {recording.why}."


def has_unknown(value: Any) -> bool:
    """Return True if a value is, or holds, :data:`UNKNOWN`."""
    if isinstance(value, Mapping):
        return any(has_unknown(one) for one in value.values())
    return any(has_unknown(one) for one in value) if isinstance(value, list | tuple) else value == UNKNOWN


# --- as a file


def answers_text(answers: Answers) -> str:
    """Return a file of answers that says what is proposed, and asks for what is not known."""
    lines = [
        f'format = "{FORMAT}"',
        '# What the logs seem to be. Replace each "?", check what is marked CHECK, and give the file with --answers.',
        "",
        f"name = {_text(answers.name)}",
        "",
        *_table("sensor", answers.sensor, answers),
        *(_table("indenter", answers.indenter, answers) if answers.indenter else []),
    ]
    for logger in answers.loggers:
        lines += ["[[logger]]", f"files = {_value(list(logger.files))}", "[logger.columns]"]
        for quantity, column in logger.columns.items():
            mark = "" if column.sure else "CHECK: "
            lines.append(f"{quantity} = {_value(_column_words(quantity, column))}  # {mark}{column.why}")
        lines.append("")
    for recording in answers.recordings:
        words: dict[str, Any] = {"name": recording.name, "files": list(recording.files), "use": recording.use}
        if recording.late is not None:
            words |= {"late": recording.late, "uncertainty": recording.uncertainty or 0.0}
        words |= {word: value for word, value in (("from", recording.begin), ("to", recording.end)) if value is not None}
        lines.append("[[recording]]")
        lines += [f"{word} = {_value(value)}" for word, value in words.items()]
        lines += [f"# {'' if recording.sure else 'CHECK: '}{recording.why}"] if recording.why else []
        lines.append("")
    lines += [f"# {note}" for note in answers.notes]
    return "\n".join(lines) + "\n"


def _table(name: str, words: Mapping[str, Any], answers: Answers) -> list[str]:
    lines = [f"[{name}]"]
    for word, value in words.items():
        why = answers.why.get(word, "")
        mark = "CHECK: " if word in answers.unsure else ""
        lines.append(f"{word} = {_value(value)}" + (f"  # {mark}{why}" if why else ""))
    return [*lines, ""]


def _column_words(quantity: str, column: ColumnAnswer) -> dict[str, Any]:
    words: dict[str, Any] = {}
    if column.rate:
        words["rate"] = column.rate
    elif quantity == "texel":
        words |= _texel_words(column.names)
    else:
        words["name"] = column.names[0] if len(column.names) == 1 else list(column.names)
    words |= {"unit": column.unit} if column.unit and not column.rate else {}
    words |= {
        word: getattr(column, word)
        for word, usual in (("factor", 1.0), ("zero", 0.0), ("area", 0.0))
        if getattr(column, word) != usual
    }
    return words | ({"repeated": column.repeated} if column.repeated != "refuse" else {})


def _texel_words(names: tuple[str, ...]) -> dict[str, Any]:
    """Return the names of texels as a pattern with a number, where they are one."""
    first, last = names[0], names[-1]
    for begin in range(len(first)):
        for end in range(begin + 1, len(first) + 1):
            if (
                first[begin:end].isdigit()
                and not first[end : end + 1].isdigit()
                and (not begin or not first[begin - 1].isdigit())
            ):
                pattern, start = first[:begin] + "{}" + first[end:], int(first[begin:end])
                if [pattern.replace("{}", str(start + i)) for i in range(len(names))] == list(names) and first != last:
                    return {"name": pattern, "first": start, "count": len(names)}
    return {"names": list(names)}


def toml_value(value: Any) -> str:
    """Return a value as TOML writes it in one line."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {toml_value(one)}" for key, one in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_value(one) for one in value) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    return repr(float(value)) if isinstance(value, float) else str(value)


_value = toml_value


def _text(text: str) -> str:
    escaped = "".join(c if c.isprintable() and c not in '"\\' else f"\\u{ord(c):04x}" for c in text if ord(c) < 0x10000)
    return f'"{escaped}"'


# --- from a file


def read_answers(path: str | Path) -> Answers:
    """Read a file of answers.

    Raises
    ------
    FileError
        It cannot be read, or a word or a value in it is not valid, or something in it is not answered yet.
    """
    path = Path(path)
    words = read_toml(path, "file of answers")
    if words.get("format") != FORMAT:
        raise FileError(f"'{path.name}' holds no answers about logs: its first line must be format = \"{FORMAT}\".")
    known_words(words, {"format", "name", "sensor", "indenter", "logger", "recording"}, f"'{path.name}'")
    for where in ("sensor", "indenter"):
        table = words.get(where, {})
        if not isinstance(table, dict):
            raise FileError(f"{where} of '{path.name}' is no table: write [{where}].")
        for word, value in table.items():
            if has_unknown(value):
                raise FileError(f"{word} of [{where}] in '{path.name}' is still \"?\": fill it in.")
    return Answers(
        name=checked_name(words.get("name", path.stem), f"'{path.name}'"),
        sensor=dict(words.get("sensor", {})),
        indenter=dict(words.get("indenter", {})),
        loggers=tuple(_logger(entry, number, path) for number, entry in enumerate(_list(words, "logger", path), start=1)),
        recordings=tuple(
            _recording(entry, number, path) for number, entry in enumerate(_list(words, "recording", path), start=1)
        ),
    )


def _list(words: Mapping[str, Any], key: str, path: Path) -> list[dict[str, Any]]:
    found = words.get(key)
    if not isinstance(found, list) or not found or not all(isinstance(one, dict) for one in found):
        raise FileError(f"'{path.name}' has no [[{key}]]: let `palpate rig new` write a template, and complete it.")
    return found


def _names(value: Any, where: str) -> tuple[str, ...]:
    if not isinstance(value, list) or not value:
        raise FileError(f'files of {where} is {value!r:.60}: write a list of names, as ["press_1.csv"].')
    return tuple(checked_name(one, f"files of {where}") for one in value)


def _logger(entry: dict[str, Any], number: int, path: Path) -> LoggerAnswer:
    where = f"[[logger]] {number} of '{path.name}'"
    known_words(entry, {"files", "columns"}, where)
    columns = entry.get("columns")
    if not isinstance(columns, dict):
        raise FileError(f"{where} has no [logger.columns]: say there what each column is.")
    known_words(columns, set(QUANTITIES), where)
    return LoggerAnswer(
        _names(entry.get("files"), where), {name: _column(name, one, f"{name} in {where}") for name, one in columns.items()}
    )


def _column(quantity: str, words: Any, where: str) -> ColumnAnswer:
    words = {"name": words} if isinstance(words, str) else words
    if not isinstance(words, dict):
        raise FileError(f'{where} is {words!r:.60}: write the name of the column, or {{ name = "Fz", unit = "mN" }}.')
    if has_unknown(words):
        raise FileError(f'{where} is still "?": fill it in, or remove the line if nothing was recorded.')
    known_words(words, _COLUMN_WORDS | _OWN_WORDS.get(quantity, set()), where)
    for word in ("factor", "zero", "area", "rate"):
        value = words.get(word, 1.0)
        if not is_number(value) or (word != "zero" and value == 0) or (word in ("area", "rate") and value < 0):
            raise FileError(
                f"{word} of {where} is {value!r:.60}: write a number{'' if word == 'zero' else ' other than zero'}."
            )
    unit = words.get("unit", QUANTITIES[quantity])
    units = LOG_UNITS.get(QUANTITIES[quantity], {})
    may_be_pressure = quantity == "force" and "area" in words
    known = isinstance(unit, str) and (not units or unit in units or (may_be_pressure and unit in PRESSURES))
    if not known:
        hint = " (a pressure needs area = …, in m²)" if isinstance(unit, str) and unit in PRESSURES else ""
        choice = f"one of {', '.join(units)}{hint}" if units else "its name"
        raise FileError(f"unit of {where} is {unit!r:.60}: write {choice}.")
    repeated = words.get("repeated", "refuse")
    if repeated not in REPEATED:
        raise FileError(f"repeated of {where} is {repeated!r:.60}: write one of {', '.join(REPEATED)}.")
    return ColumnAnswer(
        names=_column_names(quantity, words, where),
        unit=str(unit),
        factor=float(words.get("factor", 1.0)),
        zero=float(words.get("zero", 0.0)),
        area=float(words.get("area", 0.0)),
        rate=float(words.get("rate", 0.0)),
        repeated=repeated,
        why="the answers say so",
    )


def _column_names(quantity: str, words: Mapping[str, Any], where: str) -> tuple[str, ...]:
    if quantity == "texel":
        if "names" in words:
            return _names(words["names"], where)
        pattern, first, count = checked_name(words.get("name", ""), where), words.get("first", 0), words.get("count", 1)
        if "{}" not in pattern:
            return (pattern,)
        if (
            not all(isinstance(one, int) and not isinstance(one, bool) and 0 <= one <= 65536 for one in (first, count))
            or not count
        ):
            raise FileError(f"first and count of {where} are {first!r:.20} and {count!r:.20}: write whole numbers.")
        return tuple(pattern.replace("{}", str(first + i)) for i in range(count))
    if quantity == "time" and "rate" in words:
        return ()
    name = words.get("name", quantity)
    return _names(name, where) if isinstance(name, list) else (checked_name(name, where),)


def _recording(entry: dict[str, Any], number: int, path: Path) -> RecordingAnswer:
    where = f"[[recording]] {number} of '{path.name}'"
    known_words(entry, {"name", "files", "use", "late", "uncertainty", "from", "to"}, where)
    files, use = _names(entry.get("files"), where), entry.get("use", "fit")
    if use not in USES:
        raise FileError(f"use of {where} is {use!r:.60}: write one of {', '.join(USES)}.")
    if len(files) > 2:
        raise FileError(f"{where} has {len(files)} files: give one, or one of each of two loggers.")
    for word in ("late", "uncertainty", "from", "to"):
        if word in entry and not is_number(entry[word]):
            raise FileError(f"{word} of {where} is {entry[word]!r:.60}: write seconds.")
    late = float(entry["late"]) if "late" in entry else None
    name = checked_name(entry.get("name", Path(files[0]).stem), where)
    begin, end = (float(entry[word]) if word in entry else None for word in ("from", "to"))
    if begin is not None and end is not None and not begin < end:
        raise FileError(f"{where} is used from {begin:g} s to {end:g} s: write a `to` that is later than `from`.")
    uncertainty = float(entry.get("uncertainty", 0.0)) if late is not None else None
    return RecordingAnswer(name, files, use, late, uncertainty, begin=begin, end=end)


def confirmed(answers: Answers) -> Answers:
    """Return answers of which everything is sure but what is not known."""
    return replace(
        answers,
        loggers=tuple(
            replace(one, columns={name: replace(column, sure=True) for name, column in one.columns.items()})
            for one in answers.loggers
        ),
        recordings=tuple(replace(one, sure=True) for one in answers.recordings),
        unsure=frozenset(),
    )
