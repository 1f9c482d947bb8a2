# SPDX-License-Identifier: GPL-3.0-or-later
"""Candidates: every form of every effect, with bounds that suit the recordings and starting values for a fit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from ...effects.engine.registry import form_of, library, names_found_by
from ...effects.engine.specification import SCATTER, SILENT_TEXELS, STEPS, Form, Kind
from ...geometry.grid_layout import GridLayout
from ...geometry.rotations import rotation_matrices
from ...model.parameter import Parameter
from ...model.sensor import Effect
from ..fitting.identifiability import unidentifiable
from ..fitting.least_squares import FreeParameter, value_of
from ..fitting.noise_floor import coverage
from ..forward.predictor import Model, Predictor
from ..forward.response_check import centred

NOT_FITTED = names_found_by(SCATTER)
"""Kinds that are not fitted but found in the final residual (see :func:`.residual_tests.proportional_noise`)."""
DIRECTLY_ESTIMATED = (*names_found_by(SILENT_TEXELS), *names_found_by(STEPS))
"""Kinds whose fit, if there is one, begins with a direct estimate from the readings (see :mod:`.direct_estimates`)."""
SHORTEST_STEP, LONGEST_STEP = 0.01, 20.0
"""A starting point is moved along a candidate's strength by factors between these."""
SMALL, LARGE = 0.02, 4.0
"""A parameter shows between these multiples of the quantity that it is compared with."""
SIGNED_SHARE = 0.25
"""Bounds of a parameter that may have either sign, as a share of the upper bound of its magnitude."""
LOG_RATIO = 30.0
"""A range is searched on a logarithmic scale if its ends differ by more than this ratio."""
LEAST_WIDTH = 0.25
"""Least width of load spreading in a fit, in pitches: below, nothing reaches the neighbours, and no derivative leads back."""
AT_BOUND = 0.01
"""A parameter is at a bound if it differs from it by less than this share of the bound."""
NEARLY_ALL = 0.9
"""Least upper bound of a share that means the whole. Bounds of 0.9 and 0.95 avoid a division by zero at 1. The next smaller
bound is the 0.5 of crosstalk between wires, so any number between does the same. While 0.5 meant the whole, wires rivalled load
spreading in two of the 133 rigs of base 126900."""
LEAST_WARMTH = 1.0
"""Range of temperatures (K) from which on what follows them can be told from what does not. Chosen by eye."""
SIGNED_CORRELATION, LEAST_SIGNED = 0.5, 0.1
"""Channels are signed if at least this share of them follows the load with this correlation, and as many with its negative.
Chosen by eye: of eFlesh's channels 12 rise and 3 fall under a normal force, and 8 and 19 in shear; the texels of each other
set of benchmarks/_foreign.py all go one way."""
START_COUNT = 8
"""Number of starting points of a candidate. Where only the six of largest promise were compared by the squares there, a load
spreading was called crosstalk."""
SHARPNESS = "sharpness"
"""Name of parameters that say how sharp a knee is."""
IN_PLANE = ("x", "y", "about_z")
"""Parameters of a displacement along the skin."""
SMALL_SHIFT, SMALL_TURN = 0.02, 2e-3
"""Test steps of displaced texels: a share of the pitch, and an angle in rad, up to which a face is parallel to texels."""


@dataclass(frozen=True)
class Scales:
    """Magnitudes in a set of recordings.

    Attributes
    ----------
    depth, force, reading : float
        Largest of a texel: m, N, the sensor's unit.
    pitch : float, m
        Distance between neighbouring texels.
    step, seconds : float, s
        Median time between samples, and length of the longest trial or session.
    sliding_speed, rate : float, m/s
        Largest speeds of sliding, and of a texel's depth.
    texels : int
    travel : float, m
        Path that texels are pressed in along the longest session; infinite without a session.
    warmth : float, K
        Range of the temperatures that were recorded; zero if they were not recorded with every trial.
    """

    depth: float
    force: float
    reading: float
    pitch: float
    step: float
    seconds: float
    sliding_speed: float
    rate: float
    texels: int
    travel: float = np.inf
    warmth: float = 0.0


