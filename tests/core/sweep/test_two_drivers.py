# SPDX-License-Identifier: GPL-3.0-or-later
"""Two commands at once in the folder of one study."""

import subprocess
import sys
import time

import pytest
from small_study import run_hashes, write_study

pytest.importorskip("distributed")


@pytest.mark.slow("starts the command twice, each with workers and processes for runs")
def test_the_second_command_says_that_there_is_another_and_disturbs_nothing(tmp_path):
    study, out = write_study(tmp_path, 60, hold=0.2), tmp_path / "out"
    words = [sys.executable, "-m", "palpate.commands", "sweep", str(study), "--out", str(out), "--workers", "2"]
    with subprocess.Popen(words, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as first:
        while first.poll() is None and not (out / "study.toml").exists():
            time.sleep(0.01)
        second = subprocess.run(words, capture_output=True, text=True, timeout=300, check=False)
        assert first.poll() is None, "the first command was over too early for this test"
        assert (second.returncode, second.stderr.count("\n")) == (1, 1)
        assert "Another sweep is writing to" in second.stderr
        assert first.communicate(timeout=300)[1] == "" and first.returncode == 0
    assert len(run_hashes(out)) == 60
