# SPDX-License-Identifier: GPL-3.0-or-later
"""The designs of a study: which values the varied numbers have in each run.

A design is a set of points in the unit cube, one axis for each varied number; a distribution turns a coordinate into a value.
Points are computed once and in order, so a run's values depend on the study alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, get_args

import numpy as np

from ..errors import ParameterError
from ..io.schema import WORD, wanted

DesignKind = Literal["grid", "random", "latin-hypercube", "sobol"]
GRID, RANDOM, LATIN_HYPERCUBE, SOBOL = DESIGNS = get_args(DesignKind)
UNIFORM, LOG_UNIFORM, NORMAL, CHOICE = DISTRIBUTIONS = ("uniform", "log-uniform", "normal", "choice")
MOST_RUNS = 1_000_000
"""Most runs of a study, whose values are in memory, 8 bytes each."""
DEFAULT_LEVELS = 5
"""Values of a number in a grid, where the study does not say how many."""

Value = float | int | str | bool


@dataclass(frozen=True)
class Distribution:
    """The values that a varied number may have.

    Attributes
    ----------
    kind : str
        One of :data:`DISTRIBUTIONS`.
    words : tuple
        For ``uniform`` and ``log-uniform`` the lowest and the highest value, for ``normal`` mean and standard deviation, for
        ``choice`` the values.
    levels : int
        How many values a grid takes.
    low, high : float
        Bounds of the number. A normal distribution is truncated there; the others lie within.
    """

    kind: str
    words: tuple[Value, ...]
    levels: int = DEFAULT_LEVELS
    low: float = -math.inf
    high: float = math.inf

    @property
    def count(self) -> int:
        """Number of values in a grid."""
        return len(self.words) if self.kind == CHOICE else self.levels

    def grid_values(self) -> np.ndarray:
        """Return the values of a grid; a normal distribution gives the middles of parts of equal probability."""
        if self.kind == CHOICE:
            return self._choices
        share = (np.arange(self.levels) + 0.5) / self.levels
        if self.kind != NORMAL and self.levels > 1:
            share = np.arange(self.levels) / (self.levels - 1)
        return self.values(share)

    @property
    def _choices(self) -> np.ndarray:
        found = np.empty(len(self.words), dtype=object)
        found[:] = self.words
        return found

    def values(self, share: np.ndarray) -> np.ndarray:
        """Return the values at (n,) cumulative probabilities from 0 to 1: (n,) float, or objects for a choice."""
        if self.kind == CHOICE:
            return self._choices[np.minimum((share * len(self.words)).astype(int), len(self.words) - 1)]
        first, second = float(self.words[0]), float(self.words[1])
        if self.kind == NORMAL:
            from scipy.special import ndtr, ndtri

            begin, end = ndtr((self.low - first) / second), ndtr((self.high - first) / second)
            return np.clip(first + second * ndtri(begin + share * (end - begin)), self.low, self.high)
        if self.kind == LOG_UNIFORM:
            found = np.exp(math.log(first) + share * (math.log(second) - math.log(first)))
            return np.clip(found, first, second)  # rounding
        return first + share * (second - first)


@dataclass(frozen=True)
class Design:
    """How a study chooses the values of its runs.

    Attributes
    ----------
    kind : str
        One of :data:`DESIGNS`.
    samples : int
        Runs per scene; a grid has its own number.
    seed : int
    """

    kind: DesignKind = field(metadata={WORD: "design"})
    samples: Annotated[int, wanted("give a whole number of runs, above zero", ge=1, le=2**63 - 1)] = 0
    seed: Annotated[int, wanted("give a whole number of zero or more", ge=0, le=2**63 - 1)] = 0

    def count(self, varied: Mapping[str, Distribution]) -> int:
        """Return the number of points."""
        if self.kind != GRID:
            return self.samples
        return math.prod(distribution.count for distribution in varied.values())


def check_count(count: int) -> None:
    """Raise :class:`ParameterError` for a number of runs that no study can have."""
    if count > MOST_RUNS:
        raise ParameterError(
            f"The study asks for {count:.3g} runs, at most {MOST_RUNS} are possible: give fewer samples, levels or scenes, "
            "or split it into several studies."
        )


class Points(Sequence[dict[str, Value]]):
    """The values of every point of a design by the names of the varied numbers, as a column for each number.

    Parameters
    ----------
    columns : mapping of str to (count,) ndarray
    count : int
    """

    def __init__(self, columns: Mapping[str, np.ndarray], count: int):
        self._columns, self._count = columns, count

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, at: Any) -> Any:
        found = {name: column[at] for name, column in self._columns.items()}
        return {name: float(value) if isinstance(value, np.floating) else value for name, value in found.items()}


def points_of(design: Design, varied: Mapping[str, Distribution]) -> Points:
    """Return the values of every point, in order.

    Parameters
    ----------
    design : Design
    varied : mapping of str to Distribution

    Raises
    ------
    ParameterError
        There are too many points.
    """
    count = design.count(varied)
    check_count(count)
    columns: dict[str, np.ndarray] = {}
    if varied and design.kind == GRID:
        repeat = count
        for name, distribution in varied.items():  # the last one changes fastest
            own = distribution.grid_values()
            repeat //= len(own)
            columns[name] = np.tile(np.repeat(own, repeat), count // (repeat * len(own)))
    elif varied:
        cube = _unit_points(design, len(varied))
        columns = {name: one.values(cube[:, axis]) for axis, (name, one) in enumerate(varied.items())}
    return Points(columns, count)


def _unit_points(design: Design, axes: int) -> np.ndarray:
    """Return the (samples, axes) points of a design in the unit cube."""
    from scipy.stats import qmc

    if design.kind == RANDOM:
        return np.random.default_rng(design.seed).random((design.samples, axes))
    if design.kind == LATIN_HYPERCUBE:
        return qmc.LatinHypercube(axes, seed=design.seed).random(design.samples)
    if axes > qmc.Sobol.MAXDIM:
        raise ParameterError(f"A sobol design varies {axes} numbers, at most {qmc.Sobol.MAXDIM} are possible: use random.")
    # A power of two keeps the balance of the sequence; a study may take any number of its points.
    whole = qmc.Sobol(axes, seed=design.seed).random_base2(max(0, math.ceil(math.log2(max(1, design.samples)))))
    return whole[: design.samples]
