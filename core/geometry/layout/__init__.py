# SPDX-License-Identifier: GPL-3.0-or-later
"""How texels become an image: one pixel per texel where they form a grid, a texture map of the surface otherwise."""

__all__ = ["grid_layout", "rasterization", "texture_maps"]
