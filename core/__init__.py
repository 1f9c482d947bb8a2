# SPDX-License-Identifier: GPL-3.0-or-later
"""Computes on arrays, without Blender: contact forces of tactile sensors, their files and figures, and fits to measurements.

The packages below stand in the order of their imports: each uses only those before it. Importing `core` is cheap; numba, scipy,
matplotlib and trimesh are loaded by the modules that use them. All quantities are in SI units and float64; frames are
right-handed and quaternions are ordered (w, x, y, z).
"""

__all__ = [
    "errors",
    "version",
    "compiled",
    "jobs",
    "geometry",
    "model",
    "skins",
    "laws",
    "effects",
    "response",
    "solver",
    "io",
    "study",
    "figures",
    "export",
    "simulators",
    "gap",
]
