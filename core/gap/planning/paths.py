# SPDX-License-Identifier: GPL-3.0-or-later
"""From a programme of presses to a trajectory: poses of the probe over time, or depths or forces where a rig knows these.

The probe keeps the orientation of the recordings, travels clear of the sensor and presses along the sensor's mean normal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...errors import ParameterError
from ..dataset.rig import Rig
from ..dataset.trial import Trial
from ..forward.predictor import Predictor
from ..forward.stimulus import stimulus_of
from .limits import Limits
from .programmes import SLOWEST, PlannedPress, PlannedStep, Programme, Range

Knot = tuple[float, int, float]
"""Time (s), place and depth."""

MOST_PLACES = 24
"""Number of places at which a trajectory may press, at most, half of them between texels."""
OWN_SEED = 20
"""Seed of the places between texels."""
CLEARANCE = 0.3
"""How far the probe is from the sensor while it travels, as a share of the depth's limit."""
FIRST_REST = 0.6
"""Seconds without contact at the beginning, from which the noise is measured, and at the end."""
BISECTIONS = 30
"""Halvings of the height of the first contact: a billionth of the depth of the search."""
SHORTEST_SEGMENT = 0.02
"""Least time between two knots, s."""


@dataclass(frozen=True)
class Trajectory:
    """A planned trajectory, straight between its knots.

    Attributes
    ----------
    knots : (k,) float, s
        Increasing.
    position : (k, 3) float, m, or None
        Of the probe in the sensor's frame at the knots.
    quaternion : (4,) float or None
        Its orientation, (w, x, y, z).
    level : (k,) float or None
        Depth (m) or force (N) at the knots, where the rig knows these.
    step : float, s
        Between the samples.
    level_name : str
        What the levels are: depth or force.
    """

    knots: np.ndarray
    position: np.ndarray | None
    quaternion: np.ndarray | None
    level: np.ndarray | None
    step: float
    level_name: str = "depth"

    @property
    def time(self) -> np.ndarray:
        """Times of the samples, (T,) s."""
        return np.arange(round(float(self.knots[-1]) / self.step) + 1) * self.step

    def positions(self) -> np.ndarray | None:
        """Return the positions at the samples, (T, 3) m; None if the rig knows none."""
        if self.position is None:
            return None
        return np.stack([np.interp(self.time, self.knots, axis) for axis in self.position.T], axis=1)

    def levels(self) -> np.ndarray | None:
        """Return the depths (m) or forces (N) at the samples, (T,); None if the rig knows poses."""
        return None if self.level is None else np.interp(self.time, self.knots, self.level)

    def as_trial(self, like: Trial) -> Trial:
        """Return a recording with this stimulus and without responses, otherwise like another one."""
        time, positions = self.time, self.positions()
        turns = None if self.quaternion is None else np.tile(self.quaternion, (len(time), 1))
        return replace(
            like,
            name="planned",
            use="fit",
            time=time,
            position=positions,
            quaternion=turns,
            level=self.levels(),
            slide=np.zeros((len(time), 2)),
            reading=None,
            force=None,
            session="",
            repeats="",
        )


