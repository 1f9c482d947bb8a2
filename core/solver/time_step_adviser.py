# SPDX-License-Identifier: GPL-3.0-or-later
"""Advice on the length of a substep, with its reason."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..laws.contact_stiffness import largest_stiffness_and_damping
from ..model.scenario import Scenario
from ..model.sensor import Sensor

SHARE_OF_LIMIT = 0.2
"""Share of the explicit stability limit that is used.

A contact that vibrates against all stiff texels at once takes 5π ≈ 16 such steps per period without damping, and more with it.
"""
LONGEST = 1e-3
"""Longest recommended step (s), so that fast motions are followed where nothing is stiff."""
SHORTEST = 1e-6
"""Shortest recommended step (s); the solver stays bounded at any step, shorter ones only cost time."""
SUM_ERROR, TEXEL_ERROR = 0.002, 0.02
"""Largest changes of a sensor's sum of normal forces and of a texel's force, as shares of their largest in the run, by steps 12
to 23 times the recommended one. Measured: grasp_bottle.blend with 0.5 ms for 0.041 ms: 0.15 % and 0.12 %; hand.blend with
0.5 ms for 0.021 ms: 0.14 % and 1.9 %. The recommended steps take three and six times as long."""
FAR_ABOVE_LIMIT = 10.0
"""Stability limits from which a step is warned of. Of the 1,000 random sets of tests/oracles/sweep.py, 327 take longer steps:
in 193 of them texels report depths that stand for more energy than was put into them, by four times that of the throw in the
median. Of the other 673 sets 52 do so."""


@dataclass(frozen=True)
class Advice:
    """A step size with its reason.

    Attributes
    ----------
    dt : float, seconds
    limit : float, seconds
        Above this an explicit penalty method would be unstable; infinite when no body is free.
    reason : str
        One sentence for the user.
    contact : str
        Whose contact with which sensors has that limit, in words; empty when no body is free.
    """

    dt: float
    limit: float
    reason: str
    contact: str = ""


def stability_limit(stiffness: float, damping: float, mass: float) -> float:
    """Longest stable step of symplectic Euler on ``m ẍ + c ẋ + k x = 0``, seconds.

    The recursion ``v += dt (-k x - c v) / m; x += dt v`` has its eigenvalues on the unit circle's inside while
    ``k dt² + 2 c dt < 4 m``.
    """
    return 4.0 * mass / (damping + math.sqrt(damping * damping + 4.0 * stiffness * mass))


def advise(scenario: Scenario) -> Advice:
    """Choose a substep for a scenario.

    The limit is that of each free or driven body against every texel that could touch it at once.
    """
    limit, culprit, contact = math.inf, "", ""
    for i, body in enumerate(scenario.bodies):
        if not body.moved_by_forces:
            continue
        stiffness = damping = 0.0
        touched = []
        for sensor in scenario.sensors:
            pressed_by = any(target.body == i for target in scenario.targets) and sensor.body != i
            if sensor.body == i or pressed_by:
                k, c = _tangent_or_normal(sensor)
                stiffness += k
                damping += c
                touched.append(f"'{sensor.name}'")
        if stiffness > 0:
            found = stability_limit(stiffness, damping, body.mass)
            if found < limit:
                limit, culprit, contact = found, body.name, f"'{body.name}' with {', '.join(touched)}"
    if math.isinf(limit):
        reason = f"{LONGEST * 1e3:g} ms: no free body touches a sensor, so only the animation must be resolved."
        return Advice(LONGEST, limit, reason)
    wanted = SHARE_OF_LIMIT * limit
    of_limit = f"the explicit stability limit of '{culprit}'"
    if SHORTEST <= wanted <= LONGEST:
        reason = f"{wanted * 1e3:.3g} ms: {SHARE_OF_LIMIT:.0%} of {of_limit} ({limit * 1e3:.3g} ms)."
        return Advice(wanted, limit, reason, contact)
    dt, which = (SHORTEST, "shortest") if wanted < SHORTEST else (LONGEST, "longest")
    return Advice(dt, limit, f"{dt * 1e3:.3g} ms: the {which} recommended step; {of_limit} is {limit * 1e3:.3g} ms.", contact)


@dataclass(frozen=True)
class Plan:
    """The step that a run takes: a whole number of them makes a frame.

    Attributes
    ----------
    dt : float, seconds
    substeps : int
        In each frame.
    reason : str
        One or two sentences for the user: what was chosen or set, and what was advised and why.
    warning : str
        One sentence if the step is so long that forces may be wrong; else empty.
    """

    dt: float
    substeps: int
    reason: str
    warning: str = ""


def benefit(dt: float, advice: Advice) -> str:
    """Return the gain of the recommended step over a longer one that was set, as a sentence; empty where it is not longer."""
    if dt <= 1.001 * advice.dt:
        return ""
    return (
        f"The step that is set, {dt * 1e3:.3g} ms, is {dt / advice.dt:.3g} times the recommended one: stable and faster. In "
        f"two grasps with 12 and 23 times, sums of forces changed by {SUM_ERROR:.1%}, texels by {TEXEL_ERROR:.0%} at most."
    )


def plan(scenario: Scenario) -> Plan:
    """Return the step of a run: the advised one, or the longest that the scenario allows where that is set."""
    advice = advise(scenario)
    longest = advice.dt if scenario.dt is None else scenario.dt
    substeps = max(1, math.ceil(1.0 / (scenario.fps * longest) - 1e-9))
    dt = 1.0 / (scenario.fps * substeps)
    number = f"{substeps} per frame"
    if scenario.dt is None:
        return Plan(dt, substeps, f"Time step {dt * 1e3:.3g} ms ({number}). Recommended: {advice.reason}")
    warning = ""
    if dt > FAR_ABOVE_LIMIT * advice.limit:
        warning = (
            f"Frame {scenario.frame_start}: steps of {dt * 1e3:.3g} ms are {dt / advice.limit:,.0f} times the explicit "
            f"stability limit of the contact of {advice.contact}, whose forces may be far too large for some steps: "
            f"set a time step of {advice.dt * 1e3:.3g} ms or less."
        )
    beyond = " Longer steps are stable but less accurate." if dt > 1.001 * advice.dt else ""
    return Plan(dt, substeps, f"Time step {dt * 1e3:.3g} ms ({number}, as set). Recommended: {advice.reason}{beyond}", warning)


def _tangent_or_normal(sensor: Sensor) -> tuple[float, float]:
    """Stiffness and damping of all texels together, in the direction in which they are stiffer."""
    p, factor = sensor.parameters, np.ones(len(sensor.texels)) if sensor.painted.k is None else sensor.painted.k
    k, cn = largest_stiffness_and_damping(p)
    stiffness, damping = np.maximum(factor * k, p.sigma0), np.maximum(factor * cn, p.sigma1 + p.ct)
    return float(stiffness.sum()), float(damping.sum())
