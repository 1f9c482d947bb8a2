# SPDX-License-Identifier: GPL-3.0-or-later
"""Predictions of what a sensor with given parameters and effects records in a trial."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Generic, TypeVar

import numpy as np

from ...effects.engine import readout_chain
from ...effects.engine.registry import actual_placement as placed_texels
from ...effects.engine.registry import form_of, kind_of, site_of_action
from ...effects.engine.specification import SCATTER, STEPS, TransducerArray
from ...model.sensor import Effect, Sensor
from ...model.sensor_parameters import FRICTION_LAW_PARAMETERS, NORMAL_LAW_PARAMETERS, SensorParameters
from ..dataset.rig import FORCE, Rig
from ..dataset.trial import Trial
from .force_model import ContactHistory
from .stimulus import Stimulus, joined_stimuli, of_texels, surface_stimulus_of

Value = TypeVar("Value")
CONTACT_HEIGHT = "contact height"
CACHE_SIZE = 4
"""Number of placements, forces and readings that are kept: a derivative by one parameter needs the others again."""
SESSION_CACHE_SIZE, SESSION_CACHE_BYTES = 64, 2.5e8
"""Number of readings that a session keeps at most: each of its trials asks for all derivatives, one trial after the other.
Fewer are kept if they would take more memory than this. What readings are computed from is asked for once, so that no more of
it is kept than for a trial; sixty-four placements with their contact histories took 13 GB."""


@dataclass(frozen=True)
class Model:
    """A model of a sensor: parameters of the base model, effects on top of it, and free numbers of single recordings.

    Attributes
    ----------
    parameters : SensorParameters
    effects : tuple of Effect
    recordings : mapping of str to float
        Free numbers by which recordings differ, such as ``factor of NAME`` and ``contact height of NAME`` (see
        :class:`.trial.Trial`).
    """

    parameters: SensorParameters
    effects: tuple[Effect, ...] = ()
    recordings: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def is_stepped(self) -> bool:
        """True if readings come in steps."""
        return any(kind_of(e.name).found_by == STEPS for e in self.effects)

    @cached_property
    def readout_effects(self) -> tuple[Effect, ...]:
        """Effects on readings, without noise: a prediction is the expected value."""
        return tuple(e for e in self.effects if site_of_action(e) == "readout" and kind_of(e.name).found_by != SCATTER)

    @cached_property
    def normal_force_effects(self) -> tuple[Effect, ...]:
        """Effects on normal forces, and effects that move the texels."""
        return tuple(e for e in self.effects if site_of_action(e) != "readout" and not _acts_through(e, "friction_law"))

    @cached_property
    def friction_effects(self) -> tuple[Effect, ...]:
        """Effects on the friction law."""
        return tuple(e for e in self.effects if _acts_through(e, "friction_law"))

    @cached_property
    def placing_effects(self) -> tuple[Effect, ...]:
        """Effects that move the texels."""
        return tuple(e for e in self.effects if _acts_through(e, "placement"))

    @cached_property
    def normal_force_key(self) -> tuple[object, ...]:
        """All on which normal forces depend, but for the contact heights of recordings."""
        law = (getattr(self.parameters, name) for name in NORMAL_LAW_PARAMETERS)
        return (*law, _effects_key(self.normal_force_effects))

    def with_effect(self, effect: Effect) -> Model:
        """Return the model with one more effect."""
        return replace(self, effects=(*self.effects, effect))

    def without(self, index: int) -> Model:
        """Return the model without its effect of this index."""
        return replace(self, effects=self.effects[:index] + self.effects[index + 1 :])


@dataclass(frozen=True)
class Prediction:
    """Predicted readings and forces of a trial.

    Attributes
    ----------
    reading : (T, n) float, the sensor's unit
    force : (T, 3) float or None, newtons
        Net force; None if it is not wanted or was not measured.
    """

    reading: np.ndarray
    force: np.ndarray | None


NEUTRAL_NUMBERS = {"factor": 1.0, "zero": 0.0}
"""Factor and zero of a recording that does not differ from the others, by the words for :func:`number_name`."""


def number_name(word: str, name: str) -> str:
    """Return the name of a free number of recordings in :attr:`Model.recordings`; `word` says what it is, as "factor"."""
    return f"{word} of {name}"


class Session:
    """Recordings of one sensor as one, with an unloaded sensor between them: forces and readings along their stimulus, for any
    model. Intermediate results are kept, so that a changed parameter costs little.

    Parameters
    ----------
    trials : sequence of Trial
        In any order; a single one if the sensor was untouched before it.
    rig : Rig

    Attributes
    ----------
    trials : list of Trial
        In order of time.
    stimulus : Stimulus
        Of the points of the rig's surface, along all trials.
    """

    def __init__(self, trials: Sequence[Trial], rig: Rig):
        self.rig, self.trials = rig, sorted(trials, key=lambda trial: float(trial.time[0]))
        stimuli = [surface_stimulus_of(trial, rig) for trial in self.trials]
        self._of_texels = [of_texels(stimulus, rig) for stimulus in stimuli]
        self.stimulus, self._starts = joined_stimuli(stimuli, rig.surface)
        most = CACHE_SIZE
        if len(trials) > 1:
            most = int(np.clip(SESSION_CACHE_BYTES / (8.0 * self.stimulus.load.size), CACHE_SIZE, SESSION_CACHE_SIZE))
        self._placed: _Recent[Stimulus] = _Recent(CACHE_SIZE)
        self._histories: _Recent[ContactHistory] = _Recent(2 * CACHE_SIZE)
        self._forces: _Recent[np.ndarray] = _Recent(CACHE_SIZE)
        self._texel_forces: _Recent[np.ndarray] = _Recent(CACHE_SIZE)
        self._totals: _Recent[np.ndarray] = _Recent(most)
        self._readings: _Recent[np.ndarray] = _Recent(most)
        self._first_heights = self._heights({})

    def part(self, trial: Trial) -> tuple[Stimulus, slice]:
        """Return the stimulus of the texels in one of the trials, and its samples among those of all."""
        number = next(i for i, one in enumerate(self.trials) if one is trial)
        return self._of_texels[number], slice(self._starts[number], self._starts[number] + len(trial.time))

    def reading(self, model: Model, subset: np.ndarray | None = None) -> np.ndarray:
        """Return the readings of each texel, or of some, (T, n) in the sensor's unit."""
        p = model.parameters
        key = (self._force_key(model, subset), p.gain, p.zero, _effects_key(model.readout_effects))

        def compute() -> np.ndarray:
            effects, site = model.readout_effects, replace(self._site, gain=p.gain, zero=p.zero)
            if subset is not None:
                effects = tuple(_effect_on_texels(effect, subset) for effect in effects)
                row, column = (None if index is None else index[subset] for index in (site.row, site.column))
                site = replace(site, position=site.position[subset], area=site.area[subset], row=row, column=column)
            return readout_chain.readings(effects, site, self.stimulus.time, self.normal_force(model, subset))

        return self._readings.get_or(key, compute)

    @cached_property
    def _site(self) -> TransducerArray:
        """The texels as effects on readings see them, with the temperatures that were recorded."""
        site = readout_chain.transducers_of(Sensor("sensor", 0, self.rig.texels, self.rig.parameters))
        recorded = [trial.temperature for trial in self.trials if trial.temperature is not None]
        if not recorded:
            return site
        times, values = zip(*recorded, strict=True)
        return replace(site, temperature=(np.concatenate(times), np.concatenate(values)))

    def total_force(self, model: Model) -> np.ndarray:
        """Return the sum of normal and friction forces on the sensor, (T, 3) N."""
        p, rubbing = model.parameters, model.friction_effects
        slides = (*(getattr(p, name) for name in FRICTION_LAW_PARAMETERS), _effects_key(rubbing))
        key = (self._force_key(model, None), slides)
        return self._totals.get_or(
            key, lambda: self._contact_history(model, None).total_force(p, rubbing, self.surface_force(model))
        )

    def placed(self, model: Model) -> Stimulus:
        """Return the stimulus of the points of the surface at the places where effects move them."""
        moving = model.placing_effects if self.stimulus.trial.stimulus == "pose" else ()
        heights = self._heights(model.recordings)
        if not moving and heights == self._first_heights:
            return self.stimulus

        def place() -> Stimulus:
            t = self.rig.surface
            if moving:
                position, normal, tangent = placed_texels(moving, t.position, t.normal, t.tangent)
                t = replace(t, position=position, normal=normal, tangent=tangent)
            stimuli = [surface_stimulus_of(trial, self.rig, t, at) for trial, at in zip(self.trials, heights, strict=True)]
            return joined_stimuli(stimuli, t)[0]

        return self._placed.get_or((_effects_key(moving), heights), place)

    def _heights(self, recordings: Mapping[str, float]) -> tuple[float, ...]:
        """Contact height of each of its trials; of a free one that is not among the numbers that from which its fit starts."""
        return tuple(
            recordings.get(number_name(CONTACT_HEIGHT, one.contact_height), one.height_start)
            if isinstance(one.contact_height, str)
            else one.contact_height
            for one in self.trials
        )

    def normal_force(self, model: Model, subset: np.ndarray | None = None) -> np.ndarray:
        """Return the normal force of each texel, or of some, (T, n) N."""
        cover = self.rig.cover
        if cover is None:
            return self.surface_force(model, subset)
        weights = cover.weights
        force = self._texel_forces.get_or(self._force_key(model, None), lambda: self.surface_force(model) @ weights.T)
        return force if subset is None else force[:, subset]

    def surface_force(self, model: Model, subset: np.ndarray | None = None) -> np.ndarray:
        """Return the normal force at each point of the surface, or at some, (T, m) N: known, or from the contact law with its
        effects. Each point has the force that a whole texel would have there.
        """
        stimulus = self.placed(model)
        if stimulus.force_share is not None:
            return stimulus.force_share if subset is None else stimulus.force_share[:, subset]
        return self._forces.get_or(
            self._force_key(model, subset),
            lambda: self._contact_history(model, subset).force(model.parameters, model.normal_force_effects),
        )

    def _force_key(self, model: Model, subset: np.ndarray | None) -> object:
        return None if subset is None else subset.tobytes(), self._heights(model.recordings), model.normal_force_key

    def _contact_history(self, model: Model, subset: np.ndarray | None) -> ContactHistory:
        which = None if subset is None else subset.tobytes()
        key = which, _effects_key(model.placing_effects), self._heights(model.recordings)
        sums = subset is None and any(trial.force is not None for trial in self.trials)
        return self._histories.get_or(key, lambda: ContactHistory(self.placed(model), subset, self.rig, sums))


