# SPDX-License-Identifier: GPL-3.0-or-later
"""What a sensor with given parameters and effects would have recorded in a trial."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..contact import bristle_limit, bristle_rate, bristle_step, friction_force, parameter_row
from ..effects import bound
from ..effects.base import Effect
from ..effects.library import form_of, stage_of
from ..effects.library import placed as placed_texels
from ..jit import kernel
from ..scenario import Sensor, SensorParameters
from .rig import Rig, Trial
from .stimulus import Stimulus, stimulus_of

PLACES_KEPT, FORCES_KEPT = 4, 3
"""Placements of the texels, and forces, that are remembered per trial: a derivative by one number asks for the others again."""


@dataclass(frozen=True)
class Model:
    """A sensor in words: the base model's parameters and the effects on top of it."""

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
    """What a model says a trial recorded: `reading` (T, n) in the sensor's unit, `force` (T, 3) N where it was measured."""

    reading: np.ndarray
    force: np.ndarray | None


class Predictor:
    """Predicts one trial for any model; what only some of its numbers change is computed once.

    Parameters
    ----------
    trial : Trial
    rig : Rig
    """

    def __init__(self, trial: Trial, rig: Rig):
        self.trial, self.rig = trial, rig
        self.stimulus = stimulus_of(trial, rig)
        self._placed: dict[object, Stimulus] = {}
        self._forces: dict[object, np.ndarray] = {}
        self._felt: dict[object, _Felt] = {}

    def predict(self, model: Model, columns: np.ndarray | None = None) -> Prediction:
        """Return the prediction of a model.

        Parameters
        ----------
        model : Model
        columns : (c,) int, optional
            Only these texels; right as long as no effect lets texels feel their neighbours.
        """
        stimulus = self.placed(model)
        measured = None
        if self.trial.force is not None:
            measured = net_force(model, stimulus, self.rig, self.normal_force(model))
        force = self.normal_force(model, columns)
        site = bound.site_of(Sensor("sensor", 0, self.rig.texels, model.parameters))
        effects = model.effects
        if columns is not None:
            site = replace(
                site,
                position=site.position[columns],
                area=site.area[columns],
                row=None if site.row is None else site.row[columns],
                column=None if site.column is None else site.column[columns],
            )
            effects = tuple(_restricted(effect, columns) for effect in effects)
        return Prediction(bound.readings(effects, site, self.trial.time, force), measured)

    def placed(self, model: Model) -> Stimulus:
        """Return what the texels meet with the effects that move them."""
        moving = tuple(effect for effect in model.effects if form_of(effect.name, effect.form).place is not None)
        if not moving or self.trial.stimulus != "pose":
            return self.stimulus
        key = _key(moving)
        if key not in self._placed:
            t = self.rig.texels
            position, normal, tangent = placed_texels(moving, t.position, t.normal, t.tangent)
            moved = replace(t, position=position, normal=normal, tangent=tangent)
            _keep(self._placed, key, stimulus_of(self.trial, self.rig, moved), PLACES_KEPT)
        return self._placed[key]

    def normal_force(self, model: Model, columns: np.ndarray | None = None) -> np.ndarray:
        """Normal force of each texel (or of some), (T, n) N: from the law of contact with its effects, or known."""
        stimulus = self.placed(model)
        if stimulus.load is not None:
            return stimulus.load if columns is None else stimulus.load[:, columns]
        acting = tuple(effect for effect in model.effects if stage_of(effect) != "readout")
        p, which = model.parameters, None if columns is None else columns.tobytes()
        key = (which, p.k, p.cn, p.exponent, p.dissipation, _key(acting))
        if key not in self._forces:
            place = (which, _key(tuple(effect for effect in acting if form_of(effect.name, effect.form).place is not None)))
            if place not in self._felt:
                _keep(self._felt, place, _Felt.of(stimulus, columns), 2 * PLACES_KEPT)
            _keep(self._forces, key, self._felt[place].force(p, acting), FORCES_KEPT)
        return self._forces[key]


