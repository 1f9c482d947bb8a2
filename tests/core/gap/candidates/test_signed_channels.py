# SPDX-License-Identifier: GPL-3.0-or-later
"""Channels of magnetometers, some of which rise and others fall: which effects are looked for, and what is found."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.benchmarks._recordings import Recording
from palpate.core.gap.base.base_model import start_model
from palpate.core.gap.candidates.candidates import candidates
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.forward.predictor import predictors_of
from palpate.core.gap.selection.diagnosis import diagnose
from palpate.core.jobs import run_job

HEIGHTS = (3.0, 4.5, 6.0)
"""mm from a magnet to the magnetometers below it, at rest."""


def rig_of(folder, readings):
    """A rig with a known force of up to 20 N; `readings` gives the channels (T, n) from force and time."""
    time, trials = np.linspace(0.0, 60.0, 301), []
    for number, use in enumerate(("fit", "check")):
        force = 10.0 * (1.0 - np.cos(2.0 * np.pi * time / 11.0 + 0.3 * number * time / 60.0)) * (0.6 + 0.4 * np.cos(time / 9.0))
        channels = readings(force, time, np.random.default_rng(number))
        texels = {f"texel_{i}": one for i, one in enumerate(channels.T)}
        trials.append((use, use, {"time": time, "force": len(texels) * force, **texels}))  # all channels share the force
    sensor = f'grid = {{ rows = 1, columns = {len(texels)}, pitch = 0.01 }}\nunit = "uT"'
    return read_rig(Recording("skin", sensor, trials).write(folder))


def field(force, time, random):
    """Three magnetometers under a dipole that sinks and tilts with the force; no polynomial."""
    sinks = 1.5 * force / (force + 15.0)  # mm
    found = []
    for height, side in zip(HEIGHTS, (-1.0, 0.5, 2.0), strict=True):
        z, r = height - sinks, np.hypot(height - sinks, side)
        found += [3.0 * z * side / r**5, 0.3 * z**2 / r**5, (3.0 * z**2 - r**2) / r**5]
    channels = 1e4 * np.stack(found, axis=1)
    return channels - channels[0] + 0.3 * random.normal(size=channels.shape)


def names_tried(rig):
    predictors = predictors_of(rig.trials, rig)
    return {one.name for one in candidates(predictors, start_model(rig, predictors))}


def test_curves_with_a_sign_are_looked_for_where_channels_have_signs(tmp_path):
    assert {"channel-curve", "ambient-field"} <= names_tried(rig_of(tmp_path, field))


def test_an_ambient_field_needs_channels_in_threes(tmp_path):
    tried = names_tried(rig_of(tmp_path, lambda *given: field(*given)[:, :8]))
    assert "channel-curve" in tried and "ambient-field" not in tried


def test_texels_that_all_rise_have_no_curves_with_a_sign(tmp_path):
    tried = names_tried(rig_of(tmp_path, lambda *given: np.abs(field(*given))))
    assert not {"channel-curve", "ambient-field"} & tried and "gain-mismatch" in tried


@pytest.mark.slow("a whole diagnosis of nine channels")
def test_the_curve_of_each_channel_is_found(tmp_path):
    """The hidden dipoles are no polynomials; what is left must be within twice the noise on a recording that was not fitted."""
    result = run_job(diagnose(rig_of(tmp_path, field)))
    assert [one.name for one in result.findings] == ["channel-curve"]
    (check,) = result.of("check")
    left = check.predict(result.best.model).reading - check.trial.reading
    assert np.sqrt(np.mean(left**2)) < 2.0 * 0.3