def scales_of(predictors: Sequence[Predictor], model: Model) -> Scales:
    """Return the magnitudes in the trials of some predictors; forces are those of a model."""
    texels = predictors[0].rig.texels
    forces = [predictor.normal_force(model) for predictor in predictors]
    readings = [float(np.nanmax(np.abs(t.reading))) for t in (q.trial for q in predictors) if t.reading is not None]
    steps = [np.abs(np.diff(q.stimulus.depth, axis=0)).max(axis=1, initial=0.0) for q in predictors]
    rates = [float((step / np.diff(q.trial.time)).max(initial=0.0)) for step, q in zip(steps, predictors, strict=True)]
    return Scales(
        depth=max(max(float(q.stimulus.depth.max(initial=0.0)) for q in predictors), 1e-6),
        force=max(max(float(f.max(initial=0.0)) for f in forces), 1e-9),
        reading=max([*readings, 1e-12]),
        pitch=float(np.sqrt(np.median(texels.area))) if len(texels) > 1 else 1e-3,
        step=float(np.median([q.trial.step for q in predictors])),
        seconds=max(float(np.ptp(q.responses.stimulus.time)) for q in predictors),
        sliding_speed=max(max(float(q.stimulus.slide_speed.max(initial=0.0)) for q in predictors), 1e-6),
        rate=max([*rates, 1e-6]),
        texels=len(texels),
        travel=_travel(predictors),
        warmth=_warmth(predictors),
    )


def _warmth(predictors: Sequence[Predictor]) -> float:
    """Range of the recorded temperatures, K; zero if a trial has none."""
    recorded = [p.trial.temperature for p in predictors]
    values = [one[1] for one in recorded if one is not None]
    return float(np.ptp(np.concatenate(values))) if values and len(values) == len(recorded) else 0.0


def _travel(predictors: Sequence[Predictor]) -> float:
    """Path that texels are pressed in along the longest session, a mean weighted by their paths, m; infinite without one."""
    found = []
    for session in {id(q.session): q.session for q in predictors if q.session is not None}.values():
        path = np.maximum(np.diff(session.stimulus.depth, axis=0, prepend=0.0), 0.0).sum(axis=0)
        if path.any():
            found.append(float((path @ path) / path.sum()))
    return max(found, default=np.inf)


def search_range(parameter: Parameter, scales: Scales, form: Form) -> tuple[float, float]:
    """Return the range of values in which a parameter of a form would show in recordings of these scales, inside its bounds."""
    warmth = max(scales.warmth, LEAST_WARMTH)
    speed = scales.rate if form.friction_law is None else scales.sliding_speed
    longest = 2.0 * scales.seconds
    if form.neutral.get(parameter.name) == 0.0:  # a delay is compared with the time in which a load comes
        longest = max(min(longest, LARGE * scales.depth / scales.rate), LARGE * scales.step)
    known = {
        "N": (SMALL * scales.force, LARGE * scales.force),
        "unit": (SMALL * scales.reading, LARGE * scales.reading),
        "m": (min(0.05 * scales.depth, 0.3 * scales.pitch), max(5.0 * scales.depth, 2.0 * scales.pitch)),
        "s": (0.5 * scales.step, longest),
        "m/s": (0.02 * speed, 2.0 * speed),
        "N·s": (0.1 * scales.force * scales.seconds, 50.0 * scales.force * scales.seconds),
        "J": (0.1 * scales.force * scales.depth, 50.0 * scales.force * speed * scales.seconds),
        "s/m": (0.02 / speed, 2.0 / speed),
        "unit/s": (-0.5 * scales.reading / scales.seconds, 0.5 * scales.reading / scales.seconds),
        "rad": (-0.1, 0.1),
        "N·s/m": (0.02 * scales.force / speed, 2.0 * scales.force / speed),
        "1/K": (-0.5 / warmth, 0.5 / warmth),
        "unit/K": (-0.5 * scales.reading / warmth, 0.5 * scales.reading / warmth),
    }
    if parameter.unit.startswith("1/N"):
        size = scales.force**parameter.force_dimension
        known[parameter.unit] = 0.02 * size, 2.0 * size
    low, high = known.get(parameter.unit, (parameter.low, parameter.high))
    if parameter.low < 0.0 < low:  # either sign is possible
        low, high = -SIGNED_SHARE * high, SIGNED_SHARE * high
    if parameter.unit == "1":
        high = min(high, max(1.0, 4.0 * parameter.default))
    low, high = max(low, parameter.low), min(high, parameter.high)
    if not low < high:
        low, high = parameter.low, parameter.high
    return low, high


