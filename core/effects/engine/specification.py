# SPDX-License-Identifier: GPL-3.0-or-later
"""What an effect is: plain data on a sensor, a kind in the library, and the mechanism by which a form of it acts.

Each module of the library defines one ``KIND``. A kind has several forms: different formulas
for the same phenomenon, because publications differ. A form acts by exactly one mechanism:

================  ===========================================================================================================
``law``           law with memory, equal in the solver, over whole signals and over streams (see :data:`Law`)
``memoryless``    formula on readings: ``memoryless(signal (t, n), time (t,), values, transducers, seed) → (t, n)``
``coupling``      linear coupling of texels, made once for all samples: ``coupling(values, transducers) → CouplingMatrix``
``delay``         seconds by which the reading comes late: ``delay(values) → float``
``friction_law``  law of sliding (see :data:`FrictionLaw`)
``placement``     where the texels really are: ``placement(position, normal, tangent, values) → the same three``
================  ===========================================================================================================

Laws and friction laws are compiled, so they use only numbers, arrays and :mod:`math`. This module and those of the library
import nothing heavy, because Blender's panels list them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...model.effect import Value, Values
from ...model.parameter import Parameter
from .coupling_matrix import CouplingMatrix

SITES_OF_ACTION = ("contact", "pad", "readout")
"""Where an effect acts, in the order in which a load passes: `contact` changes the contact law itself and has no memory, `pad`
has a memory in each texel; both act on the bodies. `readout` changes only what the sensor reports."""


class TexelInput(NamedTuple):
    """What a law is told about one texel and one step.

    Attributes
    ----------
    force : float, N (of a readout law: the reading so far)
        Result of the effects that act before this one, at the end of the step.
    slope : float, N/m
        Derivative of `force` with respect to the depth at the end of the step.
    depth : float, m
        Penetration at the end of the step, zero while nothing touches. Zero for a readout law.
    slide : float, m
        Distance slid during the step. Zero for a readout law.
    """

    force: float
    slope: float
    depth: float
    slide: float


Law = Callable[[TexelInput, np.ndarray, np.ndarray, bool], tuple[float, float]]
"""``law(texel, constants, state, commit) → (force, slope)``

Parameters
----------
texel : TexelInput
constants : (c,) float
    What :attr:`Form.constants` gives for the length of this step.
state : (:attr:`Form.state_size`,) float
    What the law remembers of this texel. All zeros at the start.
commit : bool
    Write the new state. If false, the law is only evaluated, and `state` must stay as it is.
"""

FrictionLaw = Callable[[float, float, np.ndarray], tuple[float, float]]
"""``friction_law(speed, force, constants) → (factor on the friction coefficient, viscous drag in N·s/m)``

Parameters
----------
speed : float, m/s
    Sliding speed, never negative.
force : float, N
    Normal force.
constants : (c,) float
"""


@dataclass(frozen=True)
class TransducerArray:
    """The texels of a sensor, as effects on readings see them, and its linear conversion from force to reading.

    Attributes
    ----------
    position : (n, 3) float, m
    area : (n,) float, m²
    row, column : (n,) int or None
        Place of each texel in a grid, if the texels form one.
    gain, zero : float
        Conversion ``reading = zero + gain · force`` from newtons to the unit of the sensor.
    painted : float or (n,) float
        Multiplies the gain of each texel.
    name : str
        Of the sensor, for messages.
    temperature : pair of (m,) float, or None
        Times (s, increasing) and temperatures (°C) that were recorded; None if none were.
    """

    position: np.ndarray
    area: np.ndarray
    row: np.ndarray | None = None
    column: np.ndarray | None = None
    gain: float = 1.0
    zero: float = 0.0
    painted: float | np.ndarray = 1.0
    name: str = "sensor"
    temperature: tuple[np.ndarray, np.ndarray] | None = None

    def __len__(self) -> int:
        return len(self.position)


@dataclass(frozen=True)
class Form:
    """One formula of an effect.

    Attributes
    ----------
    name : str
    formula : str
        As the documentation prints it.
    reference : str
        Where the formula comes from.
    parameters : tuple of Parameter
    neutral : dict of str to float
        Values at which the effect vanishes; they may lie outside the bounds. Examples: strength zero, level infinity.
    law, memoryless, coupling, delay, friction_law, placement
        The mechanism; exactly one is given (see the text of the module).
    constants : callable
        ``constants(values, dt (m,)) → (m, c)``: the constants of a law for steps of these lengths (s). The constants of a
        friction law must not depend on the length.
    state_size : int
        How many numbers a law remembers for each texel.
    site : str
        Site of action, if it differs from that of the kind.
    after_conversion : bool
        A readout form that acts on the reading in the unit of the sensor, not on newtons before gain and zero.
    after_clip : bool
        A law that acts after the normal force was clipped at zero, so that the texel can pull.
    random : bool
        Whether the form draws random numbers, which depend on the seed.
    """

    name: str
    formula: str
    reference: str
    parameters: tuple[Parameter, ...]
    neutral: dict[str, float]
    law: Law | None = None
    memoryless: Callable[..., np.ndarray] | None = None
    coupling: Callable[[Values, TransducerArray], CouplingMatrix] | None = None
    delay: Callable[[Values], float] | None = None
    friction_law: FrictionLaw | None = None
    placement: Callable[..., tuple[np.ndarray, np.ndarray, np.ndarray]] | None = None
    constants: Callable[[Values, np.ndarray], np.ndarray] | None = None
    state_size: int = 0
    site: str = ""
    after_conversion: bool = False
    after_clip: bool = False
    random: bool = False

    @property
    def mechanism(self) -> str:
        """The name of the mechanism that is given."""
        mechanisms = ("law", "memoryless", "coupling", "delay", "friction_law", "placement")
        return next(name for name in mechanisms if getattr(self, name) is not None)

    def defaults(self, gain: float = 1.0) -> dict[str, Value]:
        """Return the default of every parameter, for a sensor with this gain."""
        return {parameter.name: parameter.scaled(gain).default for parameter in self.parameters}


@dataclass(frozen=True)
class Kind:
    """An effect of the library.

    Attributes
    ----------
    name : str
        Standard name, used in files and reports.
    title : str
        For people.
    text : str
        What it does, in one sentence.
    site : str
        Site of action, one of :data:`SITES_OF_ACTION`.
    order : float
        Rank among the effects with the same site of action: lower acts first.
    forms : tuple of Form
        The first is the usual one.
    """

    name: str
    title: str
    text: str
    site: str
    order: float
    forms: tuple[Form, ...]

    def site_of(self, form: Form) -> str:
        """Return the site of action of a form of this kind."""
        return form.site or self.site


def scalar(values: Values, name: str) -> float:
    """Return a value that is one number."""
    value = values[name]
    assert isinstance(value, float | int)
    return float(value)


def constants_from(*names: str) -> Callable[[Values, np.ndarray], np.ndarray]:
    """Return the `constants` of a form whose constants are the parameters of these names, for steps of any length."""

    def constants(values: Values, dt: np.ndarray) -> np.ndarray:
        return np.tile([scalar(values, name) for name in names], (len(dt), 1))

    return constants
