# SPDX-License-Identifier: GPL-3.0-or-later
"""The arrays of :mod:`.press_kernels`, which lie on the device."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from ...geometry.bvh import Tree
from ...geometry.mesh import TriangleMesh
from ...geometry.shapes import Shape
from ...geometry.texels import Texels
from ...solver.jumps import jump_arrays
from ..load_search import IntArray

BoolArray: TypeAlias = np.ndarray
"""An array of truth values; the translation goes by this name."""


class SensorArrays(NamedTuple):
    """A sensor with n texels and N contact points.

    Attributes
    ----------
    dt : float, seconds
    reach : float, metres
        Maximum penetration.
    share : float
        Share of a texel's force that one of its contact points has.
    pulls : int
        Whether effects can make the normal force negative.
    frame : (12, N) float
        See :attr:`.Points.frame`; by columns, which neighbouring threads of a GPU read together.
    first_point : (n + 1,) int
        Where the contact points of each texel begin.
    multipliers : (N, 2) float
        Painted multipliers of stiffness and friction.
    law : (1 or E, 10) float
        Contact law of one contact point, the same for all environments or one for each.
    conversion : (n or E n, 2) float
        Zero and scale of each texel's reading, the same for all environments or one after the other.
    force_constants, friction_constants, reading_constants : (E, laws, 2, c) float
        Constants of the laws of effects, for a step and for no time; for readings, for no time and for a step.
    """

    dt: float
    reach: float
    share: float
    pulls: int
    frame: np.ndarray
    first_point: IntArray
    multipliers: np.ndarray
    law: np.ndarray
    conversion: np.ndarray
    force_constants: np.ndarray
    friction_constants: np.ndarray
    reading_constants: np.ndarray


class TargetArrays(NamedTuple):
    """T targets, each a mesh of the tree or a simple shape.

    Attributes
    ----------
    kind : (T,) int
        MESH, SPHERE, BOX, CAPSULE or PLANE.
    size : (T, 3) float, metres
        See :attr:`.Shape.size`.
    mesh : (T,) int
        Which of the tree's meshes.
    """

    kind: IntArray
    size: np.ndarray
    mesh: IntArray


class Jumps(NamedTuple):
    """Arrays for finding targets that go through the sensor within a step; fields as in :class:`.JumpSearch`."""

    frame: np.ndarray
    bound: np.ndarray
    sphere: np.ndarray
    centre: np.ndarray
    jumped: BoolArray

    @classmethod
    def of(cls, texels: Texels, targets: Sequence[TriangleMesh | Shape], e: int) -> Jumps:
        """Return them for E environments that all begin with their first step."""
        return cls(*jump_arrays(texels, targets), np.zeros((e, len(targets), 3)), np.zeros(e, np.bool_))


class Worlds(NamedTuple):
    """Where the bodies of E environments are: the sensor, then the targets.

    Attributes
    ----------
    poses : (E, 1 + T, 7) float
        Position (m) and quaternion (w, x, y, z) of each at the step's end; given.
    begins : (E,) bool
        The environment begins with this step, at rest at these poses.
    fresh : (E,) bool
        It began with the last step.
    valid : (E,) bool
        Its poses are poses.
    position, quaternion : (E, 2 + 2T, 3), (E, 2 + 2T, 4) float
        Of all bodies at the step's beginning, and then at its end.
    rotation, step_motion : (E, 2 + 2T, 3, 3), (E, 2 + 2T, 12) float
        Of all bodies at either end, and their motions as seen from there (see :func:`.write_step_motion`).
    pose : (E, T, 12) float
        Rotation (row by row) and position of the sensor in each target's frame, at the step's end.
    motion : (E, 2, T, 12) float
        Of each target over the step, relative to the sensor (see :func:`.relative_motion`), as seen from either end.
    end_motion : (E, T, 12) float
        The first of these in the sensor's axes at the step's end.
    """

    poses: np.ndarray
    begins: BoolArray
    fresh: BoolArray
    valid: BoolArray
    position: np.ndarray
    quaternion: np.ndarray
    rotation: np.ndarray
    step_motion: np.ndarray
    pose: np.ndarray
    motion: np.ndarray
    end_motion: np.ndarray

    @classmethod
    def zero(cls, e: int, targets: int) -> Worlds:
        """Return room for environments that all begin with their first step."""
        b, flags = 1 + targets, (np.ones(e, np.bool_), np.ones(e, np.bool_), np.ones(e, np.bool_))
        bodies = [np.zeros((e, 2 * b, *shape)) for shape in ((3,), (4,), (3, 3), (12,))]
        pairs = [np.zeros((e, *shape, targets, 12)) for shape in ((), (2,), ())]
        return cls(np.zeros((e, b, 7)), *flags, *bodies, *pairs)


class Slots(NamedTuple):
    """Memory of each of N contact points for each of T targets in E environments.

    Attributes
    ----------
    pressed : (E, T, N) float
        Share of the maximum penetration that is pressed in; NO_CONTACT or TOO_DEEP where the point does not act.
    triangle : (E, T, N) int
        Of a mesh, the one that was met last.
    depth : (E, T, N) float, metres
    normal, bristle : (E, T, 3, N) float
        Outward normal of the target and bristle deflection (m), in the sensor's frame.
    force : (E, T, 3, N) float, N
        On the sensor, in its frame.
    memory : (E, N, laws, c) float
        Of effects on forces.
    reading_memory : (E, n, laws, c) float
        Of effects on readings.
    """

    pressed: np.ndarray
    triangle: IntArray
    depth: np.ndarray
    normal: np.ndarray
    bristle: np.ndarray
    force: np.ndarray
    memory: np.ndarray
    reading_memory: np.ndarray

    @classmethod
    def zero(cls, e: int, t: int, points: int, texels: int, laws: tuple[int, int], reading_laws: tuple[int, int]) -> Slots:
        """Allocate them; `laws` says how many laws there are, and how much each of them remembers at the most."""
        numbers, vectors = np.zeros((e, t, points)), np.zeros((3, e, t, 3, points))
        memory = np.zeros((e, points, *laws)), np.zeros((e, texels, *reading_laws))
        triangle = np.full(numbers.shape, -1, np.int32)
        return cls(numbers - 1.0, triangle, numbers, vectors[0], vectors[1], vectors[2], memory[0], memory[1])


class Results(NamedTuple):
    """Results of E environments of a sensor with n texels and T targets; fields as in :class:`.PressedTexels`."""

    texels: np.ndarray
    readings: np.ndarray
    contact: BoolArray
    wrench: np.ndarray
    too_deep: IntArray

    @classmethod
    def zero(cls, e: int, n: int, t: int) -> Results:
        """Allocate them."""
        return cls(
            np.zeros((e, n, 3)), np.zeros((e, n)), np.zeros((e, n), np.bool_), np.zeros((e, t, 6)), np.zeros(e, np.int32)
        )  # fmt: skip


def split_leaves(tree: Tree) -> Tree:
    """Return a tree with one triangle in each leaf, in the same order, so that queries give the same.

    A GPU then meets more boxes and fewer triangles. These take longest, as the threads of a warp wait for each other there.
    """
    many, nodes = tree.number > 1, len(tree.number)
    extra = np.where(many, tree.number, 0)
    place = np.arange(nodes + 1) + np.concatenate([[0], np.cumsum(extra)])  # of each node, and the end
    old, size = place[:-1], int(place[-1])
    bounds, skip, first, number = np.empty((size, 6)), np.arange(1, size + 1), np.zeros(size, np.int64), np.ones(size, np.int64)
    bounds[old], skip[old] = tree.bounds, place[tree.skip]
    first[old], number[old] = tree.first, np.where(many, 0, tree.number)
    new = np.setdiff1d(np.arange(size), old)
    first[new] = np.repeat(tree.first[many], tree.number[many]) + new - np.repeat(old[many] + 1, tree.number[many])
    corners = tree.faces[first[new], :9].reshape(-1, 3, 3)
    bounds[new] = np.hstack([corners.min(axis=1), corners.max(axis=1)])
    return tree._replace(bounds=bounds, skip=skip, first=first, number=number, roots=place[tree.roots])
