# SPDX-License-Identifier: GPL-3.0-or-later
"""The result of a diagnosis in sentences: a headline, the evidence for each effect, and warnings about the recordings."""

from __future__ import annotations

from ...effects.engine.registry import kind_of
from ...effects.engine.specification import SCATTER
from ..base.quantities import FORCES, READINGS, friction_kinds
from ..candidates.silenced_texels import silenced_texels
from ..dataset.trial import FAULT_KINDS
from ..fitting.identifiability import LEAST_CYCLES
from ..fitting.intervals import ParameterInterval
from ..fitting.residual_tests import LEAST_STRUCTURE
from ..forward.contact_phases import FEATURES
from ..selection.findings import Diagnosis, Finding
from ..selection.rule_numbers import SURE
from .comparison import LEAST_GAIN, LEAST_LEVEL, GapErrors, check_errors, nrmse, recording_differences

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
"""Recommended recording for an unexplained gap, by the feature that its residual depends on most."""
SLIDING_HINTS = {
    "turning": (
        "turn back after slides of several lengths, some very slowly, to see whether the residual follows the "
        "distance or the time since the reversal"
    ),
    "sliding": "slide both ways at several constant speeds",
}
"""The same for recordings of net forces under a sliding surface."""


def next_experiment(result: Diagnosis) -> str:
    """Return the recommended next recording, in one sentence; empty if no question is open."""
    if result.ambiguous:
        pairs = [f"{names[0]} from {' and '.join(names[1:])}" for names in result.ambiguous]
        parts = dict.fromkeys(kind_of(name).experiment for names in result.ambiguous for name in names)
        return f"To distinguish {', and '.join(pairs)}: {'; and '.join(parts)}."
    is_unexplained = result.verdict == "unexplained"
    if result.coverage.slides and all(p.trial.reading is None for p in result.predictors):
        hint = SLIDING_HINTS.get(result.structure.strongest, REPEAT)
        said = f"To find the cause: {hint}; slide under two other loads, and record the normal force."
        return said if is_unexplained else ""
    lacking = _lacking(result)
    if is_unexplained:
        return f"To find the cause: {'; '.join([_hint(result), *lacking])}."
    return f"To complete the recordings: {'; '.join(lacking)}." if lacking else ""


def _hint(result: Diagnosis) -> str:
    """Return the recommended recording to find the cause of an unexplained gap."""
    if result.line is not None:
        return (
            "record the same seconds without touching the sensor, with mains, motors and fans off in turn: the source of the "
            f"line at {result.line.frequency:.3g} Hz (or at a higher frequency that the sampling folds to it) "
            "acts without any load"
        )
    return HINTS.get(result.structure.strongest, REPEAT) if result.structure.total >= LEAST_STRUCTURE else REPEAT


def _lacking(result: Diagnosis) -> list[str]:
    """Return the features that the trials lack."""
    coverage, is_loud = result.coverage, result.noise[0].deviation > LOUD_NOISE * result.full[0]
    quieter = "press harder, or repeat a trial exactly and average, until the noise is below a hundredth of the range"
    everywhere = f"touch the {1.0 - coverage.touched_share:.0%} of the texels that no trial reaches"
    features = [
        (is_loud, quieter),
        (coverage.touched_share < ALL_TEXELS, everywhere),
        (coverage.cycles < LEAST_CYCLES, "repeat the cycle at least three times in one trial"),
        (coverage.longest_hold < LEAST_HOLD, "hold one depth for some ten seconds"),
        (coverage.speed_ratio < LEAST_SPEED_RATIO, "press at speeds at least tenfold apart"),
        (not coverage.unloading, "record the unloading too"),
    ]
    return [text for is_lacking, text in features if is_lacking]


MOST_SAID = 0.99
"""Largest confidence stated as a number: a few hundred cases cannot show one wrong name in a thousand."""
WIDE_INTERVAL = 20.0
"""If an interval reaches this many times below and above its value, the recordings do not identify the value."""
NOT_IDENTIFIABLE = "not identifiable from these recordings"
MANY_FLOORS = 3.0
"""Multiple of the noise floor from which the headline states the remaining error of the check recordings."""
LEAST_SHARE = 0.01
"""Smallest share of the residual that a quantity must predict to be named."""
ASSUMED_SESSION = "If they were recorded in another order or with pauses that matter, name their session and its times."
FRICTION_MATTERS = 1.5
"""The headline mentions the base model's friction if without it the error would be at least this many times as large."""


