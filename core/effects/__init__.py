# SPDX-License-Identifier: GPL-3.0-or-later
"""Behaviour of real sensors beyond the base model: settle, lag, stick, wear, drift, leak from texel to texel.

Each such phenomenon is an effect that a sensor can be given. :mod:`.engine` says what an effect is and applies it to forces and
readings; :mod:`.library` holds the effects, one module each. The registry of the engine finds them there by name, so a new
module with a ``KIND`` is all that a new effect needs. No file outside the library names an effect.
"""

__all__ = ["engine"]
