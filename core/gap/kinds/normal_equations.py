# SPDX-License-Identifier: GPL-3.0-or-later
"""Least squares of the cascade about a point: Gram blocks of half-recordings, parameters of single texels eliminated.

At a point the cascade is linear in its coefficients. Sums of products of its columns are kept for each half of each recording,
so that any set of kinds is solved for without going back to the samples. Parameters of single
texels have Gaussian priors and are eliminated by a Schur complement, one texel at a time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .cascade import TEXEL, Cascade, Point
from .dictionaries import MISALIGNMENT, VARIANTS, Variant

BOUNDS = {"k": (-0.8, 4.0), "damping": (-2.0, 6.0), "gain": (-0.8, 4.0), "zero": (-1.0, 1.0)}
"""Bounds of the corrections of the base model."""


@dataclass
class CascadeEquations:
    """Sums of products of the columns at a point, by blocks (halves of recordings).

    Attributes
    ----------
    at : dict of str to slice
        Columns of each base correction and each variant.
    variants : dict of str to Variant
    gram, right : (B, p, p), (B, p) float
    square, count : (B,) float
        Of the target: what the coefficients from zero on would have to explain.
    coupling : (B, q, p, n) float
        Products of the columns with those of the parameters of single texels.
    texel_gram, texel_right : (B, q, q, n), (B, q, n) float
    """

    at: dict[str, slice]
    variants: dict[str, Variant]
    gram: np.ndarray
    right: np.ndarray
    square: np.ndarray
    count: np.ndarray
    coupling: np.ndarray
    texel_gram: np.ndarray
    texel_right: np.ndarray


def joined(first: CascadeEquations, second: CascadeEquations) -> CascadeEquations:
    """Return the equations of two sets of recordings together; both have the same columns, in the same units."""
    names = ("gram", "right", "square", "count", "coupling", "texel_gram", "texel_right")
    both = {name: np.concatenate([getattr(first, name), getattr(second, name)]) for name in names}
    return CascadeEquations(first.at, first.variants, **both)


def normal_equations(cascade: Cascade, point: Point, variants: Sequence[Variant]) -> CascadeEquations:
    """Return the normal equations at a point.

    Parameters
    ----------
    cascade : Cascade
    point : Point
    variants : sequence of Variant
        Those of the point, and others of which nothing is there yet.
    """
    blocks: list[dict[str, np.ndarray]] = []
    at: dict[str, slice] = {}
    for number in range(len(cascade.recorded.runs)):
        made = cascade.columns(point, number, variants)
        if not at:
            start = 0
            for name, columns in made.items():
                at[name] = slice(start, start + len(columns))
                start += len(columns)
        blocks += _blocks(cascade, point, number, made, at)
    stacked = {key: np.stack([block[key] for block in blocks]) for key in blocks[0]}
    return CascadeEquations(at, {v.label: v for v in (*VARIANTS, MISALIGNMENT)}, **stacked)


def _blocks(
    cascade: Cascade,
    point: Point,
    number: int,
    made: dict[str, list[tuple[np.ndarray, np.ndarray]]],
    at: dict[str, slice],
) -> list[dict[str, np.ndarray]]:
    """Sums of products of both halves of a run."""
    recorded, run = cascade.recorded, cascade.recorded.runs[number]
    here, own = cascade.course(point, number), cascade.texel_columns(point, number)
    known, known_force = np.isfinite(run.reading), np.isfinite(run.force)
    weight, force_weight = known / recorded.noise[0], known_force / recorded.noise[1]
    n, columns = recorded.texel_count, [pair for pairs in made.values() for pair in pairs]
    table = np.empty((len(columns), len(run.time), n + 1))
    for row, (reading, force) in zip(table, columns, strict=True):
        np.multiply(reading, weight, out=row[:, :n])
        np.multiply(force, force_weight, out=row[:, n])
    texel = np.stack([own[name] * weight for name in TEXEL])
    target = np.empty((len(run.time), n + 1))
    target[:, :n] = np.where(known, run.reading - here.reading, 0.0) * weight
    target[:, n] = np.where(known_force, run.force - here.force, 0.0) * force_weight
    for name, values in [*((k, np.array([v])) for k, v in point.base.items()), *point.coefficients.items()]:
        if name in at:
            target += np.tensordot(values, table[at[name]], (0, 0))
    for index, name in enumerate(TEXEL):
        if name in point.texel:
            target[:, :n] += point.texel[name] * texel[index]
    made_blocks = []
    for half in run.halves:
        c, p, t = table[:, half], texel[:, half], target[half]
        flat = c.reshape(len(c), -1)
        by_texel = np.ascontiguousarray(p.transpose(2, 0, 1))
        made_blocks.append(
            {
                "gram": flat @ flat.T,
                "right": flat @ t.ravel(),
                "square": np.array(float(np.vdot(t, t))),
                "count": np.array(float(known[half].sum() + known_force[half].sum())),
                "coupling": np.matmul(by_texel, c[:, :, :n].transpose(2, 1, 0)).transpose(1, 2, 0),
                "texel_gram": np.einsum("qtn,rtn->qrn", p, p),
                "texel_right": np.einsum("qtn,tn->qn", p, t[:, :n]),
            }
        )
    return made_blocks
