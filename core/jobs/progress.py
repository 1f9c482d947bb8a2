# SPDX-License-Identifier: GPL-3.0-or-later
"""How far a job has come."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import TypeVar


@dataclass(frozen=True)
class Progress:
    """How far a job has come.

    Attributes
    ----------
    stage : str
        What the job is doing, in words for the user.
    done, total : int
        Steps that are done, and all steps.
    frame : int or None
        The frame that the job is at, where it goes through frames.
    """

    stage: str
    done: int
    total: int
    frame: int | None = None

    @property
    def share(self) -> float:
        """The part of the job that is done, from zero to one."""
        return self.done / self.total

    @property
    def text(self) -> str:
        """The stage, with the frame where there is one."""
        return self.stage if self.frame is None else f"{self.stage}: frame {self.frame}"


Result = TypeVar("Result")
Job = Generator[Progress, None, Result]
"""Work that yields its progress and returns its result; closing it cancels the work."""