class Predictor:
    """Predicts a trial for any model.

    Parameters
    ----------
    trial : Trial
    rig : Rig
    session : Session, optional
        The session that the trial belongs to; without it the trial begins with an untouched sensor.

    Attributes
    ----------
    responses : Session
        Forces and readings along the stimulus of the whole session, or of the trial alone.
    stimulus : Stimulus
        Of the texels, during the trial.
    samples : slice
        The trial's samples among those of `responses`.
    """

    def __init__(self, trial: Trial, rig: Rig, session: Session | None = None):
        self.trial, self.rig, self.session = trial, rig, session
        self.responses = session or Session([trial], rig)
        self.stimulus, self.samples = self.responses.part(trial)

    def predict(self, model: Model, subset: np.ndarray | None = None, with_forces: bool = True) -> Prediction:
        """Return the prediction of a model. Its arrays are kept and must not be written to.

        Parameters
        ----------
        model : Model
        subset : (c,) int, optional
            Only these texels. This is right only if no effect couples texels.
        with_forces : bool
            True if the net force is wanted, if it was measured.
        """
        trial = self.trial
        reading = self.responses.reading(model, subset)[self.samples]
        force = self.responses.total_force(model)[self.samples] if with_forces and trial.force is not None else None
        if trial.tared:
            reading, force = reading - reading[:1], None if force is None else force - force[:1]
        if trial.factor != 1.0 or trial.zero != 0.0:  # the recording's own
            if trial.reading is not None:
                rest = 0.0 if trial.tared else model.parameters.zero
                measured = trial.reading if subset is None else trial.reading[:, subset]
                factor, zero = self.numbers(model, reading - rest, measured - rest)
                reading = rest + zero + factor * (reading - rest)
            elif force is not None and trial.force is not None:
                force = self.numbers(model, force, trial.force)[0] * force
        return Prediction(reading, None if force is None else self._with_force_zero(model, force))

    def _with_force_zero(self, model: Model, force: np.ndarray) -> np.ndarray:
        """The net force as its sensor shows it, (T, 3) N."""
        name, measured = self.trial.force_zero, self.trial.force
        if not isinstance(name, str):
            return force + np.array(name) if any(name) else force
        given = [model.recordings.get(number_name(axis, name)) for axis in FORCE]
        if self.trial.use == "check" and measured is not None:  # of a specimen of which no recording was fitted
            for i, axis_zero in enumerate(given):
                good = np.isfinite(measured[:, i])
                if axis_zero is None and good.any():
                    given[i] = float((measured[good, i] - force[good, i]).mean())
        return force + np.array([0.0 if value is None else value for value in given])

    def numbers(self, model: Model, predicted: np.ndarray, measured: np.ndarray) -> tuple[float, float]:
        """Return factor and zero of the recording.

        Free numbers that the model does not have are those of a specimen of which no recording was fitted. They are computed
        from the recording itself, by least squares.
        """
        factor, zero = (
            model.recordings.get(number_name(word, value)) if isinstance(value, str) else value
            for word, value in (("factor", self.trial.factor), ("zero", self.trial.zero))
        )
        if (factor is None or zero is None) and self.trial.use == "check":
            x, y = predicted[np.isfinite(measured)], measured[np.isfinite(measured)]
            if factor is None:
                from_x, from_y = (x - float(x.mean()), y - float(y.mean())) if zero is None else (x, y - zero)
                square = float(from_x @ from_x)
                factor = float(from_x @ from_y) / square if square > 0.0 else 1.0
            if zero is None:
                zero = float((y - factor * x).mean()) if len(y) else 0.0
        return 1.0 if factor is None else factor, 0.0 if zero is None else zero

    def with_numbers_of(self, trial: Trial) -> Predictor:
        """Return a predictor of the same recording with the factor and the zero of `trial`, which share what is computed."""
        twin = copy(self)
        twin.trial = trial
        return twin

    def normal_force(self, model: Model) -> np.ndarray:
        """Return the normal force of each texel, (T, n) N."""
        return self.responses.normal_force(model)[self.samples]


