# SPDX-License-Identifier: GPL-3.0-or-later
"""Atomic writing: a file keeps its old content until the new content is complete.

The new content is written to a temporary file beside the target, which then replaces the target. A process that is killed
leaves either the old or the new file, and perhaps the temporary one, whose name begins with a dot and contains ``.partial``.

Work that would fill up a disk asks for the space before it begins (:func:`require_space`).
"""

from __future__ import annotations

import errno
import hashlib
import os
import secrets
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ..errors import FileError, os_error_reason
from .input_files import open_regular

unfinished: set[Path] = set()
"""Temporary files and folders of this process, which :func:`.hidden_folder.remove_own_files` removes."""


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
    temporary = _new_file_in(target.parent, target.stem, target.suffix)
    unfinished.add(temporary)
    try:
        yield temporary
        os.replace(temporary, target)
    except BaseException as error:
        with suppress(OSError):
            temporary.unlink()
        if isinstance(error, OSError):
            raise FileError(f"'{path}' could not be written ({os_error_reason(error)}): {_remedy(error)}.") from error
        raise
    finally:
        unfinished.discard(temporary)


def write_text(path: str | os.PathLike, text: str) -> None:
    """Write a file of text whole (see :func:`atomic_write`): in UTF-8, and with the same line ends on every system."""
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


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


def writable_folder(path: str | os.PathLike, create: bool = False) -> Path:
    """Check that files can be written into a folder, by making one.

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
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise _cannot_make_file(folder, error) from error
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
    made = _new_file_in(target.parent, target.stem, target.suffix)  # its name may be too long
    with suppress(OSError):
        made.unlink()
    return target


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file's content, 64 hexadecimal digits."""
    file: Any
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


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
    path = folder / f".{stem}.{secrets.token_hex(4)}.partial{suffix}"
    try:
        os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o666))
    except OSError as error:
        raise _cannot_make_file(folder, error) from error
    return path


def _cannot_make_file(folder: Path, error: OSError) -> FileError:
    # Permissions alone do not decide: root may write despite them, and cannot write to a read-only file system.
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS) or not os.access(folder, os.W_OK):
        return FileError(f"The folder '{folder}' is read-only: change its permissions or choose another.")
    return FileError(f"No file can be made in the folder '{folder}' ({os_error_reason(error)}): {_remedy(error)}.")


def _remedy(error: OSError) -> str:
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return "free some space or choose another folder"
    if error.errno == errno.ENAMETOOLONG:
        return "choose a shorter name"
    return "close programs that use it, check its permissions, or choose another folder"


def require_space(folder: str | os.PathLike, needed: float, what: str) -> None:
    """Check that a disk has the space that work needs.

    Parameters
    ----------
    folder : path
        It need not exist yet.
    needed : float, bytes
        From above.
    what : str
        What will be written, for the message.

    Raises
    ------
    FileError
        There is less space.
    """
    place = Path(os.path.abspath(folder))
    existing = next((one for one in (place, *place.parents) if os.path.exists(one)), None)
    if existing is None:
        raise FileError(f"'{folder}' is on a drive that is not there: choose another folder.")
    free = shutil.disk_usage(existing).free
    if free < needed:
        raise FileError(
            f"{what} needs up to {needed / 1e6:.0f} MB and the disk of '{folder}' has {free / 1e6:.0f} MB left: "
            "free some space or choose another folder."
        )
