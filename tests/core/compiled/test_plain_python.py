# SPDX-License-Identifier: GPL-3.0-or-later
"""Every line also runs in plain Python, and says the same."""

import pytest
from oracles.plain import numbers, scenes, without_numba


def test_plain_python_gives_the_same_numbers():
    """To 1e-12 over poses, velocities and all readings; compiled and library functions may differ in the last place only."""
    plain, seconds = without_numba()
    assert seconds > 0.0
    for name, scene in scenes().items():
        assert plain[name] == pytest.approx(numbers(scene), rel=0.0, abs=1e-12), name
