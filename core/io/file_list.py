# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of files that an export leaves in its folder, and the exchange of these files by those of the next export.

An export is written whole into a hidden folder. Then the list names the new files, the old files are removed, and the new ones
are renamed into their place. A process that is killed leaves the old files or the new ones, or only some of the old or of the
new ones, but never both beside each other; the next export into the folder completes what is unfinished. An export of a hundred
frames that is followed by one of ten leaves no images of the earlier one. Only files that the list names, and that still have
the content it was written for, are removed.
"""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath
from typing import Any

from ..errors import FileError, os_error_reason
from .file_writing import atomic_write, file_sha256, require_replaceable, sync_folder, writable_folder
from .regular_file import read_bytes
from .temporary_folder import NAME, remove_unfinished, temporary_folder

LIST_NAME = ".palpate-export.json"
LIST_FORMAT = "palpate-export/1"
_exchanging = threading.Lock()
"""Held while files are exchanged, so that a thread that ends the process does not remove the new ones meanwhile."""


class FileList:
    """The list of all files that were written into a folder, by kind: a format of an export, a kind of figures, a report.

    Parameters
    ----------
    folder : Path
        What a killed run has left in it is completed or removed.

    Raises
    ------
    FileError
        The files of a killed run cannot be put in their place.
    """

    def __init__(self, folder: Path):
        self._folder = folder
        self._kinds = _read(folder / LIST_NAME)
        unfinished: dict[str, list[str]] = {}
        for kind, listed in self._kinds.items():
            if not listed["complete"] and listed["new_in"]:
                listed["files"] = {name: digest for name, digest in listed["files"].items() if self._is_inside(folder / name)}
                unfinished.setdefault(listed["new_in"], []).append(kind)
        for new_in, kinds in unfinished.items():
            with _exchanging:
                self._exchange(kinds, folder / new_in)
        remove_unfinished(folder)
        for parent in {folder.joinpath(name).parent for listed in self._kinds.values() for name in listed["files"]}:
            if parent != folder and self._is_inside(parent):
                remove_unfinished(parent)

    @contextmanager
    def new_files(self, purpose: str) -> Iterator[Path]:
        """Make a hidden folder for new files. It is removed in the end, unless files in it still wait for their place.

        Parameters
        ----------
        purpose : str
            Part of its name.

        Raises
        ------
        FileError
            It cannot be made. Errors of the body name the places that the files would get.
        """

        def is_needed(new: Path) -> bool:
            return any(listed["new_in"] == new.name for listed in self._kinds.values())

        with temporary_folder(self._folder, purpose, is_needed) as new:
            try:
                yield new
            except FileError as error:
                raise FileError(str(error).replace(str(new), str(self._folder))) from error

    def replace(self, new: Path, written: Mapping[str, Iterable[Path]], source: str = "") -> list[Path]:
        """Put new files in the place of the earlier ones of their kinds.

        Parameters
        ----------
        new : Path
            The folder from :meth:`new_files`, in which they were written.
        written : mapping of str to iterable of Path
            The files in it, by kind.
        source : str
            What they were made from. Earlier files that were made from the same stay; those made from something else are
            removed, and without a source all of them.

        Returns
        -------
        list of Path
            Where the files are now.

        Raises
        ------
        FileError
            Something is in the place of a file that no file may replace, or a folder cannot be written to: earlier files are
            as they were. Or a file cannot be moved: then all new files wait in `new`, and the next run completes them.
        """
        if not written:
            return []
        names = {kind: [path.relative_to(new).as_posix() for path in paths] for kind, paths in written.items()}
        every = [name for those in names.values() for name in those]
        self._check_places(every)
        for kind, those in names.items():
            before = self._kinds.get(kind, {})
            replaced = dict(before.get("files", {}))
            kept = {}
            if source and source == before.get("source"):
                kept = {name: one for name, one in replaced.items() if name not in those and self._own_file(name, one)}
            self._kinds[kind] = {
                "complete": False,
                "files": kept | {name: file_sha256(new / name) for name in those},
                "replaced": {name: one for name, one in replaced.items() if name not in kept},
                "new_in": new.name,
                "source": source,
            }
        with _exchanging:
            self._write()
            self._exchange(list(names), new)
        return [self._folder / name for name in every]

    def _check_places(self, names: Iterable[str]) -> None:
        """Check, before an earlier file is removed, that every new file can be put in its place."""
        folders = set()
        for name in names:
            target = self._folder / name
            require_replaceable(target)
            if target.parent.is_file():
                raise FileError(f"'{target.parent}' is a file where a folder is needed: rename it.")
            folders |= {place for place in (target.parent, Path(os.path.realpath(target)).parent) if place.is_dir()}
        for folder in sorted(folders):
            writable_folder(folder)

    def _exchange(self, kinds: list[str], new: Path) -> None:
        """Remove the earlier files of some kinds and move the new ones in; what was done already is left as it is."""
        exchanged = {kind: self._kinds[kind] for kind in kinds}
        files = {name for listed in exchanged.values() for name in listed["files"]}
        present = {name for name in files if self._is_inside(new / name) and os.path.lexists(new / name)}
        gone = {name for name in files - present if not os.path.lexists(self._folder / name)}
        place = self._folder
        try:
            for kind, listed in exchanged.items():
                shared = {name for other, its in self._kinds.items() if other != kind for name in its["files"]}
                for name, digest in listed["replaced"].items():
                    if name not in shared and (name in present or name not in files):
                        place = self._folder / name
                        self._remove(name, digest)
            for name in sorted(present):
                place = self._folder / name
                place.parent.mkdir(parents=True, exist_ok=True)
                _move(new / name, place)
            for place in {self._folder.joinpath(name).parent for name in files}:
                sync_folder(place)
        except OSError as error:
            waiting = sum(os.path.lexists(new / name) for name in files)
            raise FileError(
                f"'{place}' could not be replaced ({os_error_reason(error)}): close programs that show it, check the "
                f"permissions of '{self._folder}', and do this again; {len(files) - waiting} of {len(files)} new files are in "
                "their place, the others wait there in a hidden folder."
            ) from error
        for kind, listed in exchanged.items():
            self._kinds[kind] = listed | {"complete": gone.isdisjoint(listed["files"]), "replaced": {}, "new_in": ""}
        self._write()

    def _remove(self, name: str, digest: str) -> None:
        """Remove a file of the earlier export, and the folders about it that are empty then."""
        path = self._own_file(name, digest)
        if path is None:
            return
        path.unlink(missing_ok=True)
        with suppress(OSError):  # one of them holds other files
            for parent in path.parents:
                if parent == self._folder:
                    break
                parent.rmdir()

    def _write(self) -> None:
        with atomic_write(self._folder / LIST_NAME) as temporary:
            content = {"format": LIST_FORMAT, "exports": self._kinds}
            temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")

    def _own_file(self, name: str, digest: str) -> Path | None:
        """Return the path of a listed file; None when it is gone, was changed since, or lies outside the folder."""
        path = self._folder.joinpath(name)
        try:
            if path.is_symlink() or not path.is_file() or not self._is_inside(path):
                return None
            return path if file_sha256(path) == digest else None
        except (OSError, ValueError, FileError):
            return None

    def _is_inside(self, path: Path) -> bool:
        """Return True if a path leads to a place in the folder."""
        try:
            return path.resolve().is_relative_to(self._folder.resolve())
        except (OSError, ValueError, RuntimeError):
            return False


def remove_unneeded(folder: Path) -> None:
    """Remove what this process has begun in a folder, because it is about to end; an exchange of files is waited for."""
    with _exchanging:
        needed = {listed["new_in"] for listed in _read(folder / LIST_NAME).values()}
        remove_unfinished(folder, needed, is_ending=True)


def _move(new: Path, target: Path) -> None:
    """Put a file in its place; where that is a link to a file, into the place to which it leads."""
    place = Path(os.path.realpath(target))
    try:
        os.replace(new, place)
    except OSError as error:
        if error.errno != errno.EXDEV:
            raise
        with atomic_write(place) as temporary:
            shutil.copyfile(new, temporary)


def _read(path: Path) -> dict[str, dict[str, Any]]:
    """Return the kinds of a list; none when it is missing or damaged, so that nothing is removed by it."""
    try:
        content = json.loads(read_bytes(path).decode("utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    if not isinstance(content, dict) or content.get("format") != LIST_FORMAT or not isinstance(content.get("exports"), dict):
        return {}
    found = {}
    for kind, listed in content["exports"].items():
        if isinstance(listed, dict) and isinstance(listed.get("files"), dict):
            new_in = listed.get("new_in")
            is_ours = isinstance(new_in, str) and re.fullmatch(NAME, new_in)
            found[kind] = {
                "complete": listed.get("complete") is True,
                "files": _safe(listed["files"]),
                "replaced": _safe(listed.get("replaced")),
                "new_in": new_in if is_ours else "",
                "source": str(listed.get("source", "")),
            }
    return found


def _safe(files: object) -> dict[str, str]:
    """Return the entries of a table of files that name a file in the folder of the list or in a folder in it."""
    if not isinstance(files, Mapping):
        return {}
    return {name: digest for name, digest in files.items() if isinstance(digest, str) and _is_safe(name)}


def _is_safe(name: str) -> bool:
    parts = PurePosixPath(name).parts
    hidden = any(part in ("..", LIST_NAME) or "\\" in part or "\0" in part for part in parts)
    return 0 < len(parts) <= 2 and not PurePosixPath(name).is_absolute() and not hidden
