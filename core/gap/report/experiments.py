# SPDX-License-Identifier: GPL-3.0-or-later
"""The next experiment: what to record in order to answer the questions that these recordings leave open."""

from __future__ import annotations

from ...effects.engine.registry import kind_of
from ..fitting.residual_tests import LEAST_STRUCTURE
from ..selection.findings import Diagnosis
from ..selection.identifiability import LEAST_CYCLES

LOUD_NOISE = 0.05
"""Noise, as a share of the range, above which it hides the smaller effects."""
ALL_TEXELS = 0.999
"""Share of the texels that must be touched for the recordings to cover the sensor."""
LEAST_HOLD = 2.0
"""Duration of a hold that shows creep, s."""
LEAST_SPEED_RATIO = 5.0
"""Ratio of fast to slow loading that shows an effect of speed."""

REPEAT = "repeat one trial exactly, to see which part of the difference repeats"
HINTS = {
    "common mode": "record the same seconds without touching the sensor, to see whether it is there as well",
    "shared by loaded texels": "hold one constant load for as long as a trial, to see how the reading moves by itself",
    "clock": "record as long without touching the sensor",
}
"""What to record for an unexplained gap, by the feature that its residual depends on most."""
SLIDING_HINTS = {
    "turning": (
        "turn back after slides of several lengths, some very slowly, to see whether the residual follows the "
        "distance or the time since the reversal"
    ),
    "sliding": "slide both ways at several constant speeds",
}
"""The same for recordings of net forces under a sliding surface."""


def next_experiment(result: Diagnosis) -> str:
    """Return what to record next, in one sentence; empty if no question is open."""
    if result.ambiguous:
        return _experiment_between_rivals(result)
    if result.coverage.slides and all(p.trial.reading is None for p in result.predictors):
        return _sliding_experiment(result)
    lacking = _lacking(result)
    if result.verdict == "unexplained":
        return f"To find the cause: {'; '.join([_hint(result), *lacking])}."
    return f"To complete the recordings: {'; '.join(lacking)}." if lacking else ""


def _experiment_between_rivals(result: Diagnosis) -> str:
    """What distinguishes the kinds of effects that these recordings leave as rivals."""
    pairs = [f"{names[0]} from {' and '.join(names[1:])}" for names in result.ambiguous]
    involved = list(dict.fromkeys(name for names in result.ambiguous for name in names))
    parts = [kind_of(name).experiment for name in involved]
    return f"To distinguish {', and '.join(pairs)}: {'; and '.join(dict.fromkeys(parts))}."


def _sliding_experiment(result: Diagnosis) -> str:
    """What to record if only net forces were measured while a surface slid."""
    if result.verdict != "unexplained":
        return ""
    hint = SLIDING_HINTS.get(result.structure.strongest, REPEAT)
    return f"To find the cause: {hint}; slide under two other loads, and record the normal force."


def _hint(result: Diagnosis) -> str:
    """What to record to find the cause of an unexplained gap."""
    if result.line is not None:
        return (
            "record the same seconds without touching the sensor, with mains, motors and fans off in turn: the source of the "
            f"line at {result.line.frequency:.3g} Hz (or at a higher frequency that the sampling folds to it) "
            "acts without any load"
        )
    return HINTS.get(result.structure.strongest, REPEAT) if result.structure.total >= LEAST_STRUCTURE else REPEAT


def _lacking(result: Diagnosis) -> list[str]:
    """What the trials did not do to the sensor."""
    coverage, lacking = result.coverage, []
    if result.noise[0].deviation > LOUD_NOISE * result.full[0]:
        lacking.append("press harder, or repeat a trial exactly and average, until the noise is below a hundredth of the range")
    if coverage.touched_share < ALL_TEXELS:
        lacking.append(f"touch the {1.0 - coverage.touched_share:.0%} of the texels that no trial reaches")
    if coverage.cycles < LEAST_CYCLES:
        lacking.append("repeat the cycle at least three times in one trial")
    if coverage.longest_hold < LEAST_HOLD:
        lacking.append("hold one depth for some ten seconds")
    if coverage.speed_ratio < LEAST_SPEED_RATIO:
        lacking.append("press at speeds at least tenfold apart")
    if not coverage.unloading:
        lacking.append("record the unloading too")
    return lacking
