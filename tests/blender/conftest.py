# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender for tests: a user folder of its own, and for each test an empty scene with the add-on enabled.

One pytest process serves all files, because starting Blender's module costs more than resetting it.
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


def enable_palpate():
    """Enable the add-on the way Blender does: with preferences, and bpy.data locked while it registers."""
    import addon_utils  # on the path only once bpy is imported

    errors = []
    module = addon_utils.enable("palpate", default_set=True, handle_error=errors.append)
    if errors:
        raise errors[0]
    return module


@pytest.fixture(autouse=True)
def scene():
    """Return the scene of an empty file in factory settings, with the add-on enabled."""
    bpy.ops.wm.read_factory_settings(use_empty=True)  # disables every add-on, ours too
    enable_palpate()
    # Blender prints through C's own buffer; what earlier tests left there must not appear in what this one captures
    ctypes.CDLL(None).fflush(None)
    return bpy.context.scene
