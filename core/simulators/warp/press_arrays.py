# SPDX-License-Identifier: GPL-3.0-or-later
"""The arrays of :mod:`.press_kernels`, which lie on the device."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

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
    """What is needed to find targets that go through the sensor within a step; fields as in :class:`.JumpSearch`."""

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
    position, quaternion : (E, 1 + T, 3), (E, 1 + T, 4) float
        Of each body at the step's beginning.
    pose : (E, T, 12) float
        Rotation (row by row) and position of the sensor in each target's frame, at the step's end.
    motion, end_motion, past_motion : (E, T, 12) float
        Of each target relative to the sensor (see :func:`.relative_motion`): over the step in the sensor's axes at its
        beginning, the same in those at its end, and as seen from its end.
    """

    poses: np.ndarray
    begins: BoolArray
    fresh: BoolArray
    valid: BoolArray
    position: np.ndarray
    quaternion: np.ndarray
    pose: np.ndarray
    motion: np.ndarray
    end_motion: np.ndarray
    past_motion: np.ndarray

    @classmethod
    def zero(cls, e: int, targets: int) -> Worlds:
        """Return room for environments that all begin with their first step."""
        b, flags = 1 + targets, (np.ones(e, np.bool_), np.ones(e, np.bool_), np.ones(e, np.bool_))
        pairs = [np.zeros((e, targets, 12)) for _ in range(4)]
        return cls(np.zeros((e, b, 7)), *flags, np.zeros((e, b, 3)), np.zeros((e, b, 4)), *pairs)


class Slots(NamedTuple):
    """What each of N contact points remembers of each of T targets in E environments.

    Attributes
    ----------
    pressed : (E, T, N) float
        Share of the maximum penetration that is pressed in; NO_CONTACT or TOO_DEEP where the point does not act.
    triangle : (E, T, N) int
        Of a mesh, the one that was met last.
    depth : (E, T, N) float, metres
    normal, bristle : (E, T, N, 3) float
        Outward normal of the target and bristle deflection (m), in the sensor's frame.
    force : (E, T, N, 3) float, N
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
        numbers, vectors = np.zeros((e, t, points)), np.zeros((3, e, t, points, 3))
        memory = np.zeros((e, points, *laws)), np.zeros((e, texels, *reading_laws))
        triangle = np.full(numbers.shape, -1, np.int32)
        return cls(numbers - 1.0, triangle, numbers, vectors[0], vectors[1], vectors[2], memory[0], memory[1])


class Results(NamedTuple):
    """What E environments of a sensor with n texels and T targets give; fields as in :class:`.PressedTexels`."""

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
