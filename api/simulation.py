# SPDX-License-Identifier: GPL-3.0-or-later
"""Simulate sensors and the bodies in contact with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from numpy.typing import ArrayLike

from ..core.model import body as model
from ..core.model.scenario import Scenario, Target
from . import arguments
from .arguments import ArgumentError
from .bodies import Body
from .paths import Path, PathLike, path_of
from .recordings import Recording
from .running import ShowProgress, finished, prepare_solver
from .sensors import Sensor

STANDARD_GRAVITY = (0.0, 0.0, -9.81)
"""m/s²: that of the window."""
MOST_FRAMES = 10_000_000
"""A longer run was almost certainly given a duration in milliseconds, or a wrong frame rate."""


def simulate(
    sensors: Sensor | Sequence[Sensor] | Scenario,
    bodies: Body | Sequence[Body] = (),
    duration: float | None = None,
    fps: float = 60.0,
    motion: PathLike | Mapping[str, PathLike] | None = None,
    dt: float | None = None,
    gravity: ArrayLike = STANDARD_GRAVITY,
    progress: ShowProgress = False,
) -> Recording:
    """Simulate sensors and bodies, and return the recording of the sensors.

    Parameters
    ----------
    sensors : Sensor, list of Sensor, or Scenario
        A sensor stays where it is, unless it is on a body. A scenario, as of :func:`scenario_of`, is simulated as it is: it has
        bodies, duration and all else already.
    bodies : Body or list of Body
        The objects in contact. A body that carries a sensor need not be listed.
    duration : float, seconds, optional
        Rounded to whole frames. Default: that of the longest motion.
    fps : float, frames per second
        How often the sensors are read; the solver takes shorter steps.
    motion : optional
        Moves the only body, or by name each of several bodies and fixed sensors, instead of forces: poses (m, 3) or (m, 7)
        (x, y, z, qw, qx, qy, qz; m), one for each frame, a pair of times and poses, or a CSV file.
    dt : float, seconds, optional
        Longest step of the solver. Default: what the solver advises.
    gravity : (3,) float, m/s²
    progress : bool or callable
        True for a progress bar. The first use compiles the solver, which takes about a minute.

    Returns
    -------
    Recording
        With duration · fps + 1 frames, the first one at time 0.

    Raises
    ------
    PalpateError
        An argument has a wrong type, shape or value, or nothing can touch a sensor.
    """
    from ..core.solver.simulation import solve

    if isinstance(sensors, Scenario):
        _require_nothing_else(bodies, duration, motion, dt)
        scenario, warnings = sensors, list[str]()
    else:
        items = arguments.as_list(sensors, Sensor, "sensors", "a Sensor")
        pressing = arguments.as_list(bodies, Body, "bodies", "a Body")
        pressing += [body for body in dict.fromkeys(item.body for item in items if item.body) if body not in pressing]
        paths, rate = _paths(items, pressing, motion), arguments.number(fps, "fps", above_zero=True)
        scenario, warnings = _scenario(items, pressing, paths, rate, duration)
        step = None if dt is None else arguments.number(dt, "dt", above_zero=True)
        scenario = replace(scenario, gravity=arguments.numbers(gravity, (3,), "gravity"), dt=step)
    prepare_solver()
    recording = finished(solve(scenario), progress, "simulate", "frame")
    recording.warnings = (*warnings, *recording.warnings)
    return Recording.of(recording, {one.name: (one.texels, one.painted, one.parameters) for one in scenario.read_out})


def _require_nothing_else(bodies: Any, duration: Any, motion: Any, dt: Any) -> None:
    """Raise for arguments that a scenario has already."""
    given = {"bodies": bodies or None, "duration": duration, "motion": motion, "dt": dt}
    for name, value in given.items():
        if value is not None:
            raise ArgumentError(f"{name} is part of the scenario: leave it out.")


def _paths(
    sensors: Sequence[Sensor], bodies: Sequence[Body], motion: PathLike | Mapping[str, PathLike] | None
) -> dict[str, Path]:
    """Return the paths that `motion` gives, by the names of bodies and fixed sensors."""
    if motion is None:
        return {}
    if not isinstance(motion, Mapping):
        if len(bodies) != 1:
            raise ArgumentError(f"motion is one path for {len(bodies)} bodies: give a mapping of names to paths.")
        motion = {bodies[0].name: motion}
    turns = [(body.name, body.quaternion) for body in bodies]
    turns += [(sensor.name, sensor.quaternion) for sensor in sensors if sensor.body is None]
    names = [name for name, _ in turns]
    arguments.known(motion, names, "body or fixed sensor called")
    for name in motion:
        if names.count(name) > 1:
            raise ArgumentError(
                f"motion is for '{name}', and there are {names.count(name)} of this name: name them differently."
            )
    return {name: path_of(motion[name], f"motion of '{name}'", turn) for name, turn in turns if name in motion}


def _scenario(
    sensors: Sequence[Sensor], bodies: Sequence[Body], paths: Mapping[str, Path], fps: float, duration: float | None
) -> tuple[Scenario, list[str]]:
    """Return the scenario of sensors and of all bodies that press on them or carry them, and warnings about meshes."""
    for items, argument in ((sensors, "sensors"), (bodies, "bodies")):
        if not items:
            raise ArgumentError(f"{argument} is empty: give one at least.")
    names = [sensor.name for sensor in sensors]
    for name in names:
        if names.count(name) > 1:
            raise ArgumentError(f"sensors has two that are called '{name}': give each a name of its own, as name=\"left\".")
    found, warnings = _model_bodies(bodies, paths, fps)
    targets = tuple(Target(one.name, i, own.mesh, smooth=own.smooth) for i, (one, own) in enumerate(zip(found, bodies)))
    placed = []
    for sensor in sensors:
        placed.append(sensor.of_model(len(found) if sensor.body is None else bodies.index(sensor.body)))
        if sensor.body is None:
            path = paths.get(sensor.name) or Path(None, sensor.position[None], sensor.quaternion[None])
            found.append(model.Body(sensor.name, path.motion(fps)))
    last = max(float(body.motion.times[-1]) for body in found)
    if duration is None and last == 0.0:
        raise ArgumentError("duration is missing, and nothing moves along a path that would say it: give seconds.")
    frames = round(fps * (last if duration is None else arguments.number(duration, "duration", above_zero=True)))
    if not 1 <= frames <= MOST_FRAMES:
        raise ArgumentError(f"duration makes {frames} frames at {fps:g} fps: give seconds for 1 to {MOST_FRAMES:,} frames.")
    return Scenario(tuple(found), tuple(placed), targets, 0, frames, fps, name="simulate"), warnings


def _model_bodies(bodies: Sequence[Body], paths: Mapping[str, Path], fps: float) -> tuple[list[model.Body], list[str]]:
    """Return bodies as core has them, equal names with a number behind them, and warnings about their meshes."""
    found: list[model.Body] = []
    warnings: list[str] = []
    for i, body in enumerate(bodies):
        moved = body.moved(paths[body.name]) if body.name in paths else body
        made, notes = moved.of_model(fps)
        same = sum(one.name == body.name for one in bodies[:i])
        found.append(replace(made, name=f"{body.name} {same + 1}") if same else made)
        warnings += notes
    return found, warnings
