# SPDX-License-Identifier: GPL-3.0-or-later
"""Results that runs share are those of their arguments, and few are kept."""

import gc
import weakref

import numpy as np

from palpate.core.model.shared_results import MOST_OF_EACH, SharedResults


def test_a_function_is_called_once_for_the_same_objects_and_equal_numbers():
    calls, shared, array = [], SharedResults(), np.arange(3.0)

    def total(values, factor):
        calls.append(factor)
        return factor * values.sum()

    assert shared.of(total, array, 2) == shared.of(total, array, 2) == 6.0
    assert shared.of(total, array, 3) == 9.0
    assert shared.of(total, array.copy(), 2) == 6.0  # equal values, another object
    assert calls == [2, 3, 2]
    assert shared.of(np.sum, array) == 3.0  # another function of the same objects


def test_the_last_results_are_kept_with_their_arguments_and_no_others():
    shared, seen = SharedResults(), []
    for _ in range(10):
        array = np.zeros(3)
        seen.append(weakref.ref(array))
        shared.of(np.sum, array)
    del array
    gc.collect()
    assert [found() is not None for found in seen] == [False] * (10 - MOST_OF_EACH) + [True] * MOST_OF_EACH
