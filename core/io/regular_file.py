# SPDX-License-Identifier: GPL-3.0-or-later
"""Opens input files, and refuses at once what is not a regular file.

Opening a FIFO waits for its writer, perhaps for ever, and a device such as ``/dev/zero`` never ends. Every file that a user or
another file names is therefore opened by :func:`open_regular`.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import IO, Any

from ..errors import FileError, read_errors_said

_KINDS = {
    stat.S_IFIFO: "a FIFO",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def require_regular(path: str | os.PathLike) -> None:
    """Raise :class:`FileError` if `path` is a FIFO, a socket or a device. A missing file and a folder pass."""
    try:
        mode = os.stat(path).st_mode
    except OSError:
        return
    _require_regular(path, mode)


def open_regular(path: str | os.PathLike, mode: str = "rb", **options: Any) -> IO[Any]:
    """Open a regular file as :func:`open` does.

    Parameters
    ----------
    path : path
    mode : str
    **options
        Others of :func:`open`, such as `encoding`.

    Raises
    ------
    FileError
        It is a FIFO, a socket or a device. It is not waited for and nothing is read.
    OSError
        As :func:`open`.
    """
    require_regular(path)  # before it is opened: opening some devices has an effect of its own
    file = open(path, mode, opener=_open_without_waiting, **options)  # noqa: SIM115 - the caller closes it
    try:
        _require_regular(path, os.fstat(file.fileno()).st_mode)  # it may have been exchanged meanwhile
    except BaseException:
        file.close()
        raise
    return file


def read_bytes(path: str | os.PathLike) -> bytes:
    """Return the content of a regular file; raises what :func:`open_regular` raises."""
    with open_regular(path) as file:
        return file.read()


def read_bounded(path: str | os.PathLike, limit: int, what: str = "file", advice: str = "give a smaller file") -> bytes:
    """Return the content of a regular file that is not larger than it may be.

    Parameters
    ----------
    path : path
    limit : int
        Bytes; no more are read.
    what : str
        What the file should be, for messages, as in "rig".
    advice : str
        What the user of a larger file should know or do.

    Raises
    ------
    FileError
        There is no such file, it cannot be read, or it is larger.
    """
    with read_errors_said(path, what), open_regular(path) as file:
        content: bytes = file.read(limit + 1)
    if len(content) > limit:
        raise FileError(f"'{path}' is larger than {limit >> 20} MB: {advice}.")
    return content


def _open_without_waiting(path: str, flags: int) -> int:
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0), 0o666)


def _require_regular(path: str | os.PathLike, mode: int) -> None:
    kind = _KINDS.get(stat.S_IFMT(mode))
    if kind is not None:
        raise FileError(f"'{Path(path)}' is {kind}, not a file: give the name of a regular file.")
