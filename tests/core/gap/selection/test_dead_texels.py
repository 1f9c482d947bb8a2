# SPDX-License-Identifier: GPL-3.0-or-later
"""Texels that do not answer, whatever level they stay at; texels that level off answer."""

import gap_cases as cases
import numpy as np
import pytest

from palpate.core.effects.engine.registry import form_of, kind_of
from palpate.core.gap.forward.predictor import Model, predictors_of
from palpate.core.gap.selection.base_model import prepared
from palpate.core.gap.selection.candidates import Candidate
from palpate.core.gap.selection.direct_estimates import unresponsive_texels
from palpate.core.gap.selection.view_set import view_set_of

GONE, TOUCH = [5, 9, 14], 0.004


def silent(reading, _time):
    reading[:, GONE] = 0.0


def stuck(reading, _time):
    reading[:, GONE] = 0.3


def railed(reading, _time):
    """To the rail at the first touch, and back when it ends."""
    reading[:, GONE] = np.where(reading[:, GONE] > TOUCH, 2.0, reading[:, GONE])


def clipped(reading, _time):
    np.minimum(reading, 0.03, out=reading)


@pytest.mark.parametrize(("change", "level"), [(silent, 0.0), (stuck, 0.3), (railed, 2.0), (clipped, None)])
def test_texels_that_do_not_answer(change, level):
    def changed(reading, time):
        reading = reading.copy()
        change(reading, time)
        return reading

    rig = cases.rig(change=changed, seed=3, stated=80.0, noise=1e-4)
    predictors = predictors_of(rig.trials, rig)
    noise, _ = prepared(rig, predictors)
    view_set = view_set_of(predictors, (noise[0].deviation, 1.0))
    candidate = Candidate(kind_of("dead-texels"), form_of("dead-texels", "held"))
    found = unresponsive_texels(view_set.whole, Model(rig.parameters), candidate, len(rig.texels))
    if level is None:
        assert found is None
        return
    assert np.flatnonzero(found.values["dead"]).tolist() == GONE
    np.testing.assert_allclose(np.asarray(found.values["level"])[GONE], level + rig.parameters.zero, atol=2e-3)
