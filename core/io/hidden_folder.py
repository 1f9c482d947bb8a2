# SPDX-License-Identifier: GPL-3.0-or-later
"""Hidden folders: for files that get their place when they are complete, and for the lock of a bake folder or a study.

A locked file in such a folder shows that a process is using it. The operating system releases the lock when the process ends,
however it ends, so the next process finds what a killed one has left, and removes it.
"""

from __future__ import annotations

import errno
import json
import os
import shutil
import tempfile
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import FileError, os_error_reason
from .file_writing import atomic_write, file_sha256, require_replaceable, unfinished, writable_folder, write_text
from .input_files import read_bytes

if TYPE_CHECKING:
    from filelock import BaseFileLock

PRIVATE_FOLDER = ".palpate"
"""In a bake folder and in the folder of a study: all that is Palpate's own and no part of the result."""
LOCK_NAME = "palpate.lock"
"""The locked file. It also tells Palpate's folders from those of the user's."""
_EARLIER_MARKER = "palpate-folder.json"
"""Until version 0.2.0."""
_FILES = "files"
"""Folder in a temporary folder, beside the lock."""


def is_private_folder(folder: Path) -> bool:
    """Return True for a hidden folder that Palpate has made."""
    marks = [folder / name for name in (LOCK_NAME, _EARLIER_MARKER)]
    return not folder.is_symlink() and any(mark.is_file() and not mark.is_symlink() for mark in marks)


def lock_folder(folder: Path, work: str = "bake") -> BaseFileLock:
    """Lock a bake folder or the folder of a study; its hidden folder is made if it is missing.

    The lock is held until its ``release()``. The locked file stays: another process may be about to lock it. `work` says in
    messages what writes to the folder.

    Raises
    ------
    FileError
        Another process holds the lock, the hidden folder cannot be made, or something that Palpate did not make has its name.
    """
    private = folder / PRIVATE_FOLDER
    try:
        private.mkdir(exist_ok=True)
        if not is_private_folder(private) and (private.is_symlink() or any(private.iterdir())):
            raise FileError(f"'{private}' was not made by Palpate: rename it, or choose another {work} folder.")
        lock = _lock(private)
    except OSError as error:
        raise FileError(
            f"The folder '{private}' could not be made ({os_error_reason(error)}): rename what has its name, "
            f"check the permissions, or choose another {work} folder."
        ) from error
    if lock is None:
        raise FileError(f"Another {work} is writing to '{folder}': wait for it, or choose another folder.")
    return lock


@contextmanager
def temporary_folder(parent: Path, purpose: str) -> Iterator[Path]:
    """Make a hidden folder in `parent`, and remove it with all that it holds when the body ends.

    Those that killed processes have left there are removed first.

    Parameters
    ----------
    parent : Path
    purpose : str
        Part of its name.

    Raises
    ------
    FileError
        It cannot be made.
    """
    remove_abandoned(parent)
    try:
        folder = Path(tempfile.mkdtemp(prefix=f".palpate-{purpose}-", dir=parent))
        lock = _lock(folder)
        (folder / _FILES).mkdir()
    except OSError as error:
        raise FileError(
            f"No folder can be made in '{parent}' ({os_error_reason(error)}): check its permissions and the space left."
        ) from error
    unfinished.add(folder)
    try:
        yield folder / _FILES
    finally:
        if lock is not None:
            lock.release()
        _remove(folder)
        unfinished.discard(folder)


def remove_abandoned(parent: Path) -> None:
    """Remove the temporary folders that killed processes have left in a folder."""
    for folder in sorted(parent.glob(".palpate-*-????????")):
        with suppress(OSError):
            if not is_private_folder(folder):
                folder.rmdir()  # of a kill before the lock; raises if it holds anything
            elif (lock := _lock(folder)) is not None:
                lock.release()
                _remove(folder)


def _remove(folder: Path) -> None:
    """Remove a temporary folder, and its lock last, so that whoever finds the rest knows whose it is."""
    shutil.rmtree(folder / _FILES, ignore_errors=True)
    shutil.rmtree(folder, ignore_errors=True)


def _lock(folder: Path) -> BaseFileLock | None:
    """Lock a folder and return the lock; None if another process has locked it. Raises OSError where that is impossible."""
    from filelock import FileLock, Timeout  # enabling the extension imports no dependencies

    lock = FileLock(folder / LOCK_NAME)
    try:
        lock.acquire(timeout=0)
    except Timeout:
        return None
    return lock


# An export is written whole into a hidden folder. Then its files are moved to their places, and files of the earlier export
# that have no successor are removed. A list in the folder names the files of exports with their SHA-256. Only files that the
# list names, and that still have the content it was written for, are removed.

LIST_NAME = ".palpate-export.json"
LIST_FORMAT = "palpate-export/1"
_moving = threading.Lock()
"""Held while files are moved, so that a thread that ends the process waits for that."""


