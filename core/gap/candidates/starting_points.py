# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the fit of a candidate starts: points of its search ranges, scaled along its strength by a score test."""

from __future__ import annotations

import numpy as np

from ...effects.engine.registry import form_of
from ...effects.engine.specification import SILENT_TEXELS, STEPS, scalar
from ...model.sensor import Effect
from .candidates import IN_PLANE, SMALL_SHIFT, SMALL_TURN, START_COUNT, Candidate, Scales, search_range
from .direct_estimates import quantization_starts, unresponsive_texels
from .rao_score import ScoreTest
from .view_set import ViewSet

LARGEST_SHIFT, LARGEST_TURN = 0.5, 0.1
"""Bounds of the starting points of displaced texels: a share of the pitch, and an angle in rad."""
DISPLACEMENT_SCANS = ((0.15, 8), (0.02, 8))
"""Step and number of steps to each side of the scans for a large displacement, first ones and second ones, which reach from one
first step to the next; steps are shares of the pitch and of `LARGEST_TURN`. Shifts of 25 rigs with flat punches are 0.95
pitches at most, and in 24 the fit ends at the noise, with second steps of 0.05 in 23: there the place is 0.04 pitches wide."""
THRESHOLD_SCANS = (24, 12, 12)
"""Values of a threshold over its search range, and then twice between the neighbours of the best, in scans for one where
readings jump. The first steps are of a quarter, the last of a hundredth: the threshold is found in 12 of 12 rigs, in 4 of these
beside another effect."""
TEXEL_STEP = 0.01
"""Test step of parameters of single texels, as a share of their scale."""


def starting_points(
    candidate: Candidate, score_test: ScoreTest, view_set: ViewSet, scales: Scales, count: int = START_COUNT
) -> list[tuple[float, Effect]]:
    """Return starting points of a candidate's fit, best first, each with the decrease of the squares that it promises.

    Parameters
    ----------
    candidate : Candidate
    score_test : ScoreTest
        Of the fit to which the candidate is added.
    view_set : ViewSet
        For direct estimates.
    scales : Scales
    count : int
        Number of points of the search ranges that are tried.
    """
    if candidate.kind.found_by == SILENT_TEXELS:
        effect = unresponsive_texels(view_set.whole, score_test.model, candidate, scales.texels)
        return [] if effect is None else [(score_test.score(effect)[0], effect)]
    if candidate.kind.found_by == STEPS:
        return _quantization_starts(candidate, score_test, view_set)
    if candidate.has_texel_parameters:
        return _texel_parameter_starts(candidate, score_test, scales)
    if candidate.form.placement is not None:
        starts = [_displacement_start(candidate, score_test, scales)]
        if count == START_COUNT:
            starts += _large_displacement(candidate, score_test, scales)
        return sorted(starts, key=lambda entry: -entry[0])
    return _scaled_starts(candidate, score_test, scales, count)


def _scaled_starts(candidate: Candidate, score_test: ScoreTest, scales: Scales, count: int) -> list[tuple[float, Effect]]:
    """Points of the search ranges, as they are and scaled along the candidate's strength to the best length of a score test.

    The score test is linear and an effect is not: how far loads spread does nothing near a width of zero.
    """
    gain, tried = abs(score_test.model.parameters.gain), []
    if candidate.form.jumps_at:
        return _scanned_threshold(candidate, score_test, scales, gain)
    for values in candidate.starting_values(scales, gain, count):
        effect = candidate.effect(values, scales.texels, gain)
        promise, length = score_test.score(effect)
        if length > 0.0 or candidate.is_signed:
            tried += [(promise, effect), (promise, candidate.scaled(effect, length, gain))]
    return sorted(tried, key=lambda entry: -entry[0])


def _scanned_threshold(candidate: Candidate, score_test: ScoreTest, scales: Scales, gain: float) -> list[tuple[float, Effect]]:
    """The threshold that lowers the squares most in scans that close in on it: where readings jump, no derivative does."""
    parameter = next(q for q in candidate.form.parameters if q.name in candidate.form.jumps_at)
    low, high = search_range(parameter.scaled(gain), scales, candidate.form)
    best: list[tuple[float, Effect]] = []
    for count in THRESHOLD_SCANS if low > 0.0 else ():
        values = np.geomspace(low, high, count)
        effects = [candidate.effect({parameter.name: float(value)}, scales.texels, gain) for value in values]
        decreases = [score_test.decrease_with(effect) for effect in effects]
        top = int(np.argmax(decreases))
        low, high = values[max(top - 1, 0)], values[min(top + 1, count - 1)]
        best = [(decreases[top], effects[top])]
    return best


