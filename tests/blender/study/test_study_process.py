# SPDX-License-Identifier: GPL-3.0-or-later
"""Run Study: the command runs beside Blender, its files tell how far it is, and stopping it loses nothing."""

import time

import bpy
import pytest
from blender_scenes import press, save

from palpate.addon.study import property_path, study_process, study_settings
from palpate.core.errors import PalpateError
from palpate.core.jobs import run_job
from palpate.core.study.study_file import counted_runs

LONGEST = 300
"""Seconds until a study counts as hanging; a busy machine may have to compile the solver first."""
RUNS = 30
FRAMES = 1500
"""Frames of a run: one takes as long as it takes until the process is asked how far it is."""


@pytest.fixture
def study(tmp_path):
    pytest.importorskip("distributed")
    scene, pad, _ = press(FRAMES)
    study_settings.vary(scene, property_path.path_of(pad.palpate, "k"))
    own = scene.palpate.study
    own.file, own.samples, own.workers = str(tmp_path / "s.toml"), RUNS, 1
    save(tmp_path)
    return study_settings.write_study(scene)


@pytest.mark.long("stops a study and computes it again")
def test_a_study_is_stopped_and_goes_on(study):
    job = study_process.run_study(study, 1)
    end = time.monotonic() + LONGEST
    for progress in job:
        if progress.done > 1 or time.monotonic() > end:
            break
    assert progress.text.startswith("Study: ")
    job.close()
    folder = study.with_suffix("")
    assert 1 < counted_runs(folder)[0] < RUNS
    with pytest.raises(PalpateError, match="no report"):
        study_process.report_of(study)
    assert run_job(study_process.run_study(study, 1)) == f"{RUNS} runs: {RUNS} done, 0 failed, 0 left"
    assert study_process.report_of(study).is_file()
    bpy.context.scene.palpate.study.samples = RUNS - 1
    with pytest.raises(PalpateError, match=f"samples was {RUNS} and is {RUNS - 1}"):
        bpy.ops.wm.save_mainfile()
        run_job(study_process.run_study(study_settings.write_study(bpy.context.scene), 1))


def test_a_missing_command_is_one_sentence(study, monkeypatch):
    monkeypatch.setattr(study_process, "command_in_preferences", lambda: "/nowhere/palpate")
    with pytest.raises(PalpateError, match="'/nowhere/palpate' is not a command"):
        run_job(study_process.run_study(study))
    monkeypatch.setattr(study_process, "command_in_preferences", lambda: "")
    monkeypatch.setattr(study_process.importlib.util, "find_spec", lambda _name: None)
    monkeypatch.setattr(study_process.shutil, "which", lambda _name: None)
    with pytest.raises(PalpateError, match="pip install"):
        study_process.sweep_command()
