# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/rig-format.md names every key, and its rig for two specimens and two loggers finds what is known of its recordings."""

import re
from dataclasses import fields
from pathlib import Path

import gap_cases as cases
import numpy as np
import pytest

from palpate.core.gap.dataset.column_names import QUANTITIES
from palpate.core.gap.dataset.rig import RIG_SENSOR_WORDS, RigWords, read_rig
from palpate.core.gap.dataset.trial import FAULT_KINDS, TrialWords
from palpate.core.gap.selection.diagnosis import diagnose
from palpate.core.jobs import run_job

PAGE = Path(__file__).parents[3] / "docs" / "rig-format.md"
LATE, FACTORS = 40, (1.0, 1.0, 1.5, 1.5)
"""Samples by which the responses' logger was started later, and what the readings of each recording are multiplied by."""


def test_every_key_column_and_fault_is_on_the_page():
    """Parameters of the sensor are those of sensor.toml, of which the page names some."""
    rig_words = {one.name for one in fields(RigWords)} - {"sensor", "trial", "columns", "data", "indenter", "probe"}
    words = {*rig_words, *(one.name for one in fields(TrialWords)), *RIG_SENSOR_WORDS, *FAULT_KINDS}
    named = {
        word for code in re.findall(r"`([^`\n]+)`", PAGE.read_text(encoding="utf-8")) for word in re.split(r"[\s=]+", code)
    }
    assert words | (set(QUANTITIES) - {"texel"}) <= named
    assert {f"[[{one}]]" for one in ("trial", "probe")} | {
        f"[{one}]" for one in ("sensor", "columns", "data", "indenter")
    } <= named


def test_two_specimens_and_two_loggers(tmp_path):
    (text,) = [block for block in re.findall(r"```toml\n(.*?)```", PAGE.read_text(), re.S) if 'specimen = "B"' in block]
    (tmp_path / "rig.toml").write_text(text)
    for trial, factor in zip(cases.rig(trials=4, seconds=6.0, k=80.0).trials, FACTORS, strict=True):
        reading, position = factor * trial.reading[LATE:], trial.position[:-LATE]
        table = np.column_stack([1e3 * trial.time[:-LATE], position[:, :2], 1e3 * position[:, 2], reading])
        header = "t,x,y,height," + ",".join(f"texel_{i}" for i in range(reading.shape[1]))
        np.savetxt(tmp_path / f"{trial.name}.csv", table, "%.9g", ",", header=header, comments="")
    found = run_job(diagnose(read_rig(tmp_path / "rig.toml")))
    assert {(fault.kind, fault.put_right) for fault in found.faults} == {("clock-shift", True)}
    assert found.verdict == "no gap" and not found.findings
    assert found.best.model.parameters.k == pytest.approx(80.0, rel=0.02)
    assert found.best.model.recordings["factor of B"] == pytest.approx(1.5, rel=0.02)
