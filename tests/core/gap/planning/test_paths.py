# SPDX-License-Identifier: GPL-3.0-or-later
"""Planned trajectories stay within their limits, whatever the programme, the probe and the surface."""

from __future__ import annotations

from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest
from solver_scenes import box

from palpate.core.errors import ParameterError
from palpate.core.gap.dataset.rig import Indenter
from palpate.core.gap.forward.predictor import predictors_of
from palpate.core.gap.forward.stimulus import stimulus_of
from palpate.core.gap.planning.paths import Ground, Limits, Wishes
from palpate.core.model.sensor_parameters import SensorParameters

LIMITS = Limits(depth=0.0012, speed=0.02, duration=11.0, area=(-0.004, 0.006, -0.0052, 0.0052))
ROUNDING = 1e-6
"""Relative tolerance of speeds: differences of times and places that are near each other."""


def _rigs():
    ball = cases.rig(trials=2, seconds=5.0)
    domed = replace(ball.texels, position=ball.texels.position.copy())
    domed.position[:, 2] = 0.002 * np.cos(300.0 * domed.position[:, 0])
    edges = (0.006, 0.005, 0.004)
    mesh = box(*edges)
    return {
        "ball": ball,
        "box": replace(ball, indenter=Indenter(mesh, None, edges)),
        "any mesh": replace(ball, indenter=Indenter(mesh)),
        "curved": replace(ball, texels=domed),
    }


ANY_MESH = pytest.param("any mesh", marks=pytest.mark.slow("the solver searches its contacts at every sample"))


@pytest.mark.parametrize("name", ["ball", "box", ANY_MESH, "curved"])
def test_every_trajectory_keeps_its_limits(name):
    rig = _rigs()[name]
    predictors = predictors_of(rig.trials, rig)
    ground = Ground(predictors, LIMITS)
    if name == "ball":
        texels, touched = rig.texels.position[:, :2], ground.touch
        for place, height in zip(ground.places, touched, strict=True):  # the ball rests on the nearest texel
            away = ((texels - place[:2]) ** 2).sum(axis=1).min()
            assert height == pytest.approx(np.sqrt(cases.RADIUS**2 - away), abs=1e-9)
    chosen = list(ground.programmes().values())[:: 7 if name == "any mesh" else 1]
    for programme in chosen:
        trajectory = ground.trajectory(programme)
        time, position = trajectory.trial.time, trajectory.trial.position
        assert time[0] == 0.0 and time[-1] == pytest.approx(LIMITS.duration, abs=trajectory.trial.step)
        assert (np.diff(trajectory.knots) > 0.0).all()
        for moments, places in ((trajectory.knots, trajectory.position), (time, position)):
            speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / np.diff(moments)
            assert speeds.max() <= LIMITS.speed * (1.0 + ROUNDING)
        stimulus = stimulus_of(trajectory.trial, rig)
        deep = stimulus.load.max(axis=1)
        assert 0.0 < deep.max() <= LIMITS.depth + 1e-11
        assert deep[time < 0.5].max() == 0.0 and deep[-3:].max() == 0.0  # it begins and ends clear of the sensor
        x0, x1, y0, y1 = LIMITS.area
        x, y = position[:, 0], position[:, 1]
        assert x.min() >= x0 - 1e-9 and x.max() <= x1 + 1e-9 and y.min() >= y0 - 1e-9 and y.max() <= y1 + 1e-9


def test_limits_come_from_the_recordings_unless_they_are_given():
    rig = cases.rig(trials=3, seconds=6.0)
    predictors = predictors_of(rig.trials, rig)
    own = Wishes().limits(predictors)
    assert own.depth == max(p.stimulus.load.max() for p in predictors)
    assert own.duration == pytest.approx(6.0, abs=0.05) and own.area is None
    down = max(np.abs(np.diff(t.position[:, 2])).max() * cases.RATE for t in rig.trials)
    assert 0.5 * down < own.speed <= down * (1.0 + ROUNDING)
    given = Wishes(depth=1e-4, speed=0.5, duration=3.0, area=(0, 1, 0, 1)).limits(predictors)
    assert given == Limits(1e-4, 0.5, 3.0, (0, 1, 0, 1))


def test_limits_without_meaning_are_refused():
    rig = cases.rig(trials=2, seconds=4.0)
    predictors = predictors_of(rig.trials, rig)
    with pytest.raises(ParameterError, match="depth is -1"):
        Limits(-1.0, 1.0, 1.0)
    with pytest.raises(ParameterError, match="speed is nan"):
        Limits(1.0, float("nan"), 1.0)
    with pytest.raises(ParameterError, match="area"):
        Limits(1.0, 1.0, 1.0, (1.0, 0.0, 0.0, 1.0))
    with pytest.raises(ParameterError, match="No texel lies inside"):
        Ground(predictors, replace(LIMITS, area=(0.5, 0.6, 0.5, 0.6)))
    with pytest.raises(ParameterError, match="raise the limit of the duration"):
        Ground(predictors, replace(LIMITS, duration=0.5))
    clear = [replace(t, position=t.position + [0.0, 0.0, 1.0]) for t in rig.trials]
    with pytest.raises(ParameterError, match="never touched"):
        Wishes().limits(predictors_of(clear, rig))


def test_where_depths_are_known_depths_are_planned():
    time = np.arange(200) / 40.0
    level = np.interp(time, [0.0, 1.0, 2.0, 3.0, 5.0], [0.0, 0.0, 0.001, 0.0, 0.0])
    reading = np.zeros((200, 6))
    trial = cases.depth_trial(time, level, reading=reading)
    rig = cases.grid_rig(3, 2, 0.003, SensorParameters(k=50.0), [trial])
    predictors = predictors_of(rig.trials, rig)
    limits = Wishes(duration=8.0).limits(predictors)
    ground = Ground(predictors, limits)
    assert limits.depth == pytest.approx(0.001) and limits.speed == pytest.approx(0.001, rel=0.05)
    assert not any("slide" in called or "place" in called for called in ground.programmes())
    for programme in ground.programmes().values():
        planned = ground.trajectory(programme).trial
        assert planned.position is None and planned.level.min() == 0.0 and 0.0 < planned.level.max() <= limits.depth
        assert np.abs(np.diff(planned.level)).max() * 40.0 <= limits.speed * (1.0 + ROUNDING)
