# SPDX-License-Identifier: GPL-3.0-or-later
"""Designs fill their distributions as their names promise."""

import numpy as np
import pytest
from scipy import stats

from palpate.core.study.design import DESIGNS, Design, Distribution, columns_of

VARIED = {"a": Distribution("uniform", (2.0, 4.0)), "b": Distribution("log-uniform", (1e-3, 10.0))}


@pytest.mark.parametrize("kind", ["random", "latin-hypercube", "sobol"])
def test_values_have_their_distribution(kind):
    varied = VARIED | {"c": Distribution("normal", (1.0, 0.5)), "d": Distribution("choice", ("x", "y"))}
    columns = columns_of(Design(kind, 1024, 3), varied)
    # One in a thousand seeds would be refused; this seed is fixed.
    for name, law in (("a", stats.uniform(2, 2)), ("b", stats.loguniform(1e-3, 10)), ("c", stats.norm(1, 0.5))):
        assert stats.kstest(columns[name], law.cdf).pvalue > 1e-3
    assert abs(np.sum(columns["d"] == "x") - 512) < 60  # four standard deviations


def test_a_latin_hypercube_has_one_point_in_each_slice():
    columns = columns_of(Design("latin-hypercube", 50, 1), VARIED)
    assert sorted(((columns["a"] - 2.0) / 2.0 * 50).astype(int)) == list(range(50))


def test_sobol_is_balanced_in_halves():
    columns = columns_of(Design("sobol", 64, 1), VARIED)
    assert np.sum(columns["a"] < 3.0) == 32


def test_a_grid_has_all_combinations_once():
    varied = {"a": Distribution("uniform", (0.0, 1.0), 3), "b": Distribution("choice", (1, 2))}
    columns = columns_of(Design("grid"), varied)
    assert list(zip(columns["a"], columns["b"])) == [(a, b) for a in (0.0, 0.5, 1.0) for b in (1, 2)]


@pytest.mark.parametrize("kind", DESIGNS)
def test_the_seed_decides(kind):
    def draw(seed):
        return [column.tolist() for column in columns_of(Design(kind, 8, seed), VARIED).values()]

    assert draw(1) == draw(1)
    assert (draw(1) == draw(2)) == (kind == "grid")


def test_a_normal_distribution_is_cut_at_the_bounds():
    positive = Distribution("normal", (0.1, 1.0), low=0.0)
    values = np.array(positive.values(np.linspace(0.0, 1.0, 101)))
    assert values.min() == 0.0
    assert np.isfinite(values[:-1]).all()
    assert values[50] == pytest.approx(stats.truncnorm(-0.1, np.inf, 0.1, 1.0).median())
