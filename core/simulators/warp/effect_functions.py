# SPDX-License-Identifier: GPL-3.0-or-later
"""The effects of a sensor as three functions of numbers, which apply its laws one after the other.

:func:`.compiled_program.apply_force_laws` calls laws by their addresses. A Warp kernel has none, and is compiled for one
sensor: :mod:`.translation` puts its laws in the place of the empty tuples of this module, and unrolls the loops over them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ...effects.engine.compiled_program import TexelMotion
from ...effects.engine.registry import complete_values, in_signal_order
from ...effects.engine.specification import Form, TexelInput
from ...errors import ParameterError
from ...laws.contact_law import LINEAR_EXPONENT, ContactLaw
from ...laws.normal_force import damped_force_derivatives, damping_coefficient, elastic_force, elastic_stiffness
from ...model.sensor import Effect, Sensor

Laws: TypeAlias = tuple[tuple[int, Any], ...]
"""Laws, each with its row of the constants and of the memory."""
CLIPPED_LAWS: Laws = ()
"""Laws of the normal force before it is clipped to zero, and then others of forces, friction and readings."""
UNCLIPPED_LAWS: Laws = ()
FRICTION_LAWS: Laws = ()
LAWS_OF_FORCE: Laws = ()
LAWS_OF_READINGS: Laws = ()


def force_with_effects(
    step_length: int, motion: TexelMotion, law: ContactLaw, constants: np.ndarray, memory: np.ndarray, commit: bool
) -> tuple[float, float, float]:
    """Return the normal force of a whole texel (N), and its derivatives by depth and rate (N/m and N·s/m).

    Parameters
    ----------
    step_length : int
        FULL_STEP or NO_TIME of :mod:`.effect_kernels`.
    motion : TexelMotion
    law : ContactLaw
        Of a whole texel.
    constants : (laws, 2, c) float
    memory : (laws, c) float
    commit : bool
        Update the memory.
    """
    depth, rate, linear = max(motion.depth, 0.0), motion.rate, law.exponent == LINEAR_EXPONENT
    force, slope = 0.0, 0.0
    if motion.depth > 0.0:
        force = elastic_force(motion.depth, law)
        slope = elastic_stiffness(motion.depth, force, law)
    for i, effect in CLIPPED_LAWS:
        force, slope = effect(TexelInput(force, slope, depth, motion.slide_step), constants[i, step_length], memory[i], commit)
    force, by_depth, by_rate = damped_force_derivatives(force, slope, damping_coefficient(law), rate, linear)
    if force <= 0.0 or depth <= 0.0:
        force, by_depth, by_rate = 0.0, 0.0, 0.0
    for i, effect in UNCLIPPED_LAWS:
        force, by_depth = effect(
            TexelInput(force, by_depth, depth, motion.slide_step), constants[i, step_length], memory[i], commit
        )
    return force, by_depth, by_rate


def friction_with_effects(speed: float, force: float, constants: np.ndarray) -> tuple[float, float]:
    """Return the factor on the friction coefficients, and what is added to `ct` (N·s/m), at a sliding speed (m/s)."""
    factor, viscosity = 1.0, 0.0
    for i, law in FRICTION_LAWS:
        f, c = law(speed, force, constants[i, 0])
        factor, viscosity = factor * f, viscosity + c
    return factor, viscosity


def reading_with_effects(
    force: float, zero: float, scale: float, step_length: int, constants: np.ndarray, memory: np.ndarray
) -> float:
    """Return the reading for a normal force (N), in the sensor's unit.

    Parameters
    ----------
    force : float, N
    zero, scale : float
        ``reading = zero + scale · force``.
    step_length : int
        0 at the first step, to which no time leads, else 1.
    constants : (laws, 2, c) float
    memory : (laws, c) float
    """
    value = force
    for i, law in LAWS_OF_FORCE:
        value, _ = law(TexelInput(value, 1.0, 0.0, 0.0), constants[i, step_length], memory[i], True)
    value = zero + scale * value
    for i, law in LAWS_OF_READINGS:
        value, _ = law(TexelInput(value, 1.0, 0.0, 0.0), constants[i, step_length], memory[i], True)
    return value


class EffectFunctions(NamedTuple):
    """The effects of a sensor, whose parameters may differ between environments.

    Attributes
    ----------
    instead : dict
        By name, the laws that stand for the empty tuples of this module, and the number that tells whether there are some.
    force_constants, friction_constants, reading_constants : (1 or E, laws, 2, c) float
    laws, reading_laws : (int, int)
        How many laws with memory there are, at least one, and how much each of them remembers.
    pulls : bool
        Whether the normal force can be negative.
    """

    instead: dict[str, Any]
    force_constants: np.ndarray
    friction_constants: np.ndarray
    reading_constants: np.ndarray
    laws: tuple[int, int]
    reading_laws: tuple[int, int]
    pulls: bool


def functions_of(sensors: Sequence[Sensor], dt: float) -> EffectFunctions:
    """Return the effects of a sensor for steps of `dt` seconds; of one, or of one for each environment with the same effects.

    Raises
    ------
    ParameterError
        An effect acts on readings in another way than by a law of one texel.
    """
    sensor = sensors[0]
    forces, frictions, readings = _chains(sensor)
    for item, form in readings:
        if form.law is None or form.delay is not None:
            raise ParameterError(
                f"The effect '{item.name}' ({form.name}) of '{sensor.name}' has no Warp kernel: "
                "take it away, or use PressedSensors."
            )

    def laws(chain: Chain, chosen: Callable[[Form], bool]) -> Laws:
        return tuple((i, form.law or form.friction_law) for i, (_, form) in enumerate(chain) if chosen(form))

    instead = {
        "HAS_EFFECTS": int(bool(forces or frictions)),
        "CLIPPED_LAWS": laws(forces, lambda form: not form.after_clip),
        "UNCLIPPED_LAWS": laws(forces, lambda form: form.after_clip),
        "FRICTION_LAWS": laws(frictions, lambda _: True),
        "LAWS_OF_FORCE": laws(readings, lambda form: not form.after_conversion),
        "LAWS_OF_READINGS": laws(readings, lambda form: form.after_conversion),
    }
    chains = [_chains(one) for one in sensors]
    return EffectFunctions(
        instead,
        np.array([_constants(force, [dt, 0.0]) for force, _, _ in chains]),
        np.array([_constants(friction, [dt, 0.0]) for _, friction, _ in chains]),
        np.array([_constants(chain[2], [0.0, dt], one.parameters.gain) for one, chain in zip(sensors, chains, strict=True)]),
        _memory(forces),
        _memory(readings),
        any(form.after_clip for _, form in forces),
    )


Chain: TypeAlias = list[tuple[Effect, Form]]
"""Effects one after the other, with their forms."""


def _chains(sensor: Sensor) -> tuple[Chain, Chain, Chain]:
    """Return the effects on normal forces, friction and readings."""
    acting = list(in_signal_order(sensor.effects, readout=False))
    forces = [(item, form) for item, form in acting if form.law is not None]
    frictions = [(item, form) for item, form in acting if form.friction_law is not None]
    return forces, frictions, list(in_signal_order(sensor.effects, readout=True))


def _constants(chain: Chain, lengths: list[float], gain: float = 1.0) -> np.ndarray:
    """Return the constants of laws for two lengths of a step, (laws, 2, c), padded with zeros."""
    tables = []
    for item, form in chain:
        assert form.constants is not None
        tables.append(form.constants(complete_values(item, gain), np.array(lengths)))
    width = max((table.shape[1] for table in tables), default=1)
    joined = np.zeros((max(len(tables), 1), 2, width))
    for i, table in enumerate(tables):
        joined[i, :, : table.shape[1]] = table
    return joined


def _memory(chain: Chain) -> tuple[int, int]:
    return max(len(chain), 1), max((form.state_size for _, form in chain), default=1) or 1
