# SPDX-License-Identifier: GPL-3.0-or-later
"""Guesses about logs, as one list: each says what, the value, the reason, whether it is to be checked, and how it is corrected.

The template, the questions at the terminal and in Blender, and the answers from which a rig is written all come from this list.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from ..dataset.column_names import numbered

FORMAT = "palpate-log-answers/1"
UNKNOWN = "?"
"""Value that nobody can know from the logs."""


@dataclass(frozen=True)
class Guess:
    """One line of the answers.

    Attributes
    ----------
    table : str
        Of the file of answers: empty, ``sensor``, ``indenter``, ``logger``, ``logger.columns`` or ``recording``.
    word : str
        In that table.
    value : object
        As TOML writes it; what is not known in it is :data:`UNKNOWN`.
    reason : str
    is_thin : bool
        True if it only seems so, and a person has to confirm it; else the file states it, or its numbers show it.
    number : int
        Of the ``[[logger]]`` or ``[[recording]]``, from zero on.
    of : str
        The file that it is about, if it is about one.
    """

    table: str
    word: str
    value: Any
    reason: str = ""
    is_thin: bool = False
    number: int = 0
    of: str = ""

    @property
    def is_unknown(self) -> bool:
        """True if something in the value is not known."""
        return has_unknown(self.value)

    @property
    def is_open(self) -> bool:
        """True if a person has to fill it in, or to confirm it."""
        return self.is_unknown or self.is_thin

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns that it names, if it is about a quantity."""
        words = self.value if isinstance(self.value, dict) else {}
        if "name" not in words:
            return tuple(words.get("names", ()))
        return numbered(words["name"], words.get("first", 0), words.get("count", 1))

    @property
    def what(self) -> str:
        """Name of the guess in sentences."""
        return f"{self.word} of '{self.of}'" if self.of else f"{self.word} of [{self.table}]"

    @property
    def line(self) -> str:
        """The line of the template, which is corrected there: ``?`` is to be filled in, CHECK to be confirmed."""
        mark = "CHECK: " if self.is_thin else ""
        return f"{self.word} = {toml_value(self.value)}" + (f"  # {mark}{self.reason}" if self.reason else "")

    @property
    def question(self) -> str:
        """A sentence that says what is not known, or not sure."""
        if self.is_unknown:
            return f"{self.what} is not known: {self.reason}."
        return f"{self.what} is {toml_value(self.value)}, because {self.reason}."

    def but(self, reason: str = "", is_thin: bool = False, **words: Any) -> Guess:
        """Return the guess of a column with one more reason, perhaps a thin one, and other words in its value."""
        reasons = "; ".join(one for one in (self.reason, reason) if one)
        value = {**self.value, **words} if words else self.value
        return replace(self, value=value, reason=reasons, is_thin=is_thin or self.is_thin)


@dataclass(frozen=True)
class Proposal:
    """All guesses about some logs, in the order of the file of answers, and sentences about what of the logs is not used."""

    guesses: tuple[Guess, ...]
    notes: tuple[str, ...] = ()

    @property
    def questions(self) -> list[str]:
        """Open guesses, a sentence each."""
        return [guess.question for guess in self.guesses if guess.is_open]

    @property
    def text(self) -> str:
        """The file of answers."""
        what = '# What the logs seem to be. Replace each "?", check what is marked CHECK, and give the file with --answers.'
        lines = [f'format = "{FORMAT}"', what]
        for (table, _), guesses in itertools.groupby(self.guesses, lambda guess: (guess.table, guess.number)):
            lines += [""] if table != "logger.columns" else []
            lines += [f"[[{table}]]" if table in ("logger", "recording") else f"[{table}]"] if table else []
            lines += [guess.line for guess in guesses]
        return "\n".join([*lines, "", *(f"# {note}" for note in self.notes)]) + "\n"

    def columns(self, number: int = 0) -> dict[str, Guess]:
        """Return the source of each quantity of a logger."""
        return {one.word: one for one in self.guesses if (one.table, one.number) == ("logger.columns", number)}

    def of(self, table: str, word: str) -> Guess:
        """Return the guess about a word of a table of which there is one."""
        return next(one for one in self.guesses if (one.table, one.word) == (table, word))

    def with_guess(self, new: Guess) -> Proposal:
        """Return a proposal with another guess about the same line."""
        same = (new.table, new.number, new.word)
        return replace(self, guesses=tuple(new if (o.table, o.number, o.word) == same else o for o in self.guesses))

    def confirmed(self) -> Proposal:
        """Return a proposal of which everything is taken for right but what is not known."""
        return replace(self, guesses=tuple(replace(one, is_thin=False) for one in self.guesses))


def has_unknown(value: Any) -> bool:
    """Return True if a value is, or holds, :data:`UNKNOWN`."""
    if isinstance(value, Mapping | list | tuple):
        return any(map(has_unknown, value.values() if isinstance(value, Mapping) else value))
    return value == UNKNOWN


def toml_value(value: Any) -> str:
    """Return a value as TOML writes it in one line."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {toml_value(one)}" for key, one in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_value(one) for one in value) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        escaped = "".join(
            c if c.isprintable() and c not in '"\\' else (f"\\u{ord(c):04x}" if ord(c) < 0x10000 else f"\\U{ord(c):08x}")
            for c in value
        )
        return f'"{escaped}"'
    return repr(float(value)) if isinstance(value, float) else str(value)
