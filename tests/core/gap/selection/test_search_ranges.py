# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a fit looks for a parameter, by its unit and what the recordings hold."""

from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest

from palpate.core.effects.engine.registry import form_of
from palpate.core.gap.forward.predictor import Model, predictors_of
from palpate.core.gap.selection.candidates import scales_of, search_range
from palpate.core.model.parameter import Parameter


def test_a_speed_is_that_of_sliding_for_friction_and_that_of_pressing_for_other_effects():
    rig = cases.rig(lambda force, _time: force, trials=2, seconds=5.0)
    predictors = predictors_of(rig.trials, rig)
    scales = scales_of(predictors, Model(rig.parameters))
    rates = [np.abs(np.diff(p.stimulus.depth, axis=0)).max(axis=1) / np.diff(p.trial.time) for p in predictors]
    fastest = max(rate.max() for rate in rates)
    assert scales.rate == pytest.approx(fastest) and 1e-4 < fastest < 1.0
    parameter = Parameter("rate", "m/s", 0.01, 1e-9, 2.0, "Of something.", log=True)
    scales = replace(scales, sliding_speed=1e-6)
    friction, creep = form_of("stribeck", "gaussian"), form_of("creep")
    assert search_range(parameter, scales, creep) == pytest.approx((0.02 * fastest, 2.0 * fastest))
    assert search_range(parameter, scales, friction) == pytest.approx((2e-8, 2e-6))
    work, most = Parameter("life", "J", 0.1, 1e-12, 1e9, "Of something.", log=True), 50.0 * scales.force * scales.seconds
    assert search_range(work, scales, form_of("wear"))[1] == pytest.approx(most * fastest)
    assert search_range(work, scales, friction)[1] == pytest.approx(most * 1e-6)
    drag = Parameter("drag", "N·s/m", 0.1, 1e-12, 1e9, "Of something.", log=True)
    assert search_range(drag, scales, creep)[1] == pytest.approx(2.0 * scales.force / fastest)