class FileList:
    """The list of all files that were written into a folder, by kind: a format of an export, a kind of figures, a report.

    Parameters
    ----------
    folder : Path
        What killed processes have left in it is removed.
    """

    def __init__(self, folder: Path):
        self._folder = folder
        self._kinds = _read(folder / LIST_NAME)
        remove_abandoned(folder)

    @contextmanager
    def new_files(self, purpose: str) -> Iterator[Path]:
        """Make a hidden folder for new files, which is removed in the end.

        Parameters
        ----------
        purpose : str
            Part of its name.

        Raises
        ------
        FileError
            It cannot be made. Errors of the body name the places that the files would get.
        """
        with temporary_folder(self._folder, purpose) as new:
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
            as they were. Or a file cannot be moved.
        """
        names = {kind: [path.relative_to(new).as_posix() for path in paths] for kind, paths in written.items()}
        every = [name for those in names.values() for name in those]
        self._check_places(every)
        kinds: dict[str, dict[str, Any]] = {}
        removed: dict[str, str] = {}
        for kind, those in names.items():
            before = self._kinds.get(kind, {"files": {}, "source": ""})
            earlier = {name: digest for name, digest in before["files"].items() if name not in every}
            kept = earlier if source and source == before["source"] else {}
            removed |= {name: digest for name, digest in earlier.items() if name not in kept}
            kinds[kind] = {"files": kept | {name: file_sha256(new / name) for name in those}, "source": source}
        with _moving:
            # Files that are about to be removed belong to the list until that is done.
            self._write({kind: {**own, "files": removed | own["files"]} for kind, own in kinds.items()})
            for name in every:
                _move(new / name, self._folder / name)
            listed = {name for own in (self._kinds | kinds).values() for name in own["files"]}
            for name, digest in removed.items():
                if name not in listed and self._is_own_file(name, digest):
                    self._remove(self._folder / name)
            self._write(kinds)
        return [self._folder / name for name in every]

    def _check_places(self, names: Iterable[str]) -> None:
        """Check, before an earlier file is replaced, that every new file can be put in its place."""
        folders = set()
        for name in names:
            target = self._folder / name
            require_replaceable(target)
            if target.parent.is_file():
                raise FileError(f"'{target.parent}' is a file where a folder is needed: rename it.")
            folders |= {place for place in (target.parent, Path(os.path.realpath(target)).parent) if place.is_dir()}
        for folder in sorted(folders):
            writable_folder(folder)

    def _is_own_file(self, name: str, digest: str) -> bool:
        """Return True if a listed file is in the folder, as a list from elsewhere may not say, and has the listed content."""
        path = self._folder / name
        try:
            inside = not path.is_symlink() and path.resolve().is_relative_to(self._folder.resolve())
            return inside and path.is_file() and file_sha256(path) == digest
        except (OSError, ValueError, RuntimeError, FileError):
            return False

    def _remove(self, path: Path) -> None:
        """Remove a file, and the folders about it that are empty then."""
        with suppress(OSError):
            path.unlink()
            for parent in path.parents:
                if parent == self._folder:
                    break
                parent.rmdir()  # raises if it holds other files

    def _write(self, kinds: Mapping[str, dict[str, Any]]) -> None:
        """Write the list with these kinds; the others are as they were."""
        self._kinds |= kinds
        content = {"format": LIST_FORMAT, "exports": self._kinds}
        write_text(self._folder / LIST_NAME, json.dumps(content, indent=1) + "\n")


def remove_own_files() -> None:
    """Remove the temporary files and folders of this process, because it is about to end; moves of files are waited for."""
    with _moving:
        for path in list(unfinished):
            if path.is_dir():
                _remove(path)
            else:
                with suppress(OSError):
                    path.unlink()


def _move(new: Path, target: Path) -> None:
    """Put a file in its place; where that is a link to a file, into the place to which it leads."""
    place = Path(os.path.realpath(target))
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            os.replace(new, place)
        except OSError as error:
            if error.errno != errno.EXDEV:
                raise
            with atomic_write(place) as temporary:
                shutil.copyfile(new, temporary)
    except OSError as error:
        raise FileError(
            f"'{target}' could not be replaced ({os_error_reason(error)}): close programs that show it, check the permissions "
            f"of '{target.parent}', and do this again; some of the new files may be in their places already."
        ) from error


def _read(path: Path) -> dict[str, dict[str, Any]]:
    """Return the kinds of a list; none when it is missing or damaged, so that nothing is removed by it."""
    try:
        content = json.loads(read_bytes(path).decode("utf-8"))
        kinds = content["exports"].items() if content["format"] == LIST_FORMAT else ()
        return {kind: {"files": {**own["files"]}, "source": str(own.get("source", ""))} for kind, own in kinds}
    except (OSError, ValueError, RecursionError, KeyError, TypeError, AttributeError, FileError):
        return {}
