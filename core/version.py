# SPDX-License-Identifier: GPL-3.0-or-later
"""The version of Palpate, which files say that they were written with."""

VERSION = "0.2.0"  # the same as in pyproject.toml and blender_manifest.toml; tests/core/test_packaging.py compares them