def headline(result: Diagnosis, errors: GapErrors) -> str:
    """Return the result in one sentence, after a sentence on faults of the data that were not put right."""
    outcome, faults = _outcome(result, errors), {fault.kind: FAULT_KINDS[fault.kind] for fault in result.misleading_faults}
    if not faults:
        return outcome
    correct = ", ".join(f'"{kind}"' for kind in faults)
    said = f"The data have {_listed([*faults.values()])}; put that right first (correct = [{correct}] in [data])."
    return f"{said} As they are: {outcome}"


def _outcome(result: Diagnosis, errors: GapErrors) -> str:
    """The result in one sentence, after one on how the recordings differ."""
    if result.assumed_session:
        return f"Between recordings, taken as one session in their order: {_effects(result, errors)} {ASSUMED_SESSION}"
    if result.between is None:
        return _effects(result, errors)
    own, after = result.between, errors.amended["fit"] or 0.0
    said = f"Recordings differ by a gain and a level of their own; the error shrinks from {own.before:.2%} to {after:.2%} "
    said += f"of the range.{_odd_one(own.odd_recording(result.full[READINGS]))} Name their session to learn more."
    return f"{said} Also: {_effects(result, errors)}" if result.findings or result.verdict == "unexplained" else said


def _odd_one(odd: tuple[str, float, float] | None) -> str:
    """A sentence on the recording that alone differs from all others; empty if there is none."""
    if odd is None:
        return ""
    (name, gain, level), said = odd, []
    if abs(level) > LEAST_LEVEL:
        said.append(f"reads {abs(level):.1%} of the range {'more' if level > 0 else 'less'} than the others")
    if abs(gain) > LEAST_GAIN:
        said.append(f"responds {abs(gain):.0%} {'more' if gain > 0 else 'less'} than they do")
    return f" Only '{name}' differs: it {' and '.join(said)}." if said else ""


def _effects(result: Diagnosis, errors: GapErrors) -> str:
    """The missing effects in one sentence."""
    before, after = errors.stages[0] or 0.0, errors.amended["fit"] or 0.0
    findings = by_share_closed(result)
    sure = [one for one in findings if one.confidence >= SURE]
    if result.verdict == "no gap":
        return f"No gap: the base model with its own parameters refitted leaves {before:.2%} of the range, which is noise."
    shrink, share = f"the error shrinks from {before:.2%} to {after:.2%} of the range", result.closed.least(FORCES)
    if share is not None and _has_friction(result):  # it changes no reading
        shrink += f", and {max(share, 0.0):.0%} of the squared gap of the net forces closes"
    left, stays = errors.amended["check"], ""
    if left is not None and left >= MANY_FLOORS * errors.noise_floor and not any(map(_is_noise, findings)):
        stays = f" In the check recordings {left:.2%} of the range remains, {left / errors.noise_floor:.0f} times the noise."
    with_rivals = {names[0]: " or ".join(names) for names in result.ambiguous}
    if not sure and findings and all(one.name in with_rivals for one in findings) and not result.check.is_refuted:
        choices = "; ".join(with_rivals[one.name] for one in findings)
        return f"Indistinguishable in these recordings: {choices} ({shrink}).{stays}"
    if result.verdict == "unexplained":
        return _unexplained(result, errors, sure)
    unsure = _listed([with_rivals.get(one.name, one.name) for one in findings if one not in sure])
    open_names = " (indistinguishable)" if with_rivals else ""
    if not sure:
        return f"Perhaps missing: {unsure}{open_names}; {shrink}.{stays}"
    besides = f", and perhaps {unsure}{open_names}" if len(sure) < len(findings) else ""
    return f"Missing: {_listed([one.name for one in sure])}{besides}; {shrink}.{stays}"


def _has_friction(result: Diagnosis) -> bool:
    """True if an effect on friction is among the findings."""
    return any(one.name in friction_kinds() for one in result.findings)


