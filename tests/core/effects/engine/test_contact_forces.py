# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact forces with effects along a known motion."""

import numpy as np
import pytest

from palpate.core.effects.engine.contact_forces import _damp_and_clip_plain, damp_and_clip
from palpate.core.laws.contact_law import contact_law
from palpate.core.model.sensor_parameters import SensorParameters


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
