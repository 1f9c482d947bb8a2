# SPDX-License-Identifier: GPL-3.0-or-later
"""What follows from computed forces: the sensor's readings, and numbers that summarise a recording.

:mod:`.readings` converts the normal forces of texels to readings in the sensor's unit. :mod:`.metrics` computes net forces,
slip, the free moment, and the ranges of scales that all figures share. :mod:`.magnetic_skin` has readings of several channels
from texels' displacements, by the fields of :mod:`.dipoles` and the motion inside of a :mod:`.layer`, its
presets :mod:`.skin_presets`, and :mod:`.readout_matrix` channels that are linear in what happens at several texels.
"""

__all__ = ["dipoles", "layer", "magnetic_skin", "metrics", "readings", "readout_matrix", "skin_presets"]
