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
    """Kinetic energy and height together never exceed what there was at the start, to rounding."""
    for seed in range(start, start + 25):
        energies, words = thrown(seed)
        assert np.isfinite(energies.total).all(), words
        assert energies.mechanical_growth <= 1e-9, words


@pytest.mark.parametrize("seed", UNDAMPED)
def test_edges_over_undamped_texels_gain_no_energy(seed):
    """Eq. 4's depth jumps where an edge passes a texel: the spring gives no more than was put into it all the same."""
    energies, words = thrown(seed)
    assert energies.mechanical_growth <= 1e-9, words
