# SPDX-License-Identifier: GPL-3.0-or-later
"""Forces on the texels from their contact histories, arranged so that a fit can evaluate them ten thousand times.

Only samples in contact are stored, texel after texel. Texels with equal histories, as under a flat indenter, are computed once.
Whatever depends on one sample alone is computed for all samples in one loop; only the bristle state is integrated in order.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...compiled.kernels import kernel
from ...effects.engine import contact_forces
from ...laws.contact_law import contact_law
from ...laws.friction import (
    bristle_rate,
    deflection_scale,
    friction_force,
    max_bristle_deflection,
    next_deflection,
    ramped_bristle_step,
    turned_into_plane,
)
from ...model.sensor import Effect
from ...model.sensor_parameters import SensorParameters
from ..dataset.rig import Rig
from .stimulus import Stimulus, dot, texel_shares

EQUAL_WITHIN = 1e-9
"""Difference of the means of two texels, as a share of the largest value, up to which they have equal histories."""
MEANS = 3
"""Random means in which histories are compared. Of 1,024 texels that are touched for one sample of 41,000 each, one mean takes
24 for others, and two means none."""


class ContactSamples(NamedTuple):
    """All samples in contact of all texels, or groups of equal texels, texel after texel; m in number.

    Attributes
    ----------
    sample, texel : (m,) int
        Index of the sample in the trial, and of the texel or group.
    continues : (m,) bool
        True if the sample before was in contact too.
    weight : (m,) float
        Number of equal texels; under a cover the sum of their shares of a texel.
    normal : (m, 3) float
        Direction of the normal force on the sensor.
    slip, mean_slip : (m, 3) float, m/s
        Sliding velocity, and its mean since the sample before.
    slip_squared, mean_slip_squared : (m,) float, m²/s²
        Squares of their magnitudes.
    time_step : (m,) float, s
        Time since the sample before during which the texel was touched.
    """

    sample: np.ndarray
    texel: np.ndarray
    continues: np.ndarray
    weight: np.ndarray
    normal: np.ndarray
    slip: np.ndarray
    mean_slip: np.ndarray
    slip_squared: np.ndarray
    mean_slip_squared: np.ndarray
    time_step: np.ndarray


class ContactHistory:
    """Contact of some points of a rig's surface during a trial of T samples, or of all (`subset` None). Equal points form a
    group. A sum of forces needs the history `with_samples`.

    Attributes
    ----------
    time : (T,) float, s
    touched, group : (p,) int
        Indices of the texels that are ever touched, and the column below to which each of them belongs.
    depth : (T, g) float, m
    slide_step : (T, g) float, m
        Distance of sliding since the sample before.
    rate : (T, g) float, m/s
        Rate of the depth.
    samples : ContactSamples or None
        None where no sum of forces is wanted.
    """

    def __init__(self, stimulus: Stimulus, subset: np.ndarray | None, rig: Rig, with_samples: bool):
        load = stimulus.load
        chosen = np.arange(load.shape[1]) if subset is None else subset
        (touched,) = np.nonzero(load[:, chosen].any(axis=0))
        touched_texels = chosen[touched]
        normal = -rig.surface.normal[None] if stimulus.normal is None else stimulus.normal
        normal = np.broadcast_to(normal, (*load.shape, 3))
        arrays = [load, stimulus.rate, stimulus.slide_speed, normal[:1] if stimulus.normal is None else normal]
        arrays += [one for one in (stimulus.slip, stimulus.mean_slip) if one is not None]
        first, group = _equal_texels(arrays, touched_texels)
        one = touched_texels[first]
        count = np.bincount(group, texel_shares(rig)[touched_texels], minlength=len(one))
        step = np.diff(stimulus.time, prepend=stimulus.time[0])
        self.time, self.texel_count, self.touched, self.group = stimulus.time, len(chosen), touched, group
        depth, rate, slide = (values[:, one].copy() for values in (stimulus.depth, stimulus.rate, stimulus.slide_speed))
        self.depth, self.rate, self.slide_step = depth, rate, slide * step[:, None]
        self.samples = _contact_samples(stimulus, normal, one, count, step) if with_samples else None

    def force(self, p: SensorParameters, force_effects: Sequence[Effect]) -> np.ndarray:
        """Return normal forces under the contact law and effects on it, (T, c) N; zero without contact.

        None of the effects may have parameters of single texels.
        """
        force = np.zeros((len(self.time), self.texel_count))
        found = contact_forces.normal_forces(force_effects, p, self.time, self.depth, self.slide_step, self.rate)
        force[:, self.touched] = found if found.shape[1] == len(self.group) else found[:, self.group]
        return force

    def total_force(self, p: SensorParameters, friction_effects: Sequence[Effect], force: np.ndarray) -> np.ndarray:
        """Return the sum of normal and friction forces of all texels on the sensor, (T, 3) N.

        Parameters
        ----------
        p : SensorParameters
        friction_effects : sequence of Effect
        force : (T, c) float, N
            Normal force of each texel.
        """
        t = self.samples
        assert t is not None, "the history was made without samples"
        column = np.zeros(int(self.group.max(initial=-1)) + 1, dtype=int)
        column[self.group] = self.touched
        pressed = force[t.sample, column[t.texel]]
        total = np.zeros((len(self.time), 3))
        friction_load, viscous = pressed, np.zeros_like(pressed)
        if friction_effects:
            factor, viscous = contact_forces.friction_factors(friction_effects, np.sqrt(t.slip_squared), pressed)
            friction_load = pressed * factor
        sum_forces(t, pressed, friction_load, viscous, contact_law(p), np.empty((4, len(pressed))), total)
        return total


def _contact_samples(
    stimulus: Stimulus, normal: np.ndarray, column: np.ndarray, count: np.ndarray, step: np.ndarray
) -> ContactSamples:
    """The samples in contact of some columns of a stimulus, each of a weight `count`."""
    pressed = stimulus.load[:, column] > 0
    texel, sample = map(np.ascontiguousarray, np.nonzero(pressed.T))
    own, before = column[texel], np.maximum(sample - 1, 0)
    slip, mean = np.zeros((len(sample), 3)), np.zeros((len(sample), 3))
    if stimulus.slip is not None and stimulus.mean_slip is not None:
        slip, mean = stimulus.slip[sample, own], stimulus.mean_slip[sample, own]
    continues = (sample > 0) & pressed[before, texel]
    sinking = np.where(continues, 0.0, stimulus.rate[sample, own] * step[sample])  # while it sank in, it was touched
    touched = np.divide(stimulus.depth[sample, own], sinking, out=np.ones(len(sample)), where=sinking > 0.0).clip(max=1.0)
    squares = dot(slip, slip), dot(mean, mean)
    return ContactSamples(
        sample, texel, continues, count[texel], normal[sample, own], slip, mean, *squares, step[sample] * touched
    )


def _equal_texels(arrays: list[np.ndarray], texels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First of each group of texels that are equal in all arrays (g,), and the group of each texel (p,).

    Both count the given texels, and groups come in the order of their first ones. Arrays (T, n) or (T, n, 3) are compared in
    random means of their samples, one after the other until no two texels are equal. Texels that are touched at different times
    may share one of them, and not all.
    """
    weights = np.random.default_rng(0).uniform(1.0, 2.0, (MEANS, max(len(values) for values in arrays)))
    group = np.zeros(len(texels), dtype=int)
    for values in arrays:
        if group.max(initial=-1) + 1 == len(group):
            break
        own = np.take(values, texels, axis=1).reshape(len(values), -1)
        quantum = EQUAL_WITHIN * max(float(np.abs(own).max(initial=0.0)) * len(values), 1e-300)
        means = np.round(weights[:, : len(values)] @ own / quantum) + 0.0  # no -0.0
        rows = means.reshape(MEANS, len(texels), -1).transpose(1, 0, 2)
        groups: dict[tuple[int, bytes], int] = {}
        group = np.array([groups.setdefault((g, row.tobytes()), len(groups)) for g, row in zip(group, rows, strict=True)])
    return np.unique(group, return_index=True)[1], group


