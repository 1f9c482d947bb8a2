# SPDX-License-Identifier: GPL-3.0-or-later
"""What may be missing: every form of every effect, with bounds that fit the recording, and where to begin looking."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ...effects.engine.registry import library
from ...effects.engine.specification import Form, Kind, TransducerArray
from ...model.effect import Effect
from ...model.parameter import Parameter
from ..fitting.least_squares import Fit, FreeParameter
from ..fitting.noise_floor import coverage
from ..forward.predictor import Model, Predictor
from .identifiability import unidentifiable

TIGHTER_BOUNDS = {
    ("creep", "rising-exponential", "amount"): 1.0,
    ("creep", "rising-logarithmic", "amount"): 0.3,
    ("softening", "path", "share"): 0.5,
    ("softening", "peak", "share"): 0.6,
    ("hysteresis", "duhem", "width"): 0.5,
    ("hysteresis", "trailing", "width"): 0.5,
}
"""Tighter bounds than the effects' own: past them a formula is still sound, but it is another effect that it then describes (a
reading that rises fivefold is a lag, a softening that leaves nothing is wear)."""

NOT_FITTED = ("noise",)
"""Kinds that are not found by fitting but by what is left in the end (see :mod:`.heteroscedastic_noise`)."""
DIRECTLY_ESTIMATED = ("dead-texels", "quantization")
"""Kinds whose numbers are read off the recordings, since a texel is dead or is not, and a step is there or is not."""


_HALTON_DIMENSIONS = 5
"""Parameters of a form whose starting values are independent of each other; further ones repeat those of the first."""


@dataclass(frozen=True)
class Scales:
    """How large things are in a recording.

    Attributes
    ----------
    depth, force, reading : float
        Largest of a texel: m, N, the sensor's unit.
    pitch, size : float, m
        Distance of neighbouring texels, and the sensor's own extent.
    step, seconds : float, s
        Between samples, and of the longest trial.
    speed : float, m/s
        Largest of sliding.
    texels : int
    """

    depth: float
    force: float
    reading: float
    pitch: float
    size: float
    step: float
    seconds: float
    speed: float
    texels: int


def scales_of(predictors: Sequence[Predictor], model: Model) -> Scales:
    """Measure a recording."""
    p = predictors[0].rig.texels.position
    forces = [predictor.normal_force(model) for predictor in predictors]
    readings = [np.nanmax(np.abs(t.reading)) for t in (q.trial for q in predictors) if t.reading is not None]
    force = max(float(f.max(initial=0.0)) for f in forces)
    extent = float(np.linalg.norm(np.ptp(p, axis=0))) if len(p) > 1 else 0.0
    pitch = float(np.sqrt(np.median(predictors[0].rig.texels.area))) if len(p) > 1 else 1e-3
    return Scales(
        depth=max(max(float(q.stimulus.depth.max(initial=0.0)) for q in predictors), 1e-6),
        force=max(force, 1e-9),
        reading=max([float(r) for r in readings] + [1e-12]),
        pitch=pitch,
        size=max(extent, pitch),
        step=float(np.median([q.trial.step for q in predictors])),
        seconds=max(float(q.trial.time[-1] - q.trial.time[0]) for q in predictors),
        speed=max(max(float(q.stimulus.slide.max(initial=0.0)) for q in predictors), 1e-6),
        texels=len(p),
    )


def search_range(parameter: Parameter, scales: Scales) -> tuple[float, float]:
    """Return between which values a parameter would show in a recording of these scales, inside its own bounds."""
    known = {
        "N": (0.02 * scales.force, 4.0 * scales.force),
        "unit": (0.02 * scales.reading, 4.0 * scales.reading),
        "m": (min(0.05 * scales.depth, 0.3 * scales.pitch), max(5.0 * scales.depth, 2.0 * scales.pitch)),
        "s": (0.5 * scales.step, 2.0 * scales.seconds),
        "m/s": (0.02 * scales.speed, 2.0 * scales.speed),
        "N·s": (0.1 * scales.force * scales.seconds, 50.0 * scales.force * scales.seconds),
        "J": (0.1 * scales.force * scales.depth, 50.0 * scales.force * scales.speed * scales.seconds),
        "1/N": (0.02 / scales.force, 2.0 / scales.force),
        "s/m": (0.02 / scales.speed, 2.0 / scales.speed),
        "unit/s": (-0.5 * scales.reading / scales.seconds, 0.5 * scales.reading / scales.seconds),
        "rad": (-0.1, 0.1),
        "N·s/m": (0.02 * scales.force / scales.speed, 2.0 * scales.force / scales.speed),
    }
    low, high = known.get(parameter.unit, (parameter.low, parameter.high))
    if parameter.low < 0.0 < low:  # one that may have either sign
        low, high = -0.25 * high, 0.25 * high
    if parameter.unit == "1":
        high = min(high, max(1.0, 4.0 * parameter.default))
    low, high = max(low, parameter.low), min(high, parameter.high)
    if not low < high:
        low, high = parameter.low, parameter.high
    return low, high


@dataclass(frozen=True)
class Candidate:
    """A form that may be missing."""

    kind: Kind
    form: Form

    @property
    def name(self) -> str:
        """The effect's standard name."""
        return self.kind.name

    @property
    def label(self) -> str:
        """Name and form."""
        return f"{self.kind.name}/{self.form.name}"

    @property
    def has_texel_parameters(self) -> bool:
        """Whether it has a number for each texel."""
        return any(p.per_texel for p in self.form.parameters)

    def free_parameters(self, index: int, scales: Scales, gain: float) -> list[FreeParameter]:
        """Return its numbers as those of the `index`-th effect of a stack."""
        made = []
        for raw in self.form.parameters:
            p = raw.scaled(gain)
            _, top = search_range(p, scales)
            size = max(abs(p.default), 0.1 * top) if p.unit == "1" else 0.3 * top
            high = min(p.high, TIGHTER_BOUNDS.get((self.kind.name, self.form.name, p.name), p.high))
            rest = float(self.form.neutral.get(p.name, p.default)) if p.per_texel else 0.0
            made.append(FreeParameter(index, p.name, p.low, high, p.log, max(size, 1e-12), p.per_texel, rest))
        return made

    def effect(self, values: dict[str, float], texels: int, gain: float) -> Effect:
        """Return it with these values and defaults for the others; numbers per texel are all alike at first."""
        complete = {**self.form.defaults(gain), **values}
        spread = {
            p.name: tuple([float(complete[p.name])] * texels)  # type: ignore[arg-type]
            for p in self.form.parameters
            if p.per_texel and not isinstance(complete[p.name], tuple)
        }
        return Effect(self.kind.name, self.form.name, {**complete, **spread})

    def starting_values(self, scales: Scales, gain: float, count: int = 8) -> Iterator[dict[str, float]]:
        """Yield values to start a search from, spread evenly over the search ranges (Halton's sequence)."""
        from scipy.stats import qmc

        sequence = qmc.Halton(_HALTON_DIMENSIONS, scramble=False)
        sequence.fast_forward(1)  # the first point is the corner of all ranges
        for shares in sequence.random(count):
            values = {}
            for k, raw in enumerate(self.form.parameters):
                p = raw.scaled(gain)
                low, high = search_range(p, scales)
                share = shares[k % _HALTON_DIMENSIONS]
                if low > 0 and (p.log or high > 30.0 * low):
                    values[p.name] = float(np.exp(np.log(low) + share * (np.log(high) - np.log(low))))
                else:
                    values[p.name] = float(low + share * (high - low))
            yield values

    def strength_parameter(self) -> str | None:
        """The parameter that is zero when the effect is not there, if there is one."""
        for name, value in self.form.neutral.items():
            if value == 0.0:
                return name
        return None

    def inverse_strength_parameter(self) -> str | None:
        """The parameter that is infinite when the effect is not there, if there is one: its inverse is the strength."""
        for name, value in self.form.neutral.items():
            if np.isinf(value):
                return name
        return None


