# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds of effects and their forms: plain data on a sensor, a kind in the library, and the mechanism by which a form acts.

Each module of the library defines one ``KIND``. A kind has several forms: different formulas
for the same phenomenon, because publications differ. A form acts by one mechanism; a law may have a delay behind it:

================  ===========================================================================================================
``law``           law with memory, equal in the solver, over whole signals and over streams (see :data:`Law`)
``memoryless``    formula on readings: ``memoryless(signal (t, n), time (t,), values, transducers, seed) → (t, n)``
``coupling``      linear coupling of texels, made once for all samples: ``coupling(values, transducers) → Weights``
``delay``         seconds by which the reading comes late: ``delay(values) → float``
``friction_law``  law of sliding (see :data:`FrictionLaw`)
``placement``     where the texels really are: ``placement(position, normal, tangent, values) → the same three``
================  ===========================================================================================================

The contract of a law: its answer depends on its arguments alone, ``commit=False`` leaves the memory as it is, and **a second
call with a step of length zero gives the first call's answer**. The solver asks with ``commit=False`` while it iterates, with
``commit=True`` at the end of the step, and the readout asks once more with the constants of length zero, when the memory
already holds that step. So a law may remember (also one at the site `contact`), but it must not take a rate from the memory
that a step of length zero would make zero or infinite: keep the rate in the memory instead, and update it only where time
passes.

Laws and friction laws are compiled, so they use only numbers, arrays and :mod:`math`. This module and those of the library
import nothing heavy, because Blender's panels list them.

Nothing outside the library names an effect. Its ``KIND`` states what others need to know of it, in the words of this module.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...errors import EffectError
from ...model.parameter import Parameter
from ...model.sensor import Value, Values
from .coupling_matrix import Weights

# What a kind states for the rest of the package: how recordings show it, how it is searched for, and how it is drawn.
#
# The gap analysis, the plans of experiments, the reports and the documentation know no effect by its name. They read what
# :class:`Kind` and :class:`Form` state in the words of this module.

FEATURES = {
    "unloading": "what is different after unloading; the loading curve alone could be that of a nonlinear spring",
    "timing": "what happens at one depth at different times, or at one time after different speeds",
    "rest": "what happens while a texel is without load, or in the same way under different loads",
    "places": "how neighbours differ as the load moves; at one place it is some pattern of texels that grows with the load",
    "cycles": "how a second cycle differs from the first; in a single cycle it lowers the unloading curve",
}
"""Features of recordings by which an effect is known. Recordings without them do not identify it, however well it fits."""
FAMILIES = {
    "nonlinear": "bends the curve of reading over load",
    "loop": "opens a loop between loading and unloading at any speed; the loading curve of the loop is bent as well",
    "late": "answers late, so that it lowers the unloading curve of a single cycle",
}
"""Families of effects that resemble each other, so that a better fit says little which of them acts."""

EXACT_FORM_ERROR = 0.001
"""φ of a form that contains every law of its kind, or of a converter, whose values are read off. It leaves 0.0002 at most
(benchmarks/RESULTS.md), and up to five times that of a dead zone of another generator. With 0.005, as of forms that
approximate, rivals of dead zones leave ten times as much."""
FIT, SILENT_TEXELS, STEPS, SCATTER = "fit", "silent texels", "steps", "scatter"
FOUND_BY = {
    FIT: "a fit of its formulas",
    SILENT_TEXELS: "readings that hardly follow the load",
    STEPS: "steps in the readings",
    SCATTER: "the residual of the final model; predictions are without it",
}
"""How an effect is found in recordings."""
SIGNATURES = {
    "pull": "readings below zero where it predicts a pull",
    "unloaded": "readings without load, from the beginning of the trials on",
    "end": "it comes to an end within the session",
}
"""Conditions that a fit of an effect must meet to be reported under its name, if it may otherwise stand for something else."""
NEEDS = {
    "temperature": "temperatures that were recorded and vary",
    "clock": "recordings of which a session says how the time went on between them",
    "no clock": "recordings of which each begins with an untouched sensor",
    "signed channels": "channels of which some rise and others fall under the same load",
    "axes": "the same, with a number of channels that is a multiple of three",
    "rows": "texels in rows and columns",
}
"""Contents of recordings without which an effect, or a form of it, is no candidate."""
DRAWINGS = {
    "time": "reading over time, for a course of depths",
    "depth": "force over depth, for a course of depths",
    "force": "reading over force",
    "speed": "friction at 1 N over the sliding speed",
    "pressings": "peak reading of each of forty pressings under steady sliding",
    "row": "readings of a column of texels with a load on one of them",
    "texel": "readings of single texels under the same load",
    "ball": "forces of a ball along a column of texels",
}
"""Experiments in which effects are drawn."""


