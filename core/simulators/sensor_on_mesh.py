# SPDX-License-Identifier: GPL-3.0-or-later
"""A sensor with the surface that it is on, as other simulators need it."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from ..geometry.grid_layout import GridLayout
from ..geometry.mesh import TriangleMesh, is_closed, vertex_normals
from ..model.sensor import Sensor
from ..model.sensor_parameters import DEPTH_PER_THICKNESS


@dataclass(frozen=True)
class SensorOnMesh:
    """A sensor and the surface that carries it, in one frame.

    Attributes
    ----------
    sensor : Sensor
        Its texels stand on vertices of `mesh`.
    mesh : TriangleMesh
        The sensor's mesh, of which the texels' region is a part; in the frame of the texels, metres.
    surface : TriangleMesh or None
        The surface that touches other things, where it is not `mesh`: texels that were laid onto an object are a mesh of
        their own.
    position, quaternion : (3,) float, metres, and (4,) float
        Of that frame in the scene.
    """

    sensor: Sensor
    mesh: TriangleMesh
    surface: TriangleMesh | None = None
    position: np.ndarray = field(default_factory=lambda: np.zeros(3))
    quaternion: np.ndarray = field(default_factory=lambda: np.array([1.0, 0.0, 0.0, 0.0]))

    @property
    def name(self) -> str:
        """Of the sensor."""
        return self.sensor.name

    @property
    def faces(self) -> np.ndarray:
        """(m, 3) int: the texels at the corners of the region's triangles."""
        number = np.full(len(self.mesh.vertices), -1)
        number[self.sensor.texels.vertex] = np.arange(len(self.sensor.texels))
        faces = number[self.mesh.triangles]
        return faces[(faces >= 0).all(axis=1)]

    @property
    def frames(self) -> np.ndarray:
        """(n, 3, 3) float: columns are each texel's tangent (x), bitangent (y) and normal (z)."""
        return np.stack([self.sensor.texels.tangent, self.sensor.texels.bitangent, self.sensor.texels.normal], axis=2)

    @property
    def solid(self) -> tuple[TriangleMesh, bool]:
        """The surface as a body with an inside, and whether a thickness was added.

        An open sheet has none: it becomes a layer as thick as the foam that `max_penetration` stands for.
        """
        surface = self.surface or self.mesh
        if is_closed(surface.triangles):
            return surface, False
        return thickened(surface, self.sensor.parameters.max_penetration / DEPTH_PER_THICKNESS), True


def thickened(mesh: TriangleMesh, thickness: float) -> TriangleMesh:
    """Return an open sheet as a layer below it: both sides and the walls along the open edges.

    Parameters
    ----------
    mesh : TriangleMesh
    thickness : float, metres
    """
    count = len(mesh.vertices)
    below = mesh.vertices - thickness * vertex_normals(mesh)
    directed = np.concatenate([mesh.triangles[:, [0, 1]], mesh.triangles[:, [1, 2]], mesh.triangles[:, [2, 0]]])
    key, back = directed[:, 0] * count + directed[:, 1], directed[:, 1] * count + directed[:, 0]
    a, b = directed[~np.isin(key, back)].T
    walls = np.concatenate([np.stack([b, a, a + count], axis=1), np.stack([b, a + count, b + count], axis=1)])
    triangles = np.concatenate([mesh.triangles, mesh.triangles[:, ::-1] + count, walls])
    return TriangleMesh(np.concatenate([mesh.vertices, below]), triangles)


def texel_arrays(item: SensorOnMesh) -> dict[str, np.ndarray]:
    """Return the arrays of the texels by name, in SI units and in the sensor's frame.

    ``position`` (m), ``normal``, ``tangent``, ``area`` (m²), where the texels form a grid ``row`` and ``column``, and what is
    painted as ``factor_k``, ``factor_friction`` and ``factor_gain``.
    """
    texels = item.sensor.texels
    arrays = {name: np.asarray(getattr(texels, name), float) for name in ("position", "normal", "tangent", "area")}
    if isinstance(texels.layout, GridLayout):
        arrays |= {"row": np.asarray(texels.layout.row), "column": np.asarray(texels.layout.column)}
    painted = {name: values for name, values in vars(item.sensor.painted).items() if values is not None}
    return arrays | {f"factor_{name}": np.asarray(values, float) for name, values in painted.items()}


def identifiers(names: Iterable[str]) -> dict[str, str]:
    """Return for each name a unique one of ASCII letters, digits and underscores that begins with a letter."""
    chosen: dict[str, str] = {}
    for name in names:
        clean = re.sub(r"\W", "_", name, flags=re.ASCII)
        clean = base = clean if re.match("[A-Za-z]", clean) else f"s_{clean}"
        number = 2
        while clean in chosen.values():
            clean, number = f"{base}_{number}", number + 1
        chosen[name] = clean
    return chosen


def unmodelled(item: SensorOnMesh) -> list[str]:
    """Return, in words, what only Palpate computes of a sensor."""
    law = item.sensor.parameters
    found = ["damping of texels (cn)", "LuGre friction (sigma0, sigma1, x0, mud, ct)", "the reading (gain, zero, unit)"]
    if law.normal_law != type(law)().normal_law:
        found.append(f"the normal law '{law.normal_law}'")
    if law.points_per_texel > 1:
        found.append(f"{law.points_per_texel} contact points per texel")
    painted = [name for name, values in vars(item.sensor.painted).items() if values is not None]
    if painted:
        found.append(f"painted {', '.join(painted)}")
    if item.sensor.effects:
        found.append(f"effects ({', '.join(effect.name for effect in item.sensor.effects)})")
    return found
