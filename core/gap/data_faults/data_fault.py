# SPDX-License-Identifier: GPL-3.0-or-later
"""A fault of the data: its kind, the recordings that have it, the evidence, and how it is put right."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from ..dataset.trial import FAULT_KINDS, Trial


@dataclass(frozen=True)
class DataFault:
    """A fault of the data.

    Attributes
    ----------
    kind : str
        A key of :data:`.trial.FAULT_KINDS`.
    trials : tuple of str
        Names of the recordings that have it.
    evidence : str
        What shows it, in one sentence without a full stop.
    correct : callable
        Returns one of these recordings without the fault.
    put_right : bool
        True if this was done.
    """

    kind: str
    trials: tuple[str, ...]
    evidence: str
    correct: Callable[[Trial], Trial] = field(compare=False, repr=False)
    put_right: bool = False

    @property
    def sentence(self) -> str:
        """The fault in one sentence, with what was done or can be done."""
        files = ", ".join(f"'{name}.csv'" for name in self.trials[:3]) + (" …" if len(self.trials) > 3 else "")
        what = f"{files}: {FAULT_KINDS[self.kind]}: {self.evidence}"
        mended = "this was put right" if self.put_right else f'correct = ["{self.kind}"] in [data] of the rig puts it right'
        return f"{what}; {mended}."
