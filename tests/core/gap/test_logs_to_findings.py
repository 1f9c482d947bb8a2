# SPDX-License-Identifier: GPL-3.0-or-later
"""From logs as laboratories write them to what is missing: a threshold, a load that is never zero, one axis of motion."""

from __future__ import annotations

import numpy as np
import pytest
from log_rigs import new_rig, template, write_csv

from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.selection.diagnosis import diagnose
from palpate.core.jobs import run_job

GAINS = np.array([1.0, 1.05, 1.0, 0.95])


def found_in(folder, logs, **answers):
    """The diagnosis of a rig from logs, whose questions are answered."""
    return run_job(diagnose(read_rig(new_rig(folder / "rig", logs, template(folder, logs, **answers)).path)))


def value(found, parameter):
    """The value of a parameter of the effect that is most sure."""
    surest = max(found.findings, key=lambda one: one.confidence)
    return found.best.model.effects[surest.effect].values[parameter]


def sure_names(found):
    return {one.name for one in found.findings if one.confidence > 0.9}


@pytest.mark.long("a whole diagnosis")
def test_a_sensor_with_a_threshold_has_mismatched_gains_and_no_fault_of_its_logger(tmp_path):
    """A Weiss DSA's electronics cut off below a threshold; untouched it repeats zeros, which no logger is stuck for."""
    logs = []
    for run in range(4):
        rng, time = np.random.default_rng(run), np.arange(0.0, 8.0, 0.03)
        force = 2.0 * np.clip(np.sin((0.8 + 0.1 * run) * time), 0.0, None) ** 2
        counts = np.round(400.0 * force[:, None] * GAINS + rng.normal(0.0, 1.0, (len(time), 4)))
        counts[(counts < 8.0) | (force[:, None] < 1e-9)] = 0.0
        columns = {"time": time, "force (N)": force, **{f"texel_{i}": counts[:, i] for i in range(4)}}
        logs.append(write_csv(tmp_path / f"t{run}.csv", columns))
    found = found_in(tmp_path, logs)
    assert not found.faults and sure_names(found) == {"gain-mismatch"}
    factors = np.array(value(found, "factor"))
    np.testing.assert_allclose(factors / factors[0], GAINS, atol=3e-3)


@pytest.mark.long("a whole diagnosis")
def test_a_sensor_that_is_held_down_all_the_time_has_its_gain(tmp_path):
    """Readings of 400 counts per newton under 1 to 3 N: no beginning shows them without load."""
    logs = []
    for run in range(3):
        rng, time = np.random.default_rng(run), np.arange(0.0, 6.0, 0.02)
        load = 2.0 + np.sin((1.3 + 0.2 * run) * time + run)
        columns = {"time": time, "fz": load + rng.normal(0.0, 2e-3, len(time))}
        columns |= {f"taxel{i}": 400.0 * gain * load + rng.normal(0.0, 3.0, len(time)) for i, gain in enumerate(GAINS)}
        logs.append(write_csv(tmp_path / f"slide_{run}.csv", columns))
    found = found_in(tmp_path, logs)
    assert sure_names(found) == {"gain-mismatch"}
    per_texel = found.best.model.parameters.gain * np.array(value(found, "factor")) / 4.0
    np.testing.assert_allclose(per_texel, 400.0 * GAINS, rtol=5e-3)


@pytest.mark.long("a whole diagnosis")
def test_a_ball_on_one_axis_shows_a_lag_alone(tmp_path):
    """A ball of 15 mm on 14 × 6 texels, whose height alone was logged; readings lag by 0.12 s."""
    x, y = np.meshgrid((np.arange(6) - 2.5) * 4e-3, (np.arange(14) - 6.5) * 4e-3)
    radius, stiffness, step, logs = 0.015, 58.4, 0.02, []
    keeps = np.exp(-step / 0.12)
    for run in range(4):
        rng, time = np.random.default_rng(run), np.arange(0.0, 12.0, step)
        depth = np.zeros_like(time)
        for start, most, ramp in ((1.0, 1.2e-3, 0.4), (4.0, 2.0e-3, 0.8), (8.0, 1.6e-3, 0.25)):
            up = np.clip((time - start) / ramp, 0.0, 1.0) * (1.0 - np.clip((time - start - ramp - 1.5) / ramp, 0.0, 1.0))
            depth = np.maximum(depth, most * (1.0 + 0.1 * run) * up**2 * (3.0 - 2.0 * up))
        height = np.where(depth > 0.0, radius - depth, radius + 5e-4)
        root = np.sqrt(np.maximum(radius**2 - x.ravel() ** 2 - y.ravel() ** 2, 0.0))
        force = stiffness * np.maximum(root - height[:, None], 0.0) * root / radius
        for i in range(1, len(force)):
            force[i] = keeps * force[i - 1] + (1.0 - keeps) * force[i]
        columns = {"time_ms": 1e3 * time, "probe_z_mm": 1e3 * height}
        columns |= {f"S{i}": force[:, i] + rng.normal(0.0, 4e-4, len(time)) for i in range(84)}
        logs.append(write_csv(tmp_path / f"run{run}.csv", columns))
    answers = {"rows = 2, columns = 42": "rows = 14, columns = 6", "[0.005, 0.005]": "0.004", 'sphere = "?"': "sphere = 0.015"}
    found = found_in(tmp_path, logs, **answers)
    assert {one.name for one in found.findings} == sure_names(found) == {"lag"}
    assert value(found, "time") == pytest.approx(0.12, abs=2e-3)
