# SPDX-License-Identifier: GPL-3.0-or-later
"""What importers read from XML elements: numbers, poses, and meshes beside the file."""

from __future__ import annotations

import os
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from ..errors import FileError
from ..geometry.mesh import TriangleMesh
from ..io.mesh_file import load_mesh


def numbers_in(path: str | os.PathLike, element: ElementTree.Element, key: str, default: str | None = None) -> np.ndarray:
    """Return the numbers of an attribute.

    Raises
    ------
    FileError
        It is missing and has no default, or holds something else than finite numbers.
    """
    text = element.get(key, default)
    label = f"<{element.tag} name='{element.get('name', '')}'>"
    if text is None:
        raise FileError(f"{label} in '{path}' has no '{key}': add it.")
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError as error:
        raise FileError(f"'{key}' of {label} in '{path}' is '{text[:60]}', which are not numbers: correct it.") from error
    if not np.isfinite(values).all():
        raise FileError(f"'{key}' of {label} in '{path}' has a number that is NaN or infinite: correct it.")
    return values


def vector_in(path: str | os.PathLike, element: ElementTree.Element, key: str, default: str, length: int = 3) -> np.ndarray:
    """Return an attribute of `length` numbers; raises FileError as :func:`numbers_in`, and for another number of them."""
    values = numbers_in(path, element, key, default)
    if len(values) != length:
        raise FileError(f"'{key}' of <{element.tag}> in '{path}' has {len(values)} numbers: give {length}.")
    return values


def mesh_beside(path: str | os.PathLike, name: str, folder: str = "") -> TriangleMesh:
    """Return a mesh that a file names, relative to the file and a folder; raises FileError or MeshError if there is none."""
    plain = name.removeprefix("file://")
    if "://" in plain:
        raise FileError(f"'{name}' is looked up by a robot's software: write the path of the mesh into '{path}'.")
    return load_mesh(Path(path).parent / folder / plain)


def quaternion_of(rotation: np.ndarray) -> np.ndarray:
    """Return the quaternion (w, x, y, z) of a (3, 3) rotation matrix."""
    from scipy.spatial.transform import Rotation

    return np.roll(Rotation.from_matrix(rotation).as_quat(), 1)
