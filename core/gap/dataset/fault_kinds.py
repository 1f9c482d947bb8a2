# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds of faults that data may have; a rig names those that are to be put right."""

from __future__ import annotations

FAULT_KINDS = {
    "sign": "the other sign",
    "unit": "a wrong unit",
    "reversed-channels": "channels in another order",
    "swapped-channels": "swapped channels",
    "clock-shift": "clocks of stimulus and response that are shifted",
    "repeated-samples": "repeated samples",
    "stuck-logger": "a stuck logger",
    "saturated-converter": "a converter at its rail",
}
"""Kinds of faults, in words."""
