# SPDX-License-Identifier: GPL-3.0-or-later
"""The OpenEXR library is tried in a process of its own before it is loaded beside Blender; the result is kept."""

from __future__ import annotations

import json
import subprocess
import sys

from palpate.addon.session import dependencies, openexr_check
from palpate.core.io import exr_backend, exr_library

CRASH = (sys.executable, "-c", "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)")


def test_the_library_works_beside_this_blender():
    check = exr_backend._is_safe
    assert isinstance(check, openexr_check.Check)
    assert openexr_check.run(check.command)
    assert exr_backend.backend().module is exr_library
    assert "the OpenEXR library" in dependencies.debug_info()


def test_a_crash_of_the_child_is_an_answer_and_is_asked_for_once(tmp_path, monkeypatch):
    memory, runs = tmp_path / "openexr.json", []
    monkeypatch.setattr(openexr_check, "run", lambda command, run=openexr_check.run: runs.append(command) or run(command))
    crashing = openexr_check.Check(CRASH, "crashing", memory)
    assert not crashing() and not crashing() and len(runs) == 1
    silent = openexr_check.Check((sys.executable, "-c", "pass"), "silent", memory)
    assert not silent(), "an end without the sentence of success is no success"
    assert json.loads(memory.read_text()) == {"crashing": False, "silent": False}
    working = openexr_check.Check(openexr_check._command(), "working", memory)
    assert working() and working() and len(runs) == 3
    memory.write_text("no JSON")
    assert not crashing() and len(runs) == 4


def test_no_answer_is_not_kept(tmp_path, monkeypatch):
    memory = tmp_path / "openexr.json"
    assert not openexr_check.Check((str(tmp_path / "missing"),), "missing", memory)()
    monkeypatch.setattr(openexr_check, "TIME_LIMIT", 0.05)
    sleeping = openexr_check.Check((sys.executable, "-c", "import time; time.sleep(5)"), "sleeping", memory)
    assert not sleeping()
    assert not memory.exists()


def test_enabling_the_add_on_neither_checks_nor_loads_the_library():
    program = (
        "import sys, subprocess, palpate\n"
        "subprocess.Popen = None\n"
        "palpate.register()\n"
        "from palpate.core.io import exr_backend\n"
        "assert exr_backend._is_safe is not None and exr_backend._chosen is None\n"
        "assert not {'OpenEXR', 'Imath'} & set(sys.modules)\n"
        "palpate.unregister()\n"
        "assert exr_backend._is_safe is None\n"
    )
    assert subprocess.run([sys.executable, "-c", program], timeout=60).returncode == 0
