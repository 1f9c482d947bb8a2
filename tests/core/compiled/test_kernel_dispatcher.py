# SPDX-License-Identifier: GPL-3.0-or-later
"""Each kernel is compiled once, and a compiler that fails leaves the same numbers, slowly."""

import os
import subprocess
import sys

import numpy as np
import pytest
from numba.core.caching import NullCache
from oracles import interpreted
from solver_scenes import cube_on_pad

from palpate.core.compiled import kernels
from palpate.core.compiled.kernels import inlined, kernel
from palpate.core.solver.simulation import Simulation
from palpate.core.solver.substep import advance_frames

pytestmark = pytest.mark.skipif(not kernels.COMPILED, reason="without numba nothing is compiled")

ONE_KERNEL = """
import numpy as np
from palpate.core.compiled import kernels
from palpate.core.geometry.rotations import write_rotation
out = np.zeros((3, 3))
write_rotation(np.array([0.8, 0.0, 0.6, 0.0]), out)
print(out.tobytes().hex(), kernels.are_interpreted(), sum(write_rotation.stats.cache_hits.values()))
"""


def one_kernel(code=ONE_KERNEL, **environment):
    """Run a kernel in a process of its own; return what it wrote on stdout and on stderr."""
    environment = {"PYTHONPATH": os.pathsep.join(sys.path), **os.environ, **environment}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.split(), done.stderr


@inlined
def _twice(number):
    return 2.0 * number


@kernel
def _add(values, step):
    return _twice(values[0]) + step


@kernel
def _add_both(values):
    return _add(values, 1) + _add(values, 2)


def test_a_kernel_in_another_is_translated_once_whatever_its_constants(monkeypatch):
    """`_add` is called with two constants and has one form, without machine code of its own."""
    monkeypatch.setattr(_add_both, "_cache", NullCache())  # what was kept by an earlier run is not translated at all
    assert _add_both(np.array([3.0])) == 15.0
    assert len(_add._linked) == 1 and len(_twice._linked) == 1
    assert not _add.overloads and len(_add_both.overloads) == 1


def test_a_run_is_compiled_and_has_one_form_of_its_driver():
    """Otherwise a compiler that fails would show here by slowness alone."""
    scenario = cube_on_pad(1.0, frames=3, dt=1e-3)
    for threads in (1, 2):
        simulation = Simulation(scenario, threads)
        simulation.advance()
        simulation.observe()
        simulation.advance_all()
    assert not kernels.are_interpreted()
    assert len(advance_frames.signatures) == 1 and (simulation.arrays[3].pair_loops[2:] > 0).all()


def test_a_kernel_that_others_call_can_be_called_from_python_too():
    assert _add_both(np.array([1.0])) == 7.0
    assert _add(np.array([5.0]), 1) == 11.0


@pytest.mark.parametrize("seed", [0, *(pytest.param(i, marks=pytest.mark.long("more random scenes")) for i in range(1, 6))])
def test_interpreted_kernels_give_the_same_bits_also_when_a_run_changes_over(seed):
    """200 scenes were compared by `python -m oracles.interpreted 200`: none differs."""
    assert interpreted.difference(interpreted.random_scene(seed)) == ""


def test_a_compiler_that_fails_is_said_once_and_the_numbers_are_the_same(monkeypatch, capfd):
    def fail(*_):
        raise RuntimeError("LLVM has no such target")

    with monkeypatch.context() as patch:
        patch.setattr(kernels.CPUDispatcher, "compile", fail)
        patch.setattr(kernels, "_failed", False)

        @kernel
        def three_times(number):
            return 3.0 * number

        try:
            assert (three_times(2.0), three_times(3.0)) == (6.0, 9.0)
            assert kernels.are_interpreted()
            kernels.compile_kernels()
            assert kernels.are_interpreted(), "it would only fail again"
        finally:
            patch.setattr(kernels, "_failed", False)
            kernels.compile_kernels()
    assert capfd.readouterr().err.splitlines() == [
        "Palpate's solver cannot be compiled here and computes slowly, with the same numbers: LLVM has no such target"
    ]


@pytest.mark.long("starts numba in processes of its own")
def test_a_full_disk_costs_only_what_would_be_kept(tmp_path):
    expected, _ = one_kernel(NUMBA_CACHE_DIR=str(tmp_path / "first"))
    full = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))\n" + ONE_KERNEL
    found, said = one_kernel(full, NUMBA_CACHE_DIR=str(tmp_path / "second"), PYTHONDONTWRITEBYTECODE="1")
    assert found == expected == [expected[0], "False", "0"]
    assert said.count("cannot be kept") == 1 and "NUMBA_CACHE_DIR" in said and len(said.splitlines()) == 1


@pytest.mark.long("starts numba in processes of its own")
def test_what_was_kept_is_used_and_an_unusable_folder_is_passed_over(tmp_path):
    expected, _ = one_kernel(NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    again, said = one_kernel(NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    assert again == [expected[0], "False", "1"] and said == ""
    (tmp_path / "file").touch()
    elsewhere, _ = one_kernel(NUMBA_CACHE_DIR=str(tmp_path / "file" / "cache"))
    assert elsewhere[:2] == [expected[0], "False"]


@pytest.mark.long("starts numba in processes of its own")
@pytest.mark.parametrize(
    "environment", [{"LC_ALL": "C", "LANG": "C"}, {"LC_ALL": "none.such"}, {"NUMBA_CPU_NAME": "unknown-9000"}]
)
def test_neither_locale_nor_an_unknown_processor_changes_a_number(environment, tmp_path):
    expected, _ = one_kernel(NUMBA_CACHE_DIR=str(tmp_path))
    found, _ = one_kernel(NUMBA_CACHE_DIR=str(tmp_path), **environment)
    assert found[0] == expected[0]


def test_another_numba_gets_a_sentence_and_the_same_numbers(tmp_path):
    other = "import numba; numba.__version__ = '9.1.0'\n" + ONE_KERNEL.replace(
        "sum(write_rotation.stats.cache_hits.values())", "0"
    )
    found, said = one_kernel(other, NUMBA_CACHE_DIR=str(tmp_path))
    assert found == [one_kernel(NUMBA_CACHE_DIR=str(tmp_path))[0][0], "True", "0"]
    assert said == "Palpate computes slowly, as it was never tried with numba 9.1.0: install numba 0.68.*\n"


@pytest.mark.long("starts numba in four processes")
def test_processes_that_compile_at_once_do_not_disturb_each_other(tmp_path):
    environment = {"PYTHONPATH": os.pathsep.join(sys.path), **os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    start = {"env": environment, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    running = [subprocess.Popen([sys.executable, "-c", ONE_KERNEL], **start) for _ in range(3)]
    answers = {process.communicate()[0].split()[0] for process in running}
    found, said = one_kernel(NUMBA_CACHE_DIR=str(tmp_path))
    assert answers == {found[0]} and found[1:] == ["False", "1"] and said == ""
