# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled kernels are never older than their source."""

import os
import platform
import re
import shutil
import subprocess
import sys
from typing import NamedTuple

import numpy as np
import pytest
from solver_scenes import cube_on_pad

from palpate.core.compiled import kernel_fingerprint, kernels, numba_internals
from palpate.core.compiled.struct_reference import by_reference
from palpate.core.laws.contact_law import read_law
from palpate.core.solver.dynamics import contact_assembly, friction_state
from palpate.core.solver.simulation import Simulation

numba = pytest.importorskip("numba")


@by_reference
class Inner(NamedTuple):
    values: np.ndarray


@by_reference
class Outer(NamedTuple):
    kind: np.ndarray
    inner: Inner
    number: int


@kernels.kernel
def total(outer):
    return outer.kind[0, 1] + outer.inner.values[2] + outer.number


CALLER = """
from .callee import value
from .kernels import kernel

@kernel
def twice():
    return 2.0 * value()

if __name__ == "__main__":
    print(twice(), sum(twice.stats.cache_hits.values()))
"""
CALLEE = """
from .kernels import kernel

@kernel
def value():
    return {}
"""


@pytest.mark.long("starts numba in three processes")
@pytest.mark.skipif(not kernels.COMPILED, reason="without numba nothing is kept")
def test_a_kernel_is_compiled_anew_when_one_that_it_calls_has_changed(tmp_path):
    """In another file, which numba's own check does not see. What has not changed comes from the cache."""
    package = tmp_path / "kernels"
    package.mkdir()
    (package / "__init__.py").touch()
    for module in (kernels, kernel_fingerprint, numba_internals):
        shutil.copy(module.__file__, package)
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


@pytest.mark.skipif(not kernels.COMPILED or platform.machine() not in ("x86_64", "AMD64"), reason="reads x86 machine code")
@pytest.mark.parametrize("name", ["_sum_contacts", "_update_bristles"])
def test_loops_over_contacts_run_in_vector_registers(name):
    """A call or a branch in such a loop changes no number and only makes it five times slower. Its root shows it."""
    simulation = Simulation(cube_on_pad(1.0, frames=1, dt=1e-3))
    workspace, law = simulation._workspace, read_law(simulation._model.pairs.law, 0)
    compiled = numba.njit(error_model="numpy")(
        getattr(contact_assembly if name == "_sum_contacts" else friction_state, name).py_func
    )
    if name == "_sum_contacts":
        compiled(0, 1e-3, law, simulation._model, simulation._state.effect_memory, workspace)
    else:
        compiled(0, friction_state.motion_values(workspace.pairs.known_motion[0]), simulation._state, workspace)
    (code,) = compiled.inspect_asm().values()
    assert re.search(r"^\s+v?sqrtpd\s", code, re.MULTILINE), "the square root is taken of one number at a time"


def test_tuples_that_kernels_take_by_reference_stay_tuples():
    """What a kernel reads through the pointer is what Python reads, in tuples within tuples as well."""

    inner = Inner(np.array([1.0, 2.0, 3.0]))
    outer = Outer(np.array([[10, 20], [30, 40]]), inner, 400)
    assert (outer.kind[0, 1], outer.inner.values[2], outer.number) == (20, 3.0, 400)
    assert total(outer) == 423.0
    assert total(outer._replace(number=7, inner=Inner(np.array([0.0, 0.0, 0.5])))) == 27.5


@pytest.mark.skipif(not kernels.COMPILED, reason="only compiled code has numba's types")
def test_instances_have_one_type_where_numba_would_tell_none_apart():
    """The type is looked up by what a field is; it is the one that numba finds for each field."""
    grid = np.zeros((4, 4))
    frozen = grid.copy()
    frozen.flags.writeable = False
    kinds = [grid, grid.T[:2], grid[:, :2], grid[:2, ::2], frozen]
    kinds += [np.zeros((4, 4), np.int32), np.zeros((4, 4), bool), np.zeros(4)]
    kinds.append(np.frombuffer(bytes(129), np.uint8)[1:].view(float).reshape(4, 4))  # not aligned
    types = []
    for kind in kinds:
        outers = [Outer(kind[...], Inner(np.ones(3)), 4), Outer(kind[...], Inner(np.zeros(5)), 5)]
        assert outers[0].numba_type is outers[1].numba_type
        assert outers[0].numba_type.fields == tuple(numba.typeof(field) for field in outers[0])
        types.append(outers[0].numba_type)
    for i, one in enumerate(kinds):
        for j, other in enumerate(kinds):
            assert (types[i] is types[j]) == (numba.typeof(one) == numba.typeof(other)), (i, j)


@pytest.mark.skipif(not kernels.COMPILED, reason="only compiled code takes addresses")
def test_a_field_may_not_hide_what_a_reference_keeps():
    class Wrong(NamedTuple):
        address: int

    with pytest.raises(TypeError, match="address"):
        by_reference(Wrong)
