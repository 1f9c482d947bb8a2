# SPDX-License-Identifier: GPL-3.0-or-later
"""The effects of a sensor as three functions of numbers, written for its laws one after the other.

:func:`.compiled_program.apply_force_laws` calls laws by their addresses. A Warp kernel has none, and is compiled for one
sensor: here its laws are called by name. Functions of the same names in this module are those of a sensor without effects.
"""

from __future__ import annotations

import linecache
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
    # clipped laws
    force, by_depth, by_rate = damped_force_derivatives(force, slope, damping_coefficient(law), rate, linear)
    if force <= 0.0 or depth <= 0.0:
        force, by_depth, by_rate = 0.0, 0.0, 0.0
    # unclipped laws
    return force, by_depth, by_rate


def friction_with_effects(speed: float, force: float, constants: np.ndarray) -> tuple[float, float]:
    """Return the factor on the friction coefficients, and what is added to `ct` (N·s/m), at a sliding speed (m/s)."""
    factor, viscosity = 1.0, 0.0
    # friction laws
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
    # laws of force
    value = zero + scale * value
    # laws of readings
    return value


class EffectFunctions(NamedTuple):
    """The effects of a sensor, whose parameters may differ between environments.

    Attributes
    ----------
    instead : dict
        By name, what stands for the functions of this module in the kernels.
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
    clipped = [i for i, (_, form) in enumerate(forces) if not form.after_clip]
    scope = {name: value for name, value in globals().items() if not name.startswith("__")} | {"TexelInput": TexelInput}
    for prefix, chain in (("force", forces), ("friction", frictions), ("reading", readings)):
        scope |= {f"{prefix}_{i}": form.law or form.friction_law for i, (_, form) in enumerate(chain)}
    before, after = (
        [_FORCE_LAW.format(i=i, slope=slope) for i in range(len(forces)) if (i in clipped) is first]
        for slope, first in (("slope", True), ("by_depth", False))
    )
    on_force, on_reading = (
        [_READING_LAW.format(i=i) for i, (_, form) in enumerate(readings) if form.after_conversion is late]
        for late in (False, True)
    )
    instead = {
        "HAS_EFFECTS": int(bool(forces or frictions)),
        "force_with_effects": _with_laws(force_with_effects, {"clipped laws": before, "unclipped laws": after}, scope),
        "friction_with_effects": _with_laws(
            friction_with_effects, {"friction laws": [_FRICTION_LAW.format(i=i) for i in range(len(frictions))]}, scope
        ),
        "reading_with_effects": _with_laws(
            reading_with_effects, {"laws of force": on_force, "laws of readings": on_reading}, scope
        ),
    }
    chains = [_chains(one) for one in sensors]
    return EffectFunctions(
        instead,
        np.array([_constants(force, [dt, 0.0], None) for force, _, _ in chains]),
        np.array([_constants(friction, [dt, 0.0], None) for _, friction, _ in chains]),
        np.array([
            _constants(chain[2], [0.0, dt], one.parameters.gain) for one, chain in zip(sensors, chains, strict=True)
        ]),
        _memory(forces),
        _memory(readings),
        any(form.after_clip for _, form in forces),
    )  # fmt: skip


Chain: TypeAlias = list[tuple[Effect, Form]]
"""Effects one after the other, with their forms."""


def _chains(sensor: Sensor) -> tuple[Chain, Chain, Chain]:
    """Return the effects on normal forces, friction and readings."""
    acting = list(in_signal_order(sensor.effects, readout=False))
    forces = [(item, form) for item, form in acting if form.law is not None]
    frictions = [(item, form) for item, form in acting if form.friction_law is not None]
    return forces, frictions, list(in_signal_order(sensor.effects, readout=True))


_FORCE_LAW = (
    "force, {slope} = force_{i}("
    "TexelInput(force, {slope}, depth, motion.slide_step), constants[{i}, step_length], memory[{i}], commit)"
)
_FRICTION_LAW = "f, c = friction_{i}(speed, force, constants[{i}, 0])\nfactor, viscosity = factor * f, viscosity + c"
_READING_LAW = "value, _ = reading_{i}(TexelInput(value, 1.0, 0.0, 0.0), constants[{i}, step_length], memory[{i}], True)"


def _with_laws(template: Callable[..., Any], calls: dict[str, list[str]], scope: dict[str, Any]) -> Callable[..., Any]:
    """Return a copy of a function of this module with calls in the place of its comments."""
    import inspect

    lines = []
    for line in inspect.getsource(template).splitlines():
        indent, mark = line[: len(line) - len(line.lstrip())], line.strip().removeprefix("# ")
        if line.strip().startswith("# ") and mark in calls:
            lines += [indent + part for call in calls[mark] for part in call.split("\n")]
        else:
            lines.append(line)
    text = "from __future__ import annotations\n" + "\n".join(lines) + "\n"
    file = f"<{template.__name__} {hash(text):x} {id(scope):x}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    scope = {**scope, "__name__": template.__module__}
    exec(compile(text, file, "exec"), scope)
    made: Callable[..., Any] = scope[template.__name__]
    return made


def _constants(chain: Chain, lengths: list[float], gain: float | None) -> np.ndarray:
    """Return the constants of laws for two lengths of a step, (laws, 2, c), padded with zeros."""
    tables = []
    for item, form in chain:
        assert form.constants is not None
        values = complete_values(item) if gain is None else complete_values(item, gain)
        tables.append(form.constants(values, np.array(lengths)))
    width = max((table.shape[1] for table in tables), default=1)
    joined = np.zeros((max(len(tables), 1), 2, width))
    for i, table in enumerate(tables):
        joined[i, :, : table.shape[1]] = table
    return joined


def _memory(chain: Chain) -> tuple[int, int]:
    return max(len(chain), 1), max((form.state_size for _, form in chain), default=1) or 1
