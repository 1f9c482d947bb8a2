# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings as the comparison of kinds sees them: the base model's forces, where something was measured, and the noise.

Forces are in units of the base model's largest force, so that 1 is full load. A recording that begins with an untouched sensor
is one :class:`RecordedRun`; the recordings of a session are one together, with samples in the pauses that nothing was measured
at. Samples are thinned, because each kind is a set of smooth functions.
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...effects.engine.signal_operators import load_put_on
from ...geometry.layout.grid_layout import GridLayout
from ...model.effect import Effect
from ..dataset.rig import Rig
from ..dataset.trial import Trial
from ..fitting.noise_floor import ChannelNoise
from ..forward.predictor import Model, Predictor, predictors_of
from .decision_numbers import FORCE_RESOLUTION, LEAST_RATE, MOST_VALUES
from .dictionaries import MISALIGNMENT

POSE = ("x", "y", "z", "about_x", "about_y", "about_z")
"""Parameters of the effect that displaces the texels."""


@dataclass(frozen=True)
class RecordedRun:
    """What one untouched sensor did: a recording, or the recordings of a session.

    Attributes
    ----------
    time : (T,) float, s
    load, elastic : (T, n) float
        The base model's normal force of each texel, and without damping; that is positive exactly where there is contact.
    work : (T, n) float
        Work done on each texel so far, pressing and sliding; 1 is the largest of all runs.
    read : (T, n) bool
        Where a reading was measured.
    force : (T,) float
        Measured net force along the mean normal, without the base model's friction; NaN where nothing was.
    towards_normal : (T, n) float
        Share of each texel's force that goes along the mean normal.
    """

    time: np.ndarray
    load: np.ndarray
    elastic: np.ndarray
    work: np.ndarray
    read: np.ndarray
    force: np.ndarray
    towards_normal: np.ndarray


@dataclass(frozen=True)
class Recorded:
    """All fitted recordings of a rig.

    Attributes
    ----------
    runs : tuple of RecordedRun
    noise : (float, float)
        Standard deviation of readings and of the net force.
    correlation : float
        Integral of the autocorrelation of the readings' noise in thinned samples, at least 1.
    place : (n, 2) float
        Places of the texels in their plane, in pitches.
    rows : (n, 2) int or None
        Row and column of each texel; None if they are not in a grid.
    duration : float, s
        Of the longest run.
    full_path : float
        Load that was put on the texel that was pressed most, over all of its presses; full load is 1.
    free : frozenset of str
        Which of "k", "damping", "gain" and "zero" the base model has free.
    source : Source
        From which loads at other places are computed.
    """

    runs: tuple[RecordedRun, ...]
    noise: tuple[float, float]
    correlation: float
    place: np.ndarray
    rows: np.ndarray | None
    duration: float
    full_path: float
    free: frozenset[str]
    source: Source

    @property
    def texel_count(self) -> int:
        """Number of texels."""
        return len(self.place)

    @property
    def has_readings(self) -> bool:
        """True if any texel was read, rather than net forces alone."""
        return any(bool(run.read.any()) for run in self.runs)


@dataclass(frozen=True)
class Source:
    """Thinned predictors of the fitted recordings, by runs, and the base model, from which the loads come."""

    rig: Rig
    model: Model
    predictors: tuple[tuple[Predictor, ...], ...]
    scale: float
    can_move: bool
    heights_free: bool
    most_work: float
    stride: int
    kept: dict[tuple[float, ...], list[np.ndarray]] = field(default_factory=dict)

    def displaced(self, displacement: tuple[float, ...]) -> list[np.ndarray]:
        """Return the loads of each run with the texels displaced (m and rad)."""
        if displacement not in self.kept:
            moved = self.model.with_effect(Effect(MISALIGNMENT.kind, "rigid", dict(zip(POSE, displacement, strict=True))))
            self.kept[displacement] = [self.load(group, moved) for group in self.predictors]
        return self.kept[displacement]

    def load(self, group: tuple[Predictor, ...], model: Model) -> np.ndarray:
        """Return the load of a run, with its pauses, by a model, (T, n)."""
        return np.ascontiguousarray(group[0].responses.normal_force(model)) / self.scale


def recorded(
    predictors: Sequence[Predictor],
    model: Model,
    free: Set[str],
    noise: tuple[ChannelNoise, ChannelNoise],
) -> Recorded:
    """Return fitted recordings without units.

    Parameters
    ----------
    predictors : sequence of Predictor
        Of all trials that are fitted.
    model : Model
        The base model.
    free : set of str
        Names of the parameters that the base model has free.
    noise : (ChannelNoise, ChannelNoise)
        Of readings and of net forces.
    """
    rig, stride = predictors[0].rig, _stride(predictors)
    groups = _groups(predictors, stride)
    gain = model.parameters.gain
    scale = max(max(float(p.normal_force(model).max(initial=0.0)) for p in predictors), 1e-12)
    posed = all(p.trial.stimulus == "pose" for p in predictors)
    heights_free = any(isinstance(p.trial.contact_height, str) for p in predictors)
    source = Source(rig, model, groups, scale, posed, heights_free, 1.0, stride)
    loads = [source.load(group, model) for group in groups]
    works = [_work(group, load * scale) for group, load in zip(groups, loads, strict=True)]
    source = replace(source, most_work=max(max(float(work.max(initial=0.0)) for work in works), 1e-300))
    runs = tuple(_run(group, source, load, work) for group, load, work in zip(groups, loads, works, strict=True))
    ranges = [np.ptp(run.force[np.isfinite(run.force)]) for run in runs if np.isfinite(run.force).any()]
    read = any(run.read.any() for run in runs)
    level = max(noise[1].deviation / scale, FORCE_RESOLUTION * float(max(ranges, default=1.0)) if read else 0.0)
    names = {"k", *(["damping"] if "cn" in free else []), *(name for name in ("gain", "zero") if name in free)}
    place, rows = _places(rig)
    return Recorded(
        runs,
        (noise[0].deviation / abs(gain) / scale, level),
        max(noise[0].correlation_time / stride, 1.0),
        place,
        rows,
        max(float(np.ptp(run.time)) for run in runs),
        max(float(load_put_on(run.load)[-1].max()) for run in runs),
        frozenset(names),
        source,
    )


