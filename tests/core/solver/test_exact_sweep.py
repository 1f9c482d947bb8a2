# SPDX-License-Identifier: GPL-3.0-or-later
"""Random parameter sets: no NaN, and a body that is thrown onto a pad never has more energy than it came with.

The quick tier has those that are known to be hard and the first 25, the long tier 400.
"""

import numpy as np
import pytest
from oracles import balance
from oracles.sweep import energies, random_case, thrown
from solver_scenes import about

from palpate.core.solver.simulation import Simulation

UNDAMPED = (161, 359, 553, 557, 991)
"""Edges run over texels whose damping is less than 1 % of their stiffness: what only the tanks hold back."""


TURNING = (94, 244, 529, 929)
"""Bodies that turn by a tenth of a radian and more in a step: the energy of rotation depends on how a body lies at its end."""


@pytest.mark.parametrize(
    "seeds",
    [
        UNDAMPED,
        TURNING,
        pytest.param(range(25), marks=pytest.mark.slow("25 random bodies; a few say nothing of the rest")),
        *(
            pytest.param(range(a, b), marks=pytest.mark.long("the rest of 400 random bodies"))
            for a, b in ((25, 200), (200, 400))
        ),
    ],
    ids=str,
)
def test_thrown_bodies_gain_no_energy(seeds):
    """Kinetic energy and height never grow, to rounding; nor does their sum with what contacts may give back."""
    for seed in seeds:
        energies, words = thrown(seed)
        assert np.isfinite(energies.total).all(), words
        assert energies.mechanical_growth <= 1e-9, words
        assert energies.growth <= 1e-9, words


@pytest.mark.parametrize("degrees", [17.0, 71.0, 103.0])
def test_a_pad_that_rests_askew_brings_no_energy(degrees):
    """It has not moved: rounding of its rotation is no motion, and contacts give no more than was put into them."""
    scenario, _, words = random_case(498)
    turned = balance.turned_and_moved(scenario, about((3, -1, 2), degrees), np.zeros(3))
    simulation = Simulation(turned)
    _, _, velocities = simulation._prescribed_motion(1, 1)
    assert (velocities[0, :, 0] == 0.0).all()
    scale = thrown(498, 0)[0].scale
    assert energies(turned, 100, scale).growth <= 1e-9, words
