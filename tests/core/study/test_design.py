# SPDX-License-Identifier: GPL-3.0-or-later
"""Designs fill their distributions as their names promise."""

import numpy as np
import pytest
from scipy import stats

from palpate.core.errors import ParameterError
from palpate.core.study.design import DESIGNS, Design, Distribution, points_of

VARIED = {"a": Distribution("uniform", (2.0, 4.0)), "b": Distribution("log-uniform", (1e-3, 10.0))}


@pytest.mark.parametrize("kind", ["random", "latin-hypercube", "sobol"])
def test_values_have_their_distribution(kind):
    varied = VARIED | {"c": Distribution("normal", (1.0, 0.5)), "d": Distribution("choice", ("x", "y"))}
    points = points_of(Design(kind, 1024, 3), varied)
    # One in a thousand seeds would be refused; this seed is fixed.
    for name, law in (("a", stats.uniform(2, 2)), ("b", stats.loguniform(1e-3, 10)), ("c", stats.norm(1, 0.5))):
        assert stats.kstest([point[name] for point in points], law.cdf).pvalue > 1e-3
    assert abs(sum(point["d"] == "x" for point in points) - 512) < 60  # four standard deviations


def test_a_latin_hypercube_has_one_point_in_each_slice():
    points = points_of(Design("latin-hypercube", 50, 1), VARIED)
    assert sorted(int((point["a"] - 2.0) / 2.0 * 50) for point in points) == list(range(50))


def test_sobol_is_balanced_in_halves():
    points = points_of(Design("sobol", 64, 1), VARIED)
    assert sum(point["a"] < 3.0 for point in points) == 32


def test_a_grid_has_all_combinations_once():
    varied = {"a": Distribution("uniform", (0.0, 1.0), 3), "b": Distribution("choice", (1, 2))}
    points = points_of(Design("grid"), varied)
    assert [tuple(point.values()) for point in points] == [(a, b) for a in (0.0, 0.5, 1.0) for b in (1, 2)]


@pytest.mark.parametrize("kind", DESIGNS)
def test_the_seed_decides(kind):
    def draw(seed):
        return list(points_of(Design(kind, 8, seed), VARIED))

    assert draw(1) == draw(1)
    assert (draw(1) == draw(2)) == (kind == "grid")


def test_a_normal_distribution_is_cut_at_the_bounds():
    positive = Distribution("normal", (0.1, 1.0), low=0.0)
    values = np.array(positive.values(np.linspace(0.0, 1.0, 101)))
    assert values.min() == 0.0
    assert np.isfinite(values[:-1]).all()
    assert values[50] == pytest.approx(stats.truncnorm(-0.1, np.inf, 0.1, 1.0).median())


def test_too_many_runs_are_refused_before_they_are_drawn():
    with pytest.raises(ParameterError, match=r"asks for 1e\+09 runs"):
        points_of(Design("random", 10**9), VARIED)
