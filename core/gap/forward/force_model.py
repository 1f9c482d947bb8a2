# SPDX-License-Identifier: GPL-3.0-or-later
"""From what texels meet to the forces on them: laid out so that a fit can ask for it ten thousand times.

Only samples in contact are kept, texel after texel. Texels that meet the same at all times, as under a flat end, are computed
once. What is asked of each sample by itself is computed for all samples in one loop, without looking back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...compiled.kernels import kernel
from ...effects.engine import contact_forces
from ...laws.contact import bristle_rate, bristle_step, friction_force, max_bristle_deflection, parameter_row
from ...model.effect import Effect
from ...model.sensor_parameters import SensorParameters

if TYPE_CHECKING:
    from ..dataset.rig import Rig
    from .stimulus import Stimulus

ALIKE = 1e-9
"""Share of the largest value to which two texels must agree to be computed as one."""


class Touches(NamedTuple):
    """All samples of all texels (or groups of texels that are alike) in contact, texel after texel, m in number.

    Attributes
    ----------
    sample, texel : (m,) int
    follows : (m,) bool
        It was in contact at the sample before as well.
    weight : (m,) float
        How many texels it stands for.
    normal : (m, 3) float
        Direction of the normal force on the sensor.
    slip, between : (m, 3) float, m/s
        Now, and the mean of now and the sample before.
    square, square_between : (m,) float, m²/s²
        Of these speeds.
    length : (m,) float, s
        Since the sample before.
    """

    sample: np.ndarray
    texel: np.ndarray
    follows: np.ndarray
    weight: np.ndarray
    normal: np.ndarray
    slip: np.ndarray
    between: np.ndarray
    square: np.ndarray
    square_between: np.ndarray
    length: np.ndarray


@dataclass(frozen=True)
class Felt:
    """What some texels meet during a trial of T samples, those that are alike as one.

    Attributes
    ----------
    time : (T,) float, s
    width : int
        Number of texels.
    place, group : (p,) int
        Which texels are touched at all, and which column of the arrays below each belongs to.
    depth, slide, rate : (T, g) float
        See :func:`.bound.forces`.
    touches : Touches
    """

    time: np.ndarray
    width: int
    place: np.ndarray
    group: np.ndarray
    depth: np.ndarray
    slide: np.ndarray
    rate: np.ndarray
    touches: Touches

    @classmethod
    def of(cls, stimulus: Stimulus, columns: np.ndarray | None, rig: Rig) -> Felt:
        """Lay out what some texels of a rig meet (all of them: None)."""
        load = stimulus.pressed_by
        chosen = np.arange(load.shape[1]) if columns is None else columns
        (place,) = np.nonzero(load[:, chosen].any(axis=0))
        touched = chosen[place]
        normal = -rig.texels.normal[None] if stimulus.normal is None else stimulus.normal
        normal = np.broadcast_to(normal, (*load.shape, 3))
        slip = np.zeros_like(normal) if stimulus.slip is None else stimulus.slip
        met = [load, stimulus.rate, stimulus.slide, *np.moveaxis(normal, 2, 0), *np.moveaxis(slip, 2, 0)]
        first, group = _alike([values[:, touched] for values in met])
        one = touched[first]
        step = np.diff(stimulus.time, prepend=stimulus.time[0])
        touches = _touches(load[:, one] > 0, np.bincount(group, minlength=len(one)), normal[:, one], slip[:, one], step)
        depth, rate, slide = (values[:, one].copy() for values in (stimulus.depth, stimulus.rate, stimulus.slide))
        return cls(stimulus.time, len(chosen), place, group, depth, slide * step[:, None], rate, touches)

    def force(self, p: SensorParameters, acting: Sequence[Effect]) -> np.ndarray:
        """Normal force of the texels under a law of contact and the effects on it, zero where nothing touches, (T, c) N.

        None of the effects may have a number for each texel.
        """
        force = np.zeros((len(self.time), self.width))
        found = contact_forces.normal_forces(acting, p, self.time, self.depth, self.slide, self.rate)
        force[:, self.place] = found[:, self.group]
        return force

    def total(self, p: SensorParameters, rubbing: Sequence[Effect], force: np.ndarray) -> np.ndarray:
        """Sum over all texels of their normal and friction forces on the sensor, (T, 3) N.

        Parameters
        ----------
        p : SensorParameters
        rubbing : sequence of Effect
            Those on friction.
        force : (T, c) float, N
            Normal force of each texel.
        """
        t = self.touches
        column = np.zeros(int(self.group.max(initial=-1)) + 1, dtype=int)
        column[self.group] = self.place
        pressed = force[t.sample, column[t.texel]]
        total = np.zeros((len(self.time), 3))
        factor, viscous = np.ones(1), np.zeros(1)
        if rubbing:
            factor, viscous = contact_forces.friction_factors(rubbing, np.sqrt(t.square), pressed)
        work = np.empty((5, len(pressed)))
        sum_forces(t, pressed, factor, viscous, parameter_row(p), work, total)
        return total


def _alike(met: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """First of each group of columns that are the same in all arrays (g,), and each column's group (p,)."""
    words = []
    for values in met:
        size = max(float(np.abs(values).max(initial=0.0)), 1e-300)
        words.append(np.round(values / (ALIKE * size)).astype(np.int64))
    columns = np.ascontiguousarray(np.concatenate(words).T)
    seen: dict[bytes, int] = {}
    group = np.array([seen.setdefault(column.tobytes(), len(seen)) for column in columns], dtype=int)
    _, first = np.unique(group, return_index=True)
    return first, group


