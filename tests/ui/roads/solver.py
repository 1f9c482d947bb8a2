# SPDX-License-Identifier: GPL-3.0-or-later
"""Shared by roads that play: the solver's first use is a road of its own (first_use.py), the others wait for it before."""

import importlib


def is_ready():
    return importlib.import_module("bl_ext.user_default.palpate.addon.session.first_use").is_ready()


def wait(ui):
    """Wait until the solver is compiled, which takes half a minute in the first road of a run."""
    yield from ui.wait_until(is_ready, "the solver is ready", timeout=900)
