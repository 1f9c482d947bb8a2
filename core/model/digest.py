# SPDX-License-Identifier: GPL-3.0-or-later
"""Hashes of descriptions made of dataclasses, arrays, numbers and words."""

from __future__ import annotations

import hashlib
from dataclasses import Field, fields, is_dataclass
from typing import Any

import numpy as np

from .recording import BLOCK_BYTES, row_blocks

IF_GIVEN = "if given"
"""Key of the metadata of a field that counts only if it is not None. What lacks it has the hash from before there was such a
field."""


def digest_of(value: object) -> str:
    """Return a hash of a description, the same in every process and on every platform.

    The names of fields and their order count. Checkpoints and bakes keep the hash of their scenario, so after a field has been
    renamed or moved, an unfinished bake starts again from its first frame.

    Parameters
    ----------
    value : object
        A dataclass, or a tuple of dataclasses. Their fields hold numbers, texts, arrays, dictionaries and again dataclasses.
    """
    digest = hashlib.sha256(b"palpate-scenario/1")
    _feed(digest, value)
    return digest.hexdigest()


_known_fields: dict[Any, tuple[Field[Any], ...] | None] = {}


def _fields_of(value: Any) -> tuple[Field[Any], ...] | None:
    """Return the fields of a dataclass, None for another value; looked up by its type, as a scenario has hundreds of values."""
    kind = type(value)
    if kind not in _known_fields:
        _known_fields[kind] = fields(kind) if is_dataclass(kind) else None
    return _known_fields[kind]


def stated_fields(value: Any) -> list[Field[Any]]:
    """Return the fields of a dataclass that count for its hash and stand in its file."""
    own = _fields_of(value) or ()
    return [item for item in own if IF_GIVEN not in item.metadata or getattr(value, item.name) is not None]


def _feed(digest: hashlib._Hash, value: Any) -> None:
    """Hash dataclasses field by field, arrays with type and shape, and everything else by its representation."""
    if _fields_of(value) is not None:
        for item in stated_fields(value):
            digest.update(item.name.encode())
            _feed(digest, getattr(value, item.name))
    elif isinstance(value, tuple | list):
        digest.update(f"[{len(value)}".encode())
        for item in value:
            _feed(digest, item)
    elif isinstance(value, dict):
        _feed(digest, sorted(value.items()))
    elif isinstance(value, np.ndarray):
        array = np.ascontiguousarray(value)
        digest.update(f"{array.dtype.str}{array.shape}".encode())
        for rows in row_blocks(array) if array.nbytes > BLOCK_BYTES else (...,):
            digest.update(array[rows].tobytes())
    else:
        digest.update(repr(value).encode())
