# SPDX-License-Identifier: GPL-3.0-or-later
"""The kernels' working memory, so that nothing is allocated inside the loop."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..compiled.struct_reference import by_reference
from ..effects.engine.compiled_program import TexelContacts

SUMS = 27
"""Numbers that the contacts of a pair are summed up in: a symmetric (6, 6) block by its lower triangle, and a wrench."""


@by_reference
class BodyWork(NamedTuple):
    """Working memory for each of the b bodies.

    Attributes
    ----------
    rotation, inertia : (b, 3, 3) float
        Orientation, and inertia in world axes.
    step_motion : (b, 12) float
        Velocity V of each body's reference point and a matrix W, row by row: the points at arm r move by ``dt (V + W r)``.
    known_step_motion : (b, 12) float
        The part of the step motion that is not solved for.
    spin_correction : (b, 3) float, rad/s
        By how much the mean spin of a free body over the step differs from its spin at the beginning if nothing acts.
    end_quaternion, end_rotation, end_spin : (b, 4), (b, 3, 3), (b, 3) float
        Orientation and angular velocity (rad/s) of a free body at the step's end, as the velocities solved for give them.
    unbooked_energy : (b,) float, joules
        By how much the rotational energy of a free body grows more in the step than torques and mean spins say.
    contact_force : (b,) float, N
        Sum of the sizes of the forces with which pairs whose energy is accounted for act on a body.
    velocity_before : (b, 6) float
        Velocity at the step's beginning.
    carrier_velocity : (b, 6) float
        Velocity of a driven body without the speed of its drive.
    """

    rotation: np.ndarray
    inertia: np.ndarray
    step_motion: np.ndarray
    known_step_motion: np.ndarray
    spin_correction: np.ndarray
    end_quaternion: np.ndarray
    end_rotation: np.ndarray
    end_spin: np.ndarray
    unbooked_energy: np.ndarray
    contact_force: np.ndarray
    velocity_before: np.ndarray
    carrier_velocity: np.ndarray


@by_reference
class ContactWork(NamedTuple):
    """The contacts of the step.

    Attributes
    ----------
    rows : (blocks, ROW) float
        One row per contact, in blocks (see :mod:`.detection.detection_data`).
    slots : (blocks, LANES) int
        Slot of each row in :class:`.State`.
    surface_velocity : (blocks, 3 · LANES) float
        Velocity that a deforming target or sensor adds at each row, in the sensor's axes, m/s; read where `deforming` is true.
    deforming : (q,) bool
        The target or the sensor of the pair deforms.
    first_block : (q,) int
        Where each pair's rows begin.
    number, too_deep : (q,) int
        How many rows each pair has in use, and how many of its points are pressed past their maximum penetration.
    most_too_deep : (q,) int
        `too_deep` of the step of a frame in which it was largest in all.
    """

    rows: np.ndarray
    slots: np.ndarray
    surface_velocity: np.ndarray
    deforming: np.ndarray
    first_block: np.ndarray
    number: np.ndarray
    too_deep: np.ndarray
    most_too_deep: np.ndarray


@by_reference
class PairWork(NamedTuple):
    """Working memory for each of the q pairs.

    Attributes
    ----------
    sums : (q, SUMS · LANES) float
        Sums over the contacts of each pair, lane by lane.
    pose : (q, 12) float
        Rotation (row by row) and position of each pair's sensor in the target's frame.
    rotations : (q, 3, 3, 3) float
        Rotations that deforming surfaces need.
    motion, known_motion : (q, 12) float
        How a target's points move relative to a sensor, and the part of it that is not solved for: U, then W row by row.
    """

    sums: np.ndarray
    pose: np.ndarray
    rotations: np.ndarray
    motion: np.ndarray
    known_motion: np.ndarray


@by_reference
class LinearSystem(NamedTuple):
    """The linear system of a step with its u unknowns.

    Attributes
    ----------
    matrix, vector : (u, u), (u,) float
        The vector holds the right side first and the solution after.
    momentum : (u,) float
        Momentum that the unknowns would have without contacts and drives.
    guess, free_solution : (u,) float
        The unknowns as they were guessed last, and as they would be if nothing touched.
    previous : (2, u) float
        What the previous iteration found, and by how much that changed its guess.
    block, wrench : (6, 6), (6,) float
        What the contacts of one pair resist, and their force and torque on the target, both in the sensor's axes.
    map_a, map_b : (6, 6) float
        From the velocities of a pair's two bodies to their relative velocity.
    """

    matrix: np.ndarray
    vector: np.ndarray
    momentum: np.ndarray
    guess: np.ndarray
    free_solution: np.ndarray
    previous: np.ndarray
    block: np.ndarray
    wrench: np.ndarray
    map_a: np.ndarray
    map_b: np.ndarray


@by_reference
class DriveWork(NamedTuple):
    """Working memory for the actuators.

    Attributes
    ----------
    axis : (b, 3) float
        Direction of each driven body's axis in the world at the step's end.
    mass : (d,) float, kg
        Mass that each actuator moves.
    load : (d,) float, N·s
        Impulse that its weight and the motion of its carrier ask for in this step.
    """

    axis: np.ndarray
    mass: np.ndarray
    load: np.ndarray


@by_reference
class EffectWork(NamedTuple):
    """Working memory for the sensors' effects.

    Attributes
    ----------
    contacts : TexelContacts, (blocks, LANES)
        What effects make of each contact; without blocks when none acts on forces.
    points : TexelContacts, (1, N)
        The contact of each contact point at the step's end; without points when no effect acts on forces.
    point_numbers : (N,) int
        0, 1, 2 …
    """

    contacts: TexelContacts
    points: TexelContacts
    point_numbers: np.ndarray


@by_reference
class EnergyWork(NamedTuple):
    """Working memory for each pair's energy account (see :func:`.check_energy`).

    Attributes
    ----------
    tracked : (q,) bool
        The energy of the pair is accounted for: forces move one of its bodies, and nothing else brings energy. Adhesion pulls
        before it is pulled, prescribed deformation pushes from within, and drives push at will.
    force, new_force, previous_force : (q, 6) float
        Force and torque on the target, in the axes of the sensor's body, that belong to the guess, and as an iteration and
        the one before found them. The sum over all parts of a pair stands with the last part, as in the following arrays.
    work, available : (q,) float, joules
        Work that each pair does in the step, and the most that it may do.
    scale : (q,) float
        Factor on the pair's forces in this step.
    scale_low, scale_high : (q,) float
        Bounds of the bisection for `scale`: a factor that the pair can pay for, and one that it cannot.
    """

    tracked: np.ndarray
    force: np.ndarray
    new_force: np.ndarray
    previous_force: np.ndarray
    work: np.ndarray
    available: np.ndarray
    scale: np.ndarray
    scale_low: np.ndarray
    scale_high: np.ndarray


@by_reference
class Workspace(NamedTuple):
    """All of the kernels' working memory.

    Attributes
    ----------
    bodies : BodyWork
    contacts : ContactWork
    pairs : PairWork
    system : LinearSystem
    drives : DriveWork
    effects : EffectWork
    energy : EnergyWork
    step : (1,) float, seconds
        The time step that helper threads reckon with.
    queue : (QUEUE_SIZE,) or (0,) int
        Where helper threads find work (see :mod:`.thread_team`).
    pair_loops : (6,) int
        Address of what each loop over pairs does with a pair (see :mod:`.parallel_loops`).
    """

    bodies: BodyWork
    contacts: ContactWork
    pairs: PairWork
    system: LinearSystem
    drives: DriveWork
    effects: EffectWork
    energy: EnergyWork
    step: np.ndarray
    queue: np.ndarray
    pair_loops: np.ndarray
