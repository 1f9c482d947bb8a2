# SPDX-License-Identifier: GPL-3.0-or-later
"""Predictions of what a sensor with given parameters and effects records in a trial."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...effects.engine import readout_chain
from ...effects.engine.registry import actual_placement as placed_texels
from ...effects.engine.registry import form_of, site_of_action
from ...model.effect import Effect
from ...model.sensor import Sensor
from ...model.sensor_parameters import FRICTION_LAW_PARAMETERS, NORMAL_LAW_PARAMETERS, SensorParameters
from ..dataset.rig import Rig, Trial
from .force_model import ContactHistory
from .stimulus import Stimulus, stimulus_of

CACHE_SIZE = 4
"""Number of placements, forces and readings that are kept per trial: a derivative by one parameter needs the others again."""


@dataclass(frozen=True)
class Model:
    """A model of a sensor: parameters of the base model, and effects on top of it."""

    parameters: SensorParameters
    effects: tuple[Effect, ...] = ()

    def with_effect(self, effect: Effect) -> Model:
        """Return the model with one more effect."""
        return replace(self, effects=(*self.effects, effect))

    def without(self, index: int) -> Model:
        """Return the model without its effect of this index."""
        return replace(self, effects=self.effects[:index] + self.effects[index + 1 :])


@dataclass(frozen=True)
class Prediction:
    """What a model predicts for a trial.

    Attributes
    ----------
    reading : (T, n) float, the sensor's unit
    force : (T, 3) float or None, newtons
        Net force; None if it is not wanted or was not measured.
    """

    reading: np.ndarray
    force: np.ndarray | None


class Predictor:
    """Predicts a trial for any model. Intermediate results are kept, so that a changed parameter costs little.

    Parameters
    ----------
    trial : Trial
    rig : Rig
    """

    def __init__(self, trial: Trial, rig: Rig):
        self.trial, self.rig = trial, rig
        self.stimulus = stimulus_of(trial, rig)
        self._placed: dict[object, Stimulus] = {}
        self._histories: dict[object, ContactHistory] = {}
        self._forces: dict[object, np.ndarray] = {}
        self._totals: dict[object, np.ndarray] = {}
        self._readings: dict[object, np.ndarray] = {}

    def predict(self, model: Model, subset: np.ndarray | None = None, with_forces: bool = True) -> Prediction:
        """Return the prediction of a model. Its arrays are kept and must not be written to.

        Parameters
        ----------
        model : Model
        subset : (c,) int, optional
            Only these texels. This is right only if no effect couples texels.
        with_forces : bool
            Whether the net force is wanted, if it was measured.
        """
        wanted = with_forces and self.trial.force is not None
        return Prediction(self._reading(model, subset), self._total(model) if wanted else None)

    def _reading(self, model: Model, subset: np.ndarray | None) -> np.ndarray:
        """Readings, (T, n) in the sensor's unit."""
        p = model.parameters
        # Without noise: the prediction is the expected value.
        reading = tuple(e for e in model.effects if site_of_action(e) == "readout" and e.name != "noise")
        key = (self._force_key(model, subset), p.gain, p.zero, _effects_key(reading))
        if key not in self._readings:
            site = readout_chain.transducers_of(Sensor("sensor", 0, self.rig.texels, p))
            if subset is not None:
                site = replace(
                    site,
                    position=site.position[subset],
                    area=site.area[subset],
                    row=None if site.row is None else site.row[subset],
                    column=None if site.column is None else site.column[subset],
                )
                reading = tuple(_effect_on_texels(effect, subset) for effect in reading)
            force = self.normal_force(model, subset)
            _remember(self._readings, key, readout_chain.readings(reading, site, self.trial.time, force), CACHE_SIZE)
        return self._readings[key]

    def _total(self, model: Model) -> np.ndarray:
        """Sum of normal and friction forces on the sensor, (T, 3) N."""
        p, rubbing = model.parameters, tuple(effect for effect in model.effects if _acts_through(effect, "friction_law"))
        slides = (*(getattr(p, name) for name in FRICTION_LAW_PARAMETERS), _effects_key(rubbing))
        key = (self._force_key(model, None), slides)
        if key not in self._totals:
            _remember(
                self._totals,
                key,
                self._contact_history(model, None).total_force(p, rubbing, self.normal_force(model)),
                CACHE_SIZE,
            )
        return self._totals[key]

    def placed(self, model: Model) -> Stimulus:
        """Return the stimulus of the texels at the places where effects move them."""
        moving = tuple(effect for effect in model.effects if _acts_through(effect, "placement"))
        if not moving or self.trial.stimulus != "pose":
            return self.stimulus
        key = _effects_key(moving)
        if key not in self._placed:
            t = self.rig.texels
            position, normal, tangent = placed_texels(moving, t.position, t.normal, t.tangent)
            moved = replace(t, position=position, normal=normal, tangent=tangent)
            _remember(self._placed, key, stimulus_of(self.trial, self.rig, moved), CACHE_SIZE)
        return self._placed[key]

    def normal_force(self, model: Model, subset: np.ndarray | None = None) -> np.ndarray:
        """Return the normal force of each texel, or of some, (T, n) N: known, or from the contact law with its effects."""
        stimulus = self.placed(model)
        if stimulus.force_share is not None:
            return stimulus.force_share if subset is None else stimulus.force_share[:, subset]
        whole = self._forces.get(self._force_key(model, None))
        if subset is not None and whole is not None:
            return whole[:, subset]
        key = self._force_key(model, subset)
        if key not in self._forces:
            _remember(
                self._forces,
                key,
                self._contact_history(model, subset).force(model.parameters, _effects_on_normal_force(model)),
                CACHE_SIZE,
            )
        return self._forces[key]

    def _force_key(self, model: Model, subset: np.ndarray | None) -> object:
        p, which = model.parameters, None if subset is None else subset.tobytes()
        return which, *(getattr(p, name) for name in NORMAL_LAW_PARAMETERS), _effects_key(_effects_on_normal_force(model))

    def _contact_history(self, model: Model, subset: np.ndarray | None) -> ContactHistory:
        which = None if subset is None else subset.tobytes()
        key = which, _effects_key(tuple(effect for effect in model.effects if _acts_through(effect, "placement")))
        if key not in self._histories:
            _remember(self._histories, key, ContactHistory.of(self.placed(model), subset, self.rig), 2 * CACHE_SIZE)
        return self._histories[key]


def _effects_on_normal_force(model: Model) -> tuple[Effect, ...]:
    """Effects on normal forces, and effects that move the texels."""
    return tuple(e for e in model.effects if site_of_action(e) != "readout" and not _acts_through(e, "friction_law"))


def _acts_through(effect: Effect, mechanism: str) -> bool:
    return form_of(effect.name, effect.form).mechanism == mechanism


def _remember(memory: dict, key: object, value: object, most: int) -> None:
    """Store something, and drop the oldest entries if there are too many."""
    while len(memory) >= most:
        del memory[next(iter(memory))]
    memory[key] = value


def _effects_key(effects: tuple[Effect, ...]) -> object:
    return tuple((effect.name, effect.form, effect.seed, *effect.values.items()) for effect in effects)


def _effect_on_texels(effect: Effect, subset: np.ndarray) -> Effect:
    """The effect on some of the texels."""
    if not any(isinstance(value, tuple) for value in effect.values.values()):
        return effect
    values = {k: tuple(np.asarray(v)[subset]) if isinstance(v, tuple) else v for k, v in effect.values.items()}
    return replace(effect, values=values)
