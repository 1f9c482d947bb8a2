# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate sweep`` from the command line: what comes out, and mistakes that are one sentence."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command_runs import LONGEST, assert_succeeds, run_command
from sample_bake import read_exr
from small_study import begun, rows_of, write_study
from study_scenes import HEAD, tiny_scene

from palpate.commands import main
from palpate.core.errors import PalpateError
from palpate.core.io.bake_folder import IMAGE_LIST_NAME, check_sha256, frame_file, read_checksums, read_manifest
from palpate.core.io.bake_reader import read_bake
from palpate.core.io.recording_npz import load_recording
from palpate.core.io.scenario_npz import save_scenario
from palpate.core.study.study_file import part_files
from palpate.core.version import VERSION
from palpate.sweep import driver
from palpate.sweep.driver import dask_client
from palpate.sweep.parts import Parts, RunResult, write_part
from palpate.sweep.studies import FIXED_SECONDS, Estimate, locked_folder, try_study
from palpate.sweep.study_folder import open_study, resume_study
from palpate.sweep.worker import compute_batch

pytest.importorskip("distributed")
parquet = pytest.importorskip("pyarrow.parquet")

STUDY = (
    HEAD
    + """design = "latin-hypercube"
samples = 24
fps = 200
name = "small presses"
[vary]
"Pad.k" = { log-uniform = [20, 200] }
[press]
depth = { uniform = [0.5e-3, 2e-3] }
slide = { uniform = [0, 1e-3] }
"""
)


def write(folder: Path, text: str = STUDY) -> Path:
    save_scenario(folder / "tiny.npz", tiny_scene())
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return folder / "study.toml"


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """The output folder of the study, computed in one go."""
    folder = tmp_path_factory.mktemp("undisturbed")
    said = assert_succeeds("sweep", write(folder), "--out", folder / "out", "--workers", 2)
    assert "24 runs: 24 done, 0 failed, 0 left" in said
    return folder / "out"


@pytest.mark.slow("computes the study that the tests of this file share")
def test_a_run_holds_what_it_promises(undisturbed, tmp_path):
    """With recordings it has a folder as a bake has, and the same numbers as without."""
    opened = begun(write(tmp_path, STUDY.replace("fps = 200", "fps = 200\nrecordings = true")))
    compute_batch([5], str(opened.folder))
    (row,) = rows_of(opened.folder)
    place = opened.folder / "runs" / row["digest"]
    recording = load_recording(place / "Pad" / "recording.npz")
    assert row["metric.max_normal_force"] == recording.sensors["Pad"].normal_force.sum(axis=1).max() > 0
    assert row["metric.max_depth"] <= row["varied.press.depth"]
    baked = read_bake(place)  # a run is read like a bake
    assert baked.parameters["Pad"].k == row["varied.Pad.k"] and baked.manifests["Pad"].unit == "N"
    expected = rows_of(undisturbed)[5]
    assert {name: value for name, value in row.items() if name != "digest"} == {
        name: value for name, value in expected.items() if name != "digest"
    }


@pytest.mark.long("computes a study twice")
def test_failed_runs_are_left_alone_until_they_are_asked_for(undisturbed, tmp_path):
    folder = tmp_path / "study"
    opened = open_study(write(tmp_path), folder)
    write_part(folder, [RunResult(opened.runs[index], "The lamp went out.") for index in (0, 20)])
    said = assert_succeeds("sweep", folder, "--workers", 1)
    assert "24 runs: 22 done, 2 failed, 0 left" in said and "--retry-failed computes them again" in said
    table = parquet.read_table(folder / "runs.parquet").to_pylist()
    expected = parquet.read_table(undisturbed / "runs.parquet").to_pylist()
    for row in (table[0], table[20]):
        assert (row["status"], row["message"]) == ("failed", "The lamp went out.")
        assert all(row[name] == expected[row["run"]][name] for name in row if name.startswith("varied.") or name == "digest")
    said = assert_succeeds("sweep", folder, "--workers", 1, "--retry-failed")
    assert "24 runs: 24 done, 0 failed, 0 left" in said
    assert rows_of(folder) == rows_of(undisturbed)
    assert (folder / "runs.parquet").read_bytes() == (undisturbed / "runs.parquet").read_bytes()


