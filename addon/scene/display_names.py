# SPDX-License-Identifier: GPL-3.0-or-later
"""Names, stored in .blend files, of what a bake puts on a sensor to be seen: reading a scene must leave these things out."""

from __future__ import annotations

UV_MAP = "Palpate"
"""Texture coordinates of the heat map."""
HEAT_MAP_MODIFIER = "Palpate Heat Map"
"""Geometry nodes that store the baked force on the vertices."""
INDENTATION_MODIFIER = "Palpate Indentation"
"""Geometry nodes that move the surface of a sensor inwards by the baked penetration."""
MODIFIERS = {HEAT_MAP_MODIFIER, INDENTATION_MODIFIER}
REST_POSITION = "palpate_rest"
"""Vertex attribute of an indented mesh: where its vertices are without indentation; those of its own mesh come first."""
STATED_NORMAL = "palpate_normal"
"""Vertex attribute of an imported sensor: normals that its file states, where they are not those of the surface."""
GAP_COLORS = "Palpate Gap"
"""Colour attribute of a sensor: the errors of its texels in measurements."""
OLD_MATERIAL = ".palpate_old_material"
"""Face attribute of a baked sensor: the material index before the heat map; −1 on faces that kept theirs."""
