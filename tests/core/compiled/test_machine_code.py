# SPDX-License-Identifier: GPL-3.0-or-later
"""Machine code of kernels that was packed elsewhere is loaded where it fits, and only there."""

import importlib.util
import json
import os
import subprocess
import sys
import zlib

import pytest

from palpate.core.compiled import kernels, machine_code, numba_internals
from palpate.core.geometry import rotations

if importlib.util.find_spec("numba") is None or os.environ.get("PALPATE_NUMBA") == "0":
    pytest.skip("needs numba: without it there is no machine code", allow_module_level=True)

COMMON = """
import importlib, json, runpy, sys
from pathlib import Path
process, package, packed = sys.argv[1:]
runpy.run_path(process)["load"](package)
if package != "palpate":
    sys.modules["palpate"] = None  # it has one name only
machine_code = importlib.import_module(f"{package}.core.compiled.machine_code")
kernel = importlib.import_module(f"{package}.core.geometry.rotations").add_triple_product
machine_code.PACKED_FILE = Path(packed)
import numpy as np
def call():
    table = np.arange(36.0).reshape(6, 6)
    matrix = np.zeros((6, 6))
    kernel(matrix, 0, 0, table, 6, table + table.T, table / 7.0, 6, 0.1)
    return [value.hex() for value in matrix.ravel().tolist()]
"""
MAKE = COMMON + "print(json.dumps(call()))\nmachine_code.PACKED_FILE.write_bytes(machine_code.pack([kernel]))"
USE = (
    COMMON
    + """
count, result = machine_code.install([kernel]), call()
print(json.dumps([count, sum(kernel.stats.cache_hits.values()), sum(kernel.stats.cache_misses.values()), result]))
"""
)


def run(script, repository, cache, package, packed, **environment):
    """Run a script in a Python of its own, with a cache of its own, where the package may have another name."""
    process = repository / "core" / "solver" / "precompile_process.py"
    command = [sys.executable, "-c", script, str(process), package, str(packed)]
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache)} | environment
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def made(repository, tmp_path_factory):
    """Return a file with the machine code of one kernel for the common processor, and what the kernel computed there."""
    folder = tmp_path_factory.mktemp("made")
    name, features = machine_code.target()
    wanted = {"NUMBA_CPU_NAME": name, "NUMBA_CPU_FEATURES": ",".join(f"+{feature}" for feature in features)}
    return folder / "code.bin", run(MAKE, repository, folder / "cache", "palpate", folder / "code.bin", **wanted)


@pytest.fixture
def packed(made, monkeypatch):
    """Return what was packed, in a place where this process looks for it."""
    path = made[0].with_name("changed.bin")
    path.write_bytes(made[0].read_bytes())
    monkeypatch.setattr(machine_code, "PACKED_FILE", path)
    return path


def test_the_installed_numba_compiles_and_its_code_can_be_packed():
    """Otherwise everything here would be tested by nothing: an import that numba no longer knows turns compiling off."""
    assert kernels.COMPILED, numba_internals.REASON
    assert numba_internals.CAN_PACK


@pytest.mark.parametrize("package", ["palpate", "bl_ext.user_default.palpate"])
def test_nothing_is_compiled_and_the_numbers_are_the_same(made, repository, tmp_path, package):
    count, hits, misses, result = run(USE, repository, tmp_path / "cache", package, made[0])
    assert (count, hits, misses) == (1, 1, 0)
    assert result == made[1]


def test_code_for_another_numba_kernel_or_processor_is_left_alone(packed, monkeypatch):
    assert machine_code.fits()
    for change in ({"numba": "0.1"}, {"fingerprint": "0" * 12}, {"python": "cpython-27"}, {"features": ["warp-drive"]}):
        head, _, body = packed.read_bytes().partition(b"\n")
        with monkeypatch.context() as patch:
            other = packed.with_name("other.bin")
            other.write_bytes(json.dumps(json.loads(head) | change).encode() + b"\n" + body)
            patch.setattr(machine_code, "PACKED_FILE", other)
            assert not machine_code.fits() and machine_code.install([rotations.add_triple_product]) == 0, change


@pytest.mark.parametrize("damage", ["empty", "cut", "flipped", "no line"])
def test_a_damaged_file_is_left_alone(packed, damage):
    whole = packed.read_bytes()
    flipped = bytearray(whole)
    flipped[-5] ^= 1
    packed.write_bytes({"empty": b"", "cut": whole[:-7], "flipped": bytes(flipped), "no line": zlib.compress(whole)}[damage])
    assert machine_code.install([rotations.add_triple_product]) == 0


def test_without_a_file_nothing_is_installed(monkeypatch, tmp_path):
    monkeypatch.setattr(machine_code, "PACKED_FILE", tmp_path / "none.bin")
    assert not machine_code.fits() and machine_code.install([rotations.add_triple_product]) == 0
