# SPDX-License-Identifier: GPL-3.0-or-later
"""What a recording covers is seen whatever its pace, and what it cannot tell is not asked."""

from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest

from palpate.core.effects.engine.registry import effect
from palpate.core.gap.candidates.candidates import candidates
from palpate.core.gap.fitting.identifiability import (
    KNOWN_FROM_CYCLES,
    KNOWN_FROM_PLACES,
    KNOWN_FROM_TIMING,
    KNOWN_FROM_UNLOADING,
    LOOP_CURVATURE,
    curvature_ratio,
    indistinguishable,
    unidentifiable,
)
from palpate.core.gap.fitting.noise_floor import coverage
from palpate.core.gap.forward.contact_phases import PHASES, phase_indices
from palpate.core.gap.forward.predictor import Model, Predictor
from palpate.core.model.sensor_parameters import SensorParameters

PROGRAMMES = {
    "ramp": ([0, 1], [0, 1]),
    "press": ([0, 1, 2], [0, 1, 0]),
    "held": ([0, 1, 9, 10], [0, 1, 1, 0]),
    "stairs": ([0, 1, 4, 5, 9], [0, 0.5, 0.5, 1, 1]),
}


def predictor(programme, seconds):
    """A pad of two texels, pressed to 1 mm by a programme that is stretched to so many seconds."""
    at, depth = PROGRAMMES[programme]
    time = np.linspace(0, seconds, 600)
    level = 1e-3 * np.interp(time / seconds * at[-1], at, depth)
    reading = 50.0 * level[:, None] * np.ones(2)
    trial = cases.depth_trial(time, level, reading=reading)
    return Predictor(trial, cases.grid_rig(1, 2, 3e-3, SensorParameters(k=50.0), [trial], ["k"]))


@pytest.mark.parametrize("seconds", [1.0, 20.0, 4000.0])
@pytest.mark.parametrize(("programme", "unloads"), [("ramp", False), ("stairs", False), ("press", True), ("held", True)])
def test_unloading_is_seen_at_any_pace(programme, unloads, seconds):
    seen = coverage([predictor(programme, seconds)])
    assert seen.unloading == unloads
    expected = set() if unloads else set(KNOWN_FROM_UNLOADING)
    assert set(unidentifiable(seen)) - {"drift"} == expected
    # Those that unload end without load; what settles at two loads does not go with the clock alone.
    assert ("drift" in unidentifiable(seen)) == (programme == "ramp")
    assert seen.held_load_ratio == pytest.approx(2.0 if programme == "stairs" else 1.0, rel=0.05)


def test_time_and_depth_are_one_in_a_single_ramp():
    assert set(KNOWN_FROM_TIMING) <= set(indistinguishable(coverage([predictor("ramp", 60.0)]), "stiffening"))
    for programme in ("press", "held", "stairs"):
        assert not set(KNOWN_FROM_TIMING) & set(indistinguishable(coverage([predictor(programme, 60.0)]), "stiffening"))
    both = coverage([predictor("ramp", 60.0), predictor("ramp", 6.0)])
    assert not set(KNOWN_FROM_TIMING) & set(indistinguishable(both, "stiffening"))


@pytest.mark.parametrize("seconds", [20.0, 4000.0])
def test_a_slow_ramp_is_no_hold(seconds):
    assert coverage([predictor("ramp", seconds)]).longest_hold == 0.0
    assert coverage([predictor("held", seconds)]).longest_hold == pytest.approx(0.8 * seconds, rel=0.02)
    found = phase_indices(predictor("ramp", seconds).stimulus)[5:]
    assert (found == PHASES.index("loading")).all()


def test_what_was_never_brought_out_is_no_candidate():
    up, back = (predictor(programme, 20.0) for programme in ("ramp", "press"))
    asked = [{c.name for c in candidates([one], Model(one.rig.parameters))} for one in (up, back)]
    assert not asked[0] & set(KNOWN_FROM_UNLOADING) and set(KNOWN_FROM_UNLOADING) <= asked[1]
    assert {"stiffening", "creep"} <= asked[0]


