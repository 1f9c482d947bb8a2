# SPDX-License-Identifier: GPL-3.0-or-later
"""What an effect is: plain data on a sensor, a kind in the library, and the mechanism by which a form of it acts.

Each module of the library defines one ``KIND``. A kind has several forms: different formulas for the same phenomenon, since no
two papers agree on one. A form acts by exactly one mechanism:

================  ===========================================================================================================
``law``           law with memory, equal in the solver, over whole signals and over streams (see :data:`Law`)
``memoryless``    formula on readings: ``memoryless(signal (t, n), time (t,), values, transducers, seed) → (t, n)``
``coupling``      linear coupling of texels, made once for all samples: ``coupling(values, transducers) → CouplingMatrix``
``delay``         seconds by which the reading comes late: ``delay(values) → float``
``friction_law``  law of sliding: ``friction_law(speed, force, numbers, row) → (factor on the friction coefficient, N·s/m)``
``placement``     where the texels really are: ``placement(position, normal, tangent, values) → the same three``
================  ===========================================================================================================

Laws and friction laws are compiled, so they use only numbers, arrays and :mod:`math`. This module and those of the library
import nothing heavy, because Blender's panels list them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...model.effect import Value, Values
from ...model.parameter import Parameter
from .coupling_matrix import CouplingMatrix

SITES_OF_ACTION = ("contact", "pad", "readout")
"""`contact`: the law of contact itself, without memory. `pad`: with memory; both act on the bodies. `readout`: only on what
the sensor reports."""

Law = Callable[..., tuple[float, float]]
"""``law(force, slope, depth, slide, numbers, row, memory, point, at, commit) → (force, slope)``

Parameters
----------
force : float, N (of a readout law: the reading so far)
    What the laws before this one give at the end of the step.
slope : float, N/m
    Its derivative by the depth at the end of the step.
depth : float, m
    Penetration at the end of the step, zero while nothing touches. A readout law gets zero.
slide : float, m
    Distance slid in the step. A readout law gets zero.
numbers, row : (…, c) float, int
    The law's constants for this length of step are ``numbers[row]``.
memory, point, at : (…, m) float, int, int
    The law's own memory are the columns from ``at`` on of ``memory[point]``; it is all zero at first.
commit : bool
    Write the memory. Without it the law is only asked what would be.
"""


@dataclass(frozen=True)
class TransducerArray:
    """Where an effect sits: the texels and the linear conversion of the sensor it belongs to.

    Attributes
    ----------
    position : (n, 3) float, m
    area : (n,) float, m²
    row, column : (n,) int or None
        Of texels that form a grid.
    gain, zero : float
        Conversion from newtons to the sensor's unit.
    painted : float or (n,) float
        Multiplies the gain of each texel.
    """

    position: np.ndarray
    area: np.ndarray
    row: np.ndarray | None = None
    column: np.ndarray | None = None
    gain: float = 1.0
    zero: float = 0.0
    painted: float | np.ndarray = 1.0
    name: str = "sensor"

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
    parameters : tuple of Parameter
    neutral : dict of str to float
        Values, possibly outside the bounds, at which the effect is not there: ``strength`` zero, a level of infinity.
    law, memoryless, coupling, delay, friction_law, placement
        How it acts; exactly one is given (see the module's text).
    constants : callable
        ``constants(values, dt (m,)) → (m, c)``: the numbers of a law for steps of these lengths (s), of a friction law for
        none in particular.
    memory : int
        How many numbers a law remembers.
    site : str
        Where it differs from that of its kind.
    after_conversion : bool
        A readout form that acts on the reading in the sensor's unit, and not on newtons before gain and zero.
    after_clip : bool
        A law that acts after the force was cut off at zero, so that it may pull.
    random : bool
        It depends on the seed.
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
    friction_law: Callable[..., tuple[float, float]] | None = None
    placement: Callable[..., tuple[np.ndarray, np.ndarray, np.ndarray]] | None = None
    constants: Callable[[Values, np.ndarray], np.ndarray] | None = None
    memory: int = 0
    site: str = ""
    after_conversion: bool = False
    after_clip: bool = False
    random: bool = False

    @property
    def mechanism(self) -> str:
        """How it acts: the name of the one attribute that is given."""
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
        Its standard name: files and reports use it.
    title : str
        For people.
    text : str
        What it does, in one sentence.
    site : str
        One of :data:`SITES_OF_ACTION`.
    order : float
        Place in the chain among those of its site.
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
        """Return where a form of this kind acts."""
        return form.site or self.site


def scalar(values: Values, name: str) -> float:
    """Return a value that is one number."""
    value = values[name]
    assert isinstance(value, float | int)
    return float(value)


def constants_from(*names: str) -> Callable[[Values, np.ndarray], np.ndarray]:
    """Return the `constants` of a law whose numbers are its parameters of these names, whatever the step."""

    def constants(values: Values, dt: np.ndarray) -> np.ndarray:
        return np.tile([scalar(values, name) for name in names], (len(dt), 1))

    return constants
