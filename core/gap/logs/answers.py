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
from typing import Annotated, Any, Literal

from ...errors import FileError
from ...io.input_files import checked_name, read_toml
from ...io.schema import WORD, Name, Number, Positive, Seconds, known_words, read_words, wanted
from ..dataset.column_names import QUANTITIES
from .column_meaning import LOG_UNITS, PRESSURES

FORMAT = "palpate-log-answers/1"
UNKNOWN = "?"
Use = Literal["fit", "check", "leave out"]
Repeated = Literal["refuse", "spread", "mean"]
"""What is done where time stamps repeat: they are evenly spread up to the next stamp, or their samples are averaged."""
_COLUMN_WORDS = {"name", "unit", "factor", "zero"}
_NAME_WORDS = {"name", "names", "first", "count"}
_OWN_WORDS = {"time": {"rate", "repeated"}, "force": {"area"}, "texel": {"names", "first", "count"}}


_Files = Annotated[tuple[str, ...], wanted('write a list of names, as ["press_1.csv"]', names=True, min_length=1)]


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
    constant : float or None
        In SI units, instead of a column.
    repeated : str
        What is done where time stamps repeat.
    why : str
        Why this is proposed.
    sure : bool
    """

    names: tuple[str, ...]
    unit: str = ""
    factor: Number = 1.0
    zero: Number = 0.0
    area: Positive = 0.0
    rate: Positive = 0.0
    repeated: Repeated = "refuse"
    constant: Number | None = None
    why: str = ""
    sure: bool = True

    @property
    def lacks_area(self) -> bool:
        """True if it is a pressure whose area is not known."""
        return self.unit in PRESSURES and not self.area


@dataclass(frozen=True)
class LoggerAnswer:
    """One kind of files: `files` are their names, `columns` where each quantity comes from."""

    files: _Files
    columns: Annotated[dict[str, Any], wanted("say in [logger.columns] what each column is")]


@dataclass(frozen=True)
class RecordingAnswer:
    """One trial: a file, or one of each of two loggers.

    Attributes
    ----------
    name : str
    files : tuple of str
    use : str
    late, uncertainty : float or None, s
        How much later the clock of the second logger shows the same event. None: as the correlation says.
    why : str
    sure : bool
    begin, end : float or None, s
        What is used of the file that has what drove the sensor, counted from its first sample. None: all of it.
    """

    name: Name
    files: _Files
    use: Use = "fit"
    late: Seconds | None = None
    uncertainty: Seconds | None = None
    why: str = ""
    sure: bool = True
    begin: Seconds | None = field(default=None, metadata={WORD: "from"})
    end: Seconds | None = field(default=None, metadata={WORD: "to"})


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
                if quantity == "force" and column.lacks_area:
                    yield f"area of {quantity} of '{logger.files[0]}' is not known: m² on which the pressure acts."
                elif has_unknown(list(column.names)) or column.unit == UNKNOWN:
                    yield f"{quantity} of '{logger.files[0]}' is not known: {column.why}."
                elif not column.sure:
                    unit = f" in {column.unit}" if column.unit else ""
                    given = column.rate if column.constant is None else column.constant
                    yield f"{quantity} is '{column.names[0] if column.names else given}'{unit}, because {column.why}."
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
            value = column.constant if column.constant is not None else _column_words(quantity, column)
            lines.append(f"{quantity} = {_value(value)}  # {mark}{column.why}")
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
    words |= {"area": UNKNOWN} if quantity == "force" and column.lacks_area else {}
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
    found = read_words(words, _Answers, f"'{path.name}'", besides=("format",))
    for where, table in (("sensor", found.sensor), ("indenter", found.indenter)):
        for word, value in table.items():
            if has_unknown(value):
                raise FileError(f"{word} of [{where}] in '{path.name}' is still \"?\": fill it in.")
    loggers = (_logger(entry, f"[[logger]] {i} of '{path.name}'") for i, entry in enumerate(found.logger, start=1))
    recordings = (_recording(entry, f"[[recording]] {i} of '{path.name}'") for i, entry in enumerate(found.recording, start=1))
    name = found.name or checked_name(path.stem, f"'{path.name}'")
    return Answers(name, found.sensor, found.indenter, tuple(loggers), tuple(recordings))


_Tables = Annotated[
    list[dict[str, Any]], wanted("let `palpate rig new` write a template with [[logger]] and [[recording]]", min_length=1)
]


@dataclass
class _Answers:
    logger: _Tables
    recording: _Tables
    name: Name = ""
    sensor: Annotated[dict[str, Any], wanted("write [sensor]")] = field(default_factory=dict)
    indenter: Annotated[dict[str, Any], wanted("write [indenter]")] = field(default_factory=dict)


def _logger(entry: dict[str, Any], where: str) -> LoggerAnswer:
    found = read_words(entry, LoggerAnswer, where)
    known_words(found.columns, QUANTITIES, where)
    return replace(found, columns={name: _column(name, one, f"{name} in {where}") for name, one in found.columns.items()})


def _column(quantity: str, words: Any, where: str) -> ColumnAnswer:
    if isinstance(words, int | float) and not isinstance(words, bool) and quantity not in ("time", "texel"):
        return read_words({"constant": words}, ColumnAnswer, where, names=(), unit="", why="the answers say so", sure=True)
    words = {"name": words} if isinstance(words, str) else words
    if not isinstance(words, dict):
        raise FileError(f'{where} is {words!r:.60}: write the name of the column, or {{ name = "Fz", unit = "mN" }}.')
    if has_unknown(words):
        raise FileError(f'{where} is still "?": fill it in, or remove the line if nothing was recorded.')
    known_words(words, _COLUMN_WORDS | _OWN_WORDS.get(quantity, set()), where)
    unit, units = words.get("unit", QUANTITIES[quantity]), LOG_UNITS.get(QUANTITIES[quantity], {})
    given = {word: words[word] for word in words if word not in _NAME_WORDS}
    found = read_words(given, ColumnAnswer, where, besides=("unit",), names=(), unit=unit, why="the answers say so", sure=True)
    if found.factor == 0.0:
        raise FileError(f"factor of {where} is 0: write a number other than zero.")
    is_pressure = isinstance(unit, str) and unit in PRESSURES
    if not isinstance(unit, str) or (units and unit not in units and not (found.area and is_pressure)):
        hint = " (a pressure needs area = …, in m²)" if is_pressure else ""
        choice = f"one of {', '.join(units)}{hint}" if units else "its name"
        raise FileError(f"unit of {where} is {unit!r:.60}: write {choice}.")
    return found if found.rate else replace(found, names=_column_names(quantity, words, where))


@dataclass
class _ColumnNames:
    name: str | Annotated[tuple[str, ...], wanted("write a name, or a list of them", min_length=1)] | None = None
    names: Annotated[tuple[str, ...], wanted('write a list of names, as ["R1", "R2"]', names=True, min_length=1)] = ()
    first: Annotated[int, wanted("write a whole number", ge=0, le=65536)] = 0
    count: Annotated[int, wanted("write a whole number above zero", ge=1, le=65536)] = 1


def _column_names(quantity: str, words: Mapping[str, Any], where: str) -> tuple[str, ...]:
    found = read_words(words, _ColumnNames, where, besides=words)
    name = ("" if quantity == "texel" else quantity) if found.name is None else found.name
    if quantity == "texel" and isinstance(name, tuple):
        raise FileError(f"name of {where} is {list(name)!r:.60}: write one name, or names = [...].")
    names = found.names or (name if isinstance(name, tuple) else (name,))
    for name in names:
        checked_name(name, where)
    if quantity == "texel" and not found.names and "{}" in names[0]:
        return tuple(names[0].replace("{}", str(found.first + i)) for i in range(found.count))
    return names


def _recording(entry: dict[str, Any], where: str) -> RecordingAnswer:
    files = entry.get("files")
    name = Path(files[0]).stem if isinstance(files, list) and files and isinstance(files[0], str) else "recording"
    found = read_words({"name": name, **entry}, RecordingAnswer, where, why="", sure=True)
    if len(found.files) > 2:
        raise FileError(f"{where} has {len(found.files)} files: give one, or one of each of two loggers.")
    if found.begin is not None and found.end is not None and not found.begin < found.end:
        raise FileError(f"{where} is used from {found.begin:g} s to {found.end:g} s: write a `to` that is later than `from`.")
    return replace(found, uncertainty=None if found.late is None else found.uncertainty or 0.0)


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
