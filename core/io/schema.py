# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of files as dataclasses: msgspec checks each value by its annotation, and a mistake becomes one sentence.

::

    @dataclass(frozen=True)
    class SecondLogger:
        file: Name
        late: Annotated[float, wanted("write seconds", ge=-1e10, le=1e10)] = 0.0

refuses a table with the words ``late of readings of Trial 2 of 'rig.toml' is 'soon': write seconds.``

Never annotate a number with limits or a tuple of fixed length in one union: msgspec 0.22 mixes the two up and reads memory that
is not its own. A list with `min_length` and `max_length` says the same and is safe.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, fields
from functools import cache
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin, get_type_hints

import msgspec

from ..errors import FileError, os_error_reason, suggestion
from .input_files import checked_name, read_bytes

T = TypeVar("T")

LARGEST = 1.7e308
"""Largest size of a number in a file."""
WORD = "word"
"""Key of a field's metadata: its name in the file, where that is no name of Python."""
THIS_FORMAT = "this format"
_NAME = "name"


def wanted(advice: str, names: bool = False, **limits: Any) -> msgspec.Meta:
    """Return the annotation of a word.

    Parameters
    ----------
    advice : str
        What to write, for the sentence of a mistake.
    names : bool
        Whether each text has to be a name (:func:`.checked_name`).
    **limits
        Of :class:`msgspec.Meta`.
    """
    return msgspec.Meta(description=advice, title=_NAME if names else None, **limits)


Name = Annotated[str, wanted("write a text", names=True)]
Number = Annotated[float, wanted("give a number", ge=-LARGEST, le=LARGEST)]
Positive = Annotated[float, wanted("give a number above zero", gt=0.0, le=LARGEST)]
Seconds = Annotated[float, wanted("write seconds", ge=-LARGEST, le=LARGEST)]
Switch = Annotated[bool, wanted("write true or false")]


def known_words(table: Mapping[str, Any], words: Iterable[str], where: str, what: str = THIS_FORMAT) -> None:
    """Raise :class:`FileError` for the first key of a table that is not among the `words` of its format."""
    known = sorted(words) if isinstance(words, set) else list(words)
    for key in table:
        if key not in known:
            hint = suggestion(key, known)
            raise FileError(f"{key!r:.60} in {where} is not a word of {what}{hint}: it knows {', '.join(known)}.")


def read_words(
    table: Any, kind: Callable[..., T], where: str, what: str = THIS_FORMAT, besides: Iterable[str] = (), **given: Any
) -> T:
    """Return a table of a file as an object of a dataclass.

    Parameters
    ----------
    table : mapping
        As TOML gives it.
    kind : type
        The dataclass; its fields are the words of the table.
    where, what : str
        Which table of which file this is, and what its format is called, for messages.
    besides : iterable of str
        Words that the table may have and that are read elsewhere.
    **given
        Fields that are not in the file.

    Raises
    ------
    FileError
        A word is missing, is not known, or has a value that it cannot have.
    """
    if not isinstance(table, Mapping):
        raise FileError(f"{where} is {table!r:.60}: write a table.")
    known_words(table, [*(word for word, (name, *_) in _words(kind).items() if name not in given), *besides], where, what)
    try:
        found = _made(table, kind, given)
    except _Fault as fault:
        word, value = fault.word, table.get(fault.word)
        above, advice = _in_brackets(word, fault.hint), _advice(fault.hint, value)
        if word not in table:
            raise FileError(f"{where} has no {above}: {advice}") from fault
        if above != word:
            raise FileError(f"{where} has no {above}, but {word} = {value!r:.60}: {advice}") from fault
        raise FileError(f"{word} of {where} is {value!r:.60}: {advice}") from fault
    for word, (name, hint, _) in _words(kind).items():
        meta = _meta(hint)
        if word in table and name not in given and meta is not None and meta.title == _NAME:
            value = getattr(found, name)
            for text in value if isinstance(value, tuple) else (value,):
                checked_name(text, where if word == "name" else f"{word} of {where}")
    return found


