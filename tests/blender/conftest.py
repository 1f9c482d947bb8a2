# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender for tests: a user folder of its own, and for each test an empty file with the add-on enabled.

One pytest process serves many files, because starting Blender's module costs more than resetting it. Factory settings are
loaded and the add-on is enabled once for each module of tests, which takes six times as long as opening an empty file.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import tempfile

import pytest

# Before the first `import bpy`: no test reads or writes the preferences and extensions of whoever runs it.
_USER_FOLDER = tempfile.mkdtemp(prefix="palpate-tests-")
os.environ["BLENDER_USER_RESOURCES"] = _USER_FOLDER

import bpy  # noqa: E402


def pytest_sessionfinish():
    """Leave nothing behind in the temporary folder."""
    shutil.rmtree(_USER_FOLDER, ignore_errors=True)


def factory_settings():
    """Load factory settings, which disable every add-on, and enable ours the way Blender does.

    That is with preferences, and with bpy.data locked while it registers.
    """
    import addon_utils  # on the path only once bpy is imported

    bpy.ops.wm.read_factory_settings(use_empty=True)
    errors = []
    addon_utils.enable("palpate", default_set=True, handle_error=errors.append)
    if errors:
        raise errors[0]


def is_enabled() -> bool:
    """Tell whether the add-on is enabled in Blender's list and registered: a test may have ended either."""
    import addon_utils

    import palpate

    return addon_utils.check("palpate") == (True, True) and bool(palpate._registered)


def open_empty_file():
    """Open an empty file with the add-on enabled, and end what it does beside the file: timers, and a process that compiles."""
    from palpate.addon.session import first_use
    from palpate.addon.timeline import second_look

    second_look.stop()
    first_use.stop()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)  # handlers of the add-on forget the last file


@pytest.fixture(autouse=True, scope="module")
def blender():
    """Set Blender up for a module of tests."""
    factory_settings()


@pytest.fixture(autouse=True)
def scene(blender, request):
    """Return the scene of an empty file with the add-on enabled; again for a test that is marked `enabling`."""
    if request.node.get_closest_marker("enabling") or not is_enabled():
        factory_settings()
    else:
        open_empty_file()
    # Blender prints through C's own buffer; what earlier tests left there must not appear in what this one captures
    ctypes.CDLL(None).fflush(None)
    return bpy.context.scene


@pytest.fixture
def demo_blend(repository):
    return repository / "sample_blends" / "demo.blend"


@pytest.fixture
def settings():
    """Return the settings of a new object."""
    bpy.ops.mesh.primitive_plane_add()
    return bpy.context.object.palpate


@pytest.fixture
def refused(capfd):
    """Return a function that runs a command which has to refuse, and returns the only line that it says."""
    from palpate.commands import main

    def run(*words) -> str:
        capfd.readouterr()
        assert main([*map(str, words)]) == 1, words
        out, err = capfd.readouterr()
        assert out == "" and len(err.splitlines()) == 1, (words, out, err)
        return err.strip()

    return run