@dataclass(frozen=True)
class Candidate:
    """A form of an effect that may be missing in the model.

    Attributes
    ----------
    kind : Kind
    form : Form
        With the parameters that are looked for.
    held : tuple of str
        Parameters that no fit changes.
    """

    kind: Kind
    form: Form
    held: tuple[str, ...] = ()

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
        """True if it has parameters of single texels."""
        return any(p.per_texel for p in self.form.parameters)

    def free_parameters(self, index: int, scales: Scales, gain: float) -> list[FreeParameter]:
        """Return its free parameters as those of the effect number `index` of a stack."""
        made = []
        for raw in (p for p in self.form.parameters if p.name not in self.held):
            p = raw.scaled(gain)
            _, top = search_range(p, scales, self.form)
            size = max(abs(p.default), 0.1 * top) if p.unit == "1" else 0.3 * top
            low, high = p.low, min(p.high, self.form.fitted_up_to.get(p.name, p.high))
            if p.name in self.form.over_within:
                high = max(min(high, self.form.over_within[p.name] * scales.travel), low * LOG_RATIO)
            if self.form.coupling is not None and p.unit == "m":
                low = min(max(low, LEAST_WIDTH * scales.pitch), high)
            rest = float(self.form.neutral.get(p.name, p.default)) if p.per_texel else 0.0
            made.append(FreeParameter(index, p.name, low, high, p.log, max(size, 1e-12), p.per_texel, rest))
        return made

    def effect(self, values: dict[str, float], texels: int, gain: float) -> Effect:
        """Return the effect with some values and defaults for the others; parameters of single texels start equal."""
        free, whole = self.form.defaults(gain), form_of(self.kind.name, self.form.name)
        known = {name: value for name, value in whole.neutral.items() if name not in free}  # what is not looked for
        complete = {**known, **free, **values}
        spread = {
            p.name: tuple([float(complete[p.name])] * texels)  # type: ignore[arg-type]
            for p in self.form.parameters
            if p.per_texel and not isinstance(complete[p.name], tuple)
        }
        return Effect(self.kind.name, self.form.name, {**complete, **spread})

    def starting_values(self, scales: Scales, gain: float, count: int = START_COUNT) -> Iterator[dict[str, float]]:
        """Yield starting values, spread evenly over the search ranges (Halton sequence)."""
        for point in _halton_points(len(self.form.parameters), count):
            values = {}
            for share, raw in zip(point, self.form.parameters, strict=True):
                p = raw.scaled(gain)
                low, high = search_range(p, scales, self.form)
                if low > 0 and (p.log or high > LOG_RATIO * low):
                    values[p.name] = float(np.exp(np.log(low) + share * (np.log(high) - np.log(low))))
                else:
                    values[p.name] = float(low + share * (high - low))
            yield values

    @property
    def is_signed(self) -> bool:
        """True if its strength may be negative."""
        strength, _ = self._strength()
        return strength is not None and strength.low < 0.0

    def scaled(self, effect: Effect, length: float, gain: float) -> Effect:
        """Return the effect with so many times its strength, inside its bounds; the same if it has none."""
        strength, power = self._strength()
        if strength is None:
            return effect
        p, value = strength.scaled(gain), effect.values[strength.name]
        factor = np.clip(length, -LONGEST_STEP if p.low < 0.0 else SHORTEST_STEP, LONGEST_STEP)
        return replace(effect, values={**effect.values, p.name: float(np.clip(value * factor**power, p.low, p.high))})

    def _strength(self) -> tuple[Parameter | None, float]:
        """The parameter that is zero if the effect is absent, with 1, or the one that is infinite, with -1."""
        for end, power in ((0.0, 1.0), (np.inf, -1.0)):
            for p in self.form.parameters:
                if not p.per_texel and self.form.neutral.get(p.name) == end:
                    return p, power
        return None, 1.0


@cache
def _halton_points(dimensions: int, count: int) -> np.ndarray:
    """The first points of a Halton sequence but the corner of the unit cube, (count, dimensions) float, as scipy's.

    The import of scipy.stats takes half a second, and this is all that a diagnosis would need of it.
    """
    primes = [n for n in range(2, 2 + dimensions**2) if all(n % i for i in range(2, n))][:dimensions]
    points = np.zeros((count, dimensions))
    for axis, base in enumerate(primes):
        left, size = np.arange(1, count + 1), 1.0 / base
        while left.any():
            points[:, axis] += left % base * size
            left, size = left // base, size / base
    return points


def parameters_at_bounds(model: Model, free: Sequence[FreeParameter], index: int) -> dict[str, float]:
    """Return the fitted parameters of an effect that are at a bound, with the bound.

    The bound at which a part of the formula does nothing does not count: a simpler formula does as well. Nor does the upper
    bound of a share that means the whole: then the effect takes all that it can, or its shape is the limit that elements which
    stick and slip have (the β of Bouc and Wen is 1 where unloading yields as loading does, as in every Masing loop).

    Parameters
    ----------
    model : Model
    free : sequence of FreeParameter
    index : int
        Of the effect in the model's stack.
    """
    effect = model.effects[index]
    form = form_of(effect.name, effect.form)
    neutral = form.neutral
    shares = [p for p in form.parameters if p.unit == "1" and p.low >= 0.0 and NEARLY_ALL <= p.high <= 1.0]
    whole = {p.name: p.high for p in shares if p.high == 1.0 or p.low == neutral.get(p.name) == 0.0}
    whole |= {p.name: p.high for p in form.parameters if p.name == SHARPNESS}
    found = {}
    for item in free:
        if item.effect == index and not item.per_texel:
            value = float(value_of(model, item))
            for end in (item.low, item.high):
                counts = end != float(neutral.get(item.name, 0.0)) and end != whole.get(item.name)
                if counts and abs(value - end) <= AT_BOUND * abs(end):
                    found[item.name] = end
    return found


