# SPDX-License-Identifier: GPL-3.0-or-later
"""The chain of effects from forces to readings."""

import numpy as np

from palpate.core.effects.engine.readout_chain import readings
from palpate.core.effects.engine.registry import effect
from palpate.core.effects.engine.specification import TransducerArray


def test_the_chain_runs_in_the_order_of_a_sensor():
    """Cover, transducer, converter: noise is quantized, not the other way round, however the stack is written."""
    stack = (effect("quantization", step=0.25), effect("noise", spread=0.05), effect("load-spreading"))
    y, x = (index.ravel() for index in np.mgrid[0:14, 0:6] * 0.0034)
    grid = TransducerArray(np.stack([x, y, np.zeros(84)], axis=1), np.full(84, 0.0034**2))
    time = np.linspace(0.0, 0.4, 20)
    force = np.random.default_rng(0).random((20, 84))
    found = readings(stack, grid, time, force)
    np.testing.assert_array_equal(found, readings(stack[::-1], grid, time, force))
    np.testing.assert_allclose(found / 0.25, np.round(found / 0.25), atol=1e-12)
