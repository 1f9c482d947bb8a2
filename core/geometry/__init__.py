# SPDX-License-Identifier: GPL-3.0-or-later
"""Geometry: triangle meshes, texels on them, contact points of texels, and the images that texels become.

:mod:`.mesh` checks meshes and computes their normals, areas and mass properties; :mod:`.bvh` finds where segments meet them.
:mod:`.texels` makes texels of a region's vertices and shows them from outside. :mod:`.grid_layout` and :mod:`.texture_maps`
arrange texels as images. :mod:`.texel_arrays` and :mod:`.scattered_points` place texels on a surface that has none.
:mod:`.point_surface` joins points of a surface by triangles.
"""

__all__ = [
    "bvh",
    "contact_points",
    "grid_layout",
    "mesh",
    "point_surface",
    "rotations",
    "scattered_points",
    "shapes",
    "texel_arrays",
    "texels",
    "texture_maps",
]
