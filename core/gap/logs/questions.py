# SPDX-License-Identifier: GPL-3.0-or-later
"""Asks what logs leave open, at the terminal or in a dialog; what is typed is written as in a file of answers."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from ..dataset.column_names import QUANTITIES
from .column_meaning import KNOWN_UNITS
from .guess import Guess, Proposal, toml_value

LEFT_OUT = "-"
"""Reply for a column that is not to be used."""


class OpenQuestion(Exception):
    """A question to which there is no reply yet; its text is what to ask."""


def answered(proposal: Proposal, replies: Sequence[str]) -> Proposal:
    """Return a proposal whose open questions have these replies, in turn; raise :class:`OpenQuestion` for the next one."""
    waiting = iter(replies)

    def ask(question: str) -> str:
        for reply in waiting:
            return reply
        raise OpenQuestion(question)

    return asked(proposal, ask)


def asked(proposal: Proposal, ask: Callable[[str], str] = input) -> Proposal:
    """Return a proposal of which every open guess was put to the user; Enter keeps what is proposed."""
    found = (_asked(guess, ask) for guess in proposal.guesses)
    return replace(proposal, guesses=tuple(guess for guess in found if guess is not None))


def _asked(guess: Guess, ask: Callable[[str], str]) -> Guess | None:
    """Return a guess after the question about it; None if the column is not to be used."""
    is_column = guess.table == "logger.columns"
    choice = (
        f": the column and its unit, force = … if it is a force, {LEFT_OUT} for none" if is_column else ", as in the brackets"
    )
    while guess.is_open:
        typed = ask(f"{guess.what}{choice} ({guess.reason})\n  [{toml_value(guess.value)}] ").strip()
        if typed == LEFT_OUT and is_column:
            return None
        word, is_other, rest = (part.strip() for part in typed.partition("="))
        if is_column and is_other and word in QUANTITIES:
            guess, typed = replace(guess, word=word, value={}), rest
        value = _typed(typed, guess) if typed else guess.value
        guess = replace(guess, value=value, is_thin=False) if value is not None else guess
    return guess


def _typed(typed: str, guess: Guess) -> Any:
    """Return a reply as TOML; of a column its name and its unit are enough. None if it is neither."""
    try:
        return tomllib.loads(f"value = {typed}")["value"]
    except tomllib.TOMLDecodeError:
        if guess.table != "logger.columns":
            return None
        name, _, unit = typed.rpartition(" ")
        is_unit = name and unit in KNOWN_UNITS
        kept = {word: guess.value[word] for word in ("unit", "area") if isinstance(guess.value, dict) and word in guess.value}
        return {**kept, "name": name, "unit": unit} if is_unit else {**kept, "name": typed}
