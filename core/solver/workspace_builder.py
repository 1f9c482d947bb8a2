# SPDX-License-Identifier: GPL-3.0-or-later
"""Allocation of the kernels' working memory."""

from __future__ import annotations

import numpy as np

from ..effects.engine.compiled_program import TexelContacts
from ..geometry.rotations import write_backward_step_motion
from .contact_rows import LANES, ROW
from .detection.detection_data import SurfaceMotion
from .dynamics.modes import pairs_with_account
from .solver_model import SolverModel, State
from .workspace import SUMS, BodyWork, ContactWork, DriveWork, EffectWork, EnergyWork, LinearSystem, PairWork, Workspace


def workspace_for(model: SolverModel, state: State, surfaces: SurfaceMotion, queue: np.ndarray) -> Workspace:
    """Allocate the working memory of a run."""
    b, q, n = len(state.position), len(model.pairs.sensor), max(6, model.bodies.unknowns)
    slots = np.diff(model.pairs.first_slot, append=len(state.triangle))
    blocks = np.cumsum([0, *(-(-slots // LANES))])
    deforming = surfaces.sensor_deforms[model.pairs.sensor] | surfaces.target_deforms[model.pairs.target]
    effect_blocks, effect_points = (0, 0) if model.effects.is_empty else (blocks[-1], len(model.points.frame))
    return Workspace(
        bodies=_body_work(state),
        contacts=ContactWork(
            rows=np.zeros((blocks[-1], ROW)),
            slots=np.zeros((blocks[-1], LANES), np.int64),
            surface_velocity=np.zeros((blocks[-1] if deforming.any() else 0, 3 * LANES)),
            deforming=deforming,
            first_block=blocks[:-1],
            number=np.zeros(q, np.int64),
            too_deep=np.zeros(q, np.int64),
            most_too_deep=np.zeros(q, np.int64),
        ),
        pairs=PairWork(
            sums=np.zeros((q, SUMS * LANES)),
            pose=np.zeros((q, 12)),
            rotations=np.zeros((q, 3, 3, 3)),
            motion=np.zeros((q, 12)),
            known_motion=np.zeros((q, 12)),
        ),
        system=_linear_system(n),
        drives=DriveWork(np.zeros((b, 3)), np.zeros(len(model.drives.gains)), np.zeros(len(model.drives.gains))),
        effects=EffectWork(
            contacts=TexelContacts.zeros(effect_blocks, LANES),
            points=TexelContacts.zeros(1, effect_points),
            point_numbers=np.arange(len(model.points.frame)),
        ),
        energy=_energy_work(model, deforming),
        step=np.zeros(1),
        queue=queue,
        pair_loops=np.zeros(6, np.int64),
    )


def _body_work(state: State) -> BodyWork:
    b = len(state.position)
    step_motion = np.zeros((b, 12))
    for body in range(b):
        write_backward_step_motion(state.velocity[body], 1e-9, step_motion[body])
    return BodyWork(
        rotation=np.zeros((b, 3, 3)),
        inertia=np.zeros((b, 3, 3)),
        step_motion=step_motion,
        known_step_motion=np.zeros((b, 12)),
        spin_correction=np.zeros((b, 3)),
        end_quaternion=np.zeros((b, 4)),
        end_rotation=np.zeros((b, 3, 3)),
        end_spin=np.zeros((b, 3)),
        unbooked_energy=np.zeros(b),
        contact_force=np.zeros(b),
        velocity_before=np.zeros((b, 6)),
        carrier_velocity=np.zeros((b, 6)),
    )


def _linear_system(n: int) -> LinearSystem:
    return LinearSystem(
        matrix=np.zeros((n, n)),
        vector=np.zeros(n),
        momentum=np.zeros(n),
        guess=np.zeros(n),
        free_solution=np.zeros(n),
        previous=np.zeros((2, n)),
        block=np.zeros((6, 6)),
        wrench=np.zeros(6),
        map_a=np.zeros((6, 6)),
        map_b=np.zeros((6, 6)),
    )


def _energy_work(model: SolverModel, deforming: np.ndarray) -> EnergyWork:
    pairs, q = model.pairs, len(model.pairs.sensor)
    effects = model.effects
    pulls = effects.first_unclipped[pairs.sensor] < effects.first_law[pairs.sensor + 1]  # as compiled_program.may_pull
    return EnergyWork(
        tracked=pairs_with_account(model.bodies.mode, pairs) & ~deforming & ~pulls,
        force=np.zeros((q, 6)),
        new_force=np.zeros((q, 6)),
        previous_force=np.zeros((q, 6)),
        work=np.zeros(q),
        available=np.zeros(q),
        scale=np.ones(q),
        scale_low=np.zeros(q),
        scale_high=np.ones(q),
    )