@kernel
def sum_forces(samples, force, friction_load, viscous, parameters, work, total):  # type: ignore[no-untyped-def]
    """Sum normal forces and friction (paper, Eq. 9 and 13) of all samples in contact, for a known motion.

    Parameters
    ----------
    samples : ContactSamples
        Of m samples.
    force, friction_load : (m,) float, N
        Normal force of one texel, and its product with the factor that effects give the friction coefficient.
    viscous : (m,) float, N·s/m
        What effects add to `ct`.
    parameters : ContactLaw
    work : (4, m) float
        Room for what the bristles keep and gain over the step, and the rate of Eq. 9 as ``own · v - fade · z``.
    total : (T, 3) float, N
        Added to; forces on the sensor.
    """
    length, now, before = samples.time_step, samples.slip_squared, samples.mean_slip_squared
    keeps, gains, owns, fades = work[0], work[1], work[2], work[3]
    for i in range(force.shape[0]):
        start = max(friction_load[i - 1], 0.0) if samples.continues[i] else 0.0
        keeps[i], gains[i] = ramped_bristle_step(before[i], start, friction_load[i], length[i], parameters)
    for i in range(force.shape[0]):
        owns[i] = bristle_rate(0.0, 1.0, now[i], friction_load[i], parameters)
        fades[i] = bristle_rate(-1.0, 0.0, now[i], friction_load[i], parameters)
    zx, zy, zz = 0.0, 0.0, 0.0
    for i in range(force.shape[0]):
        sample, weight, push = samples.sample[i], samples.weight[i], force[i] * samples.weight[i]
        nx, ny, nz = samples.normal[i, 0], samples.normal[i, 1], samples.normal[i, 2]
        total[sample, 0] += push * nx
        total[sample, 1] += push * ny
        total[sample, 2] += push * nz
        if not samples.continues[i]:
            zx, zy, zz = 0.0, 0.0, 0.0
        zx, zy, zz = turned_into_plane((zx, zy, zz), (nx, ny, nz))
        fn = friction_load[i]
        if fn <= 0.0:
            zx, zy, zz = 0.0, 0.0, 0.0
            continue
        if sample > 0:
            keep, gain = keeps[i], gains[i]
            zx = next_deflection(keep, zx, gain, samples.mean_slip[i, 0])
            zy = next_deflection(keep, zy, gain, samples.mean_slip[i, 1])
            zz = next_deflection(keep, zz, gain, samples.mean_slip[i, 2])
        scale = deflection_scale(zx * zx + zy * zy + zz * zz, max_bristle_deflection(fn, parameters))
        zx, zy, zz = scale * zx, scale * zy, scale * zz
        vx, vy, vz = samples.slip[i, 0], samples.slip[i, 1], samples.slip[i, 2]
        own, fade, c = owns[i], fades[i], viscous[i]
        total[sample, 0] += weight * (friction_force(zx, own * vx - fade * zx, vx, parameters) + c * vx)
        total[sample, 1] += weight * (friction_force(zy, own * vy - fade * zy, vy, parameters) + c * vy)
        total[sample, 2] += weight * (friction_force(zz, own * vz - fade * zz, vz, parameters) + c * vz)