def by_share_closed(result: Diagnosis) -> list[Finding]:
    """Return the findings, the one that closes most of the gap first."""
    return sorted(result.findings, key=lambda one: -one.closes)


def _is_noise(finding: Finding) -> bool:
    """True if a finding is noise, of which no model predicts a sample."""
    return kind_of(finding.name).found_by == SCATTER


def check_failure(result: Diagnosis) -> str:
    """Return in a sentence why the amended model fails on the check recordings; empty if it does not."""
    worst = result.check.worst
    if worst is None or all(map(_is_noise, result.findings)):
        return ""
    quantity = next(q for q in (READINGS, FORCES) if result.check.refutes(q) and worst.count[q])
    before, after, fitted = check_errors(result, worst, quantity)
    what = "" if quantity == READINGS else " of the net force"
    rises = f"rises from {before:.2%} to {after:.2%} of the range"
    said = rises if after > before else f"is {after:.2%} of the range, not {fitted:.2%}"
    differs = "; ".join(recording_differences(result, worst.name))
    return f"in the check recording '{worst.name}' the error{what} {said}; {differs}"


def caution(result: Diagnosis) -> str:
    """Return a warning about the use of the amended sensor; empty if there is none."""
    if failure := check_failure(result):
        return f"The amended sensor fails on the check recordings: {failure}."
    with_rivals = {group[0] for group in result.ambiguous}
    if result.findings and all(one.name in with_rivals for one in result.findings):
        said = "The amended sensor has one of several effects that these recordings do not distinguish"
        return f"{said}: under other loads it may be wrong."
    is_part = result.verdict == "unexplained" and result.findings
    return "The amended sensor explains only a part of the gap." if is_part else ""


def _unexplained(result: Diagnosis, errors: GapErrors, sure: list[Finding]) -> str:
    """The headline of a gap that is not explained."""
    names = [one.name for one in sure]
    part = f" {_listed(names)} {'is' if len(names) == 1 else 'are'} part of it." if names else ""
    failure = check_failure(result)
    if failure and result.findings:
        fitted = _listed([one.name for one in by_share_closed(result)])
        many = len(result.findings) > 1
        return f"Unexplained: {fitted} {'fit' if many else 'fits'} the fitted recordings, but {failure}.{part}"
    apart, is_quiet = result.check.worst, result.structure.total < LEAST_STRUCTURE and result.line is None
    if apart is not None and not result.findings and result.between is None and is_quiet:
        left, other = errors.base["fit"] or 0.0, errors.base["check"] or 0.0
        return (
            f"Unexplained: the base model fits the fitted recordings ({left:.2%} of the range) and not the check recording "
            f"'{apart.name}' (all of them: {other:.2%}); {'; '.join(recording_differences(result, apart.name))}."
        )
    if result.line is not None:
        line, unit = result.line, result.rig.parameters.unit
        said = f"a line at {line.frequency:.3g} Hz of {line.amplitude:.3g} {unit}, also present without load"
        return f"Unexplained: {said}, is {line.share:.0%} of the noise without load.{part}"
    after, structure = errors.amended["fit"] or 0.0, result.structure
    if structure.total < LEAST_STRUCTURE or structure.shares.get(structure.strongest, 0.0) < LEAST_SHARE:
        said = f"the residual ({after:.2%} of the range) does not correlate with any measured quantity"
    else:
        said = f"the residual ({after:.2%} of the range) varies most with {FEATURES[structure.strongest]}"
    frictionless = (errors.frictionless or {}).get("fit") or 0.0
    if not _has_friction(result) and frictionless >= FRICTION_MATTERS * (errors.base["fit"] or 0.0):
        # It does not say that no friction is missing: an open gap of the net forces may be friction of another law.
        part += f" The base model has friction; without it the error would be {frictionless:.2%}."
    return f"Unexplained: {said}.{part}"


def said_confidence(confidence: float) -> str:
    """Return a confidence in percent."""
    return f"{confidence:.0%}" if confidence <= MOST_SAID else f"over {MOST_SAID:.0%}"


