# SPDX-License-Identifier: GPL-3.0-or-later
"""What is computed without ``scipy.stats``, which takes half a second to load, is what ``scipy.stats`` gives."""

import numpy as np
import pytest
from scipy import stats

from palpate.core.gap.fitting.regression import student_quantile
from palpate.core.gap.selection.candidates import _halton_points


@pytest.mark.parametrize("dimensions", [1, 2, 5, 12])
def test_halton_points(dimensions):
    sequence = stats.qmc.Halton(dimensions, scramble=False)
    sequence.fast_forward(1)
    assert np.array_equal(_halton_points(dimensions, 300), sequence.random(300))


def test_quantiles():
    for freedom in (1, 2, 7, 40, 1000):
        assert student_quantile(freedom) == pytest.approx(stats.t.ppf(0.975, freedom), rel=1e-14)