@dataclass
class FittedCandidate:
    """A candidate fitted on top of a model.

    Attributes
    ----------
    candidate : Candidate
    fit : Fit
    held_out : (trials, 2) float
        Squares of each trial, of readings and of forces, as predicted by a fit that has not seen it, in units of the noise.
    """

    candidate: Candidate
    fit: Fit
    held_out: np.ndarray

    @property
    def mean(self) -> float:
        """Mean square on unseen trials."""
        return float(self.held_out.sum() / self.fit.count.sum())

    @property
    def parameter_count(self) -> int:
        """How many numbers it takes."""
        n = len(self.fit.model.effects)
        values = self.fit.model.effects[n - 1].values
        return sum(len(v) if isinstance(v, tuple) else 1 for v in values.values())


def candidates(predictors: Sequence[Predictor], model: Model) -> list[Candidate]:
    """Return the forms that these recordings could show at all."""
    posed = any(p.trial.stimulus == "pose" for p in predictors)
    dragged = any(p.trial.force is not None and p.stimulus.slide.any() for p in predictors)
    read = any(p.trial.reading is not None for p in predictors)
    several = len(predictors[0].rig.texels) > 1
    loaded = all(p.trial.stimulus == "force" for p in predictors)
    cannot = unidentifiable(coverage(predictors))
    found = []
    for kind in library().values():
        if kind.name in NOT_FITTED or kind.name in cannot:
            continue
        for form in kind.forms:
            acts_on_force = kind.site_of(form) != "readout"
            if (
                form.random
                or form.name == "bits"
                or (form.placement is not None and not posed)
                or (form.friction_law is not None and not dragged)
            ):
                continue
            if form.friction_law is None and acts_on_force and loaded:
                continue  # known loads leave a law of contact nothing to say
            if not acts_on_force and not read:
                continue
            one = Candidate(kind, form)
            if not several and (one.has_texel_parameters or is_spatial(form)):
                continue
            found.append(one)
    return found


def is_spatial(form: Form) -> bool:
    """Whether a form lets texels feel their neighbours: found out by loading one of three."""
    if form.coupling is not None:
        return True
    if form.memoryless is None:
        return False
    position = np.array([[0.0, 0.0, 0.0], [0.003, 0.0, 0.0], [0.006, 0.0, 0.0]])
    site = TransducerArray(position, np.full(3, 9e-6), np.zeros(3, int), np.arange(3))
    values = form.defaults()
    for p in form.parameters:
        if p.per_texel:
            values[p.name] = tuple([float(values[p.name])] * 3)  # type: ignore[arg-type]
    time = np.zeros(2)
    alone, loaded = (form.memoryless(np.array([[0.0, x, 0.0]] * 2), time, values, site, 0)[0] for x in (0.0, 0.05))
    return bool(np.abs(loaded - alone)[[0, 2]].max() > 1e-9)
