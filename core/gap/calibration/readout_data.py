# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings of a rig as a read-out sees them: readings as what is known, and what drove the sensor as what is wanted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import FileError, counted
from ..dataset.rig import Rig
from ..dataset.trial import Trial

FEWEST_SAMPLES = 60
"""Samples with readings and targets that a fit needs."""
UNITS = {"x": "m", "y": "m", "depth": "m"}
"""Units of targets that are not in newtons."""


@dataclass(frozen=True)
class ReadoutRecording:
    """One recording.

    Attributes
    ----------
    name : str
    time : (T,) float, s
    readings : (T, c) float
    targets : (T, q) float
        NaN where one is not known.
    """

    name: str
    time: np.ndarray
    readings: np.ndarray
    targets: np.ndarray


@dataclass(frozen=True)
class ReadoutData:
    """All recordings of a rig.

    Attributes
    ----------
    targets : tuple of str
        What is wanted: "force", "x", "y", "depth", "force_x", "force_y", "force_z".
    texels : int
        Of the rig.
    channels : (c,) int
        Texels whose readings are used; those that never change are not.
    fit, check : tuple of ReadoutRecording
    notes : tuple of str
    """

    targets: tuple[str, ...]
    texels: int
    channels: np.ndarray
    fit: tuple[ReadoutRecording, ...]
    check: tuple[ReadoutRecording, ...]
    notes: tuple[str, ...] = ()

    def unit(self, target: str) -> str:
        """Return the unit of a target."""
        return UNITS.get(target, "N")


def readout_data(rig: Rig) -> ReadoutData:
    """Return the recordings of a rig for a read-out.

    Raises
    ------
    FileError
        There are no readings, or nothing that all fitted recordings say of what drove the sensor, or too few samples.
    """
    fit = [trial for trial in rig.of("fit") if trial.reading is not None]
    check = [trial for trial in rig.of("check") if trial.reading is not None]
    if not fit:
        raise FileError(
            f"No recording of '{rig.name}' to be fitted has readings: a read-out needs them beside what drove the sensor."
        )
    names = [set(_targets(trial)) for trial in fit]
    shared = tuple(name for name in _targets(fit[0]) if all(name in own for own in names) and _varies(fit, name))
    if not shared:
        raise FileError(f"The recordings of '{rig.name}' share no force, depth or place that changes: record one of them.")
    notes = []
    values = np.concatenate([trial.reading for trial in fit if trial.reading is not None])
    alive = np.fmax.reduce(values, axis=0) > np.fmin.reduce(values, axis=0)
    if not alive.any():
        raise FileError(f"No channel of '{rig.name}' changes in the fitted recordings: check the connection.")
    if not alive.all():
        named = ", ".join(f"texel_{i}" for i in np.flatnonzero(~alive)[:5])
        notes.append(f"{counted(int((~alive).sum()), 'channel')} never change and are not used: {named}.")
    channels = np.flatnonzero(alive)
    parts = tuple(_recording(trial, shared, channels) for trial in fit)
    count = sum(_complete(part) for part in parts)
    if count < FEWEST_SAMPLES:
        raise FileError(
            f"The fitted recordings of '{rig.name}' have {counted(count, 'sample')} with all readings and "
            f"{' and '.join(shared)}: a read-out needs {FEWEST_SAMPLES}."
        )
    usable = [trial for trial in check if set(shared) <= set(_targets(trial))]
    notes += [f"'{trial.name}' is no check, because it lacks {' or '.join(shared)}." for trial in check if trial not in usable]
    checks = tuple(_recording(trial, shared, channels) for trial in usable)
    return ReadoutData(shared, len(alive), channels, parts, checks, tuple(notes))


def _targets(trial: Trial) -> dict[str, np.ndarray]:
    """What is known of what drove a recording, by name."""
    found: dict[str, np.ndarray] = {}
    if trial.level is not None:
        found["force" if trial.stimulus == "force" else "depth"] = trial.level
    if trial.position is not None:
        found |= {"x": trial.position[:, 0], "y": trial.position[:, 1]}
    if trial.force is not None:
        found |= {f"force_{axis}": column for axis, column in zip("xyz", trial.force.T) if np.isfinite(column).any()}
    return found


def _varies(trials: list[Trial], name: str) -> bool:
    return any(np.nanmax(_targets(trial)[name]) > np.nanmin(_targets(trial)[name]) for trial in trials)


def _recording(trial: Trial, targets: tuple[str, ...], channels: np.ndarray) -> ReadoutRecording:
    assert trial.reading is not None
    own = _targets(trial)
    return ReadoutRecording(
        trial.name, trial.time, trial.reading[:, channels], np.stack([own[name] for name in targets], axis=1)
    )


def _complete(part: ReadoutRecording) -> int:
    return int((np.isfinite(part.readings).all(axis=1) & np.isfinite(part.targets).all(axis=1)).sum())
