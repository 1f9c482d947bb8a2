# SPDX-License-Identifier: GPL-3.0-or-later
"""The frame of a picture shows settled forces, and not an impact."""

from types import SimpleNamespace

import numpy as np
import pytest

from palpate.core import response


class Loads:
    """Recording of one texel with these normal forces."""

    def __init__(self, force):
        self.frames = np.arange(10, 10 + len(force))
        self.sensors = {"Pad": SimpleNamespace(normal_force=np.asarray(force, dtype=float)[:, None])}

    def blocks(self):
        half = len(self.frames) // 2
        for part in (slice(0, half), slice(half, None)):
            yield SimpleNamespace(sensors={"Pad": SimpleNamespace(normal_force=self.sensors["Pad"].normal_force[part])})


def test_after_an_impact_the_middle_of_the_rest():
    force = [0, 0, 9, 3, 1, 2, 1.6, *[1.5] * 20]
    assert response.peak_frame(Loads(force)) == 12
    assert response.settled_frame(Loads(force)) == pytest.approx(10 + 17, abs=2)


def test_the_turning_point_of_an_overshoot_is_no_rest():
    """Two fingers under force control, frame by frame: above 6 N for ten frames, at 6 N for fifty."""
    overshoot = [5.19, 6.63, 6.68, 6.48, 6.3, 6.18, 6.1, 6.06, 6.03, 6.02, 6.01, 6.01]
    force = [*[0.0] * 9, *overshoot, *[6.0] * 51]
    assert response.peak_frame(Loads(force)) == 10 + 11
    shown = response.settled_frame(Loads(force)) - 10
    assert shown >= 30 and force[shown] == 6.0


def test_the_largest_of_two_plateaus():
    force = [*[1.0] * 30, *np.linspace(1.0, 4.0, 10), *[4.0] * 30, *np.linspace(4.0, 0.0, 10)]
    assert 52 <= response.settled_frame(Loads(force)) <= 78


def test_hardly_any_load_is_not_worth_a_picture():
    """A finger that rests lightly for long and presses hard for short: the press is shown although it never settles."""
    force = [*[0.1] * 50, *np.linspace(0.0, 10.0, 30), *np.linspace(10.0, 0.0, 30)]
    assert response.settled_frame(Loads(force)) == response.peak_frame(Loads(force)) == 10 + 79


def test_without_force_the_first_frame():
    assert response.settled_frame(Loads(np.zeros(12))) == 10


def test_loads_that_go_up_and_down_without_rest():
    force = 1.0 + np.sin(np.linspace(0.0, 30.0, 100))
    assert response.settled_frame(Loads(force)) == response.peak_frame(Loads(force)) or (
        abs(force[response.settled_frame(Loads(force)) - 10] - 2.0) < 0.05
    )