def evidence(result: Diagnosis, errors: GapErrors) -> list[str]:
    """Return a sentence for each effect that was found, and one for the trials that were never fitted."""
    left = [error or 0.0 for error in errors.stages]
    said = []
    for one in by_share_closed(result):
        rivals = f"; it could also be {' or '.join(one.rivals)}" if one.rivals else ""
        before, after = left[one.effect], left[one.effect + 1]
        confidence = said_confidence(one.confidence)
        said.append(f"{one.name} ({one.form}): {before:.2%} → {after:.2%}, confidence {confidence}{rivals}")
        so = "so its number is in doubt and its name is not" if one.confidence >= SURE else "so its name is in doubt"
        said += [f"{one.name}: {why}, {so}" for why in (*one.unsettled, *one.doubts)]
    if result.of("check") and result.findings:
        before, after = errors.base["check"] or 0.0, errors.amended["check"] or 0.0
        said.append(f"check recordings, never fitted: {before:.2%} → {after:.2%}; noise alone is {errors.noise_floor:.2%}")
    least = [share for share in map(result.closed.least, (READINGS, FORCES)) if share is not None]
    if least and result.findings:
        closed = f"{max(min(least), 0.0):.0%} of the squared gap is closed"
        said.append(f"{closed} (the least of fitted, left-out and check recordings)")
    return said


def noise_sentence(share: float, left: float | None) -> str:
    """Return sentences about loud noise.

    Parameters
    ----------
    share : float
        Standard deviation of the readings without load, as a share of the range.
    left : float or None
        Error of the amended model on the fitted recordings, likewise. It contains the noise. Where it is less than half of
        `share`, the readings without load were no noise: they had load, and the rig says otherwise.
    """
    if left is not None and left < 0.5 * share:
        return (
            f"Readings change by {share:.0%} of the range although poses and shapes show no contact, and the "
            f"amended sensor leaves {left:.2%}: contact begins elsewhere. "
            'Try contact_height = "free" in [sensor], and check the shapes.'
        )
    return f"Noise is {share:.0%} of the range: effects that are not much larger cannot be detected in these recordings."


def warnings(result: Diagnosis) -> list[str]:
    """Return warnings about the recordings, without those of the rig."""
    said = [fault.sentence for fault in result.faults] + [text for text in (caution(result),) if text]
    for silenced in silenced_texels(result.predictors, result.base.model, result.noise[READINGS].deviation):
        said.append(
            f"Texel {silenced.texel} does not respond to load from {silenced.seconds:.3g} s of '{silenced.recording}' on: "
            f"repair it, or leave its readings empty from there on."
        )
    overpressed = max((p.stimulus.overpressed for p in result.predictors), default=0)
    if overpressed:
        said.append(
            f"Up to {overpressed} texels were pressed past the maximum penetration of "
            f"{result.rig.parameters.max_penetration * 1e3:.3g} mm: here they still exert force, in a simulation not."
        )
    share = result.noise[0].deviation / result.full[0]
    if share > LOUD_NOISE:
        said.append(noise_sentence(share, nrmse(result.of("fit"), result.best.model, result.full)))
    if not result.of("check"):
        said.append('No trial is kept for checking: give one use = "check", so that the result is tested on it.')
    if len(result.of("fit")) == 1:
        said.append("Only one trial was fitted: effects were compared on its halves.")
    return said


def interval_text(one: ParameterInterval) -> str:
    """Return a number with its interval, for the terminal; of one that is not identifiable, what the amended sensor has."""
    ends = interval_ends(one)
    return f"{ends}; sensor.toml has {one.value:.4g}" if ends == NOT_IDENTIFIABLE else f"{one.value:.4g} ({ends})"


def interval_ends(one: ParameterInterval) -> str:
    """Return an interval, or a remark if it fills the bounds of its parameter or leaves the order of magnitude open."""
    on_both_sides = one.low >= 0.0 and one.high > WIDE_INTERVAL * one.value and one.low * WIDE_INTERVAL <= one.value
    if one.fills_bounds or on_both_sides or one.high - one.low > WIDE_INTERVAL**2 * abs(one.value) > 0.0:
        return NOT_IDENTIFIABLE
    return f"{one.low:.4g} … {one.high:.4g}"


def _listed(names: list[str]) -> str:
    """Names as a list in words."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}" if names else "nothing"
