# SPDX-License-Identifier: GPL-3.0-or-later
"""Atomic writing: a file keeps its old content until the new content is complete and on the disk.

The new content is written to a temporary file beside the target, which then replaces the target. A process that is killed
leaves either the old or the new file. It may also leave a temporary file, whose name contains ``.partial``;
:func:`remove_leftovers` deletes these. While a temporary file is written it is locked, so that other processes leave it alone.
"""

from __future__ import annotations

import errno
import glob
import hashlib
import os
import re
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..errors import FileError, os_error_reason
from .file_lock import try_lock
from .regular_file import open_regular


@contextmanager
def atomic_write(path: str | os.PathLike) -> Iterator[Path]:
    """Write a file so that `path` always has either its old content or all of the new content.

    Parameters
    ----------
    path : path
        The file to make or to replace. Where it is a symbolic link, the file it points to is replaced.

    Yields
    ------
    Path
        A new, empty file beside `path`, with the same suffix. The body of the ``with`` statement writes and closes it. It
        replaces `path` when the body ends, and is removed when the body raises.

    Raises
    ------
    FileError
        The folder is missing, cannot be written to, is full, or `path` is a folder, a device or read-only.
    """
    require_replaceable(path)
    target = Path(os.path.realpath(path))
    _require_folder(target.parent)
    temporary, handle = _new_locked_file(target.parent, target.stem, target.suffix)
    try:
        yield temporary
        sync_file(temporary)
        os.replace(temporary, target)
    except BaseException as error:
        with suppress(OSError):
            temporary.unlink()
        if isinstance(error, OSError):
            raise FileError(f"'{path}' could not be written ({os_error_reason(error)}): {_remedy(error)}.") from error
        raise
    finally:
        if handle is not None:
            os.close(handle)
    sync_folder(target.parent)


def require_replaceable(path: str | os.PathLike) -> None:
    """Raise FileError if something is at `path` that no file may replace: a folder, a device, or a file that is read-only."""
    require_name(path)
    target = Path(os.path.realpath(path))
    if os.path.isdir(target):
        raise FileError(f"'{path}' is a folder: give the name of a file in it.")
    if os.path.exists(target) and not os.path.isfile(target):  # a rename would put a plain file in the place of /dev/null
        raise FileError(f"'{path}' is a device, not a file: give the name of a file.")
    if os.path.exists(target) and not os.access(target, os.W_OK):
        raise FileError(f"'{path}' is read-only: change its permissions or choose another name.")


@contextmanager
def write_file(path: str | os.PathLike, atomic: bool = True) -> Iterator[Path]:
    """Write a file, either atomically (:func:`atomic_write`) or directly.

    Parameters
    ----------
    path : path
    atomic : bool
        False writes to `path` itself and does not wait until the data is on the disk. This is many times faster, but an
        interruption leaves an incomplete file: only for a folder that nobody reads before it is complete.

    Yields
    ------
    Path
        The file to write and close.

    Raises
    ------
    FileError
        As :func:`atomic_write`.
    """
    if atomic:
        with atomic_write(path) as temporary:
            yield temporary
        return
    try:
        yield Path(path)
    except OSError as error:
        raise FileError(f"'{path}' could not be written ({os_error_reason(error)}): {_remedy(error)}.") from error


def writable_folder(path: str | os.PathLike, create: bool = False) -> Path:
    """Check that files can be written into a folder, by creating one and deleting it.

    Parameters
    ----------
    path : path
    create : bool
        Create the folder if it is missing, and the folders above it that are missing.

    Returns
    -------
    Path
        Absolute.

    Raises
    ------
    FileError
        There is no such folder, something else has its name, or it cannot be written to.
    """
    require_name(path)
    folder = Path(os.path.abspath(path))
    if create and not os.path.exists(folder):
        _require_no_file_above(folder)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileError(f"The folder '{folder}' could not be made ({os_error_reason(error)}): {_remedy(error)}.") from error
    _require_folder(folder)
    _new_file_in(folder, "check", "")
    _remove_unlocked(folder, "check", "")
    return folder


def writable_file(path: str | os.PathLike) -> Path:
    """Check before work begins that a file could be written, and create the folders above it that are missing.

    Returns
    -------
    Path
        Absolute, without links.

    Raises
    ------
    FileError
        As :func:`atomic_write`.
    """
    require_replaceable(path)
    target = Path(os.path.realpath(path))
    writable_folder(target.parent, create=True)
    _new_file_in(target.parent, target.stem, target.suffix)  # its name may be too long
    _remove_unlocked(target.parent, target.stem, target.suffix)
    return target


def remove_leftovers(folder: str | os.PathLike, is_ending: bool = False) -> list[Path]:
    """Delete the temporary files that interrupted calls of :func:`atomic_write` left in `folder`.

    Files that are being written, by this process or by another, stay.

    Parameters
    ----------
    folder : path
    is_ending : bool
        True if this process is about to end, and its own files are deleted as well. No other process may be writing to the
        folder then.

    Returns
    -------
    list of Path
        The deleted files, sorted by name.
    """
    removed = []
    for path in sorted(Path(folder).glob(".*.partial*")):
        if re.fullmatch(r"\..*\.[0-9a-f]{8}\.partial(\.[^.]*)?", path.name) and path.is_file():
            with suppress(OSError):
                if is_ending or not _is_being_written(path):
                    path.unlink()
                    removed.append(path)
    return removed