def test_another_study_in_the_same_folder_is_refused(undisturbed, tmp_path, capsys):
    study = write(tmp_path, STUDY.replace("24", "25").replace("2e-3", "3e-3"))
    assert main(["sweep", str(study), "--out", str(undisturbed)]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "samples was 24 and is 25" in line
    assert "press.depth was" in line
    assert main(["sweep", str(undisturbed), "--status"]) == 0
    assert capsys.readouterr().out == "24 runs: 24 done, 0 failed, 0 left\n"


def test_a_folder_that_another_command_writes_to_is_refused(tmp_path, capsys):
    study, out = write(tmp_path), tmp_path / "out"
    with locked_folder(study, out):
        assert main(["sweep", str(study), "--out", str(out)]) == 1
    assert "Another sweep is writing to" in capsys.readouterr().err


def test_a_folder_of_an_earlier_version_is_one_sentence(undisturbed, tmp_path):
    shutil.copytree(undisturbed, tmp_path / "out")
    frozen = tmp_path / "out" / "study.toml"
    frozen.write_text(frozen.read_text().replace(f'version = "{VERSION}"', 'version = "0.0.1"'))
    with pytest.raises(PalpateError, match="was begun with Palpate 0.0.1.*give another folder with --out"):
        resume_study(tmp_path / "out")


def test_mistakes_are_one_line_and_begin_nothing(tmp_path, capsys):
    assert main(["sweep", str(write(tmp_path, STUDY.replace("Pad.k", "Pad.kk")))]) == 1
    assert capsys.readouterr().err == "palpate sweep: There is no 'Pad.kk' to vary in 'tiny': did you mean 'Pad.k'?\n"
    assert not (tmp_path / "study").exists()


def test_names_are_listed_for_a_study_with_a_wrong_one_and_for_a_scene(tmp_path, capsys):
    study = write(tmp_path, STUDY.replace("Pad.k", "Pad.kk"))
    for place in (study, tmp_path / "tiny.npz"):
        assert main(["sweep", str(place), "--list"]) == 0
        assert capsys.readouterr().out.startswith("tiny:\n  Pad.k N/m: a value above zero\n")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["study.toml", "tiny.npz"]


@pytest.mark.long("a dry run and a study from the command line")
def test_a_study_may_change_after_a_dry_run_and_a_folder_named_as_the_package_does_no_harm(tmp_path):
    """A bake leaves a folder `palpate` beside its .blend, and Python looks in its working folder first."""
    (tmp_path / "palpate").mkdir()
    (tmp_path / "palpate" / "__init__.py").write_text("raise ImportError('this is a bake')\n", encoding="utf-8")
    study = write(tmp_path)
    script = "from palpate.commands import run_process; run_process()"
    words = [sys.executable, "-P", "-c", script, "sweep", study.name]
    options = {"cwd": tmp_path, "capture_output": True, "text": True, "timeout": LONGEST, "check": False}
    tried = subprocess.run([*words, "--dry-run"], **options)
    assert (tried.returncode, tried.stderr) == (0, "")
    assert "24 runs, " in tried.stdout
    assert not (tmp_path / "study").exists()
    write(tmp_path, STUDY.replace("samples = 24", "samples = 2"))
    done = subprocess.run([*words, "--workers", "1"], **options)
    assert (done.returncode, done.stderr) == (0, "")
    assert "2 runs: 2 done, 0 failed, 0 left" in done.stdout


def test_the_time_of_a_study_counts_start_and_report():
    found = Estimate(seconds=0.5, closing=0.01, size=1.0, failures=[], tried=5)
    assert found.seconds_of(1, 8) == pytest.approx(FIXED_SECONDS + 0.51)  # seven of the workers have nothing to do
    assert found.seconds_of(101, 2) == pytest.approx(FIXED_SECONDS + 25.25 + 1.01)


@pytest.mark.slow("computes some runs and a report")
def test_a_trial_counts_what_fails(tmp_path):
    study = write_study(tmp_path, 30, fails=True)
    _, found = try_study(study)
    assert found.tried in (5, 30) and 0 < len(found.failures) < found.tried
    assert found.size > 0.0 and found.seconds > 0.0
    opened = begun(study)
    assert try_study(opened.folder)[1].failures == found.failures
    assert not part_files(opened.folder)


def test_workers_that_do_not_start_are_one_sentence(monkeypatch):
    """Dask says so by a RuntimeError, whatever ended them: a kill, or a limit of memory."""

    def end_at_once(**_words):
        raise RuntimeError("Nanny failed to start.")

    monkeypatch.setattr("distributed.LocalCluster", end_at_once)
    said = "The 2 worker processes did not start .Nanny failed to start.*same command again"
    with pytest.raises(PalpateError, match=said), dask_client(2):
        pass


def test_other_limits_hold_for_the_same_study(undisturbed, tmp_path):
    """No result depends on them, and the message of a run that was too slow or too large advises to raise one."""
    folder = tmp_path / "out"
    shutil.copytree(undisturbed, folder)
    file = write(tmp_path, STUDY.replace("fps = 200", "fps = 200\nrun_limit = 77\nrun_memory = 999"))
    study = open_study(file, folder).study
    assert (study.run_limit, study.run_memory) == (77.0, 999.0)


@pytest.mark.long("computes a study in five commands")
def test_parts_make_the_whole(undisturbed, tmp_path):
    """As on a farm: the study is begun, its parts are computed by themselves, and a last command exports the dataset."""
    h5py = pytest.importorskip("h5py")
    study, out = write(tmp_path), tmp_path / "out"
    refused = run_command("sweep", study, "--out", out, "--part", "1/2")
    assert (refused.returncode, refused.stderr.count("\n")) == (1, 1)
    assert "--begin" in refused.stderr
    assert_succeeds("sweep", study, "--out", out, "--begin")
    for part, count in (("2/2", 12), ("1/2", 24)):
        assert_succeeds("sweep", out, "--part", part, "--workers", 1)
        assert len(Parts(out).done) == count
    assert not (out / "dataset").exists()
    said = assert_succeeds("sweep", out, "--format", "hdf5")
    assert rows_of(out) == rows_of(undisturbed)
    assert f"export: {out / 'dataset.h5'}" in said.splitlines()
    with h5py.File(out / "dataset.h5") as file:
        assert len(file["episodes/run"]) == 24


@pytest.mark.slow("bakes the images of a run")
def test_runs_have_images_where_the_study_asks_for_them(tmp_path):
    opened = begun(write(tmp_path, STUDY.replace("fps = 200", "fps = 200\nimages = true")))
    assert compute_batch([0], str(opened.folder)).done == 1
    folder = opened.folder / "runs" / opened.runs[0].digest / "Pad"
    assert read_manifest(folder).has_images
    for name, sha256 in read_checksums(folder / IMAGE_LIST_NAME):
        check_sha256(folder / name, sha256)
    recording = load_recording(folder / "recording.npz")
    frame = int(recording.frames[len(recording.frames) // 2])
    channels, _ = read_exr(folder / frame_file(frame))
    total = recording.at(frame).sensors["Pad"].normal_force.sum()
    assert channels["R"].sum() == pytest.approx(total, rel=1e-6) and total > 0.0  # images have 32 bits
    assert len(list(folder.glob("*.exr"))) == len(recording.frames)


@pytest.mark.parametrize(
    ("total", "seconds", "size"), [(1_000_000, 5.0, 200), (1000, 5.0, 1), (100_000, 0.005, 1000), (40, 1e-3, 5)]
)
def test_a_million_runs_make_some_thousand_parts(total, seconds, size):
    """Neither does a batch of a short study keep the other workers waiting, nor does one of long runs lose hours."""
    batches = driver.batches_of(np.arange(total), total, seconds, 2)
    assert len(batches[0]) == size and len(batches) <= max(driver.MOST_PARTS, 1000)
    assert [index for batch in batches for index in batch] == list(range(total))
