# SPDX-License-Identifier: GPL-3.0-or-later
"""The kernels' working memory."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..compiled.struct_reference import by_reference
from ..effects.engine.compiled_program import COLUMNS
from ..geometry.rotations import DRIVEN, FREE, write_backward_twist
from ..laws.contact import DEPTH, LANES, NX, PX, ROW, SolverModel, State
from .detection.deformation import SurfaceMotion
from .dynamics.effect_kernels import may_pull

SUMS = 27
"""Numbers that the contacts of a pair are summed up in: a symmetric (6, 6) block by its lower triangle, and a wrench."""


@by_reference
class Workspace(NamedTuple):
    """Working memory of the kernels, so that nothing is allocated inside the loop.

    Attributes
    ----------
    rotation, inertia : (b, 3, 3) float
        Orientation and world-axes inertia of each body.
    twist : (b, 12) float
        Velocity of each body's reference point and a matrix W (row by row): the points at arm r move by ``dt (V + W r)``.
    known : (b, 12) float
        The part of the twist that is not solved for.
    rows : (blocks, ROW) float
        One row per contact, in blocks (see :mod:`.contact`).
    slots : (blocks, LANES) int
        Place of each row in the memory of :class:`.State`.
    own : (blocks, 3 · LANES) float
        Velocity that a deforming target or sensor adds at each row, in the sensor's axes, m/s; read where `moving` says so.
    moving : (q,) bool
    first_block : (q,) int
        Where each pair's rows begin.
    contacts, sunk : (q,) int
        How many rows each pair has in use, and how many of its points are pressed past their maximum penetration.
    sums : (q, SUMS · LANES) float
        Of the contacts of each pair, lane by lane.
    pose : (q, 12) float
        Rotation (row by row) and position of each pair's sensor in the target's frame.
    turn : (q, 3, 3, 3) float
        Rotations that deforming surfaces need.
    motion, part : (q, 12) float
        How a target's points move relative to a sensor, and the part of it that is not solved for: U, then W row by row.
    block, wrench : (6, 6), (6,) float
        What the contacts of one pair resist, and their force and torque on the target, both in the sensor's axes.
    map_a, map_b : (6, 6) float
        From the twists of both bodies to the relative motion.
    matrix, vector, momentum, guess, alone : (u, u), (u,), (u,), (u,), (u,) float
        The linear system, its u unknowns as they were guessed last, and as they would be if nothing touched.
    earlier : (2, u) float
        What the round before found, and by how much that changed its guess.
    tumbling : (b, 3) float
        By how much the mean spin of a free body over the step differs from its spin at the beginning if nothing acts, rad/s.
    axis : (b, 3) float
        Direction of each drive in the world at the step's end.
    carried : (b, 6) float
        Velocity of a driven body without the speed of its drive.
    felt : (blocks, COLUMNS · LANES) float
        What effects make of each contact (:mod:`.compiled_program`); without rows when none acts on forces.
    pressed : (1, COLUMNS · N) float
        What presses on each contact point at the step's end, the same way.
    every : (N,) int
        Numbers of the contact points.
    drive_mass, drive_load : (d,) float
        What each drive moves (kg), and the impulse that its weight and its carrier ask for in this step (N·s).
    before : (b, 6) float
        Velocity of each body at the step's beginning.
    counted : (q,) bool
        Which pairs have a tank (see :mod:`.passivity`): forces move one of their bodies, and nothing but they brings energy.
        Adhesion pulls before it is pulled, prescribed deformation pushes from within, and drives push at will.
    force, found, found_before : (q, 6) float
        Force and torque on the target, in the axes of the sensor's body, that belong to the guess, and as a round and the one
        before found them; those of all parts of a pair with the last, like the following.
    work, left, hold, enough, too_much : (q,) float
        Work that each pair does in the step and could do (J); the share of its forces that acts, and what it lies between.
    step : (1,) float, seconds
        The time step that helpers are to reckon with.
    board : (QUEUE_SIZE,) or (0,) int
        Where helpers look for work (see :mod:`.thread_team`).
    """

    rotation: np.ndarray
    inertia: np.ndarray
    twist: np.ndarray
    known: np.ndarray
    rows: np.ndarray
    slots: np.ndarray
    own: np.ndarray
    moving: np.ndarray
    first_block: np.ndarray
    contacts: np.ndarray
    too_deep: np.ndarray
    sums: np.ndarray
    pose: np.ndarray
    turn: np.ndarray
    motion: np.ndarray
    part: np.ndarray
    block: np.ndarray
    wrench: np.ndarray
    map_a: np.ndarray
    map_b: np.ndarray
    matrix: np.ndarray
    vector: np.ndarray
    momentum: np.ndarray
    guess: np.ndarray
    alone: np.ndarray
    earlier: np.ndarray
    tumbling: np.ndarray
    axis: np.ndarray
    carried: np.ndarray
    felt: np.ndarray
    pressed: np.ndarray
    every: np.ndarray
    drive_mass: np.ndarray
    drive_load: np.ndarray
    before: np.ndarray
    counted: np.ndarray
    force: np.ndarray
    found: np.ndarray
    found_before: np.ndarray
    work: np.ndarray
    left: np.ndarray
    hold: np.ndarray
    enough: np.ndarray
    too_much: np.ndarray
    step: np.ndarray
    queue: np.ndarray


def workspace_for(model: SolverModel, state: State, surfaces: SurfaceMotion, queue: np.ndarray) -> Workspace:
    """Allocate the working memory of a run."""
    b = len(state.position)
    slots = np.diff(model.slot_start, append=len(state.hint))
    blocks = np.cumsum([0, *(-(-slots // LANES))])
    twist = np.zeros((b, 12))
    for body in range(b):
        write_backward_twist(state.velocity[body], 1e-9, twist[body])
    n = max(6, model.unknowns)
    moving = surfaces.bends[model.pairs[:, 0]] | surfaces.deforms[model.pairs[:, 1]]
    return Workspace(
        rotation=np.zeros((b, 3, 3)),
        inertia=np.zeros((b, 3, 3)),
        twist=twist,
        known=np.zeros((b, 12)),
        rows=np.zeros((blocks[-1], ROW)),
        slots=np.zeros((blocks[-1], LANES), np.int64),
        own=np.zeros((blocks[-1] if moving.any() else 0, 3 * LANES)),
        moving=moving,
        first_block=blocks[:-1],
        contacts=np.zeros(len(model.pairs), np.int64),
        too_deep=np.zeros(len(model.pairs), np.int64),
        sums=np.zeros((len(model.pairs), SUMS * LANES)),
        pose=np.zeros((len(model.pairs), 12)),
        turn=np.zeros((len(model.pairs), 3, 3, 3)),
        motion=np.zeros((len(model.pairs), 12)),
        part=np.zeros((len(model.pairs), 12)),
        block=np.zeros((6, 6)),
        wrench=np.zeros(6),
        map_a=np.zeros((6, 6)),
        map_b=np.zeros((6, 6)),
        matrix=np.zeros((n, n)),
        vector=np.zeros(n),
        momentum=np.zeros(n),
        guess=np.zeros(n),
        alone=np.zeros(n),
        earlier=np.zeros((2, n)),
        tumbling=np.zeros((b, 3)),
        axis=np.zeros((b, 3)),
        carried=np.zeros((b, 6)),
        felt=np.zeros((0 if model.program.is_empty else blocks[-1], COLUMNS * LANES)),
        pressed=np.zeros((1, 0 if model.program.is_empty else COLUMNS * len(model.points))),
        every=np.arange(len(model.points)),
        drive_mass=np.zeros(len(model.drives)),
        drive_load=np.zeros(len(model.drives)),
        before=np.zeros((b, 6)),
        counted=_counted(model, moving),
        force=np.zeros((len(model.pairs), 6)),
        found=np.zeros((len(model.pairs), 6)),
        found_before=np.zeros((len(model.pairs), 6)),
        work=np.zeros(len(model.pairs)),
        left=np.zeros(len(model.pairs)),
        hold=np.ones(len(model.pairs)),
        enough=np.zeros(len(model.pairs)),
        too_much=np.ones(len(model.pairs)),
        step=np.zeros(1),
        queue=queue,
    )


def _counted(model: SolverModel, moving: np.ndarray) -> np.ndarray:
    sensor, target = model.pairs.T
    kinds = model.kind[np.stack([model.sensor_body[sensor], model.target_body[target]])]
    moved = (kinds == FREE).any(axis=0) & (kinds != DRIVEN).all(axis=0)
    pulls = np.array([may_pull(i, model.program) for i in sensor], dtype=bool)
    return moved & ~moving & ~pulls


def contacts_of(pair: int, workspace: Workspace) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the contacts of one pair, freshly gathered.

    Returns
    -------
    slots : (n,) int
        Place of each in the memory of :class:`.State`.
    normal : (n, 3) float
        The target's outward normal, in the frame of the sensor's body like the point.
    point : (n, 3) float, metres
        From the body's reference point.
    depth : (n,) float, metres
    """
    count, first = workspace.contacts[pair], workspace.first_block[pair]
    blocks = slice(first, first - (-count // LANES))
    columns = workspace.rows[blocks].reshape(-1, ROW // LANES, LANES).swapaxes(1, 2).reshape(-1, ROW // LANES)[:count]
    n, p = NX // LANES, PX // LANES
    return workspace.slots[blocks].ravel()[:count], columns[:, n : n + 3], columns[:, p : p + 3], columns[:, DEPTH // LANES]
