# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of files as typed values: msgspec reads and checks them, and a mistake becomes one sentence.

A class says what a table may have::

    class RecordingWords(Table):
        file: Name
        tared: Switch = False
        late: Annotated[float, wanted("write seconds", ge=-1e10, le=1e10)] = 0.0

and the sentence of a mistake is ``late of Trial 2 of 'rig.toml' is 'soon': write seconds.``

A union must not hold a number with limits beside a tuple of fixed length: msgspec 0.22 then reads beyond its own memory. A list
with `min_length` and `max_length` does the same and is safe.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Annotated, Any, Literal, TypeVar, get_args, get_type_hints

import msgspec

from ..errors import FileError, did_you_mean, os_error_reason
from .regular_file import read_bytes
from .toml_file import checked_name

T = TypeVar("T")
Words = TypeVar("Words", bound="Table")

LARGEST = 1.7e308
"""Largest size of a number in a file; a larger one is infinite or nearly so."""
THIS_FORMAT = "this format"


def wanted(advice: str, **limits: Any) -> msgspec.Meta:
    """Return the annotation of a word: what to write, for its sentence, and limits as :class:`msgspec.Meta` takes them."""
    return msgspec.Meta(description=advice, **limits)


_NAME = wanted("write a text")
Name = Annotated[str, _NAME]
"""A text that can be a name (:func:`.checked_name`)."""
Number = Annotated[float, wanted("give a number", ge=-LARGEST, le=LARGEST)]
Switch = Annotated[bool, wanted("write true or false")]
FREE: Literal["free"] = "free"
"""What a rig writes for a number that is fitted."""


class Table(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of a file that has no other words than its fields."""


def known_words(table: Mapping[str, Any], words: Iterable[str], where: str, what: str = THIS_FORMAT) -> None:
    """Raise :class:`FileError` for the first key of a table that is not among the `words` of its format."""
    known = sorted(words)
    for key in table:
        if key not in known:
            advice = did_you_mean(key, known, f"it knows {', '.join(known)}.")
            raise FileError(f"{key!r:.60} in {where} is not a word of {what}: {advice}")


def read_table(table: Any, kind: type[Words], where: str, what: str = THIS_FORMAT) -> Words:
    """Return a table as an object of its class.

    Parameters
    ----------
    table : mapping
        As TOML gives it.
    kind : type
        A subclass of :class:`Table`.
    where, what : str
        Which table of which file this is, and what its format is called, for messages.

    Raises
    ------
    FileError
        A word is missing, is not known, or has a value that it cannot have.
    """
    if isinstance(table, Mapping):
        known_words(table, kind.__struct_encode_fields__, where, what)
    try:
        found = msgspec.convert(table, kind)
    except msgspec.ValidationError as error:
        raise FileError(_sentence(str(error), table, kind, where, what)) from error
    for name, hint in _hints(kind).items():
        if name in table and _NAME in _parts(hint):
            value = getattr(found, name)
            for text in value if isinstance(value, tuple) else (value,):
                checked_name(text, f"{name} of {where}")
    return found


def read_json(path: str | os.PathLike, kind: type[T], format_name: str, advice: str) -> tuple[T, dict[str, Any]]:
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
    found : object of the class
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
    said = content.get("format") if isinstance(content, dict) else None
    if said is None:
        raise FileError(f"'{path}' is damaged (it says no format): {advice}.")
    if said != format_name:
        raise FileError(f"'{path}' is not a '{format_name}' file but {said!r:.60}: {advice} with this version.")
    try:
        return msgspec.convert(content, kind), content
    except msgspec.ValidationError as error:
        words, value = _place(str(error), content)
        missing = _quoted(str(error), "Object missing required field")
        place = ".".join(words).replace(".[", "[")
        fault = f"'{missing}' is missing" if missing else f"{place} is {value!r:.60}"
        raise FileError(f"'{path}' is damaged ({fault}): {advice}.") from error


def _sentence(message: str, table: Any, kind: type[Table], where: str, what: str) -> str:
    """Return our sentence for a message of msgspec."""
    words, value = _place(message, table)
    advice = ""
    for word in words:
        where = f"{word} of {where}"
        advice, kind = _advice(kind, word), _table_in(kind, word)
    missing = _quoted(message, "Object missing required field")
    if missing:
        return f"{where} has no {missing}: {_advice(kind, missing)}."
    if "unknown field" in message:
        try:
            known_words(value, kind.__struct_encode_fields__, where, what)
        except FileError as error:
            return str(error)
    return f"{where} is {value!r:.60}: {advice or 'write a table'}."


def _place(message: str, content: Any) -> tuple[list[str], Any]:
    """Return the words that lead to what a message is about, and its value; a list of plain values counts as one."""
    words: list[str] = []
    for name, index in re.findall(r"\.([^.\[]+)|\[(\d+)\]", message.rpartition(" - at `$")[2].removesuffix("`")):
        if name and isinstance(content, Mapping) and name in content:
            words.append(name)
            content = content[name]
        elif index and isinstance(content, list) and isinstance(content[int(index)], Mapping):
            words.append(f"[{index}]")
            content = content[int(index)]
        else:
            break
    return words, content


def _quoted(message: str, begin: str) -> str:
    return message.removeprefix(begin).split("`")[1] if message.startswith(begin) else ""


def _hints(kind: type[Table]) -> dict[str, Any]:
    """Return the annotations of a table by the words of the file."""
    hints = get_type_hints(kind, include_extras=True)
    return {word: hints[name] for word, name in zip(kind.__struct_encode_fields__, kind.__struct_fields__, strict=True)}


def _parts(hint: Any) -> Iterator[Any]:
    """Yield an annotation and what it consists of, metadata too."""
    yield hint
    for part in get_args(hint):
        yield from _parts(part)


def _advice(kind: type[Table], word: str) -> str:
    metas = [part for part in _parts(_hints(kind)[word]) if isinstance(part, msgspec.Meta)]
    return next((meta.description for meta in metas if meta.description), "give another value")


def _table_in(kind: type[Table], word: str) -> type[Table]:
    return next((part for part in _parts(_hints(kind)[word]) if isinstance(part, type) and issubclass(part, Table)), kind)