class Ground:
    """Where a probe can press, and at which height it touches.

    Parameters
    ----------
    predictors : sequence of Predictor
        Of the recordings. The first of the fitted ones that touches says how the probe is turned.
    limits : Limits

    Attributes
    ----------
    like : Trial
        The recording that planned ones are like.
    places : (m, 3) float, m
        On the sensor; one row without meaning where depths or forces are known.
    touch : (m,) float, m
        Height of the probe's origin over each place, along `up`, at which it touches.
    up : (3,) float
        The sensor's mean normal.

    Raises
    ------
    ParameterError
        No texel lies inside the area of the limits, or the probe does not fit through the limits in time.
    """

    def __init__(self, predictors: Sequence[Predictor], limits: Limits):
        touching = [p for p in predictors if (p.stimulus.load > 0.0).any()] or list(predictors)
        self.like, self.rig, self.limits = touching[0].trial, touching[0].rig, limits
        self.up = self.rig.texels.normal.sum(axis=0)
        self.up = self.up / max(float(np.linalg.norm(self.up)), 1e-12)
        self.quaternion: np.ndarray | None = None
        if self.like.position is None or self.like.quaternion is None:
            self.places, self.touch = np.zeros((1, 3)), np.zeros(1)
        else:
            deepest = int(np.argmax(touching[0].stimulus.load.max(axis=1)))
            self.quaternion = self.like.quaternion[deepest]
            self.places = _places(self.rig, limits)
            self.touch = (
                self._touching_heights() if self.is_posed else np.full(len(self.places), self.like.position[deepest, 2])
            )
        self._clear = np.zeros(len(self.places))  # depth of the probe while it travels, negative above the sensor
        if self.is_posed:
            heights = self.places @ self.up + self.touch
            self._clear = heights - float(heights.max()) - CLEARANCE * limits.depth
        self._fallback = PlannedPress(0, (PlannedStep(1.0, 1.0, 0.0),), 1.0, 0.0)
        needed = self._with_press([(0.0, 0, self._clear[0]), (FIRST_REST, 0, self._clear[0])], self._fallback)[-1][0]
        if needed + FIRST_REST > limits.duration:
            raise ParameterError(
                f"One press to the full depth takes {needed + FIRST_REST:.3g} s, more than the {limits.duration:g} s that are "
                "allowed: raise the limit of the duration or of the speed."
            )

    @property
    def is_posed(self) -> bool:
        """True if the rig knows poses, rather than depths or forces."""
        return self.like.stimulus == "pose"

    @property
    def span(self) -> Range:
        """What programmes may be made of."""
        slowest = self.limits.depth / (SLOWEST * self.limits.duration * self.limits.speed)
        return Range(len(self.places), float(np.clip(slowest, 1e-3, 0.5)), self.limits.duration)

    def trajectory(self, programme: Programme) -> Trajectory:
        """Return the trajectory of as many presses of a programme as there is time for."""
        begin = [(0.0, programme[0].place, float(self._clear[programme[0].place]))]
        begin.append((FIRST_REST, *begin[0][1:]))
        knots = begin
        for press in (*programme, self._fallback):
            longer = self._with_press(knots, press)
            if longer[-1][0] + FIRST_REST <= self.limits.duration:
                knots = longer
            elif knots is not begin:
                break
        knots = [*knots, (self.limits.duration, *knots[-1][1:])]
        time, place, depth = (np.array(column) for column in zip(*knots, strict=True))
        return self._through(time, place, depth)

    def _with_press(self, knots: list[Knot], press: PlannedPress) -> list[Knot]:
        """Knots with those of one press more: travel, steps, release, rest."""
        time, before, depth = knots[-1]
        made, clear = list(knots), float(self._clear[press.place])

        def go(depth_wanted: float, way: float, speed: float) -> None:
            nonlocal time, depth
            time += max(way / (speed * self.limits.speed), SHORTEST_SEGMENT)
            depth = depth_wanted
            made.append((time, press.place, depth))

        def wait(seconds: float) -> None:
            nonlocal time
            if seconds > SHORTEST_SEGMENT:
                time += seconds
                made.append((time, press.place, depth))

        if press.place != before:
            way = self._clear_position(press.place) - self._clear_position(before)
            go(clear, float(np.linalg.norm(way)), 1.0)
        for step in press.steps:
            wanted = step.depth * self.limits.depth
            go(wanted, abs(wanted - depth), step.speed)
            wait(step.hold)
        go(clear, depth - clear, press.release)
        wait(press.rest)
        return made

    def _clear_position(self, place: int) -> np.ndarray:
        """Where the probe is clear of the sensor over a place, (3,) m."""
        found: np.ndarray = self.places[place] + (self.touch[place] - self._clear[place]) * self.up
        return found

    def _through(self, time: np.ndarray, place: np.ndarray, depth: np.ndarray) -> Trajectory:
        """The trajectory through knots at times, places and depths."""
        step = self.like.step
        if self.is_posed:
            position = self.places[place] + (self.touch[place] - depth)[:, None] * self.up
            return Trajectory(time, position, self.quaternion, None, step)
        if self.quaternion is None:
            return Trajectory(time, None, None, depth, step, self.like.stimulus)
        position = self.places[place] + self.touch[place][:, None] * self.up
        return Trajectory(time, position, self.quaternion, depth, step, self.like.stimulus)

    def _touching_heights(self) -> np.ndarray:
        """Height over each place at which the probe touches: from above in steps, then by halving."""
        rig, count = self.rig, len(self.places)
        reach = rig.parameters.max_penetration
        indenter = rig.indenter_of(self.like)
        assert indenter is not None
        size = float(np.linalg.norm(indenter.mesh.vertices, axis=1).max())
        along = rig.texels.position @ self.up
        high = float(along.max()) + size - self.places @ self.up + reach
        low = high.copy()
        waiting = np.ones(count, bool)
        for _ in range(int(np.ceil((float(np.ptp(along)) + 2.0 * size) / reach)) + 3):
            low = np.where(waiting, low - reach, low)
            waiting &= ~self._touches(low)
            if not waiting.any():
                break
        high = low + reach
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            touches = self._touches(middle)
            low, high = np.where(touches, middle, low), np.where(touches, high, middle)
        return high

    def _touches(self, heights: np.ndarray) -> np.ndarray:
        """True if the probe touches at heights over its places, (m,) bool."""
        count = len(self.places)
        position = self.places + heights[:, None] * self.up
        nothing = np.zeros((count, 2))
        assert self.quaternion is not None
        trial = replace(
            self.like, time=np.arange(float(count)), position=position, quaternion=np.tile(self.quaternion, (count, 1)),
            slide=nothing, reading=None, force=None,
        )  # fmt: skip
        touched: np.ndarray = (stimulus_of(trial, self.rig).load > 0.0).any(axis=1)
        return touched


def _places(rig: Rig, limits: Limits) -> np.ndarray:
    """Texels that are spread over the area, and places between them, (m, 3) m."""
    texels = rig.texels
    inside = np.flatnonzero(limits.holds(texels.position))
    if not len(inside):
        raise ParameterError("No texel lies inside the area that is allowed: give it in metres, in the sensor's frame.")
    centre = texels.position[inside].mean(axis=0)
    picked = [int(inside[np.argmin(np.linalg.norm(texels.position[inside] - centre, axis=1))])]
    while len(picked) < min(MOST_PLACES // 2, len(inside)):  # each the farthest one from all before
        apart = np.linalg.norm(texels.position[inside][:, None] - texels.position[picked][None], axis=2).min(axis=1)
        picked.append(int(inside[np.argmax(apart)]))
    on = texels.position[picked]
    pitch = float(np.sqrt(np.median(texels.area))) if len(texels) > 1 else 0.0
    shift = np.random.default_rng(OWN_SEED).uniform(-0.5, 0.5, (len(picked), 2)) * pitch
    side = np.cross(texels.normal[picked], texels.tangent[picked])
    between = on + shift[:, :1] * texels.tangent[picked] + shift[:, 1:] * side
    return np.concatenate([on, between[limits.holds(between)]])
