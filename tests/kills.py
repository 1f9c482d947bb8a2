# SPDX-License-Identifier: GPL-3.0-or-later
"""Stops a function at any of its steps, as a kill or a full disk does, for tests of what is left behind."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import pytest

STEPS = ("replace", "unlink", "rmdir", "mkdir")
"""Functions of :mod:`os` that change names in folders: what is found after a kill depends on which of them were called."""


class Stopped(BaseException):
    """The process was killed here."""


@contextmanager
def files_up_to(size: int) -> Iterator[None]:
    """Let no file grow beyond a number of bytes in the body, which stands for a full disk."""
    resource = pytest.importorskip("resource")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


@contextmanager
def stopped_at(number: int, error: OSError | None = None) -> Iterator[list[str]]:
    """Let the call of this number of :data:`STEPS` fail in the body; yield the list of calls, which grows.

    Without an error this stands for a kill: all later calls fail as well, and the body ends by :class:`Stopped`. With an error
    that one call raises it, and the body handles it.
    """
    calls: list[str] = []

    def failing(name, original):
        def call(*arguments, **options):
            calls.append(f"{name} {arguments[0]}")
            if len(calls) == number and error is not None:
                raise error
            if len(calls) >= number and error is None:
                raise Stopped
            return original(*arguments, **options)

        return call

    with pytest.MonkeyPatch.context() as patch:
        for name in STEPS:
            patch.setattr(os, name, failing(name, getattr(os, name)))
        with suppress(Stopped):
            yield calls