def read_json(path: str | os.PathLike, kind: Callable[..., T], format_name: str, advice: str) -> tuple[T, dict[str, Any]]:
    """Read a JSON file that Palpate wrote.

    Parameters
    ----------
    path : path
    kind : type
        A dataclass. Other keys than its fields are left out.
    format_name : str
        What the file says of its format.
    advice : str
        What to do if it is damaged.

    Returns
    -------
    found : object of the dataclass
    content : dict
        All of the file.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    FileError
        It cannot be read, or it is not what this version reads.
    """
    try:
        content = json.loads(read_bytes(path).decode("utf-8", "surrogatepass"))
    except FileNotFoundError:
        raise
    except OSError as error:
        raise FileError(f"'{path}' could not be read ({os_error_reason(error)}): check its permissions.") from error
    except (ValueError, RecursionError) as error:
        raise FileError(f"'{path}' is damaged (not JSON): {advice}.") from error
    stated = content.get("format") if isinstance(content, dict) else None
    if stated is None:
        raise FileError(f"'{path}' is damaged (it says no format): {advice}.")
    if stated != format_name:
        raise FileError(f"'{path}' is not a '{format_name}' file but {stated!r:.60}: {advice} with this version.")
    try:
        return _made(content, kind, {}), content
    except _Fault as fault:
        raise FileError(f"'{path}' is damaged ({fault}): {advice}.") from fault


class _Fault(Exception):
    """A word that is missing or has a wrong value, in words for the brackets of a message."""

    def __init__(self, word: str, hint: Any, stated: str):
        super().__init__(stated)
        self.word, self.hint = word, hint


def _made(table: Mapping[str, Any], kind: Callable[..., T], given: Mapping[str, Any]) -> T:
    values = dict(given)
    for word, (name, hint, is_required) in _words(kind).items():
        if name in given:
            continue
        if word in table:
            try:
                values[name] = msgspec.convert(table[word], hint)
            except msgspec.ValidationError as error:
                message, _, place = str(error).partition(" - at `$")
                inside = f"{word}{place.rstrip('`')}: {message}"
                is_in_list = place and "[...]" not in place  # a key is not told
                raise _Fault(word, hint, inside if is_in_list else f"{word} is {table[word]!r:.60}") from error
        elif is_required:
            raise _Fault(word, hint, f"'{word}' is missing")
    return kind(**values)


@cache
def _words(kind: Any) -> dict[str, tuple[str, Any, bool]]:
    """Return the name, the annotation and the need of each field of a dataclass, by its word in the file."""
    hints = get_type_hints(kind, include_extras=True)
    return {
        one.metadata.get(WORD, one.name): (one.name, hints[one.name], one.default is one.default_factory is MISSING)
        for one in fields(kind)
    }


def _meta(hint: Any) -> msgspec.Meta | None:
    """Return the metadata that :func:`wanted` gave to a word, also to one that may be None."""
    return next((meta for part in (hint, *get_args(hint)) for meta in getattr(part, "__metadata__", ())), None)


def _in_brackets(word: str, hint: Any) -> str:
    """Return a word as it stands above a table, or above each table of a list; other words as they are."""
    kinds = [getattr(part, "__origin__", part) for part in (hint, *get_args(hint))]
    if dict[str, Any] in kinds:
        return f"[{word}]"
    return f"[[{word}]]" if list[dict[str, Any]] in kinds else word


def _advice(hint: Any, value: Any) -> str:
    meta = _meta(hint)
    if meta is not None:
        return f"{meta.description}."
    choices = [choice for part in (hint, *get_args(hint)) if get_origin(part) is Literal for choice in get_args(part)]
    listed = " or ".join(f'"{choice}"' for choice in choices) if len(choices) == 2 else f"one of {', '.join(choices)}"
    return f"write {listed if choices else 'another value'}{suggestion(str(value), choices)}."
