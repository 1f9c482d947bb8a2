# SPDX-License-Identifier: GPL-3.0-or-later
"""The state of a running simulation as plain arrays and JSON, and back into a new simulation of the same scenario.

What a class carries from frame to frame stands in its ``CARRIED``. Nothing else is saved: all the rest follows from the
scenario or from what is carried. The file may come from anywhere, and kernels follow the numbers in it without looking. So each
value must have the type and the shape that a new simulation has in its place, floats must be finite, and triangles must be
those of their target. The file contains no pickle: reading it runs no code from it.
"""

from __future__ import annotations

import copy
import hashlib
import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from .solver_model import SolverModel, State

MAY_BE_INFINITE = "stored_energy"
"""Field of :class:`.State` that is infinite where animation brings energy (see :mod:`.passivity`)."""
LARGEST = 1e30
"""Largest size of a number in a state: products of several larger ones overflow. No scene comes near it."""


def pack(simulation: Any) -> dict[str, np.ndarray]:
    """Return what a simulation carries as arrays for an .npz file."""
    arrays: dict[str, np.ndarray] = {}
    tree = _pack(simulation, arrays)
    return {"tree": np.array(json.dumps(tree)), **arrays}


def digest(packed: Mapping[str, np.ndarray]) -> str:
    """Return the SHA-256 of arrays with their names, types and shapes."""
    found = hashlib.sha256()
    for name, array in sorted(packed.items()):
        found.update(f"{name} {array.dtype.str} {array.shape} ".encode("utf-8", "surrogatepass"))
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()


def unpack(simulation: Any, packed: Mapping[str, np.ndarray], frame: int | None = None) -> None:
    """Set a new simulation of the same scenario to a packed state; if that fails, it is still new.

    Parameters
    ----------
    simulation : Simulation
    packed : mapping of str to ndarray
    frame : int, optional
        The frame that the state must be of.

    Raises
    ------
    ValueError, KeyError, TypeError, AttributeError
        The state is damaged, of another scenario, or of another version of the program.
    """
    found = _unpack(simulation, json.loads(str(packed["tree"])), packed, "simulation")
    scenario = simulation.scenario
    if not scenario.frame_start <= found.frame <= scenario.frame_end:
        raise ValueError(f"frame {found.frame} is none of the scenario's")
    if frame not in (None, found.frame):
        raise ValueError(f"the state is of frame {found.frame}, not {frame}")
    _check_state(found._state, simulation._model, np.cumsum([0, *(len(target.mesh.triangles) for target in scenario.targets)]))
    for name in simulation.CARRIED:
        setattr(simulation, name, getattr(found, name))
    simulation.follow_state()


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
        return {"fields": {name: _pack(getattr(value, name), arrays) for name in value._fields}}
    if isinstance(value, list):
        return {"items": [_pack(item, arrays) for item in value]}
    if isinstance(value, dict):
        return {"pairs": [[_pack(key, arrays), _pack(item, arrays)] for key, item in value.items()]}
    return {"object": {name: _pack(getattr(value, name), arrays) for name in type(value).CARRIED}}


def _unpack(now: Any, tree: Any, packed: Mapping[str, np.ndarray], where: str) -> Any:
    """Return what `tree` says in the place of `now`, whose type and shape it must have; `now` is unchanged."""
    if not isinstance(tree, dict):
        return _scalar(now, tree, where)
    if len(tree) != 1:
        raise ValueError(f"{where} is no single value")
    ((kind, content),) = tree.items()
    if kind == "array" and isinstance(now, np.ndarray):
        return _array(now, packed[content], where)
    if kind == "fields" and hasattr(now, "_fields"):
        _require_same(content, now._fields, where)
        return type(now)(**{n: _unpack(getattr(now, n), content[n], packed, f"{where}.{n}") for n in now._fields})
    if kind == "items" and isinstance(now, list):
        return _items(now, content, packed, where)
    if kind == "pairs" and isinstance(now, dict):
        pairs = {key: item for key, item in content if type(key) in (int, str)}
        _require_same(pairs, now, where)
        return {key: _unpack(item, pairs[key], packed, f"{where}[{key}]") for key, item in now.items()}
    if kind == "object" and hasattr(now, "CARRIED"):
        _require_same(content, now.CARRIED, where)
        found = copy.copy(now)
        for name in now.CARRIED:
            setattr(found, name, _unpack(getattr(now, name), content[name], packed, f"{where}.{name}"))
        if hasattr(found, "check_carried"):
            found.check_carried()
        return found
    raise ValueError(f"{where} is {kind!r}, but {type(now).__name__} was expected")


