# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects in the formulas of the library, written down a second time from docs/effects.md, with their true values."""

from __future__ import annotations

from .other import Maker

OWN: dict[str, Maker] = {}
