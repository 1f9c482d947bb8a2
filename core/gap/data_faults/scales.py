# SPDX-License-Identifier: GPL-3.0-or-later
"""Responses of the other sign, or in a unit that is wrong by a factor of ten or 9.81."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..dataset.rig import Rig, Trial
from ..forward.response_check import OPPOSITE, correlation, moments, normal_load, responses_of
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
    gain_is_known = rig.parameters.unit == "N" or "gain" in rig.given
    signs, units = [], []
    for part, expected in (("reading", float(np.sign(rig.parameters.gain)) if gain_is_known else 0.0), ("force", 1.0)):
        recorded = {s.trial.name: responses_of(rig, [s], part) for s in stimuli}
        clear = {name: own for name, own in recorded.items() if abs(correlation(own)) > LEAST_CORRELATION}
        signs += _signs(clear, part, expected)
        units += _one_of_many(clear, part)
    return [*signs, *_friction_signs(stimuli), *(units or _against_force(rig, stimuli) or _against_stiffness(rig, stimuli))]


# --- sign


def _signs(recorded: Mapping[str, Responses], part: str, expected: float) -> list[DataFault]:
    """Readings or net forces whose sign is not that of compression, or (`expected` 0) not that of the other recordings."""
    found = {name: correlation(own) for name, own in recorded.items()}
    common = expected or float(np.sign(sum(np.sign(value) for value in found.values())))
    what, goes = ("readings", "go") if part == "reading" else ("net force", "goes")
    against = "compression counts as positive" if expected else "the other recordings say otherwise"
    said = f"the {what} of '{{name}}.csv' {goes} the other way (correlation with the load {{value:.2f}}), and {against}"
    return _of_other_sign(found, common, said, partial(_scaled, part=part, factor=-1.0))


def _friction_signs(stimuli: Sequence[Stimulus]) -> list[DataFault]:
    """Net forces along the surface that do work on the surface that slides, where friction takes work from it."""
    found = {s.trial.name: _work_share(s.trial.travel, s.trial.force) for s in stimuli if s.trial.force is not None}
    said = (
        "the net force along the surface of '{name}.csv' drives the slide instead of resisting it (its work is "
        "{value:.2f} of what a force along the travel would do), but forces act on the sensor"
    )
    return _of_other_sign(found, 1.0, said, partial(_scaled, part="force", factor=np.array([-1.0, -1.0, 1.0])))


def _of_other_sign(found: Mapping[str, float], common: float, said: str, correct: Callable[[Trial], Trial]) -> list[DataFault]:
    """The fault of the recordings whose value clearly has not the common sign; `said` is for the first of them."""
    wrong = tuple(name for name, value in found.items() if value * common < OPPOSITE)
    return [DataFault("sign", wrong, said.format(name=wrong[0], value=found[wrong[0]]), correct)] if wrong else []


def _work_share(travel: np.ndarray, force: np.ndarray) -> float:
    """Work of the net force along the stated travel over what it would be if it always pointed along it; 0 without travel."""
    step = np.diff(travel, axis=0)
    known = np.nan_to_num(force[:, :2])
    mean = 0.5 * (known[1:] + known[:-1])
    most = float(np.linalg.norm(mean, axis=1) @ np.linalg.norm(step, axis=1))
    return float((mean * step).sum()) / most if most > 0.0 else 0.0


# --- unit


def _one_of_many(recorded: Mapping[str, Responses], part: str) -> list[DataFault]:
    """Recordings whose response per load is a factor of units away from that of the others."""
    if len(recorded) < 3:
        return []
    slope = np.array([abs(_slope(own)) for own in recorded.values()])
    typical = float(np.median(slope))
    usual = (slope < SAME_SLOPE * typical) & (slope > typical / SAME_SLOPE)
    if usual.sum() < max(2, len(recorded) // 2):
        return []
    ratios = slope / float(np.exp(np.mean(np.log(slope[usual]))))
    what, are = ("readings", "are") if part == "reading" else ("net force", "is")
    said = f"the {what} of '{{name}}.csv' for the same load {are} {{ratio:.3g}} times those of the other recordings"
    return _in_other_unit(dict(zip(recorded, ratios.tolist(), strict=True)), part, said)


def _against_force(rig: Rig, stimuli: Sequence[Stimulus]) -> list[DataFault]:
    """Readings in newtons whose sum is a factor of units away from the measured net force."""
    pairs = {}
    for s in stimuli:
        if s.trial.reading is not None and s.trial.force is not None:
            along = normal_load(rig, s)
            size = np.linalg.norm(along, axis=1)
            normal = along[int(np.argmax(size))] / max(float(size.max()), 1e-300)
            force = (s.trial.force @ normal)[:, None]
            pairs[s.trial.name] = force, np.where(np.isfinite(force), s.trial.reading.sum(axis=1)[:, None], np.nan)
    if rig.parameters.unit != "N" or not pairs:
        return []
    ratio = _slope(list(pairs.values()))
    return _in_other_unit(
        dict.fromkeys(pairs, ratio), "reading", "the readings sum to {ratio:.3g} times the measured net force"
    )


def _against_stiffness(rig: Rig, stimuli: Sequence[Stimulus]) -> list[DataFault]:
    """Readings in newtons that are a factor of units away from the stiffness that the rig states."""
    recorded = [s for s in stimuli if s.trial.reading is not None and s.trial.stimulus != "force"]
    is_stated = rig.parameters.unit == "N" and "k" in rig.given and "gain" not in rig.given
    pairs = responses_of(rig, recorded, "reading")
    if not is_stated or rig.parameters.normal_law != "linear" or correlation(pairs) < LEAST_CORRELATION:
        return []
    found = _slope(pairs)
    said = f"the readings rise by {found:.3g} N per metre of depth, {{ratio:.3g}} times the k of the rig"
    return _in_other_unit({s.trial.name: found / rig.parameters.k for s in recorded}, "reading", said)


def _in_other_unit(ratios: Mapping[str, float], part: str, said: str) -> list[DataFault]:
    """The fault of the recordings whose ratio to what it should be is near a factor of units; `said` is for the first."""
    factors = {name: factor for name, ratio in ratios.items() if (factor := unit_factor(ratio))}
    if not factors:
        return []
    name, factor = next(iter(factors.items()))
    times = f"{factor:.3g} times too small" if factor > 1.0 else f"{1.0 / factor:.3g} times too large"
    said = f"{said.format(name=name, ratio=ratios[name])}, as of a unit {times}"
    return [DataFault("unit", tuple(factors), said, lambda trial: _scaled(trial, part, 1.0 / factors[trial.name]))]


def unit_factor(ratio: float) -> float | None:
    """Return the factor of units, or its inverse, that is nearest to a ratio of two slopes; None if none is near."""
    if not (np.isfinite(ratio) and ratio > 0.0):
        return None
    choices = [value for factor in FACTORS for value in (factor, 1.0 / factor)]
    nearest = min(choices, key=lambda value: abs(np.log(ratio / value)))
    return nearest if abs(np.log(ratio / nearest)) < np.log1p(NEAR) else None


def _slope(pairs: Responses) -> float:
    """Slope of responses over loads of all channels together, each about its mean."""
    xx, xy, _ = moments(pairs).tolist()
    return float(xy / max(xx, 1e-300))


def _scaled(trial: Trial, part: str, factor: float | np.ndarray) -> Trial:
    return replace(trial, **{part: factor * getattr(trial, part)})
