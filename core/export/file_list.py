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
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path, PurePosixPath
from typing import Any

from ..errors import FileError
from ..io.file_writing import atomic_write, file_sha256, os_error_reason, require_replaceable, sync_folder
from ..io.regular_file import read_bytes
from ..io.temporary_folder import remove_unfinished

LIST_NAME = ".palpate-export.json"
LIST_FORMAT = "palpate-export/1"


class FileList:
    """The list of the files of all exports into a folder, by format.

    Parameters
    ----------
    folder : Path
        What a killed export has left in it is completed or removed.

    Raises
    ------
    FileError
        The files of a killed export cannot be put in their place.
    """

    def __init__(self, folder: Path):
        self._folder = folder
        self._formats = _read(folder / LIST_NAME)
        for kind, listed in self._formats.items():
            if not listed["complete"] and listed["new_in"]:
                listed["files"] = {name: digest for name, digest in listed["files"].items() if self._is_inside(folder / name)}
                self._exchange(kind, self._folder / listed["new_in"])
        remove_unfinished(folder)
        for parent in {self._folder.joinpath(name).parent for listed in self._formats.values() for name in listed["files"]}:
            if parent != folder and self._is_inside(parent):
                remove_unfinished(parent)

    def replace(self, kind: str, new: Path, written: Iterable[Path]) -> list[Path]:
        """Put the files of a complete export in the place of those of the earlier export of this format.

        Parameters
        ----------
        kind : str
            The format.
        new : Path
            A folder in the folder of the list, in which the export was written.
        written : iterable of Path
            The files in it.

        Returns
        -------
        list of Path
            Where the files are now.

        Raises
        ------
        FileError
            Something is in the place of a file that no file may replace, or a file cannot be moved.
        """
        names = [path.relative_to(new).as_posix() for path in written]
        for name in names:
            require_replaceable(self._folder / name)
            if name.count("/") and self._folder.joinpath(name).parent.is_file():
                raise FileError(f"'{self._folder.joinpath(name).parent}' is a file where a folder is needed: rename it.")
        listed = {
            "complete": False,
            "files": {name: file_sha256(new / name) for name in names},
            "replaced": self._formats.get(kind, {}).get("files", {}),
            "new_in": new.name,
        }
        self._formats[kind] = listed
        self._write()
        self._exchange(kind, new)
        return [self._folder / name for name in names]

    def _exchange(self, kind: str, new: Path) -> None:
        """Remove the files of the earlier export and move the new ones in; what was done already is left as it is."""
        listed = self._formats[kind]
        present = {name for name in listed["files"] if self._is_inside(new / name) and os.path.lexists(new / name)}
        shared = {name for other, its in self._formats.items() if other != kind for name in its["files"]}
        gone = {name for name in listed["files"] if name not in present and not os.path.lexists(self._folder / name)}
        try:
            for name, digest in listed["replaced"].items():
                if name not in shared and (name in present or name not in listed["files"]):
                    self._remove(name, digest)
            for name in sorted(present):
                target = self._folder / name
                target.parent.mkdir(exist_ok=True)
                _move(new / name, target)
            for parent in {self._folder.joinpath(name).parent for name in listed["files"]}:
                sync_folder(parent)
        except OSError as error:
            raise FileError(
                f"The export to '{self._folder}' could not be put in its place ({os_error_reason(error)}): "
                "check its permissions and export again."
            ) from error
        self._formats[kind] = {"complete": not gone, "files": listed["files"], "replaced": {}, "new_in": ""}
        self._write()

    def _remove(self, name: str, digest: str) -> None:
        """Remove a file of the earlier export, and its folder if it is empty then."""
        path = self._own_file(name, digest)
        if path is None:
            return
        path.unlink(missing_ok=True)
        if path.parent != self._folder:
            with suppress(OSError):  # it holds other files
                path.parent.rmdir()

    def _write(self) -> None:
        with atomic_write(self._folder / LIST_NAME) as temporary:
            content = {"format": LIST_FORMAT, "exports": self._formats}
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
    """Return the exports of a list; none when it is missing or damaged, so that nothing is removed by it."""
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
            is_ours = isinstance(new_in, str) and re.fullmatch(r"\.palpate-export\.[0-9a-f]{8}\.partial", new_in)
            found[kind] = {
                "complete": listed.get("complete") is True,
                "files": _safe(listed["files"]),
                "replaced": _safe(listed.get("replaced")),
                "new_in": new_in if is_ours else "",
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
