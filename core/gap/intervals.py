# SPDX-License-Identifier: GPL-3.0-or-later
"""How well recordings tell the numbers of a fitted model: 95 % intervals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..calibrate.regression import student
from .fit import PRIOR, Fit, Sums, flattened, total_of, value_of

if TYPE_CHECKING:
    from .diagnose import Diagnosis

NORMAL_REACH = 1.959964
"""Standard deviations on either side that hold 95 % of a normal distribution."""


@dataclass(frozen=True)
class Number:
    """A fitted number.

    Attributes
    ----------
    effect : int
        Index in the model's stack; -1 for the base model.
    name : str
    value, low, high : float
        With its 95 % interval.
    """

    effect: int
    name: str
    value: float
    low: float
    high: float


def numbers(result: Diagnosis) -> list[Number]:
    """Return the numbers of the amended model that are not one per texel.

    Each has the largest of four standard errors: that of noise as it is where nothing touches; from the scatter of the
    gradients of channels within about a second, which holds for coloured noise and for residuals of unequal size; of texels
    within whole trials, which holds for colour of any length; and of whole trials, as when the formula is not quite the
    sensor's. A number that few channels or trials tell, as those of friction, has too few gradients for the last two: they sum
    to zero where the fit ends, and hold for the others only.
    """
    found = result.best
    common = [item for item in found.free if not item.per_texel]
    bread, by_block, by_texel, by_trial = _covariances(found)
    trials = len(found.sse)
    kinds = [bread, by_block, by_texel, by_trial]
    reach = [NORMAL_REACH] * 3 + [student(trials - 1) if trials > len(common) + 1 else NORMAL_REACH]
    made = []
    for i, item in enumerate(common):
        at = float(item.to(value_of(found.model, item)))
        spread = max(far * float(np.sqrt(max(kind[i, i], 0.0))) for far, kind in zip(reach, kinds, strict=True))
        ends = sorted((float(item.back(at - spread)), float(item.back(at + spread))))
        made.append(Number(item.effect, item.name, float(value_of(found.model, item)), ends[0], ends[1]))
    return made


def _covariances(found: Fit) -> tuple[np.ndarray, ...]:
    """Covariances of the common numbers in their coordinates, (p, p) each: of noise alone, and by groups (see :func:`numbers`).

    Squares of the residual are summed in groups within which noise may be as coloured as it likes (Liang and Zeger,
    Biometrika 73, 1986).
    """
    assert found.sums is not None
    t = total_of(flattened(found.sums))
    m = t.h.shape[1]
    a = t.a + 1e-12 * (1.0 + np.trace(t.a)) * np.eye(len(t.a))
    shift = _followed(t) if m else np.zeros((t.b.shape[0], m, len(t.a)))
    a = a - np.einsum("nmp,nmq->pq", t.b, shift)
    bread = np.linalg.pinv(a, hermitian=True)
    blocks, texels, trials = [], [], []
    for trial in found.sums:
        gradient = np.concatenate([one.gradients for one in trial])
        if m:  # what the numbers per texel take up of it; of which block that is, is not known
            own = np.einsum("nmp,nm->np", shift, np.sum([one.h for one in trial], axis=0))
            gradient[:, : len(shift)] -= own / len(gradient)
        blocks.append(gradient.reshape(-1, len(a)))
        texels.append(gradient.sum(axis=0))
        trials.append(gradient.sum(axis=(0, 1))[None])
    return bread, *(_sandwich(bread, np.concatenate(groups)) for groups in (blocks, texels, trials))


def _followed(t: Sums) -> np.ndarray:
    """How numbers per texel give way to the common ones, (n, m, p), while their mean over the texels that were touched stays.

    What all texels have in common is a common number's: each texel's gain times two is the sensor's.
    """
    m = t.h.shape[1]
    inverse = np.linalg.inv(t.c + PRIOR * np.eye(m))
    told = np.einsum("nmm->nm", t.c)
    told = (told > 1e-9 * told.max(initial=1e-300)).astype(float)
    follow = inverse @ t.b
    pulled = np.einsum("nmk,nk->nmk", inverse, told)
    stiffness, drift = np.einsum("nm,nmk->mk", told, pulled), np.einsum("nm,nmp->mp", told, follow)
    kept: np.ndarray = follow - pulled @ np.linalg.lstsq(stiffness, drift, rcond=None)[0]
    return kept


def _sandwich(bread: np.ndarray, gradients: np.ndarray) -> np.ndarray:
    groups = int((np.abs(gradients).sum(axis=1) > 0).sum())
    factor = groups / max(groups - len(bread), 1)
    covariance: np.ndarray = factor * bread @ (gradients.T @ gradients) @ bread
    return covariance
