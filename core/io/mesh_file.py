# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangle meshes from files: STL, PLY, OBJ and OFF, read by trimesh. Coordinates are metres."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from ..errors import FileError, MeshError
from ..geometry.mesh import TriangleMesh, checked_mesh
from .regular_file import open_regular

SUFFIXES = (".stl", ".ply", ".obj", ".off")
"""Endings of the files that are read."""


def load_mesh(path: str | os.PathLike) -> TriangleMesh:
    """Read a mesh. Vertices at the same place become one, as STL repeats them for each face.

    Raises
    ------
    FileError
        There is no such file, or it is none of these formats.
    MeshError
        It has no faces with an area, or a coordinate is not finite.
    """
    import trimesh

    name, suffix = Path(path).name, Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise FileError(f"'{path}' is not a mesh file: give one that ends with {', '.join(SUFFIXES)}.")
    try:
        with open_regular(path) as file:
            loaded = trimesh.load_mesh(file, file_type=suffix[1:], process=False)
    except FileNotFoundError as error:
        raise FileError(f"There is no mesh file '{path}': check its name and folder.") from error
    except MemoryError:
        raise
    except Exception as error:  # a reader meets anything in a damaged file
        words = " ".join(str(error).split()) or type(error).__name__
        raise FileError(f"'{path}' could not be read as a mesh ({words:.80}): export it again.") from error
    if not isinstance(loaded, trimesh.Trimesh):
        raise MeshError(f"'{name}' has no faces: give the file of a surface.")
    if np.isfinite(loaded.vertices).all():  # else checked_mesh says which is not
        loaded.merge_vertices(merge_tex=True, merge_norm=True)
    return checked_mesh(loaded.vertices, loaded.faces, name)[0]
