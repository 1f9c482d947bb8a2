# SPDX-License-Identifier: GPL-3.0-or-later
"""Damaged files of other programs' sensors: one sentence, or whole sensors."""

from __future__ import annotations

from .readers import Readers


class Imports(Readers):
    """Damaged sensors of other programs."""

    short, long = 300, 3500
    source, with_bakes = "damaged_sensors", False


AREA = Imports