def _touches(touching: np.ndarray, count: np.ndarray, normal: np.ndarray, slip: np.ndarray, step: np.ndarray) -> Touches:
    texel, sample = np.nonzero(touching.T)
    before = np.maximum(sample - 1, 0)
    follows = (sample > 0) & touching[before, texel]
    now = slip[sample, texel]
    between = 0.5 * (now + slip[before, texel])
    squares = ((now * now).sum(axis=1), (between * between).sum(axis=1))
    return Touches(
        sample, texel, follows, count[texel].astype(float), normal[sample, texel], now, between, *squares, step[sample]
    )


@kernel
def sum_forces(touches, force, factor, viscous, parameters, work, total):  # type: ignore[no-untyped-def]
    """Sum normal forces and friction (paper, Eq. 9 and 13) of all samples in contact, for a known motion.

    Parameters
    ----------
    touches : Touches
        Of m samples.
    force : (m,) float, N
        Normal force of one texel.
    factor, viscous : (m,) or (1,) float
        What effects do: to the friction coefficient, and N·s/m beside `ct`.
    parameters : (8,) float
    work : (5, m) float
        Room for what the bristles keep and gain over the step, the rate of Eq. 9 as ``own · v - fade · z``, and force · factor.
    total : (T, 3) float, N
        Added to; forces on the sensor.
    """
    plain = factor.shape[0] == 1
    held, length, now, before = work[4], touches.length, touches.square, touches.square_between
    keeps, gains, owns, fades = work[0], work[1], work[2], work[3]
    for i in range(force.shape[0]):
        held[i] = force[i] if plain else force[i] * factor[i]
    for i in range(force.shape[0]):  # over a step the load is the mean of its ends, as the velocity is
        load = 0.5 * (held[i] + held[i - 1]) if touches.follows[i] and held[i - 1] > 0.0 else held[i]
        keeps[i], gains[i] = bristle_step(before[i], load, length[i], parameters)
    for i in range(force.shape[0]):
        owns[i] = bristle_rate(0.0, 1.0, now[i], held[i], parameters)
        fades[i] = bristle_rate(-1.0, 0.0, now[i], held[i], parameters)
    zx, zy, zz = 0.0, 0.0, 0.0
    for i in range(force.shape[0]):
        sample, weight, push = touches.sample[i], touches.weight[i], force[i] * touches.weight[i]
        nx, ny, nz = touches.normal[i, 0], touches.normal[i, 1], touches.normal[i, 2]
        total[sample, 0] += push * nx
        total[sample, 1] += push * ny
        total[sample, 2] += push * nz
        if not touches.follows[i]:
            zx, zy, zz = 0.0, 0.0, 0.0
        square, out = zx * zx + zy * zy + zz * zz, zx * nx + zy * ny + zz * nz
        zx, zy, zz = zx - out * nx, zy - out * ny, zz - out * nz
        flat = zx * zx + zy * zy + zz * zz
        if flat > 0.0:  # the bristle turns with the surface and keeps its length
            turned = (square / flat) ** 0.5
            zx, zy, zz = turned * zx, turned * zy, turned * zz
        fn = held[i]
        if fn <= 0.0:
            zx, zy, zz = 0.0, 0.0, 0.0
            continue
        if sample > 0:
            keep, gain = keeps[i], gains[i]
            zx = keep * zx + gain * touches.between[i, 0]
            zy = keep * zy + gain * touches.between[i, 1]
            zz = keep * zz + gain * touches.between[i, 2]
        limit, reach = max_bristle_deflection(fn, parameters), (zx * zx + zy * zy + zz * zz) ** 0.5
        if reach > limit:
            zx, zy, zz = zx * limit / reach, zy * limit / reach, zz * limit / reach
        vx, vy, vz = touches.slip[i, 0], touches.slip[i, 1], touches.slip[i, 2]
        own, fade, c = owns[i], fades[i], viscous[0] if plain else viscous[i]
        total[sample, 0] += weight * (friction_force(zx, own * vx - fade * zx, vx, parameters) + c * vx)
        total[sample, 1] += weight * (friction_force(zy, own * vy - fade * zy, vy, parameters) + c * vy)
        total[sample, 2] += weight * (friction_force(zz, own * vz - fade * zz, vz, parameters) + c * vz)
