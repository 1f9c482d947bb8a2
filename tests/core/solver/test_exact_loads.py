# SPDX-License-Identifier: GPL-3.0-or-later
"""Weights at rest: the paper's Table 3 and Fig. 9, on pads of any resolution."""

import numpy as np
import pytest
from oracles.loads import GRIDS, tilted, weight_error
from solver_scenes import GRAVITY, cube_on_pad

from palpate.core.solver.simulation import run


@pytest.mark.parametrize("mass", [0.1, 1.0, 4.0, 10.0])
@pytest.mark.parametrize("grid", GRIDS)
def test_texels_add_up_to_the_weight_and_all_are_lit(grid, mass):
    """A level cube at rest is a linear system: what is left is its settling and the rounding of some thousand additions."""
    error, dark = weight_error(grid, mass)
    assert error < 1e-11
    assert dark == 0


@pytest.mark.parametrize("seconds", [60.0, pytest.param(1200.0, marks=pytest.mark.long("twenty minutes on the slope"))])
def test_tilted_cube_neither_creeps_nor_sleeps(seconds):
    """10°, 1 kg. The texels together carry m g sin 10° along the pad to rounding, and nothing moves any more after 10 s."""
    along, shear, friction, lean, creep = tilted(seconds)
    pull = GRAVITY * np.sin(np.radians(10.0))
    assert pull == pytest.approx(1.7035, abs=1e-4)
    assert along == pytest.approx(pull, rel=1e-9)
    assert shear == pytest.approx(pull, rel=1e-9)  # the shear image adds up to it: each texel's part in its own plane
    # Friction alone acts in the cube's face, which leans downhill on its springs.
    assert 0.0 < lean < np.radians(0.2)
    assert friction == pytest.approx(GRAVITY * np.sin(np.radians(10.0) + lean), rel=1e-9)
    assert creep < 1e-10


@pytest.mark.parametrize("mass", [0.01, 0.1])
@pytest.mark.parametrize("k", [1e3, 1e5])
def test_a_light_body_that_came_too_deep_rises_to_its_weight(k, mass):
    """Dropped by a millimetre at a step that flies it in blind, cn a tenth of a per cent of k: the pad reads 4,000 times its
    weight at first. What it lost by that is enough for the pad to lift it, so no tank holds it down."""
    recording = run(cube_on_pad(mass, frames=50, fps=100, dt=5e-3, k=k, cn=1e-3 * k, gap=1e-3))
    total = recording.sensors["pad"].normal_force.sum(axis=1) / (mass * GRAVITY)
    assert total.max() > 5.0
    assert total[-1] == pytest.approx(1.0, rel=1e-6)
