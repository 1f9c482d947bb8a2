# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies in contact with sensors or carrying them: boxes, spheres and meshes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ..core.geometry import shapes
from ..core.geometry.mesh import TriangleMesh, mass_properties, turned_outwards
from ..core.model import body as model
from . import arguments
from .arguments import ArgumentError
from .paths import LEVEL, Path, PathLike, path_of, standing

SPHERE_SUBDIVISIONS = 4
"""Of an icosahedron: 5120 faces, whose shading is smooth, so that texels meet the normals of the sphere."""

CAPSULE_RINGS = 24
"""Rings of vertices in each half sphere of a capsule, and a quarter of those around it: as fine as the sphere."""


class Placement(TypedDict, total=False):
    """Further arguments of the functions that make bodies; see :meth:`Body.from_mesh`."""

    quaternion: ArrayLike
    path_of_motion: PathLike
    velocity: ArrayLike
    angular_velocity: ArrayLike
    name: str


@dataclass(frozen=True, eq=False, repr=False)
class Body:
    """A rigid body: free when it has a mass, else moved along a path, else fixed.

    Make one with :meth:`box`, :meth:`sphere`, :meth:`capsule`, :meth:`plane` or :meth:`from_mesh`.

    Attributes
    ----------
    name : str
    mesh : TriangleMesh
        In the frame of the body, metres.
    path : Path
        Of the frame of the body in the world; of a free body its first pose counts.
    mass : float or None, kg
    velocity, angular_velocity : (3,) float, m/s and rad/s, world frame
        Of a free body at the start.
    smooth : bool
        Contact normals are interpolated between vertices.
    shape : Shape or None
        What the mesh stands for; :class:`PressedSensor` and :class:`PressedSensors` compute contacts with it in closed form.
    """

    name: str
    mesh: TriangleMesh
    path: Path
    mass: float | None = None
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))
    angular_velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))
    smooth: bool = False
    shape: shapes.Shape | None = None

    @classmethod
    def box(
        cls,
        size: ArrayLike,
        mass: float | None = None,
        position: ArrayLike = (0.0, 0.0, 0.0),
        **placement: Unpack[Placement],
    ) -> Body:
        """Return a box about the origin of its frame; arguments as of :meth:`from_mesh`.

        Parameters
        ----------
        size : float or (3,) float, metres
            Full length of its edges.
        mass : float, kg, optional
            Makes it free.
        position : (3,) float, metres
        **placement
        """
        import trimesh

        edges = arguments.numbers(np.tile(size, 3) if np.ndim(size) == 0 else size, (3,), "size")
        arguments.number(edges.min(), "size", above_zero=True)
        placement.setdefault("name", "box")
        made = cls._of(trimesh.creation.box(edges), "size", mass, position, placement)
        return replace(made, shape=shapes.box((float(edges[0]), float(edges[1]), float(edges[2]))))

    @classmethod
    def sphere(
        cls,
        radius: float,
        mass: float | None = None,
        position: ArrayLike = (0.0, 0.0, 0.0),
        **placement: Unpack[Placement],
    ) -> Body:
        """Return a sphere about the origin of its frame; arguments as of :meth:`from_mesh`.

        Parameters
        ----------
        radius : float, metres
        mass : float, kg, optional
            Makes it free.
        position : (3,) float, metres
        **placement
        """
        import trimesh

        radius = arguments.number(radius, "radius", above_zero=True)
        ball = trimesh.creation.icosphere(subdivisions=SPHERE_SUBDIVISIONS, radius=radius)
        placement.setdefault("name", "sphere")
        return replace(cls._of(ball, "radius", mass, position, placement), smooth=True, shape=shapes.sphere(radius))

    @classmethod
    def capsule(
        cls,
        radius: float,
        length: float,
        mass: float | None = None,
        position: ArrayLike = (0.0, 0.0, 0.0),
        **placement: Unpack[Placement],
    ) -> Body:
        """Return a capsule about the origin of its frame; arguments as of :meth:`from_mesh`.

        Parameters
        ----------
        radius : float, metres
        length : float, metres
            Of its cylinder, along z, without the two half spheres.
        mass : float, kg, optional
            Makes it free.
        position : (3,) float, metres
        **placement
        """
        radius, length = (
            arguments.number(value, name, above_zero=True) for value, name in ((radius, "radius"), (length, "length"))
        )
        placement.setdefault("name", "capsule")
        made = cls._of(_capsule_mesh(radius, length), "radius", mass, position, placement)
        return replace(made, smooth=True, shape=shapes.capsule(radius, length))

    @classmethod
    def plane(cls, size: float = 1.0, position: ArrayLike = (0.0, 0.0, 0.0), **placement: Unpack[Placement]) -> Body:
        """Return the ground: all below the xy plane of its frame; arguments as of :meth:`from_mesh`.

        It is unbounded in :class:`PressedSensor` and :class:`PressedSensors`; :func:`simulate` takes a block of a size.

        Parameters
        ----------
        size : float, metres
            Edge of the block's square upper side; it is a tenth as thick.
        position : (3,) float, metres
        **placement
        """
        import trimesh

        size = arguments.number(size, "size", above_zero=True)
        block = trimesh.creation.box((size, size, 0.1 * size))
        block.apply_translation([0.0, 0.0, -0.05 * size])
        placement.setdefault("name", "plane")
        return replace(cls._of(block, "size", None, position, placement), shape=shapes.plane())

    @classmethod
    def from_mesh(
        cls, mesh: Any, mass: float | None = None, position: ArrayLike = (0.0, 0.0, 0.0), **placement: Unpack[Placement]
    ) -> Body:
        """Return a body with the surface of a mesh.

        Parameters
        ----------
        mesh : path, (vertices, faces) or mesh of trimesh
            STL, PLY, OBJ or OFF; metres.
        mass : float, kg, optional
            Makes it free: forces and gravity move it. Centre of mass and inertia are those of the uniform solid.
        position : (3,) float, metres
        quaternion : (4,) float
            (w, x, y, z).
        path_of_motion : optional
            Poses (m, 3) or (m, 7), one for each frame; a pair of times (m,) and poses; or a CSV file with the columns time, x,
            y, z and, for a turning body, qw, qx, qy, qz.
        velocity, angular_velocity : (3,) float, m/s and rad/s
            Of a free body at the start.
        name : str, optional
            Default: that of the file.

        Raises
        ------
        PalpateError
            An argument has a wrong type, shape or value, or the mesh is no surface.
        """
        return cls._of(mesh, "mesh", mass, position, placement)

    @classmethod
    def _of(cls, mesh: Any, argument: str, mass: float | None, position: ArrayLike, placement: Placement) -> Body:
        """Return a body; `argument` is what the size of its mesh follows from."""
        arguments.known(placement, sorted(Placement.__annotations__), "argument")
        name = arguments.name_from(mesh, placement.get("name"), "body")
        surface = turned_outwards(arguments.mesh_of(mesh, "mesh", name), name)
        arguments.size_checked(surface.vertices, arguments.LARGEST_BODY, argument, f"body '{name}'")
        path, turn = placement.get("path_of_motion"), placement.get("quaternion", LEVEL)
        if mass is not None and path is not None:
            raise ArgumentError(f"Body '{name}' has a mass, so that forces move it, and a path_of_motion: leave one out.")
        return cls(
            name,
            surface,
            standing(position, turn) if path is None else path_of(path, "path_of_motion", turn),
            None if mass is None else arguments.number(mass, "mass", above_zero=True),
            arguments.numbers(placement.get("velocity", np.zeros(3)), (3,), "velocity"),
            arguments.numbers(placement.get("angular_velocity", np.zeros(3)), (3,), "angular_velocity"),
        )

    @property
    def position(self) -> np.ndarray:
        """(3,) float, metres: where it starts."""
        return self.path.positions[0]

    @property
    def quaternion(self) -> np.ndarray:
        """(4,) float: its orientation at the start, (w, x, y, z)."""
        return self.path.quaternions[0]

    def moved(self, motion: PathLike | Path, argument: str = "motion") -> Body:
        """Return the same body, moved along a path instead of by forces; `motion` as `path_of_motion` of :meth:`from_mesh`."""
        return replace(self, path=path_of(motion, argument, self.quaternion), mass=None)

    def of_model(self, fps: float) -> tuple[model.Body, list[str]]:
        """Return the body as core has it, and warnings about its mesh."""
        motion = self.path.motion(fps)
        if self.mass is None:
            return model.Body(self.name, motion), []
        center, inertia, notes = mass_properties(self.mesh, self.mass, self.name)
        made = model.Body(self.name, motion, True, self.mass, center, inertia, self.velocity, self.angular_velocity)
        return made, notes

    def __repr__(self) -> str:
        size = " × ".join(f"{1e3 * edge:.3g}" for edge in np.ptp(self.mesh.vertices, axis=0))
        how = "fixed" if len(self.path.positions) == 1 else f"moved through {len(self.path.positions)} poses"
        return f"<Body '{self.name}': {size} mm, {f'free, {self.mass:g} kg' if self.mass is not None else how}>"