def remove_leftovers_of(target: Path) -> None:
    """Delete what interrupted exchanges of a .blend have left beside it, and Blender's own unfinished file of such a one."""
    for path in target.parent.glob(f".{glob.escape(target.name)}.*.partial*"):
        if re.fullmatch(r"[0-9a-f]{8}\.partial@?", path.name[len(target.name) + 2 :]):
            with suppress(OSError):
                if path.name.endswith("@") or not _is_being_written(path):
                    path.unlink(missing_ok=True)


def _is_being_written(path: Path) -> bool:
    """Return True if a process holds the lock on a temporary file. Windows lets nobody delete a file that is open."""
    if path.is_symlink() or os.name == "nt":
        return False
    handle = os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_NOFOLLOW)
    try:
        return not try_lock(handle)
    finally:
        os.close(handle)


def exchange_file(new: Path, target: Path, backups: int = 0) -> None:
    """Put a finished file in the place of another; at every moment `target` is one of the two.

    Parameters
    ----------
    new : Path
        In the folder of `target`.
    target : Path
    backups : int
        Number of earlier versions that are kept as ``<target>1``, ``<target>2``, …

    Raises
    ------
    OSError
        It cannot be replaced.
    """
    if backups and target.exists():
        back_up(target, backups)
    os.replace(new, target)
    sync_folder(target.parent)


def back_up(target: Path, backups: int) -> None:
    """Give the present file a second name, ``<target>1``; that of before becomes ``<target>2``, and so on.

    The file itself stays in its place. Raises OSError where that is impossible.
    """
    versions = [target.with_name(f"{target.name}{number}") for number in range(1, backups + 1)]
    if versions[0].exists() and versions[0].samefile(target):
        return  # an interrupted exchange has done it
    temporary = _new_file_in(target.parent, target.name, "")
    temporary.unlink()
    try:
        os.link(target, temporary)
    except OSError:  # the file system has no hard links
        shutil.copy2(target, temporary)
    for older, newer in zip(reversed(versions), reversed(versions[:-1])):
        if newer.exists():
            os.replace(newer, older)
    os.replace(temporary, versions[0])


def sync_folder(folder: Path) -> None:
    """Flush a folder's list of names to the disk, on systems that allow it, so that a rename survives a power cut."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def sync_file(path: Path) -> None:
    """Bring the content of a file onto the disk."""
    with open(path, "rb+") as file:
        os.fsync(file.fileno())


def write_hashed(path: Path, content: bytes) -> str:
    """Write a new file in a folder that nobody reads yet and return the SHA-256 of its content; it is not yet on the disk.

    Raises
    ------
    OSError
        It cannot be written.
    """
    with open(path, "wb") as file:
        file.write(content)
    return hashlib.sha256(content).hexdigest()


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file's content, 64 hexadecimal digits."""
    digest = hashlib.sha256()
    with open_regular(path) as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def require_name(path: str | os.PathLike) -> None:
    """Raise FileError if no file can have this name: an empty one would be the present folder."""
    name = os.fspath(path)
    if not name.strip() or "\0" in name:
        raise FileError(f"{name!r} is not the name of a file or a folder: give another.")


def _require_folder(folder: Path) -> None:
    if os.path.isdir(folder):
        return
    if os.path.exists(folder):
        raise FileError(f"'{folder}' is a file where a folder is needed: choose another folder.")
    _require_no_file_above(folder)
    raise FileError(f"The folder '{folder}' does not exist: create it or choose another.")


def _require_no_file_above(folder: Path) -> None:
    for above in folder.parents:
        if os.path.exists(above) and not os.path.isdir(above):
            raise FileError(f"'{folder}' cannot be a folder because '{above}' is a file: choose another folder.")


def _new_file_in(folder: Path, stem: str, suffix: str) -> Path:
    """Create an empty file with a unique name; the user's umask decides who may read it."""
    path, handle = _open_new_file(folder, stem, suffix)
    os.close(handle)
    return path


def _remove_unlocked(folder: Path, stem: str, suffix: str) -> None:
    """Remove the files of these names that nobody is writing: those of runs that were stopped before they could do so."""
    for path in folder.glob(f".{glob.escape(stem)}.????????.partial{glob.escape(suffix)}"):
        with suppress(OSError):  # the next run tries again
            if not _is_being_written(path):
                path.unlink()


def _new_locked_file(folder: Path, stem: str, suffix: str) -> tuple[Path, int | None]:
    """Create an empty file as :func:`_new_file_in` does; return it with the descriptor that holds its lock."""
    while True:
        path, handle = _open_new_file(folder, stem, suffix)
        if os.name == "nt":  # Windows could not replace the target by a file that is open
            os.close(handle)
            return path, None
        if try_lock(handle) and path.exists():
            return path, handle
        os.close(handle)  # another process took it for a leftover before it was locked


def _open_new_file(folder: Path, stem: str, suffix: str) -> tuple[Path, int]:
    """Create an empty file with a unique name and return it with its descriptor."""
    path = folder / f".{stem}.{secrets.token_hex(4)}.partial{suffix}"
    try:
        return path, os.open(path, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o666)
    except OSError as error:
        # Permissions alone do not decide: root may write despite them, and cannot write to a read-only file system.
        if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS) or not os.access(folder, os.W_OK):
            raise FileError(f"The folder '{folder}' is read-only: change its permissions or choose another.") from error
        raise FileError(
            f"No file can be made in the folder '{folder}' ({os_error_reason(error)}): {_remedy(error)}."
        ) from error


def _remedy(error: OSError) -> str:
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return "free some space or choose another folder"
    if error.errno == errno.ENAMETOOLONG:
        return "choose a shorter name"
    return "close programs that use it, check its permissions, or choose another folder"