def _twenty_seconds() -> np.ndarray:
    return np.linspace(0, 20, 2001)


def _press_and_hold() -> np.ndarray:
    return 0.002 * np.interp(_twenty_seconds(), [0, 1, 1.3, 12, 12.3, 20], [0, 0, 1, 1, 0, 0])


def cycles(count: int, time: np.ndarray, depth: float = 0.002) -> np.ndarray:
    """Return the course of the depth (m) in so many presses in the form of a cosine."""
    return depth * 0.5 * (1 - np.cos(2 * np.pi * count * time / time[-1]))


@dataclass(frozen=True, eq=False)
class Drawing:
    """The experiment in which the documentation draws the forms of an effect.

    Attributes
    ----------
    over : str
        One of :data:`DRAWINGS`.
    time, depth : (T,) float, s and m
        Course of the depth, for a drawing over time or depth: a press that is held, if none is given.
    values : dict of str to dict
        By the name of a form, values that replace its defaults.
    """

    over: str = "time"
    time: np.ndarray = field(default_factory=_twenty_seconds)
    depth: np.ndarray = field(default_factory=_press_and_hold)
    values: dict[str, dict[str, float]] = field(default_factory=dict)


SITES_OF_ACTION = ("contact", "pad", "readout")
"""Where an effect acts, in the order in which a load passes: `contact` acts before `pad`, as a part of the contact law itself;
both act on the bodies, and both may have a memory in each texel. `readout` changes only what the sensor reports."""


