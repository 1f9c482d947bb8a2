# SPDX-License-Identifier: GPL-3.0-or-later
"""How texels become a picture: rows and columns where they form a grid, a texture map of the surface otherwise."""

from .grid_layout import GridLayout, grid_layout
from .texture_maps import UVLayout, mapped_layout, uv_layout

__all__ = ["GridLayout", "UVLayout", "grid_layout", "mapped_layout", "uv_layout"]
