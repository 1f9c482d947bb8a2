# SPDX-License-Identifier: GPL-3.0-or-later
"""Normal forces of effects step by step, by the kernels that the solver calls: what laws along a signal are held against."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from palpate.core.effects.engine.compiled_program import (
    PointRange,
    TexelContacts,
    TexelMotion,
    apply_force_laws,
    compile_program,
    write_base_law,
)
from palpate.core.laws.contact_law import LINEAR_EXPONENT, contact_law
from palpate.core.model.sensor import Effect
from palpate.core.model.sensor_parameters import SensorParameters


class StepwiseNormalForces:
    """Normal forces step by step, as the solver needs them: any number of trial evaluations, then the step itself.

    Parameters
    ----------
    effects : sequence of Effect
        Effects on readings are ignored.
    parameters : SensorParameters
    dt : (m,) float, s
        Lengths of step that will occur.
    points : int
        Number of contact points.
    """

    def __init__(self, effects: Sequence[Effect], parameters: SensorParameters, dt: ArrayLike, points: int):
        self.parameters = parameters
        self.program = compile_program([effects], dt)
        self.memory = self.program.memory(points)
        self._contacts = TexelContacts.zeros(1, points)
        self._points = PointRange(0, 0, points, np.arange(points), 0, 0)

    def step(
        self, step_length: int, depth: np.ndarray, rate: np.ndarray, slide_step: np.ndarray | None = None, commit: bool = True
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return forces and tangents at the end of a step.

        Parameters
        ----------
        step_length : int
            Index of the length of the step.
        depth, rate, slide_step : (n,) float, m, m/s, m
            Depth at the end of the step, its rate during the step, and the distance slid in the step.
        commit : bool
            Update the memory of the effects. If false, the step is only evaluated.

        Returns
        -------
        force : (n,) float, N
        by_depth, by_rate : (n,) float, N/m and N·s/m
            Derivatives of the force.
        """
        law, contacts = contact_law(self.parameters), self._contacts
        slide_step = np.zeros(len(depth)) if slide_step is None else slide_step
        for i in range(len(depth)):
            write_base_law(contacts, 0, i, TexelMotion(depth[i], rate[i], slide_step[i], 0.0), law)
        linear = law.exponent == LINEAR_EXPONENT
        apply_force_laws(0, step_length, contacts, self._points, linear, self.program, self.memory, commit)
        return contacts.force[0].copy(), contacts.by_depth[0].copy(), contacts.by_rate[0].copy()