class TexelInput(NamedTuple):
    """Inputs of a law: one texel and one step.

    Attributes
    ----------
    force : float, N (of a readout law: the reading so far)
        Result of the effects that act before this one, at the end of the step.
    slope : float, N/m
        Derivative of `force` with respect to the depth at the end of the step.
    depth : float, m
        Penetration at the end of the step, zero without contact. Zero for a readout law.
    slide_step : float, m
        Distance slid during the step. Zero for a readout law.
    """

    force: float
    slope: float
    depth: float
    slide_step: float


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
    law, memoryless, coupling, delay, friction_law, placement
        The mechanism: one is given, or a law and a delay (see the text of the module).
    constants : callable
        ``constants(values, dt (m,)) → (m, c)``: the constants of a law for steps of these lengths (s); by default its
        parameters in their order. The constants of a friction law must not depend on the length.
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
    is_tried : bool
        Whether the gap analysis takes the form as a candidate, if the form is not random.
    fitted_up_to : dict of str to float
        Upper bounds of parameters in a fit, below their own: beyond them the formula is valid but describes another effect.
    over_within : dict of str to float
        Upper bounds of paths (m) in a fit, as shares of the path that texels are pressed in along a session.
    same_as : str
        Parameter of the base model that does the same; the form is no candidate where that is free.
    needs : str
        What recordings must hold for this form, one of :data:`NEEDS`, if it differs from the kind's.
    error : float or None
        φ of a form that is free to follow any law of its kind, or of a converter: the share of the mean square of the kind's
        change that it leaves of other laws at most, as measured: :data:`EXACT_FORM_ERROR`, or rounded up to 0.005. None for
        formulas of textbooks.
    jumps_at : tuple of str
        The parameter, if the reading jumps where a load reaches its value: no derivative leads there, so it is scanned.
    is_apart : bool
        Whether the free forms of its kind explain a part of it and do not follow it, so that it is looked for beside them.
    level_number : callable
        Of a converter: ``level_number(sizes, values) → numbers``: how many steps lead to readings so far from the one without
        load, in the sensor's unit; whole numbers at its levels.
    couples : bool
        Whether a formula on readings (`memoryless`) couples texels.
    """

    name: str
    formula: str
    reference: str
    parameters: tuple[Parameter, ...]
    law: Law | None = None
    memoryless: Callable[..., np.ndarray] | None = None
    coupling: Callable[[Values, TransducerArray], Weights] | None = None
    delay: Callable[[Values], float] | None = None
    friction_law: FrictionLaw | None = None
    placement: Callable[..., tuple[np.ndarray, np.ndarray, np.ndarray]] | None = None
    constants: Callable[[Values, np.ndarray], np.ndarray] | None = None
    state_size: int = 0
    site: str = ""
    after_conversion: bool = False
    after_clip: bool = False
    random: bool = False
    is_tried: bool = True
    fitted_up_to: dict[str, float] = field(default_factory=dict)
    over_within: dict[str, float] = field(default_factory=dict)
    same_as: str = ""
    needs: str = ""
    error: float | None = None
    jumps_at: tuple[str, ...] = ()
    is_apart: bool = False
    level_number: Callable[[np.ndarray, Values], np.ndarray] | None = None
    couples: bool = False

    def __post_init__(self) -> None:
        if self.constants is None and (self.law is not None or self.friction_law is not None):
            object.__setattr__(self, "constants", constants_from(*(parameter.name for parameter in self.parameters)))

    @cached_property
    def neutral(self) -> dict[str, float]:
        """The values at which the effect vanishes, by the names of the parameters that state one."""
        return {parameter.name: parameter.neutral for parameter in self.parameters if parameter.neutral is not None}

    @property
    def is_spatial(self) -> bool:
        """True if what the form does to a texel depends on others."""
        return self.coupling is not None or self.couples

    @property
    def is_wide(self) -> bool:
        """True if the form is free to follow any law of its kind, or is one that those forms do not follow."""
        return self.error is not None or self.is_apart

    @cached_property
    def mechanism(self) -> str:
        """The name of the mechanism that is given; of two, the law."""
        mechanisms = ("law", "memoryless", "coupling", "delay", "friction_law", "placement")
        return next(name for name in mechanisms if getattr(self, name) is not None)

    def defaults(self, gain: float = 1.0) -> dict[str, Value]:
        """Return the default of every parameter, for a sensor with this gain."""
        return {parameter.name: parameter.scaled(gain).default for parameter in self.parameters}


@dataclass(frozen=True)
class Kind:
    """An effect of the library, and all that the rest of the package knows of it.

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
    experiment : str
        The recording that shows the effect most clearly, as a request.
    drawing : Drawing
        The experiment in which the documentation draws it.
    known_from : tuple of str
        Features of recordings without which they do not identify it, of :data:`FEATURES`.
    families : tuple of str
        Which effects resemble it, of :data:`FAMILIES`.
    is_gain_of_texels : bool
        Whether it gives each texel a gain of its own.
    found_by : str
        How it is found in recordings, one of :data:`FOUND_BY`.
    signature : str
        What a fit must show, one of :data:`SIGNATURES`; empty if nothing more is asked.
    needs : str
        What recordings must hold, one of :data:`NEEDS`; empty if nothing more is asked.
    known_parameters : tuple of str
        Parameters that a fit leaves at their neutral values, because the recordings hold them.
    """

    name: str
    title: str
    text: str
    site: str
    order: float
    forms: tuple[Form, ...]
    experiment: str
    drawing: Drawing = field(default_factory=Drawing)
    known_from: tuple[str, ...] = ()
    families: tuple[str, ...] = ()
    is_gain_of_texels: bool = False
    found_by: str = FIT
    signature: str = ""
    needs: str = ""
    known_parameters: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        stated = (
            ("known_from", self.known_from, FEATURES),
            ("families", self.families, FAMILIES),
            ("found_by", (self.found_by,), FOUND_BY),
            ("signature", (self.signature,), SIGNATURES),
            ("needs", (self.needs, *(form.needs for form in self.forms)), NEEDS),
            ("drawing", (self.drawing.over,), DRAWINGS),
        )
        for attribute, words, known in stated:
            for word in words:
                if word and word not in known:
                    raise EffectError(f"{attribute} of effect '{self.name}' is '{word}': choose from {', '.join(known)}.")

    @cached_property
    def forms_by_name(self) -> dict[str, Form]:
        """The forms by their names."""
        return {form.name: form for form in self.forms}

    def site_of(self, form: Form) -> str:
        """Return the site of action of a form of this kind."""
        return form.site or self.site

    def needs_of(self, form: Form) -> str:
        """Return the contents that recordings need for a form of this kind, one of :data:`NEEDS`."""
        return form.needs or self.needs


def where_loaded(change: Callable[[np.ndarray], np.ndarray], signal: np.ndarray) -> np.ndarray:
    """Apply a function with f(0) = 0 to the non-zero samples of a signal only, because most samples are unloaded."""
    loaded = signal != 0.0
    changed = np.zeros(signal.shape)
    changed[loaded] = change(signal[loaded])
    return changed


def scalar(values: Values, name: str) -> float:
    """Return a value that is one number."""
    value = values[name]
    assert isinstance(value, float | int)
    return float(value)


def constants_from(*entries: str | float) -> Callable[[Values, np.ndarray], np.ndarray]:
    """Return the `constants` of a form whose constants are parameters, by name, and numbers, for steps of any length."""

    def constants(values: Values, dt: np.ndarray) -> np.ndarray:
        return np.tile([scalar(values, one) if isinstance(one, str) else one for one in entries], (len(dt), 1))

    return constants
