# SPDX-License-Identifier: GPL-3.0-or-later
"""Responses of the other sign, or in a unit that is wrong by a factor of ten or 9.81."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..dataset.rig import Rig, Trial
from ..forward.response_check import OPPOSITE, centred, correlation, normal_load, responses_of
from ..forward.stimulus import Stimulus
from .data_fault import DataFault

FACTORS = (10.0, 9.81, 100.0, 1000.0)
"""Factors by which units are mistaken: prefixes, and kilograms for newtons."""
NEAR = 0.2
"""Largest distance of a ratio from such a factor, or from its inverse, as a share of it."""
SAME_SLOPE = 2.0
"""The other recordings must agree on the response per load up to this factor for one of them to be in another unit."""
Responses = Sequence[tuple[np.ndarray, np.ndarray]]
"""Loads and responses."""
LEAST_CORRELATION = 0.5
"""Least correlation of a response with its load for its slope or its sign to count."""


def find_scale_faults(rig: Rig, stimuli: Sequence[Stimulus]) -> list[DataFault]:
    """Return responses of the other sign, and in another unit."""
    return [*_signs(rig, stimuli), *_units(rig, stimuli)]


# --- sign


def _signs(rig: Rig, stimuli: Sequence[Stimulus]) -> list[DataFault]:
    """Readings or net forces whose sign is not that of compression, or not that of the other recordings."""
    faults = []
    gain_is_known = rig.parameters.unit == "N" or "gain" in rig.given
    for part, expected in (("reading", float(np.sign(rig.parameters.gain)) if gain_is_known else 0.0), ("force", 1.0)):
        found = {s.trial.name: correlation(responses_of(rig, [s], part)) for s in stimuli if getattr(s.trial, part) is not None}
        clear = {name: value for name, value in found.items() if abs(value) > LEAST_CORRELATION}
        common = expected or float(np.sign(sum(np.sign(value) for value in clear.values())))
        wrong = tuple(name for name, value in clear.items() if value * common < OPPOSITE)
        if wrong and common:
            what = "readings" if part == "reading" else "net force"
            against = "compression counts as positive" if expected else "the other recordings say otherwise"
            value = clear[wrong[0]]
            said = f"the {what} of '{wrong[0]}.csv' {'go' if part == 'reading' else 'goes'} the other way"
            said += f" (correlation with the load {value:.2f}), and {against}"
            faults.append(DataFault("sign", wrong, said, partial(_scaled, part=part, factor=-1.0)))
    return [*faults, *_friction_signs(stimuli)]


def _friction_signs(stimuli: Sequence[Stimulus]) -> list[DataFault]:
    """Net forces along the surface that do work on the surface that slides, where friction takes work from it."""
    found = {s.trial.name: _work_share(s.trial) for s in stimuli if s.trial.force is not None}
    wrong = tuple(name for name, value in found.items() if value < OPPOSITE)
    if not wrong:
        return []
    said = (
        f"the net force along the surface of '{wrong[0]}.csv' drives the slide instead of resisting it (its work is "
        f"{found[wrong[0]]:.2f} of what a force along the travel would do), but forces act on the sensor"
    )
    return [DataFault("sign", wrong, said, partial(_scaled, part="force", factor=np.array([-1.0, -1.0, 1.0])))]


def _work_share(trial: Trial) -> float:
    """Work of the net force along the stated travel over what it would be if it always pointed along it; 0 without travel."""
    assert trial.force is not None
    step = np.diff(trial.travel, axis=0)
    known = np.nan_to_num(trial.force[:, :2])
    force = 0.5 * (known[1:] + known[:-1])
    most = float(np.linalg.norm(force, axis=1) @ np.linalg.norm(step, axis=1))
    return float((force * step).sum()) / most if most > 0.0 else 0.0


# --- unit


def _units(rig: Rig, stimuli: Sequence[Stimulus]) -> list[DataFault]:
    """One recording in another unit than the others, or all readings against the net force or the rig's stiffness."""
    faults = []
    for part in ("reading", "force"):
        recorded = {s.trial.name: responses_of(rig, [s], part) for s in stimuli}
        faults += _one_of_many({name: own for name, own in recorded.items() if abs(correlation(own)) > LEAST_CORRELATION}, part)
    if not faults:
        faults += _against_force(rig, stimuli) or _against_stiffness(rig, stimuli)
    return faults


