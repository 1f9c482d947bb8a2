# SPDX-License-Identifier: GPL-3.0-or-later
"""Functions for scripts, notebooks, commands and the add-on: plain functions and a few objects over the packages of core.

The root package offers the names of these modules as ``palpate.Sensor``, ``palpate.simulate`` and so on, and imports a module
when one of its names is first used. Arguments are checked here; everything is computed in core.
"""

__all__ = [
    "arguments",
    "bodies",
    "contacts",
    "experiment",
    "fits",
    "gap",
    "loop",
    "paths",
    "recordings",
    "running",
    "sensors",
    "simulation",
    "skins",
    "study",
]
