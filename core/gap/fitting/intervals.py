# SPDX-License-Identifier: GPL-3.0-or-later
"""How well recordings tell the numbers of a fitted model: 95 % intervals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .least_squares import TEXEL_PRECISION, Fit, NormalEquations, all_equations, summed_equations, value_of
from .regression import student_quantile

NORMAL_QUANTILE = 1.959964
"""Standard deviations on either side that hold 95 % of a normal distribution."""
UNIDENTIFIED = 1e-8
"""Eigenvalue of the normal equations, with a diagonal of ones, up to which they tell nothing of a direction: as of two drags
that only act as their sum."""


@dataclass(frozen=True)
class ParameterInterval:
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


def parameter_intervals(found: Fit) -> list[ParameterInterval]:
    """Return the numbers of the amended model that are not one per texel.

    Each has the widest of four intervals: of noise as it is where nothing touches; from the scatter of the gradients of
    channels within about a second, which holds for coloured noise and for residuals of unequal size; of texels within whole
    trials, which holds for colour of any length; and of whole trials, as when the formula is not quite the sensor's. A number
    that few channels or trials tell, as those of friction, has too few gradients for the last two: they sum to zero where the
    fit ends, and hold for the others only.
    """
    common = [item for item in found.free if not item.per_texel]
    kinds = _covariances(found)
    made = []
    for i, item in enumerate(common):
        at = float(item.to_coordinate(value_of(found.model, item)))
        spread = NORMAL_QUANTILE * max(float(np.sqrt(max(kind[i, i], 0.0))) for kind in kinds)
        ends = sorted((float(item.from_coordinate(at - spread)), float(item.from_coordinate(at + spread))))
        made.append(ParameterInterval(item.effect, item.name, float(value_of(found.model, item)), ends[0], ends[1]))
    return made


def _covariances(found: Fit) -> tuple[np.ndarray, ...]:
    """Covariances of the common numbers in their coordinates, (p, p) each: of noise alone, and by groups (see
    :func:`parameter_intervals`).
    """
    assert found.equations is not None
    total = summed_equations(all_equations(found.equations))
    m = total.texel_gradient.shape[1]
    shift = _texel_response(total) if m else np.zeros((total.coupling.shape[0], m, len(total.common)))
    a = total.common - np.einsum("nmp,nmq->pq", total.coupling, shift)
    bread = _inverse(a)
    blocks, texels, trials = [], [], []
    for trial in found.equations:
        gradient = np.concatenate([one.gradients for one in trial])
        if m:  # what the numbers per texel take up of it; of which block that is, is not known
            own = np.einsum("nmp,nm->np", shift, np.sum([one.texel_gradient for one in trial], axis=0))
            gradient[:, : len(shift)] -= own / len(gradient)
        blocks.append(gradient.reshape(-1, len(a)))
        texels.append(gradient.sum(axis=0))
        trials.append(gradient.sum(axis=(0, 1))[None])
    return bread, *(_sandwich(bread, np.concatenate(groups)) for groups in (blocks, texels, trials))


def _texel_response(total: NormalEquations) -> np.ndarray:
    """How numbers per texel give way to the common ones, (n, m, p), while their mean over the texels that were touched stays.

    What all texels have in common is a common number's: each texel's gain times two is the sensor's.
    """
    m = total.texel_gradient.shape[1]
    inverse = np.linalg.inv(total.texel + TEXEL_PRECISION * np.eye(m))
    informed = np.einsum("nmm->nm", total.texel)
    informed = (informed > 1e-9 * informed.max(initial=1e-300)).astype(float)
    follow = inverse @ total.coupling
    pulled = np.einsum("nmk,nk->nmk", inverse, informed)
    stiffness, drift = np.einsum("nm,nmk->mk", informed, pulled), np.einsum("nm,nmp->mp", informed, follow)
    kept: np.ndarray = follow - pulled @ np.linalg.lstsq(stiffness, drift, rcond=None)[0]
    return kept


def _inverse(a: np.ndarray) -> np.ndarray:
    """Inverse of normal equations (p, p), next to infinite along what they do not tell."""
    squares = np.diag(a)
    size = np.sqrt(np.where(squares > 1e-30 * squares.max(initial=0.0), squares, 1.0))  # one without any effect stays so
    informed, along = np.linalg.eigh(a / np.outer(size, size))
    inverse: np.ndarray = (
        (along / np.where(informed > UNIDENTIFIED, informed, 1e-4 * UNIDENTIFIED)) @ along.T / np.outer(size, size)
    )
    return inverse


def _sandwich(bread: np.ndarray, gradients: np.ndarray) -> np.ndarray:
    """Covariance (p, p) from the scatter of groups' gradients (g, p), so wide that normal intervals hold what Student's do.

    Noise may be as coloured as it likes within a group (Liang and Zeger, Biometrika 73, 1986). Where few groups tell most of a
    number their scatter is itself uncertain: as of so many equal groups as the fourth moment of normal influences says, which
    is three times the square of the second (effective number of clusters; Carter, Schnepel and Steigerwald, Rev. Econ. Stat.
    99, 2017).
    """
    groups = int((np.abs(gradients).sum(axis=1) > 0).sum())
    influence = gradients @ bread
    squares, fourth = (influence**2).sum(axis=0), (influence**4).sum(axis=0)
    effective = np.clip(3.0 * squares**2 / np.maximum(fourth, 1e-300), 2.0, max(groups, 2))
    reach = np.array([student_quantile(number - 1.0) for number in effective]) / NORMAL_QUANTILE
    factor = groups / max(groups - len(bread), 1)
    covariance: np.ndarray = factor * np.outer(reach, reach) * (influence.T @ influence)
    return covariance
