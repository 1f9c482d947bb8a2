# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact forces with effects along a known motion."""

import numpy as np
import pytest
from stepwise_forces import StepwiseNormalForces

from palpate.core.effects.engine.contact_forces import _damp_and_clip_plain, damp_and_clip, normal_forces
from palpate.core.effects.engine.registry import effect
from palpate.core.laws.contact_law import contact_law
from palpate.core.model.sensor_parameters import SensorParameters


def test_the_law_of_hunt_and_crossley_is_a_base_as_well():
    """Step by step as over the whole signal, with an effect between its spring and its damping."""
    parameters = SensorParameters(k=3e4, normal_law="hunt-crossley", exponent=1.5, dissipation=2.0)
    random = np.random.default_rng(1)
    time = np.cumsum(0.02 * random.choice([0.5, 1.0, 1.5], 80)) - 0.02
    depth = np.maximum(0.002 * np.sin(time)[:, None] * random.uniform(0.3, 1.0, 12), 0.0)
    items = (effect("stiffening"), effect("creep"))
    whole = normal_forces(items, parameters, time, depth)
    lengths = np.diff(time, prepend=time[0])
    pad = StepwiseNormalForces(items, parameters, lengths, depth.shape[1])
    rate = np.diff(depth, axis=0, prepend=depth[:1]) / np.where(lengths > 0, lengths, 1.0)[:, None]
    for i in range(len(time)):
        np.testing.assert_allclose(pad.step(i, depth[i], rate[i])[0], whole[i], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(
        normal_forces((), parameters, time, depth, rate=np.zeros_like(depth)), 3e4 * depth**1.5, rtol=1e-12, atol=1e-12
    )


@pytest.mark.parametrize("law", ["linear", "hunt-crossley"])
def test_damping_is_the_same_compiled_and_as_formulas_of_arrays(law):
    """Where the surfaces part fast the sum is clipped, and where nothing touches there is no force, whatever the rate."""
    parameters = contact_law(SensorParameters(k=50.0, cn=0.1, normal_law=law, exponent=1.5, dissipation=2.0))
    random = np.random.default_rng(2)
    depth, rate = np.maximum(random.normal(size=(40, 5)), 0.0) * 1e-3, random.normal(size=(40, 5))
    compiled = 50.0 * depth
    arrays = compiled.copy()
    damp_and_clip(compiled, depth, rate, parameters)
    _damp_and_clip_plain(arrays, depth, rate, parameters)
    np.testing.assert_array_equal(compiled, arrays)
    clipped = (depth > 0.0) & (compiled == 0.0)
    assert clipped.any() and (compiled >= 0.0).all() and not compiled[depth == 0.0].any()
    if law == "linear":
        np.testing.assert_allclose(compiled, np.where(depth > 0.0, np.maximum(50.0 * depth + 0.1 * rate, 0.0), 0.0), rtol=1e-12)