def candidates(predictors: Sequence[Predictor], model: Model) -> list[Candidate]:
    """Return the candidates that could show in these recordings at all.

    A gain that changes by itself is a warm-up in a session, in which the time goes on from recording to recording. Elsewhere
    each recording begins with an untouched sensor, and such a gain is a form of drift. The height of displaced texels belongs
    to the base model if contact heights are free. How far texels are displaced along the skin is not fitted where a box presses
    flat on them, because a texel is under it or not: a scan finds it (:mod:`.starting_points`).
    """
    posed = any(p.trial.stimulus == "pose" for p in predictors)
    dragged = any(p.trial.force is not None and p.stimulus.slide_speed.any() for p in predictors)
    read = any(p.trial.reading is not None for p in predictors)
    several = len(predictors[0].rig.texels) > 1
    in_rows = isinstance(predictors[0].rig.texels.layout, GridLayout)
    loaded = all(p.trial.stimulus == "force" for p in predictors)
    cannot = unidentifiable(coverage(predictors))
    on_clock = all(p.session is not None for p in predictors)
    warmed = _warmth(predictors) >= LEAST_WARMTH
    heights_open = all(isinstance(p.trial.contact_height, str) for p in predictors if p.trial.stimulus == "pose")
    in_steps = posed and all(_is_flat_press(p) for p in predictors if p.trial.stimulus == "pose")
    signed = has_signed_channels(predictors, model)
    in_threes = signed and len(predictors[0].rig.texels) % 3 == 0
    lacking = {"temperature": not warmed, "clock": not on_clock, "no clock": on_clock}
    lacking |= {"signed channels": not signed, "axes": not in_threes, "rows": several and not in_rows}
    found = []
    for kind in library().values():
        if kind.name in NOT_FITTED or kind.name in cannot:
            continue
        for form in kind.forms:
            moves = form.placement is not None
            if form.friction_law is not None:
                is_recorded = dragged
            elif kind.site_of(form) == "readout":
                is_recorded = read
            else:  # with known loads the contact law does not matter
                is_recorded = posed if moves else not loaded
            if form.random or not form.is_tried or not is_recorded or lacking.get(kind.needs_of(form), False):
                continue
            known = (*kind.known_parameters, "z") if moves and heights_open else kind.known_parameters
            fitted = replace(form, parameters=tuple(p for p in form.parameters if p.name not in known)) if known else form
            one = Candidate(kind, fitted, form.jumps_at or (IN_PLANE if moves and in_steps else ()))
            if several or not (one.has_texel_parameters or form.is_spatial):
                found.append(one)
    return found


def _is_flat_press(predictor: Predictor) -> bool:
    """True if a box presses on texels with a face that is parallel to all of them."""
    trial, normal = predictor.trial, predictor.rig.surface.normal
    indenter = predictor.rig.indenter_of(trial)
    if indenter is None or indenter.edges is None or trial.quaternion is None:
        return False
    turned = np.abs(normal @ rotation_matrices(trial.quaternion))  # (T, n, 3), along the axes of the box
    return bool(turned.max(axis=2).min() > np.cos(SMALL_TURN))


def is_free_already(candidate: Candidate, free: Sequence[FreeParameter]) -> bool:
    """Return whether the base model has a candidate as a free parameter: a common offset is its `zero`."""
    same = candidate.form.same_as
    return bool(same) and any(item.effect < 0 and item.name == same for item in free)


def has_signed_channels(predictors: Sequence[Predictor], model: Model) -> bool:
    """Return whether some channels rise and others fall under load, as the axes of magnetometers do."""
    sums = np.zeros((3, len(predictors[0].rig.texels)))
    for predictor in predictors:
        if predictor.trial.reading is None:
            continue
        x, y = centred(predictor.normal_force(model), predictor.trial.reading)
        sums += [(x * y).sum(axis=0), (x * x).sum(axis=0), (y * y).sum(axis=0)]
    follows = sums[0] / np.sqrt(np.maximum(sums[1] * sums[2], 1e-300))
    least = max(1.0, LEAST_SIGNED * len(follows))
    return bool((follows >= SIGNED_CORRELATION).sum() >= least and (follows <= -SIGNED_CORRELATION).sum() >= least)
