# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects of a real sensor that its model lacks."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..core.errors import FileError
from ..core.gap.dataset.rig import Rig
from ..core.gap.dataset.rig import read_rig as read_rig_file
from ..core.gap.report.comparison import GapErrors, gap_errors
from ..core.gap.selection.findings import Diagnosis
from ..core.geometry.grid_layout import GridLayout
from ..core.geometry.mesh import TriangleMesh
from ..core.jobs import Job
from ..core.model.sensor import Sensor as ModelSensor
from ..core.model.sensor import Value
from . import arguments
from .arguments import ArgumentError
from .running import ShowProgress, finished, prepare_solver
from .sensors import Sensor

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RigOrFile = Rig | str | os.PathLike[str]


@dataclass(frozen=True, repr=False)
class Interval:
    """A fitted value with its 95 % interval; `low` and `high` are None where there is one value for each texel.

    Attributes
    ----------
    value : float or tuple of float
    low, high : float or None
    """

    value: Value
    low: float | None = None
    high: float | None = None

    def __str__(self) -> str:
        if isinstance(self.value, tuple):
            return f"{len(self.value)} values from {min(self.value):.3g} to {max(self.value):.3g}"
        return f"{self.value:.3g}" + ("" if self.low is None else f" ({self.low:.3g} to {self.high:.3g})")

    def __repr__(self) -> str:
        return f"<Interval: {self}>"


@dataclass(frozen=True, repr=False)
class FoundEffect:
    """An effect that the model lacks.

    Attributes
    ----------
    name, form : str
        As in docs/effects.md.
    confidence : float
        From 0 to 1.
    parameters : dict of str to Interval
    rivals : tuple of str
        Effects that explain the recordings as well.
    """

    name: str
    form: str
    confidence: float
    parameters: dict[str, Interval]
    rivals: tuple[str, ...] = ()

    def __repr__(self) -> str:
        words = [f"{name} {value}" for name, value in self.parameters.items()]
        words += [f"or {rival}" for rival in self.rivals]
        return f"<FoundEffect: {self.name} ({self.form}), {self.confidence:.0%}{''.join(f', {word}' for word in words)}>"


class Gap:
    """Effects that the model of a sensor lacks: the result of :func:`find_gap`.

    Attributes
    ----------
    rig : Rig
    diagnosis : Diagnosis
        Everything that was found out.
    errors : GapErrors
        Errors of all models, on fitted and on check recordings.
    """

    def __init__(self, rig: Rig, diagnosis: Diagnosis, errors: GapErrors):
        self.rig, self.diagnosis, self.errors = rig, diagnosis, errors

    @property
    def verdict(self) -> str:
        """One of "no gap", "explained" and "unexplained"."""
        return self.diagnosis.verdict

    @cached_property
    def effects(self) -> list[FoundEffect]:
        """The effects that the model lacks, with confidence and parameters."""
        found, stack = [], self.sensor.effects
        for one in self.diagnosis.findings:
            intervals = {own.name: own for own in self.diagnosis.intervals if own.effect == one.effect}
            parameters = {
                name: Interval(value, intervals[name].low, intervals[name].high) if name in intervals else Interval(value)
                for name, value in stack[one.effect].values.items()
            }
            found.append(FoundEffect(one.name, one.form, one.confidence, parameters, one.rivals))
        return found

    @property
    def error_before(self) -> float | None:
        """Root mean square error of the base model on the fitted recordings, as a share of the measured range."""
        return self.errors.base["fit"]

    @property
    def error_after(self) -> float | None:
        """Root mean square error with the effects, as a share of the measured range."""
        return self.errors.amended["fit"]

    @cached_property
    def sensor(self) -> Sensor:
        """The amended sensor: the fitted parameters and the effects, on the texels of the rig."""
        from ..core.gap.report.amended_sensor import amended_sensor

        model, texels = amended_sensor(self.diagnosis), self.rig.texels
        faces = texels.layout.triangles if isinstance(texels.layout, GridLayout) else np.zeros((0, 3), int)
        mesh = TriangleMesh(texels.position, faces)
        return Sensor(ModelSensor(model.name, 0, texels, model.parameters, effects=model.effects), mesh)

    @property
    def headline(self) -> str:
        """The result in a sentence or two."""
        from ..core.gap.report import sentences

        return sentences.headline(self.diagnosis, self.errors)

    def plot(self, name: str = "curves") -> Figure:
        """Return a figure of the report, which a notebook shows: "curves", "gap", "loops", "map", "overview" or "phases"."""
        from ..core.gap.report.plots import CAPTIONS, picture
        from .drawings import shown_in_notebooks

        arguments.known([name], list(CAPTIONS), "figure called")
        return shown_in_notebooks(picture(name, self.diagnosis, self.errors))

    def report(self, folder: str | os.PathLike[str], progress: ShowProgress = False) -> Path:
        """Write report.html, gap.json, sensor.toml, plots and the next experiment into a folder; return the page.

        The files of an earlier report are replaced together when all are written.
        """
        from ..core.gap.report import summary
        from ..core.io.file_writing import writable_folder

        place = writable_folder(folder, create=True)
        finished(summary.write_report(self.diagnosis, place, self.errors), progress, "report")
        return place / "report.html"

    def __repr__(self) -> str:
        names = ", ".join(f"{one.name} ({one.confidence:.0%})" for one in self.effects) or "no effect"
        before, after = (f"{error:.2%}" if error is not None else "unknown" for error in (self.error_before, self.error_after))
        return f"<Gap of '{self.rig.name}': {self.verdict}, {names}, error {before} to {after}>"

    def _repr_html_(self) -> str:
        """The result and the measured and predicted curves, for notebooks."""
        from ..core.gap.report.plots import picture
        from .drawings import png_tag

        return f"<div>{escape(self.headline)}</div>{png_tag(picture('curves', self.diagnosis, self.errors))}"


def read_rig(path: str | os.PathLike[str]) -> Rig:
    """Read a rig: the description of measurements (docs/rig-format.md) and all its recordings.

    Raises
    ------
    PalpateError
        Something in it cannot be used.
    """
    return read_rig_file(Path(path))


def find_gap(rig: RigOrFile, progress: ShowProgress = False) -> Gap:
    """Find the effects in the recordings of a rig that the model of the sensor lacks.

    Parameters
    ----------
    rig : Rig or path of a rig.toml
    progress : bool or callable
        True for a progress bar.

    Raises
    ------
    PalpateError
        The rig cannot be used.
    """
    found = rig_of(rig)
    prepare_solver()
    return finished(search(found), progress, "gap")


def search(rig: Rig) -> Job[Gap]:
    """Find the effects that the model lacks, as a job: windows run it a little at a time.

    Yields
    ------
    Progress

    Returns
    -------
    Gap
    """
    from ..core.gap.selection.diagnosis import diagnose

    diagnosis = yield from diagnose(rig)
    return Gap(rig, diagnosis, gap_errors(diagnosis))


def rig_of(rig: RigOrFile) -> Rig:
    """Return a rig; a path is read."""
    if isinstance(rig, str | os.PathLike):
        return read_rig(rig)
    if not isinstance(rig, Rig):
        raise ArgumentError(f"rig is {arguments.brief(rig)}: give the path of a rig.toml, or what read_rig returns.")
    if not rig.of("fit"):
        raise FileError(f"Rig '{rig.name}' has no recording with use = \"fit\": give at least one.")
    return rig
