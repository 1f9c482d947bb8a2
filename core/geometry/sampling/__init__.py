# SPDX-License-Identifier: GPL-3.0-or-later
"""Placing texels on a surface: in rows and columns along straightest geodesics, or evenly without rows."""

__all__ = ["even_points", "poisson_disk", "straightest_geodesics", "texel_arrays"]
