# SPDX-License-Identifier: GPL-3.0-or-later
"""Readings of several channels from what happens at texels: magnetic skins, and channels that are linear in forces.

:mod:`.magnetic_skin` has the fields of dipoles that move inside a soft layer, :mod:`.skin_presets` skins as they are built.
:mod:`.channel_readouts` makes these or linear channels the read-out of a sensor, whose channels every run then computes.
"""

__all__ = ["channel_readouts", "magnetic_skin", "skin_presets"]
