# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled kernels are never older than their source."""

import os
import shutil
import subprocess
import sys

import pytest

from palpate.core import jit

CALLER = """
from .callee import value
from .jit import kernel

@kernel
def twice():
    return 2.0 * value()

if __name__ == "__main__":
    print(twice(), sum(twice.stats.cache_hits.values()))
"""
CALLEE = """
from .jit import kernel

@kernel
def value():
    return {}
"""


@pytest.mark.skipif(not jit.COMPILED, reason="without numba nothing is kept")
def test_a_kernel_is_compiled_anew_when_one_that_it_calls_has_changed(tmp_path):
    """In another file, which numba's own check does not see. What has not changed comes from the cache."""
    package = tmp_path / "kernels"
    package.mkdir()
    (package / "__init__.py").touch()
    shutil.copy(jit.__file__, package)
    (package / "caller.py").write_text(CALLER)
    answers = []
    for number in (1.0, 1.0, 3.0):
        (package / "callee.py").write_text(CALLEE.format(number))
        done = subprocess.run(
            [sys.executable, "-m", "kernels.caller"],
            cwd=tmp_path,
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"},
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        answers.append(done.stdout.split())
    assert answers == [["2.0", "0"], ["2.0", "1"], ["6.0", "0"]]
