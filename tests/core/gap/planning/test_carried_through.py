# SPDX-License-Identifier: GPL-3.0-or-later
"""The next experiment from end to end: what recordings leave ambiguous, a recording along the written trajectory resolves."""

import json

import numpy as np
import pytest
import relaxing_pad as pad

from palpate.commands import main


def said(rig, out):
    assert main(["gap", str(rig), "--out", str(out)]) == 0
    return json.loads((out / "gap.json").read_text())


@pytest.mark.long("palpate gap twice, from a rig to its report")
def test_the_trajectory_that_is_written_resolves_what_was_ambiguous(tmp_path):
    rng = np.random.default_rng(5)
    rig = pad.write(tmp_path, rng)
    before = said(rig, tmp_path / "before")
    assert any("creep" in group for group in before["ambiguous"])
    assert before["planned_experiment"]["separation_after"] > before["planned_experiment"]["separation_before"]
    pad.add_planned(rig, tmp_path / "before" / "next_experiment.csv", rng)
    after = said(rig, tmp_path / "after")
    assert not after["ambiguous"] and after["verdict"] == "explained"
    assert [one["effect"] for one in after["found"] if one["confidence"] >= 0.5] == ["creep"]
