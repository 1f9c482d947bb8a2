# SPDX-License-Identifier: GPL-3.0-or-later
"""The designs of a study: which values the varied numbers have in each run.

A design is a set of points in the unit cube, one axis for each varied number; a distribution turns a coordinate into a value.
Points are computed once and in order, so a run's values depend on the study alone.
"""

from __future__ import annotations

import glob
import math
import os
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import numpy as np

from ..errors import FileError, ParameterError, os_error_reason
from ..geometry.mesh import turned_outwards
from ..io.file_writing import file_sha256
from ..io.input_files import load_mesh
from ..io.schema import WORD, wanted
from .scene_property import is_scene_property

# The mesh files that a study gives to its targets, as ``"Ball.mesh" = { choice = ["shapes/*.stl"] }``.
#
# They are copied into the study's folder, under names made of their contents, so that the study goes on without the originals.

MESH = "mesh"
"""Last word of the name of a target's shape."""
MESHES = "meshes"
"""Folder of the copies, in that of the scenes."""


def find_meshes(vary: Mapping[str, Any], base: Path) -> dict[str, Path]:
    """Return the mesh files of a study by the names that it gives, each read once to see that it is one.

    Parameters
    ----------
    vary : mapping
        Of the study.
    base : Path
        Folder of the study's file.

    Raises
    ------
    PalpateError
        A file is missing or no mesh, or no file fits a pattern.
    """
    words: list[str] = []
    for name, entry in vary.items():
        if name.endswith(f".{MESH}") and not is_scene_property(name):
            if isinstance(entry, str) and glob.has_magic(entry):
                raise ParameterError(
                    f"'{name}' is the pattern '{entry}': write {{ choice = [\"{entry}\"] }} to vary its files."
                )
            given = entry.get(CHOICE) if isinstance(entry, Mapping) else [entry]
            words += [word for word in given if isinstance(word, str)] if isinstance(given, list) else []
    files: dict[str, Path] = {}
    for word in words:
        found = [Path(name).as_posix() for name in sorted(glob.glob(word, root_dir=base))] if glob.has_magic(word) else [word]
        if not found:
            raise FileError(f"No file next to the study matches the meshes '{word}': check its name and folder.")
        files |= {name: base / name for name in found}
    for file in files.values():
        turned_outwards(load_mesh(file), file.name)
    return files


def freeze_meshes(files: Mapping[str, Path], folder: Path) -> dict[str, Path]:
    """Copy mesh files into a folder, which is made, and return the copies by the names of the files; raises FileError."""
    copies = {}
    for name, file in files.items():
        copies[name] = copy = mesh_copy(folder, name, file_sha256(file))
        try:
            folder.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, copy)
        except OSError as error:
            raise FileError(
                f"The mesh '{file}' could not be copied ({os_error_reason(error)}): check it and '{folder}'."
            ) from error
    return copies


def mesh_copy(folder: Path, name: str, sha256: str) -> Path:
    """Return the copy of a mesh file in a folder; its name without the ending is the SHA-256."""
    return folder / f"{sha256}{os.path.splitext(name)[1].lower()}"


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

    def grid_values(self) -> np.ndarray:
        """Return the values of a grid; a normal distribution gives the middles of parts of equal probability."""
        if self.kind == CHOICE:
            return np.array(self.words, object)
        share = (np.arange(self.levels) + 0.5) / self.levels
        if self.kind != NORMAL and self.levels > 1:
            share = np.arange(self.levels) / (self.levels - 1)
        return self.values(share)

    def values(self, share: np.ndarray) -> np.ndarray:
        """Return the values at (n,) cumulative probabilities from 0 to 1: (n,) float, or objects for a choice."""
        if self.kind == CHOICE:
            return np.array(self.words, object)[np.minimum((share * len(self.words)).astype(int), len(self.words) - 1)]
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
        return math.prod(len(one.words) if one.kind == CHOICE else one.levels for one in varied.values())


def check_count(count: int) -> None:
    """Raise :class:`ParameterError` for a number of runs that no study can have."""
    if count > MOST_RUNS:
        raise ParameterError(
            f"The study asks for {count:.3g} runs, at most {MOST_RUNS} are possible: give fewer samples, levels or scenes, "
            "or split it into several studies."
        )


def columns_of(design: Design, varied: Mapping[str, Distribution]) -> dict[str, np.ndarray]:
    """Return the values of the varied numbers in the order of the runs, (count,) each, by name."""
    columns: dict[str, np.ndarray] = {}
    if design.kind == GRID:
        count = repeat = design.count(varied)
        for name, distribution in varied.items():  # the last one changes fastest
            own = distribution.grid_values()
            repeat //= len(own)
            columns[name] = np.tile(np.repeat(own, repeat), count // (repeat * len(own)))
    elif varied:
        columns = {name: one.values(axis) for (name, one), axis in zip(varied.items(), _unit_points(design, len(varied)).T)}
    return columns


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
