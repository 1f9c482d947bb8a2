# SPDX-License-Identifier: GPL-3.0-or-later
"""Every line also runs in plain Python, and says the same."""

import os
import subprocess
import sys

import numpy as np
import pytest
from oracles.plain import numbers, scenes, without_numba

ASK_FOR_ADDRESSES = """
from palpate.core.compiled.kernels import COMPILED, address_of, addressed_kernel, call_address
print(COMPILED, address_of(addressed_kernel(len), 1))
try:
    call_address(0, 1)
except RuntimeError as error:
    print(error)
"""


@pytest.fixture(scope="module")
def plain_run():
    """Numbers of all scenes in plain Python, and seconds per step."""
    return without_numba()


@pytest.mark.slow("the solver in plain Python, in a process whose numbers two tests share")
def test_plain_python_gives_the_same_numbers(plain_run):
    """To 1e-12 over poses, velocities and all readings; compiled and library functions may differ in the last place only."""
    plain, seconds = plain_run
    assert seconds > 0.0
    for name, scene in scenes().items():
        assert plain[name] == pytest.approx(numbers(scene), rel=0.0, abs=1e-12), name


@pytest.mark.long("the solver in plain Python, in a process of its own")
def test_without_the_internals_of_numba_everything_runs_as_plain_python(plain_run):
    """As if a later release of numba had moved a part that is not documented."""
    plain, _ = plain_run
    fallback, _ = without_numba("numba.core.datamodel")
    assert set(fallback) == set(plain)
    for name, values in plain.items():
        assert np.array_equal(fallback[name], values), name


def test_without_numba_a_function_has_no_address_and_the_error_says_so():
    environment = {**os.environ, "PALPATE_NUMBA": "0"}
    done = subprocess.run([sys.executable, "-c", ASK_FOR_ADDRESSES], env=environment, capture_output=True, text=True)
    compiled, call = done.stdout.splitlines()
    assert compiled == "False 0"
    assert call == "Nothing can be called by its address without numba: look at COMPILED first."
