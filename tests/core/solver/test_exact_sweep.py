# SPDX-License-Identifier: GPL-3.0-or-later
"""Random parameter sets: no NaN, and a body that is thrown onto a pad never has more energy than it came with.

A thousand sets are in ``make bench ONLY=exactness``; here are those that are known to be hard, and the first hundred.
"""

import numpy as np
import pytest
from oracles.sweep import thrown

UNDAMPED = (161, 359, 553, 557, 991)
"""Edges run over texels whose damping is less than 1 % of their stiffness: what only the tanks hold back."""


@pytest.mark.parametrize("start", range(0, 100, 25))
def test_thrown_bodies_gain_no_energy(start):
    """Kinetic energy and height never grow, to rounding; nor does their sum with what contacts may give back."""
    for seed in range(start, start + 25):
        energies, words = thrown(seed)
        assert np.isfinite(energies.total).all(), words
        assert energies.mechanical_growth <= 1e-9, words
        assert energies.growth <= 1e-9, words


@pytest.mark.parametrize("seed", UNDAMPED)
def test_edges_over_undamped_texels_gain_no_energy(seed):
    """Eq. 4's depth jumps where an edge passes a texel: the spring gives no more than was put into it all the same."""
    energies, words = thrown(seed)
    assert energies.mechanical_growth <= 1e-9, words
    assert energies.growth <= 1e-9, words


TURNING = (94, 244, 529, 929)
"""Bodies that turn by a tenth of a radian and more in a step: contacts were credited with more than was put into them."""


@pytest.mark.parametrize("seed", TURNING)
def test_bodies_that_turn_far_in_a_step_put_in_no_more_than_they_lose(seed):
    """The energy of a body's rotation depends on how it lies at the step's end, and the accounts of its contacts know it."""
    energies, words = thrown(seed)
    assert energies.growth <= 1e-9, words