def planned(recorded: Recorded, trial: Trial) -> Recorded:
    """Return a recording that was not made yet, in the units of those that were; all its samples count as measured.

    Parameters
    ----------
    recorded : Recorded
        Those that were made.
    trial : Trial
        Its stimulus. Responses have no meaning.

    Returns
    -------
    Recorded
        With this run alone.
    """
    before = recorded.source
    group = tuple(predictors_of([_thinned(replace(trial, reading=None, force=None), before.stride)], before.rig))
    source = replace(before, predictors=(group,), kept={})
    load = source.load(group, source.model)
    run = _run(group, source, load, _work(group, load * source.scale))
    weighs = any(np.isfinite(one.force).any() for one in recorded.runs)
    read = np.broadcast_to(np.any([one.read.any(axis=0) for one in recorded.runs], axis=0), run.read.shape)
    force = np.zeros_like(run.force) if weighs else run.force
    return replace(recorded, runs=(replace(run, read=read, force=force),), source=source)


def _stride(predictors: Sequence[Predictor]) -> int:
    """Every which sample is kept."""
    values = sum(len(p.trial.time) for p in predictors) * len(predictors[0].rig.texels)
    step = min(p.trial.step for p in predictors)
    return max(1, min(int(np.ceil(values / MOST_VALUES)), int(1.0 / (LEAST_RATE * step))))


def _groups(predictors: Sequence[Predictor], stride: int) -> tuple[tuple[Predictor, ...], ...]:
    """Thinned predictors; those of a session, with its recordings that are only checked, are one group."""
    groups: list[list[Trial]] = []
    for predictor in predictors:
        if predictor.session is None:
            groups.append([predictor.trial])
        elif all(predictor.session.trials[0] is not group[0] for group in groups):
            groups.append(list(predictor.session.trials))
    rig = predictors[0].rig
    return tuple(tuple(predictors_of([_thinned(trial, stride) for trial in group], rig)) for group in groups)


def _thinned(trial: Trial, stride: int) -> Trial:
    """Every `stride`-th sample of a trial."""
    names = ("time", "position", "quaternion", "level", "slide", "reading", "force")
    values = {name: getattr(trial, name) for name in names}
    parts: dict[str, Any] = {name: None if value is None else value[::stride] for name, value in values.items()}
    return replace(trial, **parts)


def _work(group: tuple[Predictor, ...], force: np.ndarray) -> np.ndarray:
    """Work of pressing and sliding that was done on each texel so far, (T, n)."""
    stimulus = group[0].responses.texel_stimulus
    step = np.diff(stimulus.time, prepend=stimulus.time[0])[:, None]
    return np.cumsum(force * np.hypot(stimulus.slide, stimulus.rate) * step, axis=0)


def _run(group: tuple[Predictor, ...], source: Source, load: np.ndarray, work: np.ndarray) -> RecordedRun:
    """A run from the predictors of its trials; `work` is in joules."""
    model, scale = source.model, source.scale
    elastic = source.load(group, replace(model, parameters=replace(model.parameters, cn=0.0)))
    stimulus = group[0].responses.texel_stimulus
    normals = group[0].rig.texels.normal
    axis = normals.mean(axis=0) / max(float(np.linalg.norm(normals.mean(axis=0))), 1e-12)
    direction = np.broadcast_to(-normals if stimulus.normal is None else stimulus.normal, (*load.shape, 3))
    towards = -(direction @ axis)
    read, force = np.zeros(load.shape, bool), np.full(len(load), np.nan)
    for predictor in group:
        trial, rows = predictor.trial, predictor.samples
        if trial.use != "fit":
            continue
        if trial.reading is not None:
            read[rows] = np.isfinite(trial.reading)
        if trial.force is not None:
            predicted = predictor.predict(model).force
            assert predicted is not None
            friction = -(predicted @ axis) / scale - (load[rows] * towards[rows]).sum(axis=1)
            force[rows] = -(trial.force @ axis) / scale - friction
    return RecordedRun(stimulus.time, load, elastic, work / source.most_work, read, force, towards)


def _places(rig: Rig) -> tuple[np.ndarray, np.ndarray | None]:
    """Places of texels in their plane in pitches, and their rows and columns."""
    texels = rig.texels
    across = np.cross(texels.normal[0], texels.tangent[0])
    flat = np.stack([texels.position @ texels.tangent[0], texels.position @ across], axis=1)
    pitch = float(np.sqrt(np.median(texels.area))) if len(flat) > 1 else 1.0
    layout = texels.layout
    if not isinstance(layout, GridLayout):
        return flat / pitch, None
    return flat / pitch, np.stack([layout.row, layout.column], axis=1)
