# SPDX-License-Identifier: GPL-3.0-or-later
"""Sums of products of the columns of kinds over recordings, from which least squares follow without going back to samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .columns import Column, columns, texel_columns
from .dictionaries import Variant
from .recorded import Recorded


@dataclass(frozen=True)
class NormalEquations:
    """Sums of products of columns, in units of the noise.

    Attributes
    ----------
    at : dict of str to range
        Columns of each base correction and each variant.
    gram : (p, p) float
    coupling : (q, p, n) float
        Products with the columns of parameters of single texels.
    texel_gram : (q, q, n) float
        Products of these with each other.
    count : float
        Number of measured values.
    """

    at: dict[str, range]
    gram: np.ndarray
    coupling: np.ndarray
    texel_gram: np.ndarray
    count: float

    def __add__(self, other: NormalEquations) -> NormalEquations:
        """Return the equations of two sets of recordings together; both have the same columns, in the same units."""
        return NormalEquations(
            self.at,
            self.gram + other.gram,
            self.coupling + other.coupling,
            self.texel_gram + other.texel_gram,
            self.count + other.count,
        )


def normal_equations(recorded: Recorded, variants: Sequence[Variant]) -> NormalEquations:
    """Return the normal equations of the base model and some variants.

    Parameters
    ----------
    recorded : Recorded
    variants : sequence of Variant
    """
    first, *others = (_of_run(recorded, number, variants) for number in range(len(recorded.runs)))
    return sum(others, first)


def _of_run(recorded: Recorded, number: int, variants: Sequence[Variant]) -> NormalEquations:
    """The normal equations of one run."""
    run, n = recorded.runs[number], recorded.texel_count
    at: dict[str, range] = {}
    pairs: list[Column] = []
    for name, own in columns(recorded, number, variants).items():
        at[name] = range(len(pairs), len(pairs) + len(own))
        pairs += own
    known, known_force = run.read, np.isfinite(run.force)
    weight = known / recorded.noise[0]
    table = np.empty((len(pairs), len(run.time), n + 1))
    for row, (reading, force) in zip(table, pairs, strict=True):
        np.multiply(reading, weight, out=row[:, :n])
        np.multiply(force, known_force / recorded.noise[1], out=row[:, n])
    flat, texel = table.reshape(len(table), -1), texel_columns(recorded, run) * weight
    by_texel = np.ascontiguousarray(texel.transpose(2, 0, 1))
    return NormalEquations(
        at,
        flat @ flat.T,
        np.matmul(by_texel, table[:, :, :n].transpose(2, 1, 0)).transpose(1, 2, 0),
        np.einsum("qtn,rtn->qrn", texel, texel),
        float(known.sum() + known_force.sum()),
    )
