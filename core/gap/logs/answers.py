# SPDX-License-Identifier: GPL-3.0-or-later
"""Answers about logs: which column is what, in which unit, which files belong together. A file of answers says it, or
a :class:`~.guess.Proposal` that leaves no question open, by the same words.
"""

from __future__ import annotations

import os
import tomllib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from ...errors import FileError, counted
from ...io.file_writing import writable_folder, write_text
from ...io.input_files import checked_name, read_toml
from ...io.schema import WORD, Name, Seconds, known_words, read_words, wanted
from ..dataset.column_names import QUANTITIES, Column, read_column
from .guess import FORMAT, Proposal, has_unknown

Use = Literal["fit", "check", "leave out"]
ANSWERS_NAME, PLOT_NAME = "answers.toml", "recordings.png"
"""Files beside the rig: the answers, and a picture of what was read."""

_Files = Annotated[tuple[str, ...], wanted('write a list of names, as ["press_1.csv"]', names=True, min_length=1)]


@dataclass(frozen=True)
class LoggerAnswer:
    """One kind of files: `files` are their names, `columns` where each quantity comes from.

    Columns of a table of several are ``TABLE/COLUMN``; without the table, a name means the column of every table that has it.
    """

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
    if questions := proposal.questions:
        raise FileError(f"{questions[0][:-1]}: answer it before the rig is written.")
    return _answers(tomllib.loads(proposal.text), "the proposal", proposal.text)


def answers_or_template(proposal: Proposal, folder: str | os.PathLike, advice: str) -> Answers:
    """Write what is proposed and what is asked, so that whatever is refused can be corrected there, and return the answers.

    Parameters
    ----------
    proposal : Proposal
    folder : path
    advice : str
        What to do with the file where questions are open.

    Raises
    ------
    FileError
        A question is open, or the file is there already and would be lost, or it cannot be written.
    """
    path = Path(folder) / ANSWERS_NAME
    questions = proposal.questions
    if not path.exists():
        write_text(writable_folder(folder, create=True) / ANSWERS_NAME, proposal.text)
    elif questions:
        raise FileError(f"'{path}' has answers already: give it with --answers, or remove it for a new template.")
    if questions:
        how_many = counted(len(questions), "question")
        raise FileError(f"The logs leave {how_many} open, the first: {questions[0][:-1]}; answer in '{path}', {advice}.")
    return answers_of(proposal)


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


def _column(quantity: str, words: Any, where: str) -> Column:
    if isinstance(words, int | float) and not isinstance(words, bool) and quantity not in ("time", "texel"):
        return read_words({"constant": words}, Column, where, names=(), unit="")
    if has_unknown(words):
        raise FileError(f'{where} is still "?": fill it in, or remove the line if nothing was recorded.')
    return read_column(quantity, words, where)


def _recording(entry: dict[str, Any], where: str) -> RecordingAnswer:
    files = entry.get("files")
    name = Path(files[0]).stem if isinstance(files, list) and files and isinstance(files[0], str) else "recording"
    found = read_words({"name": name, **entry}, RecordingAnswer, where)
    if len(found.files) > 2:
        raise FileError(f"{where} has {len(found.files)} files: give one, or one of each of two loggers.")
    if found.begin is not None and found.end is not None and not found.begin < found.end:
        raise FileError(f"{where} is used from {found.begin:g} s to {found.end:g} s: write a `to` that is later than `from`.")
    return found
