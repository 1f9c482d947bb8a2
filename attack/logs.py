# SPDX-License-Identifier: GPL-3.0-or-later
"""Damaged logs and answers through ``palpate rig new``: one sentence, or a whole rig."""

from __future__ import annotations

from .readers import Readers


class Logs(Readers):
    """Damaged logs."""

    short, long = 300, 4500
    source, with_bakes = "damaged_logs", False


AREA = Logs
