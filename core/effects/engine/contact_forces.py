# SPDX-License-Identifier: GPL-3.0-or-later
"""Forces of contact with a sensor's effects on a known motion: over a whole signal, and step by step with equal results."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ...model.effect import Effect
from ...model.sensor_parameters import LINEAR
from .compiled_program import (
    COLUMNS,
    DAMPING,
    FACTOR,
    FORCE,
    SLOPE,
    SPEED,
    VISCOUS,
    apply_force_laws,
    apply_friction_laws,
    compile_program,
    law_over_time,
    press,
)
from .registry import complete_values, in_signal_order
from .step_lengths import steps_of

if TYPE_CHECKING:
    from ...model.sensor_parameters import SensorParameters


def normal_forces(
    effects: Sequence[Effect],
    parameters: SensorParameters,
    time: np.ndarray,
    depth: np.ndarray,
    slide: np.ndarray | None = None,
    rate: np.ndarray | None = None,
    stiffness: ArrayLike = 1.0,
) -> np.ndarray:
    """Normal forces that a sensor's effects make of a known motion, (t, n) float, N.

    Parameters
    ----------
    effects : sequence of Effect
        Those on readings are left out.
    parameters : SensorParameters
    time : (t,) float, s, increasing
        At the first sample nothing has happened yet: no force was there before it.
    depth : (t, n) float, m
        Zero or less where nothing touches.
    slide : (t, n) float, m, optional
        Distance slid since the sample before.
    rate : (t, n) float, m/s, optional
        Of the depth; without it the change since the sample before.
    stiffness : float or (n,) float
        Multiplies k and cn of each texel, as where it is painted.
    """
    time, depth = np.asarray(time, float), np.ascontiguousarray(depth, dtype=float)
    if rate is None:
        rate = np.zeros_like(depth)
        rate[1:] = np.diff(depth, axis=0) / np.diff(time)[:, None]
    lengths, step = steps_of(time)
    inside = np.maximum(depth, 0.0)
    linear = parameters.normal_law == LINEAR
    force = parameters.k * (inside if linear else inside**parameters.exponent)
    damping = parameters.cn * rate if linear else 1.5 * parameters.dissipation * rate
    clipped = False
    for item, form in in_signal_order(effects, readout=False):
        if form.law is None or form.constants is None:
            continue
        if form.after_clip and not clipped:
            force, clipped = _cut_off(force, inside, damping, linear), True
        memory = np.zeros((depth.shape[1], form.state_size))
        force = law_over_time(form, force, step, form.constants(complete_values(item), lengths), memory, inside, slide)
    return force if clipped else _cut_off(force, inside, damping, linear)


def _cut_off(elastic: np.ndarray, depth: np.ndarray, damping: np.ndarray, linear: bool) -> np.ndarray:
    """Elastic force and damping together never pull (Eq. 8, or Hunt and Crossley's law)."""
    total = elastic + damping if linear else elastic * (1.0 + damping)
    return np.where(depth > 0.0, np.maximum(total, 0.0), 0.0)


def friction_factors(effects: Sequence[Effect], speed: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How a sensor's effects change sliding: factor on the friction coefficient, and N·s/m to add to `ct`.

    Parameters
    ----------
    effects : sequence of Effect
    speed, force : (...) float, m/s and N
    """
    speed, force = np.broadcast_arrays(np.asarray(speed, float), np.asarray(force, float))
    program, n = compile_program([effects], 0.0), speed.size
    work = np.zeros((COLUMNS, n))
    work[SPEED], work[FORCE] = speed.ravel(), force.ravel()
    apply_friction_laws(0, work.reshape(1, -1), 0, n, 0, n, np.arange(n), program, program.memory(n))
    return work[FACTOR].reshape(speed.shape), work[VISCOUS].reshape(speed.shape)


class StepwiseNormalForces:
    """Normal forces sample by sample, as the solver asks for them: any number of guesses, then the step itself.

    Parameters
    ----------
    effects : sequence of Effect
        Those on readings are left out.
    parameters : SensorParameters
    dt : (m,) float, s
        Lengths of step that will occur.
    points : int
    """

    def __init__(self, effects: Sequence[Effect], parameters: SensorParameters, dt: ArrayLike, points: int):
        self.parameters = parameters
        self.program = compile_program([effects], dt)
        self.memory = self.program.memory(points)
        self._work = np.zeros((COLUMNS, points))
        self._every = np.arange(points)

    def step(
        self, length: int, depth: np.ndarray, rate: np.ndarray, slide: np.ndarray | None = None, commit: bool = True
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the forces at the step's end (N), and their derivatives by depth (N/m) and by rate (N·s/m), each (n,) float.

        Parameters
        ----------
        length : int
            Which of the lengths of step.
        depth, rate, slide : (n,) float, m, m/s, m
            At the step's end, during it, and in it.
        commit : bool
            The step is done; without it one only asks.
        """
        p, n = self.parameters, len(depth)
        slide = np.zeros(n) if slide is None else slide
        linear = p.normal_law == LINEAR
        work = self._work.reshape(1, -1)
        for i in range(n):
            press(work, 0, n, i, depth[i], rate[i], slide[i], 0.0, p.k, p.cn, 0.0 if linear else p.exponent, p.dissipation)
        apply_force_laws(0, length, work, 0, n, 0, n, self._every, 0, 0, linear, self.program, self.memory, commit)
        return self._work[FORCE].copy(), self._work[SLOPE].copy(), self._work[DAMPING].copy()
