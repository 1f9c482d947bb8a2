# SPDX-License-Identifier: GPL-3.0-or-later
"""The mesh files that a study gives to its targets, as ``"Ball.mesh" = { choice = ["shapes/*.stl"] }``.

They are copied into the study's folder, under names made of their contents, so that the study goes on without the originals.
"""

from __future__ import annotations

import glob
import os
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path, PurePath
from typing import Any

from ..errors import FileError, os_error_reason
from ..geometry.mesh import TriangleMesh
from ..io.file_writing import atomic_write, file_sha256
from ..io.input_files import load_mesh
from .design import CHOICE
from .scene_property import is_scene_property

MESH = "mesh"
"""Last word of the name of a target's shape."""
MESHES = "meshes"
"""Folder of the copies, in that of the scenes."""
MOST_MESHES_KEPT = 64
"""Meshes that a process keeps in memory."""


class StudyMeshes(Mapping[str, TriangleMesh]):
    """The meshes of a study by the names that its file gives; each is read when it is needed.

    Parameters
    ----------
    folder : Path
        Of the copies.
    entries : iterable of mapping
        ``file``, the name, and ``sha256``.
    """

    def __init__(self, folder: Path, entries: Iterable[Mapping[str, str]] = ()):
        self._folder = folder
        self.digests = {entry["file"]: entry["sha256"] for entry in entries}
        self._load = lru_cache(maxsize=MOST_MESHES_KEPT)(load_mesh)

    def __getitem__(self, name: str) -> TriangleMesh:
        return self._load(_copy_of(self._folder, name, self.digests[name]))

    def __iter__(self) -> Iterator[str]:
        return iter(self.digests)

    def __len__(self) -> int:
        return len(self.digests)

    def __contains__(self, name: object) -> bool:
        return name in self.digests


def expanded(words: Iterable[str], known: Iterable[str]) -> list[str]:
    """Return the names of files that words of a choice mean: those that fit a pattern, in order, or the word itself."""
    names = list(known)
    found: list[str] = []
    for word in words:
        fitting = [name for name in names if PurePath(name).match(word)] if glob.has_magic(word) else [word]
        found += [name for name in fitting if name not in found]
    return found


def words_for_meshes(vary: Mapping[str, Any]) -> list[str]:
    """Return the files and patterns that a study's table of what varies has for targets."""
    found: list[str] = []
    for name, entry in vary.items():
        if not name.endswith(f".{MESH}") or is_scene_property(name):
            continue
        words = entry.get(CHOICE, []) if isinstance(entry, Mapping) else [entry]
        found += [word for word in words if isinstance(word, str)] if isinstance(words, list) else []
    return list(dict.fromkeys(found))


def find_meshes(vary: Mapping[str, Any], base: Path) -> dict[str, Path]:
    """Return the mesh files of a study by the names that it gives, each read once to see that it is one.

    Parameters
    ----------
    vary : mapping
        Of the study.
    base : Path
        Folder of the study's file.

    Raises
    ------
    PalpateError
        A file is missing or no mesh, or no file fits a pattern.
    """
    files: dict[str, Path] = {}
    for word in words_for_meshes(vary):
        if not glob.has_magic(word):
            files[word] = base / word
            continue
        found = sorted(glob.glob(word, root_dir=base))
        if not found:
            raise FileError(f"No file next to the study matches the meshes '{word}': check its name and folder.")
        files |= {Path(name).as_posix(): base / name for name in found}
    for file in files.values():
        load_mesh(file)
    return files


def freeze_meshes(files: Mapping[str, Path], folder: Path) -> list[dict[str, str]]:
    """Copy mesh files into a folder, which is made, and return the entries of :class:`StudyMeshes`; raises FileError."""
    entries = []
    for name, file in files.items():
        entry = {"file": name, "sha256": file_sha256(file)}
        entries.append(entry)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            content = file.read_bytes()
        except OSError as error:
            raise FileError(
                f"The mesh '{file}' could not be copied ({os_error_reason(error)}): check it and '{folder}'."
            ) from error
        with atomic_write(_copy_of(folder, name, entry["sha256"])) as fresh:
            fresh.write_bytes(content)
    return entries


def _copy_of(folder: Path, name: str, sha256: str) -> Path:
    return folder / f"{sha256[:24]}{os.path.splitext(name)[1].lower()}"
