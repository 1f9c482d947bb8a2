# SPDX-License-Identifier: GPL-3.0-or-later
"""Programmes: sequences of presses, drawn at random, in a few usual shapes, or changed a little.

All numbers of a programme are shares of limits and seconds, so that a programme keeps its limits whatever they are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

LEAST_DEPTH = 0.15
"""Least depth of a press, as a share of the limit."""
SLOWEST = 0.3
"""Longest way to the full depth, as a share of the duration."""
LONGEST_HOLD = 0.4
"""Longest hold, as a share of the duration."""
MOST_STEPS = 5
"""Largest number of depths in a press."""


@dataclass(frozen=True)
class PlannedStep:
    """A depth of a press, how fast it is reached, and how long it is held.

    Attributes
    ----------
    depth : float
        Share of the limit, like the next one.
    speed : float
    hold : float, s
    """

    depth: float
    speed: float
    hold: float


@dataclass(frozen=True)
class PlannedPress:
    """What is done at one place, from the first contact until the probe is clear again.

    Attributes
    ----------
    place : int
        Index of the place.
    steps : tuple of PlannedStep
    release : float
        Speed of the way out, as a share of the limit.
    rest : float, s
        Time without contact afterwards.
    """

    place: int
    steps: tuple[PlannedStep, ...]
    release: float
    rest: float


Programme = tuple[PlannedPress, ...]


@dataclass(frozen=True)
class Range:
    """What programmes may be made of.

    Attributes
    ----------
    places : int
        Number of places.
    slowest : float
        Least speed, as a share of the limit.
    duration : float, s
    """

    places: int
    slowest: float
    duration: float


def random_programme(span: Range, rng: np.random.Generator) -> Programme:
    """Return presses at random places, to random depths, at random speeds, with random holds, at least as long as wanted."""
    presses, total = [], 0.0
    while total < span.duration:
        press = _random_press(span, rng)
        presses.append(press)
        total += press.rest + sum(step.hold for step in press.steps) + 0.2
    return tuple(presses)


def _random_press(span: Range, rng: np.random.Generator) -> PlannedPress:
    steps = tuple(_random_step(span, rng) for _ in range(rng.integers(1, MOST_STEPS)))
    return PlannedPress(int(rng.integers(span.places)), steps, _speed(span, rng), _rest(span, rng))


def _random_step(span: Range, rng: np.random.Generator) -> PlannedStep:
    return PlannedStep(rng.uniform(LEAST_DEPTH, 1.0), _speed(span, rng), _hold(span, rng))


def _speed(span: Range, rng: np.random.Generator) -> float:
    return float(np.exp(rng.uniform(np.log(span.slowest), 0.0)))


def _hold(span: Range, rng: np.random.Generator) -> float:
    longest = LONGEST_HOLD * span.duration
    return 0.0 if rng.random() < 0.4 else float(longest * rng.random() ** 2)


def _rest(span: Range, rng: np.random.Generator) -> float:
    return float(0.1 + 0.2 * span.duration * rng.random() ** 3)


def usual_programmes(span: Range) -> list[Programme]:
    """Return programmes of usual shapes: a long hold, slow and fast presses, stairs, cycles, rests, many places."""
    quick, slow, long = 0.7, max(span.slowest, 0.05), 0.3 * span.duration
    many = range(span.places)
    ramp = max(span.slowest, 0.02)
    stairs = tuple(PlannedStep(share, quick, span.duration / 16.0) for share in (0.25, 0.5, 0.75, 1.0, 0.75, 0.5, 0.25))
    growing = tuple(
        PlannedPress(0, (PlannedStep(share, quick, 0.0),), quick, 0.3) for share in (0.4, 0.4, 0.7, 0.7, 1.0, 1.0, 0.4) * 3
    )
    partial = tuple(PlannedStep(share, slow, 0.0) for share in (1.0, 0.3, 0.9, 0.2, 0.7, 0.1, 1.0))
    return [
        (
            PlannedPress(0, (PlannedStep(1.0, quick, long),), quick, long),
            PlannedPress(0, (PlannedStep(0.4, quick, long),), quick, long),
        ),
        tuple(PlannedPress(i, (PlannedStep(1.0, quick, 0.3),), quick, 0.2) for i in many),
        tuple(
            PlannedPress(
                i, (PlannedStep(1.0, quick, 0.0), PlannedStep(0.3, quick, 0.2), PlannedStep(0.8, slow, 0.3)), slow, 0.3
            )
            for i in many
        ),
        (PlannedPress(0, stairs, quick, 1.0), PlannedPress(span.places // 2, stairs, quick, 1.0)),
        growing,
        tuple(PlannedPress(0, (PlannedStep(1.0, speed, 0.0),), speed, 0.3) for speed in (1.0, slow, 1.0, ramp, 0.3, 1.0, slow)),
        (
            PlannedPress(0, partial, slow, 0.5),
            PlannedPress(span.places // 3, partial, quick, 0.5),
            PlannedPress(0, partial, quick, 0.5),
        ),
        (
            PlannedPress(0, (PlannedStep(1.0, ramp, 0.0),), ramp, long),
            PlannedPress(span.places // 2, (PlannedStep(1.0, ramp, 0.0),), 1.0, long),
        ),
        tuple(PlannedPress(i % min(2, span.places), (PlannedStep(0.5, quick, 0.2),), quick, long) for i in range(4)),
    ]


def changed(programme: Programme, span: Range, rng: np.random.Generator) -> Programme:
    """Return a programme with one random change: another press, order, place, depth, speed, hold or rest."""
    presses = list(programme)
    at = int(rng.integers(min(len(presses), 40)))
    press = presses[at]
    what = rng.integers(8)
    if what == 0:
        presses[at] = _random_press(span, rng)
    elif what == 1:
        presses.insert(at, press)
    elif what == 2 and len(presses) > 1:
        del presses[at]
    elif what == 3:
        other = int(rng.integers(len(presses)))
        presses[at], presses[other] = presses[other], presses[at]
    elif what == 4:
        presses[at] = replace(press, place=int(rng.integers(span.places)))
    elif what == 5:
        presses[at] = replace(press, release=_speed(span, rng), rest=_rest(span, rng))
    else:
        presses[at] = replace(press, steps=_changed_steps(press.steps, span, rng))
    return tuple(presses)


def _changed_steps(steps: tuple[PlannedStep, ...], span: Range, rng: np.random.Generator) -> tuple[PlannedStep, ...]:
    """Steps with one more, one less, or one that differs."""
    made, at, what = list(steps), int(rng.integers(len(steps))), rng.integers(5)
    if what == 0 and len(made) < 2 * MOST_STEPS:
        made.insert(at, _random_step(span, rng))
    elif what == 1 and len(made) > 1:
        del made[at]
    elif what == 2:
        made[at] = replace(made[at], depth=rng.uniform(LEAST_DEPTH, 1.0))
    elif what == 3:
        made[at] = replace(made[at], speed=_speed(span, rng))
    else:
        made[at] = replace(made[at], hold=_hold(span, rng))
    return tuple(made)
