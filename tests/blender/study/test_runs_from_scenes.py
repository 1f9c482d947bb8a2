# SPDX-License-Identifier: GPL-3.0-or-later
"""Studies whose runs read the scene again: each run is what the scene gives when the property is set by hand."""

import json

import bpy
import numpy as np
import pytest
from blender_scenes import press, save, scenario_of
from processes import palpate

from palpate.core.errors import PalpateError
from palpate.core.io.recording_npz import load_recording
from palpate.core.solver.simulation import run
from palpate.core.study.variation import varied_scenario
from palpate.sweep.study_folder import open_study, resume_study
from palpate.sweep.worker import compute_batch

SCALE = 'bpy.data.objects["Ball"].scale[2]'
STUDY = f"""format = "palpate-sweep/1"
recordings = true
scene = "scene.blend"
design = "grid"
[vary]
'{SCALE}' = {{ choice = [1.0, 1.2] }}
"Pad.k" = {{ choice = [50.0, 80.0] }}
"""


def begun(folder, text=STUDY):
    press()
    save(folder)
    study = folder / "study.toml"
    study.write_text(text, encoding="utf-8")
    return open_study(study, folder / "out")


def computed(opened):
    return compute_batch(range(len(opened.runs)), str(opened.folder))


@pytest.mark.slow("a study that reads its runs from a scene, in processes of its own")
def test_a_run_is_what_the_scene_gives_with_these_values(tmp_path):
    opened = begun(tmp_path)
    assert computed(opened).done == 4
    for one in opened.runs:
        bpy.data.objects["Ball"].scale[2] = one.values[SCALE]
        scenario = scenario_of(bpy.context.scene)
        expected = run(varied_scenario(scenario, {"Pad.k": one.values["Pad.k"]})).sensors["Pad"]
        found = load_recording(opened.folder / "runs" / one.digest / "Pad" / "recording.npz").sensors["Pad"]
        np.testing.assert_array_equal(found.normal_force, expected.normal_force)
        assert expected.normal_force.max() > 0.0
    (tmp_path / "scene.blend").unlink()
    assert [one.digest for one in resume_study(opened.folder).runs] == [one.digest for one in opened.runs]
    assert not [path for path in (opened.folder / "scenes").iterdir() if path.name.startswith(".")]


@pytest.mark.long("a study that reads its runs from a scene, in processes of its own")
def test_a_run_that_the_scene_cannot_make_fails_alone(tmp_path):
    opened = begun(tmp_path, STUDY.replace("[1.0, 1.2]", "[0.0, 1.0]").replace("[50.0, 80.0]", "[50.0]"))
    found = computed(opened)
    ((index, sentence),) = found.failures
    assert (found.done, index) == (1, 0)
    assert "'Ball'" in sentence and "\n" not in sentence


@pytest.mark.slow("opens a scene in processes of their own")
def test_mistakes_are_found_before_anything_is_computed(tmp_path):
    with pytest.raises(PalpateError, match=r"did you mean 'scale'\?"):
        begun(tmp_path, STUDY.replace("scale[2]", "scal[2]"))
    assert not (tmp_path / "out" / "study.toml").exists()
    with pytest.raises(PalpateError, match="has keyframes"):
        begun(tmp_path, STUDY.replace("scale[2]", "location[2]"))


@pytest.mark.long("studies that read their runs from a scene, in processes of their own")
def test_the_dry_run_says_why_blender_is_needed_and_a_changed_scene_is_refused(tmp_path):
    pytest.importorskip("distributed")
    begun(tmp_path)
    words = ["sweep", tmp_path / "study.toml", "--out", tmp_path / "out"]
    said = palpate(*words, "--dry-run")
    assert (said.returncode, said.stderr) == (0, "")
    assert f"each run reads the scene in a Blender of its own, because it sets {SCALE}" in said.stdout
    bpy.data.objects["Ball"].scale[0] = 1.5
    save(tmp_path)
    refused = palpate(*words)
    assert refused.returncode == 1
    assert "scene.blend' has changed since the study" in refused.stderr


def test_a_bake_takes_the_same_values_from_a_file(tmp_path):
    press()
    save(tmp_path)
    (tmp_path / "o.toml").write_text(f"format = \"palpate-overrides/1\"\n[overrides]\n'{SCALE}' = 1.2\n", encoding="utf-8")
    words = ["--overrides", tmp_path / "o.toml", "--no-images", "--out", tmp_path / "bake"]
    done = palpate("bake", tmp_path / "scene.blend", *words)
    assert done.returncode == 0, done.stderr
    bpy.data.objects["Ball"].scale[2] = 1.2
    expected = run(scenario_of(bpy.context.scene))
    found = load_recording(tmp_path / "bake" / "Pad" / "recording.npz")
    np.testing.assert_array_equal(found.sensors["Pad"].normal_force, expected.sensors["Pad"].normal_force)
    assert json.loads((tmp_path / "bake" / "Pad" / "manifest.json").read_text())["digest"] == expected.digest
