# SPDX-License-Identifier: GPL-3.0-or-later
"""Geometry: triangle meshes, texels on them, contact points of texels, and the images that texels become.

:mod:`.mesh` checks meshes and computes their normals, areas and mass properties; :mod:`.bvh` finds where segments meet them.
:mod:`.texels` makes texels of a region's vertices, and :mod:`.projection` shows them from outside. :mod:`.layout` arranges
texels as images, and :mod:`.sampling` places texels on a surface that has none. :mod:`.point_surface` joins points of a
surface by triangles. :mod:`.smooth_depth` is the smooth surface of penetration between texels in rows and columns.
"""

__all__ = [
    "bvh",
    "contact_points",
    "layout",
    "mesh",
    "plausible_size",
    "point_surface",
    "projection",
    "rotations",
    "sampling",
    "shapes",
    "smooth_depth",
    "texels",
]