def _one_of_many(recorded: Mapping[str, Responses], part: str) -> list[DataFault]:
    """Recordings whose response per load is a factor of units away from that of the others."""
    if len(recorded) < 3:
        return []
    slope = np.array([abs(_slope(own)) for own in recorded.values()])
    typical = float(np.median(slope))
    usual = (slope < SAME_SLOPE * typical) & (slope > typical / SAME_SLOPE)
    if usual.sum() < max(2, len(recorded) // 2):
        return []
    level = float(np.exp(np.mean(np.log(slope[usual]))))
    found = {}
    for name, value in zip(recorded, slope, strict=True):
        factor = unit_factor(value / level)
        if factor is not None:
            found[name] = (factor, value / level)
    if not found:
        return []
    name, (factor, ratio) = next(iter(found.items()))
    what = "readings" if part == "reading" else "net force"
    said = (
        f"the {what} of '{name}.csv' for the same load {'are' if part == 'reading' else 'is'} {ratio:.3g} times those of the "
        f"other recordings, as of a unit {_times(factor)}"
    )
    return [DataFault("unit", tuple(found), said, lambda trial: _scaled(trial, part, 1.0 / found[trial.name][0]))]


def _against_force(rig: Rig, stimuli: Sequence[Stimulus]) -> list[DataFault]:
    """Readings in newtons whose sum is a factor of units away from the measured net force."""
    both = [s for s in stimuli if s.trial.reading is not None and s.trial.force is not None]
    if rig.parameters.unit != "N" or not both:
        return []
    pairs = []
    for s in both:
        assert s.trial.reading is not None and s.trial.force is not None
        along = normal_load(rig, s)
        size = np.linalg.norm(along, axis=1)
        normal = along[int(np.argmax(size))] / max(float(size.max()), 1e-300)
        pairs.append((s.trial.force @ normal, s.trial.reading.sum(axis=1)))
    good = [(np.isfinite(x) & np.isfinite(y), x, y) for x, y in pairs]
    ratio = _slope([(x[g][:, None], y[g][:, None]) for g, x, y in good])
    factor = unit_factor(ratio)
    if factor is None:
        return []
    names = tuple(s.trial.name for s in both)
    said = f"the readings sum to {ratio:.3g} times the measured net force, as of a unit {_times(factor)}"
    return [DataFault("unit", names, said, partial(_scaled, part="reading", factor=1.0 / factor))]


def _against_stiffness(rig: Rig, stimuli: Sequence[Stimulus]) -> list[DataFault]:
    """Readings in newtons that are a factor of units away from the stiffness that the rig states."""
    recorded = [s for s in stimuli if s.trial.reading is not None and s.trial.stimulus != "force"]
    if rig.parameters.unit != "N" or "k" not in rig.given or "gain" in rig.given or not recorded:
        return []
    if rig.parameters.normal_law != "linear":
        return []
    pairs = responses_of(rig, recorded, "reading")
    if correlation(pairs) < LEAST_CORRELATION:
        return []
    found = _slope(pairs)
    factor = unit_factor(found / rig.parameters.k)
    if factor is None:
        return []
    names = tuple(s.trial.name for s in recorded)
    said = (
        f"the readings rise by {found:.3g} N per metre of depth, {found / rig.parameters.k:.3g} times the k of the rig, "
        f"as of a unit {_times(factor)}"
    )
    return [DataFault("unit", names, said, partial(_scaled, part="reading", factor=1.0 / factor))]


def unit_factor(ratio: float) -> float | None:
    """Return the factor of units, or its inverse, that is nearest to a ratio of two slopes; None if none is near."""
    if not (np.isfinite(ratio) and ratio > 0.0):
        return None
    choices = [value for factor in FACTORS for value in (factor, 1.0 / factor)]
    nearest = min(choices, key=lambda value: abs(np.log(ratio / value)))
    return nearest if abs(np.log(ratio / nearest)) < np.log1p(NEAR) else None


def _times(factor: float) -> str:
    return f"{factor:.3g} times too small" if factor > 1.0 else f"{1.0 / factor:.3g} times too large"


def _slope(pairs: Responses) -> float:
    """Slope of responses over loads of all channels together, each about its mean."""
    xx = xy = 0.0
    for load, response in pairs:
        x, y = centred(load, response)
        xx, xy = xx + float((x * x).sum()), xy + float((x * y).sum())
    return xy / max(xx, 1e-300)


def _scaled(trial: Trial, part: str, factor: float | np.ndarray) -> Trial:
    return replace(trial, **{part: factor * getattr(trial, part)})
