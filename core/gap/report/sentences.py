# SPDX-License-Identifier: GPL-3.0-or-later
"""The result of a diagnosis in sentences: a headline, the evidence for each effect, and warnings about the recordings."""

from __future__ import annotations

from ..fitting.intervals import ParameterInterval
from ..forward.contact_phases import FEATURES
from ..selection.findings import Diagnosis
from .comparison import GapErrors
from .experiments import LOUD_NOISE

SURE = 0.5
"""Confidence from which on an effect counts as found."""
FRICTION_MATTERS = 1.5
"""The headline mentions the base model's friction if without it the error would be at least this many times as large."""


def headline(result: Diagnosis, errors: GapErrors) -> str:
    """Return the result in one sentence."""
    before, after = errors.base["fit"] or 0.0, errors.amended["fit"] or 0.0
    sure = [one for one in result.findings if one.confidence >= SURE]
    if result.verdict == "no gap":
        return f"No gap: the base model with its own parameters refitted leaves {before:.2%} of the range, which is noise."
    if result.verdict == "unexplained":
        return _unexplained(result, errors, [one.name for one in sure])
    shrink = f"the error shrinks from {before:.2%} to {after:.2%} of the range"
    if result.ambiguous and not sure:
        choices = "; ".join(" or ".join(names) for names in result.ambiguous)
        return f"Not told apart by these recordings: {choices} ({shrink})."
    with_rivals = {names[0]: " or ".join(names) for names in result.ambiguous}
    unsure = _listed([with_rivals.get(one.name, one.name) for one in result.findings if one not in sure])
    if not sure:
        return f"Perhaps missing: {unsure}; {shrink}."
    besides = ""
    if len(sure) < len(result.findings):
        besides = f", and perhaps {unsure}{' (not told apart)' if with_rivals else ''}"
    return f"Missing: {_listed([one.name for one in sure])}{besides}; {shrink}."


def _unexplained(result: Diagnosis, errors: GapErrors, sure: list[str]) -> str:
    """The headline of a gap that is not explained."""
    part = f" {_listed(sure)} is part of it." if sure else ""
    if result.line is not None:
        line, unit = result.line, result.rig.parameters.unit
        said = f"a line at {line.frequency:.3g} Hz of {line.amplitude:.3g} {unit}, there without load too"
        return f"Unexplained: {said}, is {line.share:.0%} of the noise without load.{part}"
    strongest = FEATURES.get(result.structure.strongest, "nothing that was looked at")
    after = errors.amended["fit"] or 0.0
    return f"Unexplained: what is left ({after:.2%} of the range) varies most with {strongest}.{part}{_friction(errors)}"


def _friction(errors: GapErrors) -> str:
    """A sentence on how much of the error the base model's own friction removes; empty if that is little."""
    frictionless = (errors.frictionless or {}).get("fit") or 0.0
    if frictionless < FRICTION_MATTERS * (errors.base["fit"] or 0.0):
        return ""
    return f" Friction is not missing: the base model has it, and without it the error would be {frictionless:.2%}."


def evidence(result: Diagnosis, errors: GapErrors) -> list[str]:
    """Return a sentence for each effect that was found, and one for the trials that were never fitted."""
    left = [error or 0.0 for error in errors.stages]
    said = []
    for one in result.findings:
        rivals = f"; it could as well be {' or '.join(one.rivals)}" if one.rivals else ""
        before, after = left[one.effect], left[min(one.effect + 1, len(left) - 1)]
        said.append(f"{one.name} ({one.form}): {before:.2%} → {after:.2%}, confidence {one.confidence:.0%}{rivals}")
    if result.of("check") and result.findings:
        before, after = errors.base["check"] or 0.0, errors.amended["check"] or 0.0
        said.append(f"never fitted: {before:.2%} → {after:.2%}; noise alone is {errors.noise_floor:.2%}")
    return said


def warnings(result: Diagnosis) -> list[str]:
    """Return what a reader should know about the recordings, without the rig's own warnings."""
    said = []
    overpressed = max((p.stimulus.overpressed for p in result.predictors), default=0)
    if overpressed:
        said.append(
            f"Up to {overpressed} texels were pressed past the maximum penetration of "
            f"{result.rig.parameters.max_penetration * 1e3:.3g} mm; here they go on acting, in a simulation they would not."
        )
    share = result.noise[0].deviation / result.full[0]
    if share > LOUD_NOISE:
        said.append(f"Noise is {share:.0%} of the range: an effect that is not much larger cannot be seen in these recordings.")
    if not result.of("check"):
        said.append('No trial is for checking only: give one use = "check", so that the result can be judged on it.')
    if len(result.of("fit")) == 1:
        said.append("Only one trial was fitted: its halves were judged against each other.")
    return said


def interval_text(one: ParameterInterval) -> str:
    """Return a number with its interval, for the terminal."""
    return f"{one.value:.4g} ({one.low:.4g} … {one.high:.4g})"


def _listed(names: list[str]) -> str:
    """Names as a list in words."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}" if names else "nothing"
