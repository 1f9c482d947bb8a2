# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact forces of a sensor with effects along a known motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...compiled.kernels import kernel, plain, with_plain_form
from ...laws.contact_law import ContactLaw, contact_law
from ...laws.normal_force import damped_force, elastic_force
from ...model.sensor import Effect
from .compiled_program import PointRange, TexelContacts, apply_friction_laws, compile_program, constants_of, law_over_time
from .readout_chain import steps_of
from .registry import complete_values, in_signal_order

if TYPE_CHECKING:
    from ...model.sensor_parameters import SensorParameters


def normal_forces(
    effects: Sequence[Effect],
    parameters: SensorParameters,
    time: np.ndarray,
    depth: np.ndarray,
    slide_step: np.ndarray | None = None,
    rate: np.ndarray | None = None,
) -> np.ndarray:
    """Return the normal forces on the texels of a sensor along a known motion, (t, n) float, N.

    Parameters
    ----------
    effects : sequence of Effect
        Effects on readings are ignored.
    parameters : SensorParameters
    time : (t,) float, s, increasing
        Nothing has touched the sensor before the first sample.
    depth : (t, n) float, m
        Zero or less where nothing touches.
    slide_step : (t, n) float, m, optional
        Distance slid since the sample before; zero by default.
    rate : (t, n) float, m/s, optional
        Rate of the depth; by default the difference quotient since the sample before.
    """
    time, depth = np.asarray(time, float), np.ascontiguousarray(depth, dtype=float)
    if rate is None:
        rate = np.zeros_like(depth)
        rate[1:] = np.diff(depth, axis=0) / np.diff(time)[:, None]
    rate = np.ascontiguousarray(np.broadcast_to(rate, depth.shape), dtype=float)
    lengths, step = steps_of(time)
    inside = np.maximum(depth, 0.0)
    law = contact_law(parameters)
    force = plain(elastic_force)(inside, law)
    clipped = False
    for item, form in in_signal_order(effects, readout=False):
        if form.law is None:
            continue
        if form.after_clip and not clipped:
            damp_and_clip(force, inside, rate, law)
            clipped = True
        memory = np.zeros((depth.shape[1], form.state_size))
        constants = constants_of(form, complete_values(item), lengths)
        force = law_over_time(form, force, step, constants, memory, inside, slide_step)
    if not clipped:
        damp_and_clip(force, inside, rate, law)
    return force


def _damp_and_clip_plain(force: np.ndarray, depth: np.ndarray, rate: np.ndarray, law: ContactLaw) -> None:
    """Do as :func:`damp_and_clip` without compiled code."""
    np.maximum(plain(damped_force)(force, rate, law), 0.0, out=force)
    force[~(depth > 0.0)] = 0.0


@with_plain_form(_damp_and_clip_plain)
@kernel
def damp_and_clip(force: np.ndarray, depth: np.ndarray, rate: np.ndarray, law: ContactLaw) -> None:
    """Add damping to elastic forces (t, n) in place, and clip the sums at zero (Eq. 8, or Hunt and Crossley's law).

    Where nothing touches the force is zero.
    """
    for i in range(force.shape[0]):
        for j in range(force.shape[1]):
            force[i, j] = max(damped_force(force[i, j], rate[i, j], law), 0.0) if depth[i, j] > 0.0 else 0.0


def friction_factors(effects: Sequence[Effect], speed: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how the effects of a sensor change its friction.

    Parameters
    ----------
    effects : sequence of Effect
    speed, force : (...) float, m/s and N
        Sliding speed and normal force.

    Returns
    -------
    factor : (...) float
        Multiplies the friction coefficients.
    viscosity : (...) float, N·s/m
        Is added to `ct`.
    """
    speed, force = np.broadcast_arrays(np.asarray(speed, float), np.asarray(force, float))
    program, n = compile_program([effects], 0.0), speed.size
    contacts = TexelContacts.zeros(1, n)
    contacts.speed[0], contacts.force[0] = speed.ravel(), force.ravel()
    apply_friction_laws(0, contacts, PointRange(0, 0, n, np.arange(n), 0, 0), program, program.memory(n))
    return contacts.friction_factor.reshape(speed.shape), contacts.extra_viscosity.reshape(speed.shape)