def predictors_of(trials: Sequence[Trial], rig: Rig) -> list[Predictor]:
    """Return a predictor for each trial; those of one session share its history.

    Parameters
    ----------
    trials : sequence of Trial
        All trials of each session, whatever their use: a recording that is only checked has worn the sensor, too.
    rig : Rig
    """
    names = {trial.session for trial in trials if trial.session}
    sessions = {name: Session([trial for trial in trials if trial.session == name], rig) for name in names}
    return [Predictor(trial, rig, sessions.get(trial.session)) for trial in trials]


def placed_stimulus(trial: Trial, rig: Rig, model: Model) -> Stimulus:
    """Return the stimulus of the texels in a trial at the places where a model's effects move them."""
    return of_texels(Session([trial], rig).placed(model), rig)


def _acts_through(effect: Effect, mechanism: str) -> bool:
    return form_of(effect.name, effect.form).mechanism == mechanism


class _Recent(Generic[Value]):
    """Results by key; those that were asked for last are kept."""

    def __init__(self, most: int):
        self._most = most
        self._values: OrderedDict[object, Value] = OrderedDict()

    def get_or(self, key: object, compute: Callable[[], Value]) -> Value:
        """Return the result of a key; compute it if it is not kept."""
        kept = self._values.pop(key, None)  # the key is long, and its hash is computed whenever it is looked up
        if kept is None:
            kept = compute()
            while len(self._values) >= self._most:
                self._values.popitem(last=False)
        self._values[key] = kept
        return kept


def _effects_key(effects: tuple[Effect, ...]) -> object:
    return tuple((effect.name, effect.form, effect.seed, *effect.values.items()) for effect in effects)


def _effect_on_texels(effect: Effect, subset: np.ndarray) -> Effect:
    """The effect on some of the texels."""
    values = {k: tuple(np.asarray(v)[subset]) if isinstance(v, tuple) else v for k, v in effect.values.items()}
    return replace(effect, values=values)
