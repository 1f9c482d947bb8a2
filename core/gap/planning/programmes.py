# SPDX-License-Identifier: GPL-3.0-or-later
"""The programmes of motions among which an experiment is chosen. Depths and speeds are shares of limits."""

from __future__ import annotations

from typing import NamedTuple

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


def programmes(seconds: float, places: int, track: tuple[int, ...]) -> dict[str, Programme]:
    """Return the programmes by name.

    Parameters
    ----------
    seconds : float
        Length of the recording. Shorter programmes are repeated.
    places : int
        Number of places at which the probe may press.
    track : tuple of int
        Places along which it may slide, from end to end; empty if it cannot.
    """
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
        quick, slow = (tuple(Move(0.6, speed, 0.0, place) for place in track[1:]) for speed in (1.0, 2.0 * SLOW))
        light, heavy = (tuple(Move(depth, QUICK, 0.0, place) for place in track[1:]) for depth in (0.3, 1.0))
        clear = Move(None, QUICK, 0.3, track[-1])
        found["slides at two speeds"] = tuple((Move(0.6, QUICK, 0.5, track[0]), *way, clear) for way in (quick, slow))
        found["slides under two loads"] = tuple(
            (Move(depth, QUICK, 0.5, track[0]), *way, clear) for depth, way in ((0.3, light), (1.0, heavy))
        )
    return found
