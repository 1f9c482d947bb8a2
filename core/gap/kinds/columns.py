# SPDX-License-Identifier: GPL-3.0-or-later
"""What each kind adds to readings and net forces, column by column: derivatives by its coefficients about the base model.

    pose → contact → relaxation → hysteresis → wear → [damping, clip] → adhesion → [net force] → spatial → gain → dead zone →
    saturation → lag → drift and offset

The signal that comes to a kind is the base model's load; without damping, where the kind acts before that is added and the
force is clipped at zero. The net force is what the loads add up to behind the contact.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from .dictionaries import MISALIGNMENT, VARIANTS, Variant
from .recorded import Recorded, RecordedRun

STEP = 1e-4
"""Change of which the derivatives are taken; full load is 1."""
POSE_STEP = (2e-5, 2e-5, 5e-6, 5e-4, 5e-4, 5e-4)
"""Displacements of which the derivatives are taken, m and rad."""
POSE_SCALE = (1e-3, 1e-3, 1e-3, 0.1, 0.1, 0.1)
"""Coefficients of misalignment are in these units, m and rad."""
BASE = ("k", "damping", "gain", "zero")
"""Corrections of the base model's own parameters: shares of the stiffness, the damping and the gain, and a zero."""
TEXEL = ("gain", "offset", "rate", "fading")
"""Parameters of single texels: a share of the gain, an offset, a rate of the offset per duration of the recordings, and an
offset that the load takes over, as of a cover that is stretched over the texels."""
LAST_BEFORE_CLIP = [variant for variant in VARIANTS if variant.in_contact and not variant.after_clip][-1]
"""What it changes is not clipped, unlike what those before it do."""

Column = tuple[np.ndarray, np.ndarray]
"""Change of the readings (T, n) and of the net force (T,)."""


def columns(recorded: Recorded, number: int, variants: Iterable[Variant]) -> dict[str, list[Column]]:
    """Return derivatives of a run's readings and net force by corrections of the base model and by coefficients.

    Parameters
    ----------
    recorded : Recorded
    number : int
        Of the run.
    variants : iterable of Variant

    Returns
    -------
    dict of str to list of (reading, force)
        By names of base corrections and labels of variants.
    """
    run = recorded.runs[number]
    still = np.zeros(len(run.time))
    base = {
        "k": _of_force(run, run.load),
        "damping": _of_force(run, _before_clip(run, run.load - run.elastic)),
        "gain": (run.load, still),
        "zero": (np.ones_like(run.load), still),
    }
    made = {name: [base[name]] for name in BASE if name in recorded.free}
    for variant in variants:
        if variant is MISALIGNMENT:
            made[variant.label] = [_displaced(recorded, number, axis) for axis in range(len(POSE_STEP))]
        elif variant.in_contact:
            made[variant.label] = [_of_force(run, one) for one in _forces(variant, recorded, run)]
        else:
            made[variant.label] = [(one, still) for one in variant.columns(run.load, run, recorded)]
    return made


def texel_columns(recorded: Recorded, run: RecordedRun) -> np.ndarray:
    """Return derivatives of a run's readings by the parameters of their own texels, (q, T, n) as in :data:`TEXEL`."""
    share = ((run.time - run.time[0]) / recorded.duration)[:, None] + np.zeros_like(run.load)
    return np.stack([run.load, np.ones_like(run.load), share, 1.0 / (1.0 + run.load)])


def _forces(variant: Variant, recorded: Recorded, run: RecordedRun) -> list[np.ndarray]:
    """Changes of the texels' forces by a variant that acts in the contact, (T, n) each."""
    signal = run.load if variant.after_clip else run.elastic
    changes = [np.where(run.elastic > 0.0, one, 0.0) for one in variant.columns(signal, run, recorded)]
    return changes if variant.after_clip or variant is LAST_BEFORE_CLIP else [_before_clip(run, one) for one in changes]


def _before_clip(run: RecordedRun, change: np.ndarray) -> np.ndarray:
    """What a change of forces is behind the clip: a small one of them ends where the force is zero."""
    return np.maximum(change, -run.load / STEP)


def _of_force(run: RecordedRun, force: np.ndarray) -> Column:
    """A change of the texels' forces in the readings and in the net force."""
    return force, (force * run.towards_normal).sum(axis=1)


def _displaced(recorded: Recorded, number: int, axis: int) -> Column:
    """Derivatives by a displacement of the texels along or about an axis; none by the height if that is the base model's."""
    run, source = recorded.runs[number], recorded.source
    if axis == 2 and source.heights_free:
        return np.zeros_like(run.load), np.zeros(len(run.time))
    displacement = tuple(step if i == axis else 0.0 for i, step in enumerate(POSE_STEP))
    moved = source.displaced(displacement)[number]
    return _of_force(run, (moved - run.load) / (POSE_STEP[axis] / POSE_SCALE[axis]))
