# SPDX-License-Identifier: GPL-3.0-or-later
"""From a programme to a trajectory: poses of the probe over time, or depths or forces where a rig knows these.

The probe keeps the orientation of the recordings, travels clear of the sensor and presses along the sensor's mean normal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...errors import ParameterError
from ..dataset.rig import Rig
from ..dataset.trial import Trial
from ..forward.predictor import Predictor
from ..forward.stimulus import stimulus_of

FASTEST = 0.99
"""Quantile of the speeds of a recording that counts as its fastest: single samples of a noisy pose are faster."""
LONGEST_PRESS, LONGEST_TRAVEL = 1.0, 5.0
"""A probe that moved slowly or never is planned to need this long to the full depth, and along the whole sensor, s."""
PLACE_MARGIN = 1e-9
"""Metres by which a place may lie outside the area."""


@dataclass(frozen=True)
class Limits:
    """Limits of a planned trajectory.

    Attributes
    ----------
    depth : float
        How far the probe moves beyond the first contact, m; the load where rigs know forces, N.
    speed : float
        m/s, sideways as well as up and down; N/s where rigs know forces.
    duration : float, s
    area : (float, float, float, float) or None, m
        Least and largest x, least and largest y of the places, in the sensor's frame; None is the whole sensor.
    """

    depth: float
    speed: float
    duration: float
    area: tuple[float, float, float, float] | None = None

    def __post_init__(self) -> None:
        for name in ("depth", "speed", "duration"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ParameterError(f"The limit of the {name} is {value:g}: give a positive number.")
        if self.area is not None and not (self.area[0] <= self.area[1] and self.area[2] <= self.area[3]):
            raise ParameterError("The area of the places is empty: give its least and largest x, then its least and largest y.")

    def holds(self, places: np.ndarray) -> np.ndarray:
        """Return which of some places (m, 3), in metres, lie inside the area, (m,) bool."""
        low, high = np.reshape(self.area or (-np.inf, np.inf, -np.inf, np.inf), (2, 2)).T
        return ((places[:, :2] >= low - PLACE_MARGIN) & (places[:, :2] <= high + PLACE_MARGIN)).all(axis=1)


@dataclass(frozen=True)
class Wishes:
    """The user's requirements of an experiment; None and empty are decided from the recordings.

    Attributes
    ----------
    between : tuple of str
        Kinds that it is to separate.
    depth, speed, duration : float or None
        See :class:`Limits`, as for the area.
    area : (float, float, float, float) or None
    """

    between: tuple[str, ...] = ()
    depth: float | None = None
    speed: float | None = None
    duration: float | None = None
    area: tuple[float, float, float, float] | None = None

    def limits(self, predictors: Sequence[Predictor]) -> Limits:
        """Return the limits that some recordings kept, or those that are given.

        Raises
        ------
        ParameterError
            A given limit is not positive, or the recordings never touched the sensor and no depth is given.
        """
        depth, speed, duration = self.depth, self.speed, self.duration
        first = predictors[0]
        alike = [p for p in predictors if p.trial.stimulus == first.trial.stimulus]
        if depth is None:
            depth = max(float(p.stimulus.load.max(initial=0.0)) for p in alike)
            if depth <= 0.0:
                raise ParameterError("The recordings never touched the sensor: give the limit of the depth.")
            if first.trial.stimulus == "force":
                depth = max(float(np.max(p.trial.level)) for p in predictors if p.trial.level is not None)
        if speed is None:
            extent = float(np.ptp(first.rig.texels.position, axis=0).max()) if first.trial.stimulus == "pose" else 0.0
            speed = max(*map(_speed, alike), depth / LONGEST_PRESS, extent / LONGEST_TRAVEL)
        if duration is None:
            duration = max(float(np.ptp(p.trial.time)) for p in predictors)
        return Limits(depth, speed, duration, self.area)


def _speed(predictor: Predictor) -> float:
    """Fastest motion of a recording, m/s or N/s."""
    trial = predictor.trial
    path = trial.position if trial.stimulus == "pose" else trial.level
    assert path is not None
    moved = np.diff(path.reshape(len(path), -1), axis=0)
    speeds = np.linalg.norm(moved, axis=1) / np.diff(trial.time)
    moving = speeds[speeds > 1e-3 * speeds.max(initial=0.0)]
    return float(np.quantile(moving, FASTEST)) if len(moving) else 0.0


QUICK, SLOW = 0.7, 0.05
"""Speeds of programmes."""


class Move(NamedTuple):
    """A straight motion, and a rest at its end.

    Attributes
    ----------
    depth : float or None
        Share of the limit; None is clear of the sensor.
    speed : float
        Share of the limit.
    hold : float, s
    place : int
        Index of the place; the probe moves there at the depth that it has.
    """

    depth: float | None
    speed: float = QUICK
    hold: float = 0.0
    place: int = 0


Press = tuple[Move, ...]
"""Moves from a probe that is clear of the sensor until it is clear again."""
Programme = tuple[Press, ...]


def _press(depth: float, speed: float = QUICK, hold: float = 0.0, rest: float = 0.3, place: int = 0) -> Press:
    return Move(depth, speed, hold, place), Move(None, speed, rest, place)


def _through(depths: tuple[float, ...], speed: float, hold: float, place: int = 0) -> Press:
    """A press that goes through some depths before it ends."""
    return (*(Move(depth, speed, hold, place) for depth in depths), Move(None, QUICK, 0.5, place))


def _slide(depth: float, speed: float, track: tuple[int, ...]) -> Press:
    way = (Move(depth, speed, 0.0, place) for place in track[1:])
    return Move(depth, QUICK, 0.5, track[0]), *way, Move(None, QUICK, 0.3, track[-1])


Knot = tuple[float, int, float]
"""Time (s), place and depth."""

MOST_PLACES = 6
"""Number of places at which a programme may press, at most."""
MOST_REPEATS = 1000
"""Repetitions of a programme, at most."""
TRACK_PITCHES, TRACK_PLACES = 3.0, 13
"""Length of a slide in pitches of the texels, and the number of its places at which the height is computed."""
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
    trial : Trial
        A recording along it, without responses.
    """

    knots: np.ndarray
    position: np.ndarray | None
    trial: Trial


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
        On the sensor, those of the track last; one row without meaning where depths or forces are known.
    track : tuple of int
        Places along which the probe can slide; empty where depths or forces are known.
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
        up = self.rig.texels.normal.sum(axis=0)
        self.up = up / max(float(np.linalg.norm(up)), 1e-12)
        self.quaternion: np.ndarray | None = None
        self.places, self.touch = np.zeros((1, 3)), np.zeros(1)
        self.track: tuple[int, ...] = ()
        self._clear = np.zeros(1)  # depth of the probe while it travels, negative above the sensor
        if self.like.position is not None and self.like.quaternion is not None:
            deepest = int(np.argmax(touching[0].stimulus.load.max(axis=1)))
            self.quaternion = self.like.quaternion[deepest]
            self.places = _places(self.rig, limits)
            self.touch, self._clear = np.full(len(self.places), self.like.position[deepest, 2]), np.zeros(len(self.places))
            if self.like.stimulus == "pose":
                pitch, share = float(np.sqrt(np.median(self.rig.texels.area))), np.linspace(-0.5, 0.5, TRACK_PLACES)[:, None]
                way = self.places[0] + share * TRACK_PITCHES * pitch * self.rig.texels.tangent[0]
                way = way[limits.holds(way)]
                self.track = tuple(range(len(self.places), len(self.places) + len(way)))
                self.places = np.concatenate([self.places, way])
                self.touch = self._touching_heights()
                heights = self.places @ self.up + self.touch
                self._clear = heights - float(heights.max()) - CLEARANCE * limits.depth
        needed = FIRST_REST + limits.depth / limits.speed * 2.0 + FIRST_REST
        if needed > limits.duration:
            raise ParameterError(
                f"One press to the full depth takes {needed:.3g} s, more than the {limits.duration:g} s that are "
                "allowed: raise the limit of the duration or of the speed."
            )

    def programmes(self) -> dict[str, Programme]:
        """Return the programmes that this probe can carry out, by name; short ones are repeated."""
        seconds, places, track = self.limits.duration, len(self.places) - len(self.track), self.track
        long, step, last = 0.3 * seconds, seconds / 16.0, places - 1
        stairs = (0.25, 0.5, 0.75, 1.0, 0.75, 0.5, 0.25)
        found: dict[str, Programme] = {
            "press and hold": (_press(1.0, hold=long, rest=0.6 * long), _press(0.4, hold=0.5 * long)),
            "slow press and quick release": ((Move(1.0, SLOW), Move(None, 1.0, long)),),
            "cycles at two speeds": (_press(1.0, 1.0), _press(1.0, SLOW), _press(1.0, 1.0), _press(1.0, 0.2)),
            "growing cycles": tuple(_press(depth) for depth in (0.4, 0.4, 0.7, 0.7, 1.0, 1.0, 0.4)),
            "partial unloading": (_through((1.0, 0.3, 0.9, 0.2, 0.7, 0.1, 1.0), 2.0 * SLOW, 0.0),),
            "stairs": (_through(stairs, QUICK, step),),
            "equal presses with rests": (_press(0.5, hold=0.5, rest=0.15 * seconds),),
            "two loads held": (_press(1.0, hold=long), _press(0.3, hold=long)),
        }
        if places > 1:
            found["two places"] = (_press(1.0, hold=1.0, place=0), _press(1.0, hold=1.0, place=last))
            found["stairs at two places"] = (_through(stairs, QUICK, 0.5 * step), _through(stairs, QUICK, 0.5 * step, last))
            found["every place"] = tuple(_press(1.0, hold=0.2, rest=0.2, place=place) for place in range(places))
        if track:
            found["slides at two speeds"] = (_slide(0.6, 1.0, track), _slide(0.6, 2.0 * SLOW, track))
            found["slides under two loads"] = (_slide(0.3, QUICK, track), _slide(1.0, QUICK, track))
        return found

    def trajectory(self, programme: Programme) -> Trajectory:
        """Return the trajectory of as many presses of a programme as there is time for."""
        start = programme[0][0].place
        knots = [(0.0, start, self._clear[start]), (FIRST_REST, start, self._clear[start])]
        fallback = Move(1.0, 1.0, 0.0, start), Move(None, 1.0, 0.0, start)
        for press in (*programme * MOST_REPEATS, fallback):
            longer = [*knots]
            if press[0].place != knots[-1][1]:
                self._move(longer, Move(None, 1.0, 0.0, press[0].place))
            for move in press:
                self._move(longer, move)
            if longer[-1][0] + FIRST_REST <= self.limits.duration:
                knots = longer
            elif len(knots) > 2:
                break
        knots.append((self.limits.duration, *knots[-1][1:]))
        time, place, depth = (np.array(column) for column in zip(*knots, strict=True))
        planned = self._through(time, place, depth)
        if self.track and (excess := float(stimulus_of(planned.trial, self.rig).load.max()) - self.limits.depth) > 0.0:
            # The surface between the places of a slide stands out.
            planned = self._through(time, place, np.where(depth > 0.0, depth - 1.01 * excess, depth))
        return planned

    def _move(self, knots: list[Knot], move: Move) -> None:
        """Add the knots of a move."""
        time, place, depth = knots[-1]
        wanted = float(self._clear[move.place]) if move.depth is None else move.depth * self.limits.depth
        way = abs(wanted - depth)
        if move.place != place:
            way = float(np.linalg.norm(self._position(move.place, wanted) - self._position(place, depth)))
        time += max(way / (move.speed * self.limits.speed), SHORTEST_SEGMENT)
        knots.append((time, move.place, wanted))
        if move.hold > SHORTEST_SEGMENT:
            knots.append((time + move.hold, move.place, wanted))

    def _position(self, place: int | np.ndarray, depth: float | np.ndarray) -> np.ndarray:
        """Where the probe is at a depth at a place, (3,) m, or at some depths at some places, (k, 3) m."""
        return self.places[place] + np.multiply.outer(self.touch[place] - depth, self.up)

    def _through(self, time: np.ndarray, place: np.ndarray, depth: np.ndarray) -> Trajectory:
        """The trajectory through knots at times, places and depths."""
        step, position, way = self.like.step, None, None
        samples = np.arange(round(float(time[-1]) / step) + 1) * step
        if self.quaternion is not None:
            position = self._position(place, depth if self.track else 0.0)
            way = np.stack([np.interp(samples, time, axis) for axis in position.T], axis=1)
        level = None if self.track else np.interp(samples, time, depth)
        return Trajectory(time, position, self._recording(samples, way, level))

    def _recording(self, time: np.ndarray, position: np.ndarray | None, level: np.ndarray | None = None) -> Trial:
        """A recording along positions of the probe, or depths or forces, at times, without responses."""
        turns = None if self.quaternion is None else np.tile(self.quaternion, (len(time), 1))
        planned = replace(self.like, name="planned", use="fit", time=time, position=position, quaternion=turns, level=level)
        planned = replace(planned, reading=None, force=None, session="", repeats="", temperature=None)
        return replace(planned, travel=np.zeros((len(time), 2)))

    def _touching_heights(self) -> np.ndarray:
        """Height over each place at which the probe touches: from above in steps, then by halving."""
        rig, reach = self.rig, self.rig.parameters.max_penetration
        indenter = rig.indenter_of(self.like)
        assert indenter is not None
        size = float(np.linalg.norm(indenter.mesh.vertices, axis=1).max())
        along = rig.texels.position @ self.up
        low = float(along.max()) + size - self.places @ self.up + reach
        for _ in range(int(np.ceil((float(np.ptp(along)) + 2.0 * size) / reach)) + 3):
            touches = self._touches(low)
            if touches.all():
                break
            low = np.where(touches, low, low - reach)
        high = low + reach
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            touches = self._touches(middle)
            low, high = np.where(touches, middle, low), np.where(touches, high, middle)
        return high

    def _touches(self, heights: np.ndarray) -> np.ndarray:
        """True if the probe touches at heights over its places, (m,) bool."""
        position = self.places + heights[:, None] * self.up
        trial = self._recording(np.arange(float(len(position))), position)
        return (stimulus_of(trial, self.rig).load > 0.0).any(axis=1)


def _places(rig: Rig, limits: Limits) -> np.ndarray:
    """Texels that are spread over the area, the most central one first, (m, 3) m."""
    inside = rig.texels.position[limits.holds(rig.texels.position)]
    if not len(inside):
        raise ParameterError("No texel lies inside the area that is allowed: give it in metres, in the sensor's frame.")
    picked = [int(np.argmin(np.linalg.norm(inside - inside.mean(axis=0), axis=1)))]
    while len(picked) < min(MOST_PLACES, len(inside)):  # each the farthest one from all before
        apart = np.linalg.norm(inside[:, None] - inside[picked], axis=2).min(axis=1)
        picked.append(int(np.argmax(apart)))
    return inside[picked]
