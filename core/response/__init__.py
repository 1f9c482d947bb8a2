# SPDX-License-Identifier: GPL-3.0-or-later
"""What follows from computed forces: the sensor's readings, and numbers that summarise a recording.

:mod:`.readings` converts the normal forces of texels to readings in the sensor's unit. :mod:`.metrics` computes net forces,
slip, the free moment, and the ranges of scales that all figures share. Readings of several channels are in :mod:`..skins`.
"""

__all__ = ["metrics", "readings"]