@dataclass(frozen=True)
class _Felt:
    """What the touched ones among some texels meet, laid out for the law of contact: all (T, c) float."""

    time: np.ndarray
    touched: np.ndarray
    width: int
    place: np.ndarray
    depth: np.ndarray
    slide: np.ndarray
    rate: np.ndarray

    @classmethod
    def of(cls, stimulus: Stimulus, columns: np.ndarray | None) -> _Felt:
        chosen = np.arange(stimulus.depth.shape[1]) if columns is None else columns
        (place,) = np.nonzero(stimulus.depth[:, chosen].any(axis=0))
        touched = chosen[place]
        step = np.diff(stimulus.time, prepend=stimulus.time[0])[:, None]
        depth, rate = stimulus.depth[:, touched].copy(), stimulus.rate[:, touched].copy()
        return cls(stimulus.time, touched, len(chosen), place, depth, stimulus.slide[:, touched] * step, rate)

    def force(self, p: SensorParameters, acting: tuple[Effect, ...]) -> np.ndarray:
        """Normal force of the texels, zero where nothing touches, (T, c) N."""
        force = np.zeros((len(self.time), self.width))
        effects = tuple(_restricted(effect, self.touched) for effect in acting)
        force[:, self.place] = bound.forces(effects, p, self.time, self.depth, self.slide, self.rate)
        return force


def _keep(memory: dict, key: object, value: object, most: int) -> None:
    """Remember something, and forget the oldest where there is too much."""
    while len(memory) >= most:
        del memory[next(iter(memory))]
    memory[key] = value


def _key(effects: tuple[Effect, ...]) -> object:
    return tuple((effect.name, effect.form, effect.seed, *effect.values.items()) for effect in effects)


def _restricted(effect: Effect, columns: np.ndarray) -> Effect:
    """The effect on some of the texels."""
    if not any(isinstance(value, tuple) for value in effect.values.values()):
        return effect
    values = {k: tuple(np.asarray(v)[columns]) if isinstance(v, tuple) else v for k, v in effect.values.items()}
    return replace(effect, values=values)


def net_force(model: Model, stimulus: Stimulus, rig: Rig, force: np.ndarray) -> np.ndarray:
    """Sum of normal and friction forces on the sensor, (T, 3) N.

    Parameters
    ----------
    force : (T, n) float, N
        Normal force of each texel.
    """
    normal = -rig.texels.normal[None] if stimulus.normal is None else stimulus.normal
    total = np.einsum("tn,tni->ti", force, np.broadcast_to(normal, (*force.shape, 3)))
    if stimulus.slip is not None and stimulus.slip.any():
        (touched,) = np.nonzero(force.any(axis=0))
        slip, pressed = np.ascontiguousarray(stimulus.slip[:, touched]), np.ascontiguousarray(force[:, touched])
        speed = np.linalg.norm(slip, axis=2)
        factor, viscous = bound.friction(model.effects, speed, pressed)
        dragged = np.zeros((len(force), 3))
        friction_over_time(stimulus.time, slip, pressed, factor, viscous, parameter_row(model.parameters), dragged)
        total = total + dragged
    return total


@kernel
def friction_over_time(time, slip, force, factor, viscous, parameters, total):  # type: ignore[no-untyped-def]
    """Sum the friction of all texels (paper, Eq. 9 and 13) for a known motion.

    Parameters
    ----------
    time : (T,) float, s
    slip : (T, m, 3) float, m/s
        Between two samples the bristles see the mean of both.
    force : (T, m) float, N
    factor, viscous : (T, m) float
        What effects do: to the friction coefficient, and N·s/m beside `ct`.
    parameters : (8,) float
    total : (T, 3) float, N
        Written; forces on the sensor.
    """
    for texel in range(force.shape[1]):
        zx, zy, zz = 0.0, 0.0, 0.0
        for i in range(len(time)):
            vx, vy, vz = slip[i, texel, 0], slip[i, texel, 1], slip[i, texel, 2]
            fn = force[i, texel] * factor[i, texel]
            if fn <= 0.0:
                zx, zy, zz = 0.0, 0.0, 0.0
                continue
            if i > 0:
                mx, my, mz = (
                    0.5 * (vx + slip[i - 1, texel, 0]),
                    0.5 * (vy + slip[i - 1, texel, 1]),
                    0.5 * (vz + slip[i - 1, texel, 2]),
                )
                keep, gain = bristle_step(mx * mx + my * my + mz * mz, fn, time[i] - time[i - 1], parameters)
                zx, zy, zz = keep * zx + gain * mx, keep * zy + gain * my, keep * zz + gain * mz
            limit, length = bristle_limit(fn, parameters), (zx * zx + zy * zy + zz * zz) ** 0.5
            if length > limit:
                zx, zy, zz = zx * limit / length, zy * limit / length, zz * limit / length
            square, c = vx * vx + vy * vy + vz * vz, viscous[i, texel]
            total[i, 0] += friction_force(zx, bristle_rate(zx, vx, square, fn, parameters), vx, parameters) + c * vx
            total[i, 1] += friction_force(zy, bristle_rate(zy, vy, square, fn, parameters), vy, parameters) + c * vy
            total[i, 2] += friction_force(zz, bristle_rate(zz, vz, square, fn, parameters), vz, parameters) + c * vz
