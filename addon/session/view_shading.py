# SPDX-License-Identifier: GPL-3.0-or-later
"""What the shading of a 3D view shows."""

from __future__ import annotations


def is_xray(shading) -> bool:
    """Return True where a 3D view draws objects see-through: Solid and Wireframe have a switch each."""
    if shading.type == "WIREFRAME":
        return shading.show_xray_wireframe
    return shading.type == "SOLID" and shading.show_xray
