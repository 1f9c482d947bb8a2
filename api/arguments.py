# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks of arguments. Each message names the argument, says what is wrong with it and what to give instead."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..core.errors import ArgumentError, suggestion
from ..core.geometry.mesh import TriangleMesh, checked_mesh
from ..core.model.sensor_parameters import SENSOR_PARAMETERS, SensorParameters, with_dependent_defaults
from ..core.simulators.sensor_on_mesh import SensorOnMesh

LARGEST_SENSOR, LARGEST_BODY = 5.0, 10.0
"""Metres. Larger values were almost certainly given in millimetres."""
SMALLEST = 1e-7
"""Metres. Smaller surfaces are points for texels."""


def brief(value: Any) -> str:
    """Return a value as it stands in a message: on one line, and no longer than that."""
    return " ".join(repr(value).split())[:60]


def number(value: Any, argument: str, above_zero: bool = False) -> float:
    """Return a finite number; raise :class:`ArgumentError`, which names the argument, when it is none."""
    try:
        found = float(value)
    except (TypeError, ValueError):
        raise ArgumentError(f"{argument} is {brief(value)}: give a number.") from None
    if not np.isfinite(found) or (above_zero and found <= 0):
        raise ArgumentError(f"{argument} is {found:g}: give a finite number{' above zero' if above_zero else ''}.")
    return found


def count(value: Any, argument: str) -> int:
    """Return a whole number above zero."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise ArgumentError(f"{argument} is {brief(value)}: give a whole number above zero.")
    return int(value)


def numbers(value: Any, shape: tuple[int, ...], argument: str) -> np.ndarray:
    """Return a float array of a shape, in which -1 stands for any length, of finite numbers."""
    wanted = " × ".join("n" if size < 0 else str(size) for size in shape)
    try:
        found = np.array(value, float)
    except (TypeError, ValueError):
        raise ArgumentError(f"{argument} is {brief(value)}: give {wanted} numbers.") from None
    if found.ndim != len(shape) or any(size not in (-1, own) for size, own in zip(shape, found.shape, strict=True)):
        raise ArgumentError(f"{argument} has the shape {found.shape}: give {wanted} numbers.")
    if not np.isfinite(found).all():
        place = tuple(int(i) for i in np.argwhere(~np.isfinite(found))[0])
        raise ArgumentError(f"{argument} is NaN or infinite at {list(place)}: give finite numbers.")
    return found


def quaternion(value: Any, argument: str) -> np.ndarray:
    """Return a unit quaternion (w, x, y, z)."""
    found = numbers(value, (4,), argument)
    length = float(np.linalg.norm(found))
    if length == 0.0:
        raise ArgumentError(f"{argument} is zero: give (w, x, y, z), as (1, 0, 0, 0) for no rotation.")
    return found / length


def known(words: Iterable[str], names: Sequence[str], what: str) -> None:
    """Raise :class:`ArgumentError` for the first word that is none of the names, with the most similar one."""
    for word in words:
        if word not in names:
            raise ArgumentError(f"There is no {what} '{word}'{suggestion(word, names)}: choose from {', '.join(names)}.")


def parameters(words: Mapping[str, Any], sensor: str) -> SensorParameters:
    """Return the parameters of a sensor from values by name; those that are not given have their defaults.

    A label, as "Stiffness", is understood only in the message about a wrong name.
    """
    labels = {one.label.lower().replace(" ", "_"): name for name, one in SENSOR_PARAMETERS.items() if one.label}
    values = {}
    for word, value in words.items():
        if word.lower() in labels and word not in SENSOR_PARAMETERS:
            raise ArgumentError(f"There is no parameter '{word}' of a sensor: it is called '{labels[word.lower()]}'.")
        known([word], list(SENSOR_PARAMETERS), "parameter of a sensor called")
        plain = value.item() if isinstance(value, np.generic) else value
        values[word] = SENSOR_PARAMETERS[word].read(plain)
        if values[word] is None:
            raise ArgumentError(f"{word} of sensor '{sensor}' is {brief(value)}: give {SENSOR_PARAMETERS[word].wanted}.")
    found = SensorParameters(**with_dependent_defaults(values))
    found.check(sensor)
    return found


def mesh_of(value: Any, argument: str, name: str) -> TriangleMesh:
    """Return a surface from a file, from ``(vertices, faces)``, or from an object with both, as trimesh has them."""
    if isinstance(value, str | os.PathLike):
        from ..core.io.input_files import load_mesh

        return load_mesh(value)
    if isinstance(value, TriangleMesh):
        vertices, faces = value.vertices, value.triangles
    elif isinstance(value, tuple | list) and len(value) == 2:
        vertices, faces = value
    elif hasattr(value, "vertices") and hasattr(value, "faces"):
        vertices, faces = value.vertices, value.faces
    else:
        raise ArgumentError(f"{argument} is {brief(value)}: give a file, (vertices, faces), or a mesh of trimesh.")
    points = numbers(vertices, (-1, 3), f"vertices of {argument}")
    corners = numbers(faces, (-1, 3), f"faces of {argument}")
    return checked_mesh(points, corners.astype(int), name)[0]


def size_checked(points: np.ndarray, largest: float, argument: str, what: str) -> None:
    """Raise :class:`ArgumentError` when points span so much or so little that their unit cannot be the metre."""
    span = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
    if span > largest:
        raise ArgumentError(
            f"{argument} makes {what} {span:.3g} m large: lengths are in metres, so divide millimetres by 1000."
        )
    if len(points) > 1 and span < SMALLEST:
        raise ArgumentError(f"{argument} makes {what} only {span:.3g} m large: lengths are in metres.")


def sensor_on_mesh(value: Any) -> SensorOnMesh:
    """Return a sensor, of a file or made here."""
    if not isinstance(value, SensorOnMesh):
        raise ArgumentError(f"sensor is {brief(value)}: give a Sensor.")
    return value


def name_from(value: Any, name: str | None, otherwise: str) -> str:
    """Return the given name, or that of a file, or another."""
    if name is not None:
        if not isinstance(name, str) or not name.strip():
            raise ArgumentError(f"name is {brief(name)}: give a text.")
        return name
    return Path(value).stem if isinstance(value, str | os.PathLike) else otherwise


def as_list(value: Any, kind: type, argument: str, what: str) -> list[Any]:
    """Return one thing or several as a list; raise :class:`ArgumentError` for what is of another kind."""
    items = list(value) if isinstance(value, list | tuple) else [value]
    for item in items:
        if not isinstance(item, kind):
            raise ArgumentError(f"{argument} has {brief(item)}: give {what}, or a list of several.")
    return items
