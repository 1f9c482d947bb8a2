# SPDX-License-Identifier: GPL-3.0-or-later
"""Intervals of fitted numbers: coloured noise that few groups tell of, and numbers that only act as their sum."""

import gap_cases as cases
import numpy as np
import pytest

from palpate.core.gap.fitting.intervals import NORMAL_QUANTILE, _inverse, _sandwich
from palpate.core.gap.forward.predictor import Model, Predictor
from palpate.core.model.sensor_parameters import SensorParameters


def test_what_only_acts_as_a_sum_is_told_by_nothing():
    """Of three columns two are the same: their sum and the third are told as well as they would be alone."""
    x = np.random.default_rng(0).normal(size=(1000, 2)) * (1.0, 1e-6)
    table = np.column_stack([x[:, 0], x[:, 0], x[:, 1]])
    found = _inverse(table.T @ table)
    alone = np.linalg.inv(x.T @ x)
    sums = np.array([1.0, 1.0, 0.0])
    assert found[0, 0] > 1e6 * alone[0, 0] and found[1, 1] > 1e6 * alone[0, 0]
    assert sums @ found @ sums == pytest.approx(alone[0, 0], rel=1e-2)
    assert found[2, 2] == pytest.approx(alone[1, 1], rel=1e-3)
    nothing = _inverse(np.diag([4.0, 0.0]))
    assert nothing[0, 0] == 0.25 and 1e6 < nothing[1, 1] < np.inf


@pytest.mark.parametrize("groups", [6, 40])
def test_few_groups_hold_as_often_as_many(groups):
    """A mean of values that are one in each group, of unequal scatter: 95 % of 2000 intervals should hold the truth, 0.

    Two standard deviations of that share are 1 %. Student's t is exact for equal groups only; with unequal ones it may be off
    by some points, but normal intervals of six such groups hold 83 %.
    """
    rng, held = np.random.default_rng(1), []
    scatter = np.linspace(0.5, 2.0, groups)
    for _ in range(2000):
        values = scatter * rng.normal(size=groups)
        mean = float(values.mean())
        covariance = _sandwich(np.array([[1.0 / groups]]), (values - mean)[:, None])
        held.append(abs(mean) < NORMAL_QUANTILE * float(np.sqrt(covariance[0, 0])))
    assert 0.92 < np.mean(held) < 0.98


def test_friction_at_fifty_samples_a_second_is_that_of_five_hundred():
    """While the load swings, friction from samples 20 ms apart stays within a thousandth of that from 2 ms.

    The load at a step's end instead of its mean would be off by 0.6 %.
    """
    parameters = SensorParameters(k=1e3, cn=0.0, sigma0=50.0, sigma1=0.0, x0=0.02, ct=0.0)

    def pulled(rate):
        time = np.linspace(0.0, 4.0, 4 * rate + 1)
        level = 1e-3 * (1.0 + 0.5 * np.sin(7.0 * time))
        trial = cases.depth_trial(time, level, slide=0.05 * np.sin(3.0 * time), force=np.zeros((len(time), 3)))
        return (
            Predictor(trial, cases.grid_rig(1, 1, 0.01, parameters, [trial])).predict(Model(parameters)).force[:: rate // 50, 0]
        )

    coarse, fine = pulled(50), pulled(500)
    assert np.sqrt(np.mean((coarse - fine) ** 2)) < 1e-3 * np.ptp(fine)
