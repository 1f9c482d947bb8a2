# SPDX-License-Identifier: GPL-3.0-or-later
"""Which kinds recordings can tell apart."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.benchmarks._hidden import cases as hidden
from palpate.core.effects.engine.registry import library
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.fitting.noise_floor import ChannelNoise
from palpate.core.gap.forward.predictor import Model, predictors_of
from palpate.core.gap.kinds.dictionaries import MISALIGNMENT, VARIANTS
from palpate.core.gap.kinds.distinguishability import Comparison
from palpate.core.gap.kinds.recorded import recorded


def test_every_kind_is_one_of_the_library():
    assert {variant.kind for variant in (*VARIANTS, MISALIGNMENT)} <= set(library())
    assert len({variant.label for variant in VARIANTS}) == len(VARIANTS)


def _told(kind, number, folder):
    """Shares of what the recordings of a hidden case tell, of the effect in the first by that in the second name."""
    rig = read_rig(hidden.write(hidden.draw(kind, number), folder))
    predictors = [p for p in predictors_of(rig.trials, rig) if p.trial.use == "fit"]
    noise = ChannelNoise(0.005 * np.ptp(predictors[0].trial.reading), 1.0, "given"), ChannelNoise(0.05, 1.0, "given")
    seen = recorded(predictors, Model(rig.parameters), {"cn"}, noise)
    kinds = {"misalignment", "dead-zone", "saturation", "creep", "hysteresis", "load-spreading", "crosstalk"}
    return {(one.signal, one.other): one for one in Comparison(seen, kinds).distinctions()}


@pytest.mark.long("a whole search among pairs of kinds")
def test_a_flat_indenter_cannot_tell_a_height_error_from_a_dead_zone_and_holds_tell_creep_from_hysteresis(tmp_path):
    flat = _told("two", 601, tmp_path)
    assert flat["misalignment/height", "dead-zone"].share < 0.1
    assert flat["creep", "hysteresis"].share > 0.6 and flat["creep", "hysteresis"].is_told
    assert flat["creep", "hysteresis"].smallest < flat["misalignment/height", "dead-zone"].smallest
    assert all(0.0 <= one.share <= 1.0 for one in flat.values())


@pytest.mark.long("a whole search among pairs of kinds")
def test_a_ball_can_hardly_tell_load_spreading_from_crosstalk(tmp_path):
    ball = _told("two", 600, tmp_path)
    assert ball["load-spreading", "crosstalk"].share < 0.2 < ball["load-spreading", "saturation"].share
