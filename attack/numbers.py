# SPDX-License-Identifier: GPL-3.0-or-later
"""Random parameter sets, most of them extreme, through the solver: nothing but finite numbers, and no energy from nothing.

The sets and their judge are those of the tests (tests/oracles/sweep.py): stiffness over six decades, masses over five, steps
over three, any shape, slope, throw and spin.
"""

from __future__ import annotations

import importlib
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from palpate.core.solver.simulation import Simulation

from .area import CLEAR, TRACEBACK, WRONG, Area, Case, Outcome

TESTS = Path(__file__).resolve().parents[1] / "tests"
JUDGED = ("mechanical_growth", "growth")
"""Figures of a run that must not exceed :data:`ROUNDING`: growth of motion and height, and with the energy of the springs.
The second must not in any run. The first may where the run says that its step is far above the stability limit: a body that is
thrown back rises for a whole step with its new velocity v, and so by ½ g dt v too high in energy per mass."""
ROUNDING = 1e-9
"""Growth that counts as rounding: the sums of a run are exact to about 1e-12 of their largest term."""


class Numbers(Area):
    """Extreme parameter sets."""

    short, long = 150, 1500

    def __init__(self, seed: int, tries: int, folder: Path):
        super().__init__(seed, tries, folder)
        if str(TESTS) not in sys.path:
            sys.path.append(str(TESTS))
        self._sweep = importlib.import_module("oracles.sweep")

    def cases(self) -> Iterator[Case]:
        for i in range(self.tries):
            yield Case(f"set {i}", {"set": self.seed % 1_000_000 + i})

    def attempt(self, case: Case) -> Outcome:
        try:
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore")
                run, words = self._sweep.thrown(case.data["set"])[:2]
        except Exception as error:
            return Outcome(TRACEBACK, f"{type(error).__name__}: {error}")
        case.data["words"] = str(words)
        if not np.isfinite(run.total).all():
            return Outcome(WRONG, "a number that is not finite")
        grown = {key: float(getattr(run, key)) for key in JUDGED if not getattr(run, key) <= ROUNDING}
        if "growth" in grown or (grown and not self._is_warned(case.data["set"])):
            return Outcome(WRONG, f"energy from nothing: {grown}")
        return Outcome(CLEAR)

    def _is_warned(self, number: int) -> bool:
        """Return True where the run says before its first step that steps are far above the stability limit."""
        simulation = Simulation(self._sweep.random_case(number)[0])
        simulation.advance()
        return any("stability limit" in words for words in simulation.warnings)


AREA = Numbers