def _items(now: list[Any], content: Any, packed: Mapping[str, np.ndarray], where: str) -> list[Any]:
    """Return the items of a list, which are as many as those of a new simulation; sentences may have been added."""
    if all(isinstance(item, str) for item in now):
        if not (isinstance(content, list) and all(isinstance(item, str) for item in content)):
            raise ValueError(f"{where} has items that are no text")
        return list(content)
    if len(content) != len(now):
        raise ValueError(f"{where} has {len(content)} items, not {len(now)}")
    return [_unpack(one, item, packed, f"{where}[{i}]") for i, (one, item) in enumerate(zip(now, content, strict=True))]


def _scalar(now: Any, value: Any, where: str) -> Any:
    """Return a value of the same type. None becomes a float where a first sample gives one."""
    if type(value) is not type(now) and not (now is None and isinstance(value, float)):
        raise ValueError(f"{where} is {type(value).__name__}, not {type(now).__name__}")
    if isinstance(value, float) and not abs(value) <= LARGEST:
        raise ValueError(f"{where} is {value}")
    return value


def _array(now: np.ndarray, array: np.ndarray, where: str) -> np.ndarray:
    """Return a writable array of the same type and shape; one without rows may have got some."""
    fits = array.shape == now.shape or (now.ndim > 0 and len(now) == 0 and array.shape[1:] == now.shape[1:])
    if not fits or array.dtype != now.dtype:
        raise ValueError(f"{where} is {array.dtype} {array.shape}, not {now.dtype} {now.shape}")
    if array.dtype.kind == "f" and not where.endswith(f".{MAY_BE_INFINITE}") and not (np.abs(array) <= LARGEST).all():
        raise ValueError(f"{where} has values that are not finite, or too large")
    return np.array(array, order="C")


def _require_same(names: Any, expected: Any, where: str) -> None:
    if not isinstance(names, dict) or set(names) != set(expected):
        raise ValueError(f"{where} does not have the parts {sorted(map(str, expected))}")


def _check_state(state: State, model: SolverModel, first_triangle: np.ndarray) -> None:
    """Raise ValueError unless the arrays belong to the model, and what kernels follow is there.

    Parameters
    ----------
    state : State
    model : SolverModel
    first_triangle : (T + 1,) int
        Where the triangles of each target begin.
    """
    from .solver_model import TOO_DEEP  # compiles kernels; a bake that only looks for a checkpoint needs none

    sizes = {"drives": len(model.drives.gains), "effect_memory": len(model.points.frame)}
    pairs = model.pairs
    sizes |= {"stored_energy": len(pairs.sensor)}
    sizes |= dict.fromkeys(("triangle", "bristle", "pressed_share"), int((pairs.stop_point - pairs.first_point).sum()))
    for name, size in sizes.items():
        if len(getattr(state, name)) != size:
            raise ValueError(f"{name} has {len(getattr(state, name))} rows, not {size}")
    if np.isnan(state.stored_energy).any():
        raise ValueError("an energy is not a number")
    length = np.linalg.norm(state.quaternion, axis=1)
    if not ((length > 0.5) & (length < 2.0)).all():  # Blender's are of length one to float32; any multiple would turn, too
        raise ValueError("a rotation is none")
    for pair, target in enumerate(pairs.target):
        first = pairs.first_slot[pair]
        met = state.triangle[first : first + pairs.stop_point[pair] - pairs.first_point[pair]]
        known = (met >= first_triangle[target]) & (met < first_triangle[target + 1])
        if not (known | ((met >= TOO_DEEP) & (met < 0))).all():
            raise ValueError("a triangle is not one of its target")
