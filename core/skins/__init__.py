# SPDX-License-Identifier: GPL-3.0-or-later
"""Readings of several channels from what happens at texels: magnetic skins, and channels that are linear in forces.

:mod:`.magnetic_skin` has the fields of :mod:`.dipoles` that move inside of a :mod:`.layer`, :mod:`.skin_presets` skins as they
are built, and :mod:`.readout_matrix` linear channels. :mod:`.channel_readouts` makes either the read-out of a sensor, whose
channels every run then computes.
"""

__all__ = ["channel_readouts", "dipoles", "layer", "magnetic_skin", "readout_matrix", "skin_presets"]
