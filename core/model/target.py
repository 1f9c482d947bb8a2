# SPDX-License-Identifier: GPL-3.0-or-later
"""A surface that sensors touch."""

from __future__ import annotations

from dataclasses import dataclass

from ..geometry.mesh import TriangleMesh
from .deformation import Deformation


@dataclass(frozen=True)
class Target:
    """A surface that sensors can be in contact with.

    Attributes
    ----------
    name : str
    body : int
        Index in :attr:`.Scenario.bodies`.
    mesh : TriangleMesh
        In the frame of its body, metres; its shape at the first frame.
    deformation : Deformation or None
        How its vertices move when the target is not rigid.
    sensor : int or None
        Index of the sensor whose surface this is, when the target is the soft surface of another sensor.
    smooth : bool
        True when contact normals are interpolated between the vertices, as for smooth shading; False when they are the normals
        of the triangles.
    """

    name: str
    body: int
    mesh: TriangleMesh
    deformation: Deformation | None = None
    smooth: bool = False
    sensor: int | None = None
