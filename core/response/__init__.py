# SPDX-License-Identifier: GPL-3.0-or-later
"""What follows from computed forces: :mod:`.metrics` are numbers that summarise a recording.

They are net forces, slip, the free moment, and the ranges of scales that all figures share. Readings are computed by
:mod:`..effects.engine.readout_chain`, those of several channels in :mod:`..skins`.
"""

__all__ = ["metrics"]
