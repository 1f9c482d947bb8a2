# SPDX-License-Identifier: GPL-3.0-or-later
"""Asks what logs leave open, at the terminal or in a dialog; what is typed is written as in a file of answers."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from ...io.csv_table import is_number
from .answers import Answers, ColumnAnswer, LoggerAnswer, has_unknown, toml_value

LEFT_OUT = "-"
"""What is typed for a column that is not to be used."""


class OpenQuestion(Exception):
    """A question to which there is no reply yet; its text is what to ask."""


def answered(answers: Answers, replies: Sequence[str]) -> Answers:
    """Return answers in which the open questions have these replies, in turn; raise :class:`OpenQuestion` for the next one."""
    waiting = iter(replies)

    def ask(question: str) -> str:
        for reply in waiting:
            return reply
        raise OpenQuestion(question)

    return asked(answers, ask)


def asked(answers: Answers, ask: Callable[[str], str] = input) -> Answers:
    """Return answers in which every open question was put to the user; Enter keeps what is proposed."""
    sensor, indenter = (_asked_words(words, answers, ask) for words in (answers.sensor, answers.indenter))
    loggers = tuple(
        LoggerAnswer(
            logger.files,
            {
                name: column
                for name, one in logger.columns.items()
                if (column := _asked_column(name, one, logger, ask)) is not None
            },
        )
        for logger in answers.loggers
    )
    return replace(answers, sensor=sensor, indenter=indenter, loggers=loggers, unsure=frozenset())


def _asked_words(words: dict[str, Any], answers: Answers, ask: Callable[[str], str]) -> dict[str, Any]:
    found = {}
    for word, value in words.items():
        found[word], hint = value, ""
        while has_unknown(found[word]) or (word in answers.unsure and found[word] is value):
            typed = ask(f"{word} ({answers.why.get(word, '')}){hint}\n  [{toml_value(value)}] ").strip()
            if not typed and not has_unknown(value):
                break
            try:
                found[word] = tomllib.loads(f"value = {typed}")["value"]
            except tomllib.TOMLDecodeError:
                hint = ", written as in the brackets"
    return found


def _asked_column(name: str, column: ColumnAnswer, logger: LoggerAnswer, ask: Callable[[str], str]) -> ColumnAnswer | None:
    """Return what a column is after the question about it; None if it is not to be used."""
    while not column.sure:
        is_open = has_unknown(list(column.names)) or column.unit == "?"
        shown = (
            f"{column.names[0] if column.names else column.rate or column.constant}{' ' + column.unit if column.unit else ''}"
        )
        typed = ask(f"{name} of {logger.files[0]}: column and unit, {LEFT_OUT} for none ({column.why})\n  [{shown}] ").strip()
        if typed == LEFT_OUT:
            return None
        if not typed and is_open:
            continue
        if typed and column.constant is not None and is_number(typed):
            column = replace(column, constant=float(typed), why="typed by the user")
        elif typed:
            source, _, unit = typed.rpartition(" ") if column.unit and " " in typed else (typed, "", column.unit)
            column = replace(column, names=(source,), unit=unit, constant=None, rate=0.0, why="typed by the user")
            if has_unknown(list(column.names)) or column.unit == "?":
                continue
        column = replace(column, sure=True)
    return column
