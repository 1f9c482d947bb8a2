# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes one file operation of this process fail: an error of the operating system, or a kill at that moment.

The functions of :mod:`os`, :func:`open`, and the writing of tactile images are wrapped while an :class:`Injector` is active.
Only operations below one folder count. Nothing is really synchronised meanwhile, so that hundreds of tries are quick.
"""

from __future__ import annotations

import builtins
import errno
import functools
import io
import os
import threading
from collections.abc import Callable
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

KILL, EXIT, DONE = "KILL", "EXIT", "DONE"
KINDS = ("ENOSPC", "EIO", "EACCES", "ESTALE", DONE, KILL)
"""Errors by their names. KILL: this operation and all later ones do not happen, as if the process had been killed. DONE: the
operation is carried out and reported as failed, as a network file system does when an answer is lost."""

_PATHS = {"rename": 2, "replace": 2, "link": 2, "symlink": 2, "unlink": 1, "remove": 1, "rmdir": 1, "mkdir": 1, "truncate": 1}
"""Wrapped functions of :mod:`os` that change names, and how many paths they take."""


class Stopped(BaseException):
    """The process was killed here."""


class Injector:
    """A context in which one operation fails.

    Parameters
    ----------
    root : Path
        Only operations on paths below it count.
    at : int
        Number of the operation that fails, from 1; 0 for none.
    kind : str
        One of :data:`KINDS`, or EXIT: the process ends without a word.

    Attributes
    ----------
    calls : list of str
        What was done, as ``rename Pad/x``.
    """

    def __init__(self, root: Path, at: int = 0, kind: str = "EIO"):
        self._root = os.path.realpath(root)
        self._at, self._kind = at, kind
        self._lock = threading.RLock()
        self._stack = ExitStack()
        self._stopped = self._paused = False
        self.calls: list[str] = []

    def __enter__(self) -> Injector:
        for name, paths in _PATHS.items():
            self._wrap(os, name, functools.partial(self._names, paths))
        self._wrap(os, "fsync", self._fsync)
        if hasattr(os, "sync"):
            self._wrap(os, "sync", lambda _: self._operation("sync", self._root, lambda: None))
        self._wrap(os, "open", self._os_open)
        self._wrap(io, "open", self._open)
        self._wrap(builtins, "open", self._open)
        self._wrap_images()
        self._stack.enter_context(_removers_run_at_once())
        return self

    def __exit__(self, *_) -> None:
        self._stack.close()

    def check(self) -> None:
        """Raise :class:`Stopped` if the process counts as killed."""
        if self._stopped:
            raise Stopped

    # --- one operation

    def _operation(self, name: str, path: str, function: Callable[[], Any], spoil: Callable[[], None] | None = None) -> Any:
        """Count an operation and carry it out, or let it fail; `spoil` does a part of it."""
        if self._paused:
            return function()
        with self._lock:
            if self._stopped:
                raise Stopped
            self.calls.append(f"{name} {os.path.relpath(path, self._root)}")
            fails = len(self.calls) == self._at and (name != "sync" or self._kind in (KILL, EXIT))  # sync reports no errors
            if fails and self._kind == EXIT:
                os._exit(137)
            if fails and spoil is not None and self._kind != DONE:
                self._paused = True
                spoil()
                self._paused = False
            if fails and self._kind == KILL:
                self._stopped = True
                raise Stopped
            if fails and self._kind == DONE:
                function()
                raise OSError(errno.EIO, os.strerror(errno.EIO), path)
            if fails:
                number = getattr(errno, self._kind)
                raise OSError(number, os.strerror(number), path)
        return function()

    def _counts(self, path: Any, directory: int | None = None) -> str:
        """Return the absolute path if it is below the root, else an empty text."""
        if isinstance(path, int):
            return ""
        try:
            text = os.fsdecode(os.fspath(path))
        except TypeError:
            return ""
        if directory is not None and not os.path.isabs(text):
            text = os.path.join(os.readlink(f"/proc/self/fd/{directory}"), text)
        folder, name = os.path.split(os.path.abspath(text))
        text = os.path.join(os.path.realpath(folder), name)
        return text if text == self._root or text.startswith(self._root + os.sep) else ""

    # --- what is wrapped

    def _wrap(self, module: Any, name: str, around: Callable[..., Any]) -> None:
        original = getattr(module, name)
        wrapped = functools.wraps(original)(functools.partial(around, original))
        setattr(module, name, wrapped)
        self._stack.callback(setattr, module, name, original)

    def _names(self, paths: int, original: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        directories = (options.get("dir_fd", options.get("src_dir_fd")), options.get("dst_dir_fd"))
        found = [self._counts(path, fd) for path, fd in zip(arguments[:paths], directories, strict=False)]
        function = functools.partial(original, *arguments, **options)
        inside = next((path for path in reversed(found) if path), "")
        return self._operation(original.__name__, inside, function) if inside else function()

    def _fsync(self, original: Callable[..., Any], descriptor: Any) -> Any:
        number = descriptor if isinstance(descriptor, int) else descriptor.fileno()
        path = self._counts(os.readlink(f"/proc/self/fd/{number}"))
        return self._operation("fsync", path, lambda: None) if path else original(descriptor)

    def _os_open(self, original: Callable[..., Any], path: Any, flags: int, mode: int = 0o777, **options: Any) -> Any:
        function = functools.partial(original, path, flags, mode, **options)
        inside = self._counts(path, options.get("dir_fd")) if flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT) else ""
        return self._operation("open", inside, function) if inside else function()

    def _open(
        self,
        original: Callable[..., Any],
        file: Any,
        mode: str = "r",
        buffering: int = -1,
        encoding: str | None = None,
        errors: str | None = None,
        newline: str | None = None,
        closefd: bool = True,
        opener: Any = None,
    ) -> Any:
        inside = self._counts(file) if set(mode) & set("wax+") else ""
        if not inside or opener is not None:  # an opener calls os.open
            return original(file, mode, buffering, encoding, errors, newline, closefd, opener)
        raw_mode = mode.replace("b", "").replace("t", "")
        raw = self._operation("open", inside, lambda: _WatchedFile(self, inside, raw_mode))
        buffered = io.BufferedRandom(raw) if "+" in mode else io.BufferedWriter(raw)
        return buffered if "b" in mode else io.TextIOWrapper(buffered, encoding, errors, newline)

    def _wrap_images(self) -> None:
        """Wrap the writing of tactile images, which a library does."""
        from palpate.core.io import tactile_exr

        def write_image(original: Callable[..., Any], path: Any, *arguments: Any, **options: Any) -> Any:
            inside = self._counts(path)
            function = functools.partial(original, path, *arguments, **options)
            if not inside:
                return function()

            def spoil() -> None:
                function()
                os_truncate(inside, os.path.getsize(inside) // 2)

            return self._operation("write", inside, function, spoil)

        os_truncate = os.truncate.__wrapped__ if hasattr(os.truncate, "__wrapped__") else os.truncate
        self._wrap(tactile_exr, "write_image", write_image)


class _WatchedFile(io.FileIO):
    """A file whose writing counts as an operation: the first time, the fourth, the sixteenth and so on."""

    def __init__(self, injector: Injector, path: str, mode: str):
        super().__init__(path, mode)
        self._injector, self._path, self._writes = injector, path, 0

    def write(self, data: Any) -> int | None:
        self._writes += 1
        bits = self._writes.bit_length()
        if self._writes != 1 << (bits - 1) or bits % 2 == 0:
            self._injector.check()
            return super().write(data)

        def spoil() -> None:
            super(_WatchedFile, self).write(bytes(data)[: len(data) // 2])

        return self._injector._operation("write", self._path, lambda: super(_WatchedFile, self).write(data), spoil)


@contextmanager
def _removers_run_at_once():
    """Let the thread that removes a replaced bake run where it is started, so that operations have the same order each time."""
    start = threading.Thread.start

    def at_once(self: threading.Thread) -> None:
        if self.name != "palpate-remover":
            start(self)
            return
        self.join = lambda timeout=None: None  # type: ignore[method-assign]
        try:
            self.run()
        except BaseException:  # as in a thread: it ends, the caller goes on
            return

    threading.Thread.start = at_once  # type: ignore[method-assign]
    try:
        yield
    finally:
        threading.Thread.start = start  # type: ignore[method-assign]
