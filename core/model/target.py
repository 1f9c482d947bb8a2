# SPDX-License-Identifier: GPL-3.0-or-later
"""A surface that sensors touch."""

from __future__ import annotations

from dataclasses import dataclass

from ..geometry.mesh import TriangleMesh
from .deformation import Deformation


@dataclass(frozen=True)
class Target:
    """A surface that presses on sensors.

    Attributes
    ----------
    name : str
    body : int
    mesh : TriangleMesh
        In the frame of its body, metres; its shape at the first frame.
    deformation : Deformation or None
        Where its vertices go, when it is not rigid.
    sensor : int or None
        The sensor whose surface this is, when it is soft: sensors then feel each other.
    smooth : bool
        Whether the contact normals are interpolated between the vertices, as for smooth shading, or those of the triangles.
    """

    name: str
    body: int
    mesh: TriangleMesh
    deformation: Deformation | None = None
    smooth: bool = False
    sensor: int | None = None