def _quantization_starts(candidate: Candidate, score_test: ScoreTest, view_set: ViewSet) -> list[tuple[float, Effect]]:
    """The best of the steps that are estimated from the readings; the other parameters follow it by half a step."""
    model = score_test.model
    starts = quantization_starts(view_set.moving_readings(model), view_set.whole, model, candidate)
    decreases = [(score_test.decrease_after_step(effect), effect) for effect in starts]
    return sorted(decreases, key=lambda entry: -entry[0])[:1]


def _texel_parameter_starts(candidate: Candidate, score_test: ScoreTest, scales: Scales) -> list[tuple[float, Effect]]:
    """The neutral values, with the promise of a small step of each texel by a length of its own."""
    gain = abs(score_test.model.parameters.gain)
    parameter = next(q.scaled(gain) for q in candidate.form.parameters if q.per_texel)
    scale = scales.reading if parameter.unit == "unit" else 1.0
    step = float(parameter.default) + TEXEL_STEP * scale
    moved = candidate.effect({parameter.name: step}, scales.texels, gain)
    promise = score_test.score_of_texels(moved)
    return [(promise, candidate.effect({}, scales.texels, gain))]


def _displacement_start(candidate: Candidate, score_test: ScoreTest, scales: Scales) -> tuple[float, Effect]:
    """The best small displacement of the texels: a joint score test of a small step of each parameter."""
    gain = abs(score_test.model.parameters.gain)
    parameters = [q for q in candidate.form.parameters if q.name not in candidate.held]
    neutral = dict.fromkeys(candidate.form.neutral, 0.0)
    shifts, turns = (SMALL_SHIFT * scales.pitch, LARGEST_SHIFT * scales.pitch), (SMALL_TURN, LARGEST_TURN)
    steps = {q.name: shifts if q.unit == "m" else turns for q in parameters}
    moved = [candidate.effect({**neutral, name: step}, scales.texels, gain) for name, (step, _) in steps.items()]
    promise, best = score_test.joint_score(moved)
    values = {name: float(np.clip(b * s, -m, m)) for b, (name, (s, m)) in zip(best, steps.items(), strict=True)}
    return promise, candidate.effect(values, scales.texels, gain)


def is_large_shift(effect: Effect, scales: Scales) -> bool:
    """Return whether an effect moves the texels farther than a small displacement does."""
    if form_of(effect.name, effect.form).placement is None:
        return False
    shifts = [abs(scalar(effect.values, name)) for name in ("x", "y", "z") if name in effect.values]
    return max(shifts, default=0.0) > LARGEST_SHIFT * scales.pitch


def _large_displacement(candidate: Candidate, score_test: ScoreTest, scales: Scales) -> list[tuple[float, Effect]]:
    """The displacement along the skin that lowers the squares most in scans along each axis, for indenters other than spheres.

    Under a flat indenter it changes nothing until it adds or removes a texel, so no derivative points to it. Of those that
    do as much the middle one is taken.
    """
    gain = abs(score_test.model.parameters.gain)
    pressed_by = [view.predictor.rig.indenter_of(view.predictor.trial) for view in score_test.views]
    units = {"x": scales.pitch, "y": scales.pitch, "about_z": LARGEST_TURN}
    along = [name for name in IN_PLANE if name in candidate.form.neutral]
    if not along or all(one is None or one.radius is not None for one in pressed_by):
        return []
    best, decrease = dict.fromkeys(candidate.form.neutral, 0.0), 0.0
    scans = [(step, count, name) for axes in (along[:2], along[2:]) for step, count in DISPLACEMENT_SCANS for name in axes]
    for step, count, name in scans:  # a turn last, because it imitates a shift that is not found yet
        tried = [{**best, name: best[name] + i * step * units[name]} for i in range(-count, count + 1)]
        effects = [candidate.effect(values, scales.texels, gain) for values in tried]
        decreases = [score_test.decrease_with(effect) for effect in effects]
        decrease = max(decreases)
        top = np.flatnonzero(np.isclose(decreases, decrease))
        best = tried[top[len(top) // 2]]
    return [(decrease, candidate.effect(best, scales.texels, gain))]