def test_one_cycle_does_not_tell_what_a_second_would():
    once = coverage([predictor("press", 20.0)])
    assert set(indistinguishable(once, "softening")) == {*KNOWN_FROM_CYCLES, "creep", "lag"} - {"softening"}
    assert set(indistinguishable(coverage([predictor("held", 20.0)]), "softening")) == set(KNOWN_FROM_CYCLES) - {"softening"}
    assert indistinguishable(replace(once, cycles=3), "softening") == () == indistinguishable(once, "stiffening")


@pytest.mark.parametrize("noise", [0.0, 0.005, 0.02])
def test_noise_of_a_measured_load_is_neither_cycles_nor_the_end_of_a_hold(noise):
    """One press that is held for 8 of 10 s, and the noise of a load cell on it: one cycle, one hold."""
    time = np.linspace(0, 12, 2400)
    rng = np.random.default_rng(3)
    level = np.interp(time, [1, 2, 10, 11], [0, 1, 1, 0]) + noise * rng.normal(size=len(time))
    trial = replace(cases.depth_trial(time, level, reading=level[:, None] * np.ones(2)), stimulus="force")
    seen = coverage([Predictor(trial, cases.grid_rig(1, 2, 3e-3, SensorParameters(), [trial]))])
    assert seen.cycles == 1 and seen.longest_hold == pytest.approx(8.0, abs=0.5)


@pytest.mark.parametrize("samples", [12, 40])
def test_a_curved_load_is_no_noise(samples):
    """Sines of few samples a cycle: each is counted."""
    time = np.arange(20 * samples) / samples
    level = 1e-3 * (0.5 - 0.5 * np.cos(2 * np.pi * time))
    trial = cases.depth_trial(time, level, reading=level[:, None] * np.ones(2))
    assert coverage([Predictor(trial, cases.grid_rig(1, 2, 3e-3, SensorParameters(), [trial]))]).cycles == 20


@pytest.mark.parametrize("depth", [1e-1, 4e-3, 2e-4])
def test_the_way_in_alone_may_be_that_of_a_loop(depth):
    """What bends little may be half a loop; a curve several times as steep at its end is not."""
    up, back = (predictor(programme, 20.0) for programme in ("ramp", "press"))
    model = Model(up.rig.parameters, (effect("stiffening", "polynomial", depth=depth, exponent=1.0),))
    at = 1e-3 / depth * np.linspace(0, 1, 9)
    slopes = np.diff(at * (1 + at))
    found = curvature_ratio([up], model)
    assert found == pytest.approx(slopes[-1] / slopes[0], rel=0.02)
    assert ("hysteresis" in indistinguishable(coverage([up]), "stiffening", found)) == (found < LOOP_CURVATURE)
    assert indistinguishable(coverage([back]), "stiffening", found) == ()


@pytest.mark.parametrize(("stays", "told"), [(True, False), (False, True)])
def test_one_place_does_not_tell_neighbours_from_gains(stays, told):
    """A ball on one of six rows of texels, or on one after the other."""
    rig = cases.grid_rig(6, 2, 3e-3, SensorParameters(k=50.0), given=["k"])
    time = np.linspace(0, 6, 600)
    row = np.zeros(600, int) if stays else np.minimum(time, 1.9).astype(int)
    depth = 1e-3 * np.abs(np.sin(np.pi * time))[:, None] * (np.repeat(np.arange(6), 2) == row[:, None])
    one = Predictor(cases.depth_trial(time, depth.max(axis=1), reading=50.0 * depth), rig)
    one.stimulus = replace(one.stimulus, depth=depth)
    assert (indistinguishable(coverage([one]), "crosstalk") == ()) == told
    assert told or set(indistinguishable(coverage([one]), "crosstalk")) == set(KNOWN_FROM_PLACES) - {"crosstalk"}
