# SPDX-License-Identifier: GPL-3.0-or-later
"""Random number streams."""

import numpy as np

from palpate.core.effects.engine import random_streams


def test_uniform_numbers_fill_their_interval():
    numbers = random_streams.uniform("test", 1, np.arange(100_000))
    counts, _ = np.histogram(numbers, 100, (0, 1))
    assert ((counts - 1000) ** 2 / 1000).sum() < 150  # chi-squared with 99 degrees of freedom: 1 in 1,000 is above 149
    assert numbers.min() > 0 and numbers.max() < 1
