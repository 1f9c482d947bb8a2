# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known about logs: which column is what, in which unit, which files belong together. A file of answers says it, or
a :class:`~.guess.Proposal` that leaves no question open, by the same words.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from ...errors import FileError
from ...io.input_files import checked_name, read_toml
from ...io.schema import WORD, Name, Number, Positive, Seconds, known_words, read_words, wanted
from ..dataset.column_names import QUANTITIES
from .column_meaning import LOG_UNITS, PRESSURES
from .guess import FORMAT, Proposal, has_unknown

Use = Literal["fit", "check", "leave out"]
_COLUMN_WORDS = {"name", "unit", "factor", "zero", "missing"}
_NAME_WORDS = {"name", "names", "first", "count"}
_OWN_WORDS = {"time": {"rate"}, "force": {"area"}, "texel": {"names", "first", "count"}}


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
    missing : float or None
        What the file has where a value is missing.
    constant : float or None
        In SI units, instead of a column.
    """

    names: tuple[str, ...]
    unit: str = ""
    factor: Number = 1.0
    zero: Number = 0.0
    area: Positive = 0.0
    rate: Positive = 0.0
    missing: Number | None = None
    constant: Number | None = None


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
    late : float or None, s
        How much later the clock of the second logger shows the same event. None: as the correlation says.
    begin, end : float or None, s
        What is used of the file that has what drove the sensor, counted from its first sample. None: all of it.
    """

    name: Name
    files: _Files
    use: Use = "fit"
    late: Seconds | None = None
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
    text : str
        The file of answers, with its reasons.
    """

    name: str
    sensor: dict[str, Any]
    indenter: dict[str, Any]
    loggers: tuple[LoggerAnswer, ...]
    recordings: tuple[RecordingAnswer, ...]
    text: str = ""


def read_answers(path: str | Path) -> Answers:
    """Read a file of answers.

    Raises
    ------
    FileError
        It cannot be read, or a word or a value in it is not valid, or something in it is not answered yet.
    """
    path = Path(path)
    return _answers(read_toml(path, "file of answers"), path.name, path.read_text(encoding="utf-8"))


def answers_of(proposal: Proposal) -> Answers:
    """Return the answers that a proposal gives.

    Raises
    ------
    FileError
        A question is open, or what was replied to one is not valid.
    """
    for question in proposal.questions:
        raise FileError(f"{question[:-1]}: answer it before the rig is written.")
    return _answers(tomllib.loads(proposal.text), "the proposal", proposal.text)


def _answers(words: dict[str, Any], source: str, text: str) -> Answers:
    if words.get("format") != FORMAT:
        raise FileError(f"'{source}' holds no answers about logs: its first line must be format = \"{FORMAT}\".")
    found = read_words(words, _Answers, f"'{source}'", besides=("format",))
    for where, table in (("sensor", found.sensor), ("indenter", found.indenter)):
        for word, value in table.items():
            if has_unknown(value):
                raise FileError(f"{word} of [{where}] in '{source}' is still \"?\": fill it in.")
    loggers = (_logger(entry, f"[[logger]] {i} of '{source}'") for i, entry in enumerate(found.logger, start=1))
    recordings = (_recording(entry, f"[[recording]] {i} of '{source}'") for i, entry in enumerate(found.recording, start=1))
    name = found.name or checked_name(Path(source).stem, f"'{source}'")
    return Answers(name, found.sensor, found.indenter, tuple(loggers), tuple(recordings), text)


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
        return read_words({"constant": words}, ColumnAnswer, where, names=(), unit="")
    words = {"name": words} if isinstance(words, str) else words
    if not isinstance(words, dict):
        raise FileError(f'{where} is {words!r:.60}: write the name of the column, or {{ name = "Fz", unit = "mN" }}.')
    if has_unknown(words):
        raise FileError(f'{where} is still "?": fill it in, or remove the line if nothing was recorded.')
    known_words(words, _COLUMN_WORDS | _OWN_WORDS.get(quantity, set()), where)
    unit, units = words.get("unit", QUANTITIES[quantity]), LOG_UNITS.get(QUANTITIES[quantity], {})
    given = {word: words[word] for word in words if word not in _NAME_WORDS}
    found = read_words(given, ColumnAnswer, where, besides=("unit",), names=(), unit=unit)
    if found.factor == 0.0:
        raise FileError(f"factor of {where} is 0: write a number other than zero.")
    is_pressure = isinstance(unit, str) and unit in PRESSURES
    if not isinstance(unit, str) or (units and unit not in units and not (found.area and is_pressure)):
        hint = " (a pressure needs area = …, in m²)" if is_pressure else ""
        choice = f"one of {', '.join(units)}{hint}" if units else "its name"
        raise FileError(f"unit of {where} is {unit!r:.60}: write {choice}.")
    return found if found.rate else replace(found, names=column_names(quantity, words, where))


@dataclass
class _ColumnNames:
    name: str | Annotated[tuple[str, ...], wanted("write a name, or a list of them", min_length=1)] | None = None
    names: Annotated[tuple[str, ...], wanted('write a list of names, as ["R1", "R2"]', names=True, min_length=1)] = ()
    first: Annotated[int, wanted("write a whole number", ge=0, le=65536)] = 0
    count: Annotated[int, wanted("write a whole number above zero", ge=1, le=65536)] = 1


def column_names(quantity: str, words: Mapping[str, Any], where: str = "") -> tuple[str, ...]:
    """Return the columns that the words of a quantity name."""
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
    found = read_words({"name": name, **entry}, RecordingAnswer, where)
    if len(found.files) > 2:
        raise FileError(f"{where} has {len(found.files)} files: give one, or one of each of two loggers.")
    if found.begin is not None and found.end is not None and not found.begin < found.end:
        raise FileError(f"{where} is used from {found.begin:g} s to {found.end:g} s: write a `to` that is later than `from`.")
    return found
