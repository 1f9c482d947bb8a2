# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings without contact, without an answer, or with the other sign are refused before anything is fitted."""

from dataclasses import replace

import gap_cases
import numpy as np
import pytest

from palpate.core.errors import FileError
from palpate.core.gap.base import base_model
from palpate.core.gap.forward.predictor import predictors_of

RIG = gap_cases.rig(trials=2, seconds=3.0)


def prepared(rig):
    return base_model.prepared(rig, predictors_of(rig.trials, rig))


def changed(change):
    return replace(RIG, trials=tuple(change(trial) for trial in RIG.trials))


def level(trial):
    return np.maximum(gap_cases.RADIUS - trial.position[:, 2], 0.0)


def driven(trial, kind, values):
    return replace(trial, stimulus=kind, position=None, quaternion=None, level=values)


def force(trial, sign):
    total = trial.reading.sum(axis=1)
    return np.column_stack([0 * total, 0 * total, sign * total])


def test_good_recordings_pass():
    assert prepared(RIG)
    assert prepared(changed(lambda trial: driven(trial, "depth", level(trial))))
    assert prepared(changed(lambda trial: replace(trial, reading=None, force=force(trial, -1.0))))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda trial: replace(trial, position=trial.position + [0.0, 0.0, 0.01]), "the indenter never touches"),
        (lambda trial: driven(trial, "depth", -level(trial)), "`depth` is never above zero"),
        (lambda trial: driven(trial, "force", -level(trial)), "`force` is never above zero"),
        (lambda trial: replace(trial, reading=-trial.reading), "readings of 'small' fall where the sensor is pressed"),
        (lambda trial: replace(trial, force=force(trial, 1.0)), "point the other way"),
        (lambda trial: replace(trial, reading=0.0 * trial.reading + 3.0), "ever changes"),
        (lambda trial: replace(trial, reading=0.0 * trial.reading + np.arange(24.0)), "ever changes"),
    ],
)
def test_bad_recordings_get_a_sentence(change, words):
    with pytest.raises(FileError, match=words):
        prepared(changed(change))


def test_readings_in_an_own_unit_may_fall():
    rig = changed(lambda trial: replace(trial, reading=-trial.reading))
    assert prepared(replace(rig, parameters=replace(rig.parameters, unit="V")))
