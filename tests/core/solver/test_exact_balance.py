# SPDX-License-Identifier: GPL-3.0-or-later
"""Momentum, energy and frame invariance of whole scenes."""

import numpy as np
import pytest
from oracles.balance import carried, collide, differences, round_and_round, tumbling, tumbling_flight, turned_and_moved
from solver_scenes import about


@pytest.mark.parametrize("dt", [1e-4, 1e-3])
@pytest.mark.parametrize("seed", range(6))
def test_what_one_body_gets_the_other_gives(seed, dt):
    """Both act at the same points with opposite forces: linear momentum, and angular momentum about a point far away, are kept
    to rounding at any step, spinning or not."""
    linear, angular, _ = collide(seed, dt)
    assert linear < 1e-12
    assert angular < 1e-12


@pytest.mark.parametrize("seed", range(6))
def test_a_collision_gains_no_energy(seed):
    """Motion, springs and bristles together; 1e-10 is where the rounds of a step end."""
    assert collide(seed)[2] < 1e-10


@pytest.mark.parametrize("dt", [1e-3, 1e-2])
def test_an_uneven_body_tumbles_without_gaining_energy(dt):
    """About its middle axis at 20 rad/s, 20 s: rounding alone is left, whatever the step (once it was twice the energy)."""
    growth, momentum, _ = tumbling_flight(dt, 20.0)
    assert growth < 1e-10
    assert momentum < 1e-10


def test_an_uneven_body_tumbles_as_eulers_equations_say():
    """Second order in the step; the spin goes over from one side to the other within these two seconds."""
    coarse, fine = tumbling_flight(2e-3, 2.0)[2], tumbling_flight(1e-3, 2.0)[2]
    assert fine < 2e-4
    assert coarse / fine == pytest.approx(4.0, abs=0.2)


def test_a_scene_turned_as_a_whole_feels_the_same():
    """A cube is thrown, slides and topples; gravity turns along."""
    scene = tumbling()
    turned = turned_and_moved(scene, about((1, -2, 0.5), 73.0), np.array([0.3, -0.2, 0.7]))
    assert differences(scene, turned) < 1e-9


def test_a_scene_that_moves_as_a_whole_feels_the_same():
    """Galilei: rest is a steady motion. Not the first frame, in which keyframed bodies count as at rest."""
    scene = tumbling()
    assert differences(scene, carried(scene, np.array([0.7, -0.3, 0.2]), np.zeros(3)), 1) < 1e-9


def test_a_scene_that_accelerates_as_a_whole_feels_the_same():
    """Einstein's lift: an accelerating pad under more gravity. The rounds of a step start from elsewhere, and end within 1e-9
    of the velocity that contacts give in a step, of which a third is left after all frames."""
    scene = tumbling()
    assert differences(scene, carried(scene, np.array([0.7, -0.3, 0.2]), np.array([1.0, 2.0, -0.5])), 1) < 1e-9


@pytest.mark.parametrize("turns", [0.5, 3.0])
def test_bristles_are_carried_round_without_drift(turns):
    """Pad and probe go round together at a growing speed, about an axis that passes neither of them: 960 steps, 1e-9."""
    assert round_and_round(turns) < 1e-9
