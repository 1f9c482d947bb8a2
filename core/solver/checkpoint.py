# SPDX-License-Identifier: GPL-3.0-or-later
"""The state of a running simulation as plain arrays and JSON, and back into a new simulation of the same scenario.

All attributes of a simulation are walked through, so that a later addition (an effect's memory, a controller) is saved without
a change here. Descriptions, which do not change, are left out: frozen dataclasses and functions. The file contains no pickle:
reading it runs no code from it.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Mapping
from dataclasses import is_dataclass
from typing import Any

import numpy as np

_FIXED = {"scenario", "_model", "_tree", "_closed", "_center", "_motions", "_detection"}
"""Attributes that a new simulation of the same scenario has already."""
_LEFT_OUT = {"left": "out"}


def pack(simulation: Any) -> dict[str, np.ndarray]:
    """Return a simulation's state as arrays for an .npz file."""
    arrays: dict[str, np.ndarray] = {}
    tree = {key: _pack(value, arrays) for key, value in vars(simulation).items() if key not in _FIXED}
    return {"tree": np.array(json.dumps(tree)), **arrays}


def unpack(simulation: Any, packed: Mapping[str, np.ndarray]) -> None:
    """Set a new simulation of the same scenario to a packed state.

    Raises
    ------
    ValueError, KeyError, TypeError, AttributeError
        The state is of another scenario, or of another version of the program.
    """
    tree = json.loads(str(packed["tree"]))
    if set(tree) != set(vars(simulation)) - _FIXED:
        raise ValueError("the state is that of another version")
    for key, value in tree.items():
        setattr(simulation, key, _unpack(getattr(simulation, key), value, packed))


def _pack(value: Any, arrays: dict[str, np.ndarray]) -> Any:
    if isinstance(value, np.ndarray):
        name = f"array_{len(arrays)}"
        arrays[name] = value
        return {"array": name}
    if isinstance(value, np.generic):
        return _pack(value.item(), arrays)
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return {"fields": {key: _pack(getattr(value, key), arrays) for key in value._fields}}
    if isinstance(value, list | tuple | deque):
        return {"items": [_pack(item, arrays) for item in value]}
    if isinstance(value, dict):
        return {"pairs": [[_pack(key, arrays), _pack(item, arrays)] for key, item in value.items()]}
    if _is_description(value) or not hasattr(value, "__dict__"):
        return _LEFT_OUT
    return {"object": {key: _pack(item, arrays) for key, item in vars(value).items()}}


def _is_description(value: Any) -> bool:
    frozen = is_dataclass(value) and value.__dataclass_params__.frozen  # type: ignore[union-attr]
    return frozen or callable(value)


def _unpack(now: Any, tree: Any, packed: Mapping[str, np.ndarray]) -> Any:
    """Return the unpacked value of `now`; arrays of the same shape keep their memory, which other objects may share."""
    if not isinstance(tree, dict):
        return type(now)(tree) if isinstance(now, np.generic) else tree
    if tree == _LEFT_OUT:
        return now
    kind, content = next(iter(tree.items()))
    if kind == "array":
        array = packed[content]
        if isinstance(now, np.ndarray) and now.shape == array.shape and now.dtype == array.dtype:
            now[...] = array
            return now
        return array
    if kind == "fields":
        return type(now)(**{key: _unpack(getattr(now, key), item, packed) for key, item in content.items()})
    if kind == "items":
        before = list(now) if isinstance(now, list | tuple | deque) else []
        before += [None] * (len(content) - len(before))
        found = [_unpack(one, item, packed) for one, item in zip(before, content)]
        return deque(found, now.maxlen) if isinstance(now, deque) else type(now)(found)
    if kind == "pairs":
        pairs = [(_unpack(None, key, packed), item) for key, item in content]
        return {key: _unpack(now.get(key), item, packed) for key, item in pairs}
    for key, item in content.items():
        setattr(now, key, _unpack(getattr(now, key), item, packed))
    return now