def _capsule_mesh(radius: float, length: float) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of a closed capsule along z: rings of vertices between two poles."""
    around = 4 * CAPSULE_RINGS
    turn, angle = 0.5 * np.pi * np.arange(CAPSULE_RINGS) / CAPSULE_RINGS, 2 * np.pi * np.arange(around) / around
    wide, high = radius * np.cos(turn), 0.5 * length + radius * np.sin(turn)
    wide, high = np.concatenate([wide[::-1], wide]), np.concatenate([-high[::-1], high])
    rings = np.stack(np.broadcast_arrays(wide[:, None] * np.cos(angle), wide[:, None] * np.sin(angle), high[:, None]), axis=2)
    pole = 0.5 * length + radius
    vertices = np.concatenate([rings.reshape(-1, 3), [[0.0, 0.0, -pole], [0.0, 0.0, pole]]])
    here, beside = np.arange(around), np.roll(np.arange(around), -1)
    rows = around * np.arange(len(wide) - 1)[:, None]
    a, b = (rows + here).ravel(), (rows + beside).ravel()
    last, bottom, top = around * (len(wide) - 1), np.full(around, len(vertices) - 2), np.full(around, len(vertices) - 1)
    sides = [(a, b, b + around), (a, b + around, a + around), (beside, here, bottom), (last + here, last + beside, top)]
    return vertices, np.concatenate([np.stack(side, axis=1) for side in sides])
