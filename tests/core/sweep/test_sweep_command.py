# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate sweep`` from the command line: what is done stays done, whatever is killed, and mistakes are one sentence."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from small_study import run_hashes
from study_scenes import HEAD, tiny_scene

from palpate.core.errors import PalpateError
from palpate.core.io.bake_folder import IMAGE_LIST_NAME, check_sha256, frame_file, read_checksums, read_manifest
from palpate.core.io.bake_reader import read_bake
from palpate.core.io.recording_npz import load_recording
from palpate.core.io.scenario_npz import save_scenario
from palpate.core.io.tactile_exr import read_exr
from palpate.core.study.run_files import SCENES, done_runs, make_folders, run_batch, write_failure
from palpate.core.study.run_shards import RUN, ShardScan
from palpate.sweep.driver import dask_client
from palpate.sweep.finished_runs import StoredRuns
from palpate.sweep.study_folder import begin_study
from palpate.sweep.worker import Child, Limits, compute_batch, end_children

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
LONGEST = 300
"""Seconds until a command counts as hanging; a busy machine may have to compile the solver first."""


def command(*words, **options):
    return [sys.executable, "-m", "palpate.commands", "sweep", *map(str, words)]


def sweep(*words):
    return subprocess.run(command(*words), capture_output=True, text=True, timeout=LONGEST, check=False)


def names(table: np.ndarray) -> list[str]:
    """The digests of the runs in a group of a shard."""
    return [row["name"].tobytes().hex() for row in table if row["kind"] == RUN]


def write_study(folder: Path, text: str = STUDY) -> Path:
    save_scenario(folder / "tiny.npz", tiny_scene())
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return folder / "study.toml"


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """The output folder of the study, computed in one go."""
    folder = tmp_path_factory.mktemp("undisturbed")
    finished = sweep(write_study(folder), "--out", folder / "out", "--workers", 2)
    assert (finished.returncode, finished.stderr) == (0, "")
    assert "24 runs: 24 done, 0 failed, 0 left" in finished.stdout
    return folder / "out"


@pytest.mark.slow("computes the study that the tests of this file share")
def test_a_run_holds_what_it_promises(undisturbed, tmp_path):
    """With recordings it has a folder as a bake has, and the same numbers as without."""
    study = write_study(tmp_path, STUDY.replace("fps = 200", "fps = 200\nrecordings = true"))
    opened = begin_study(study, tmp_path / "out", lambda blend, target: None)
    (one,) = [run for run in opened.runs if run.index == 5]
    words = {"index": one.index, "scene": one.scene, "values": dict(one.values), "digest": one.digest}
    try:
        assert compute_batch(str(opened.folder), [words])[0]["status"] == "done"
    finally:
        end_children()
    place = opened.folder / "runs" / one.digest
    run = json.loads((place / "run.json").read_bytes())
    recording = load_recording(place / "Pad" / "recording.npz")
    assert run["digest"] == place.name
    assert run["frames"] == len(recording.frames)
    assert run["metrics"]["max_normal_force"] == recording.sensors["Pad"].normal_force.sum(axis=1).max() > 0
    assert run["metrics"]["max_depth"] <= run["values"]["press.depth"]
    baked = read_bake(place)  # a run is read like a bake
    assert baked.parameters["Pad"].k == run["values"]["Pad.k"]
    assert baked.manifests["Pad"].unit == baked.parameters["Pad"].unit == "N"
    runs = StoredRuns(undisturbed)
    assert asdict(runs.record(one.digest))["metrics"] == run["metrics"]
    own, kept = StoredRuns(opened.folder).run(one.digest)[1], runs.run(one.digest)[1]
    assert [bytes(column.content) for column in own.columns] == [bytes(column.content) for column in kept.columns]


def test_the_dataset_of_a_study_knows_units_and_slip(undisturbed):
    info = json.loads((undisturbed / "dataset" / "meta" / "info.json").read_bytes())
    assert info["features"]["observation.reading.Pad"]["palpate"]["unit"] == "N"
    table = parquet.read_table(undisturbed / "dataset" / "data").to_pylist()
    slips = [row["episode_index"] for row in table if np.any(row["contact.slip.Pad"])]
    found = parquet.read_table(undisturbed / "runs.parquet").to_pylist()
    assert sorted(set(slips)) == [row["run"] for row in found if row["metric.first_slip"] is not None] != []
    assert parquet.read_table(undisturbed / "dataset" / "meta" / "tasks.parquet").to_pydict()["task"] == ["small presses"]


@pytest.mark.slow("the one export of a study from the command line")
def test_a_finished_study_is_exported(undisturbed):
    h5py = pytest.importorskip("h5py")
    finished = sweep(undisturbed, "--format", "hdf5")
    assert (finished.returncode, finished.stderr) == (0, "")
    assert f"export: {undisturbed / 'dataset.h5'}" in finished.stdout.splitlines()
    with h5py.File(undisturbed / "dataset.h5") as file:
        assert len(file["episodes/run"]) == 24


@pytest.mark.long("computes a study twice")
def test_failed_runs_are_left_alone_until_they_are_asked_for(undisturbed, tmp_path):
    study, folder = write_study(tmp_path), tmp_path / "study"
    lost = [run.digest for run in begin_study(study, folder, lambda blend, target: None).runs[::20]]
    for digest in lost:
        write_failure(folder, digest, "The lamp went out.")
    finished = sweep(folder, "--workers", 1)
    assert (finished.returncode, finished.stderr) == (0, "")
    assert "24 runs: 22 done, 2 failed, 0 left" in finished.stdout and "--retry-failed computes them again" in finished.stdout
    table = parquet.read_table(folder / "runs.parquet").to_pylist()
    expected = {row["run"]: row for row in parquet.read_table(undisturbed / "runs.parquet").to_pylist()}
    failed = [row for row in table if row["status"] == "failed"]
    assert {row["digest"] for row in failed} == set(lost) and {row["message"] for row in failed} == {"The lamp went out."}
    for row in failed:  # a failure's file has only its digest; the table says which run it was
        assert all(row[name] == expected[row["run"]][name] for name in row if name.startswith("varied.") or name == "digest")
    again = sweep(folder, "--workers", 1, "--retry-failed")
    assert "24 runs: 24 done, 0 failed, 0 left" in again.stdout
    assert run_hashes(folder) == run_hashes(undisturbed)
    assert (folder / "runs.parquet").read_bytes() == (undisturbed / "runs.parquet").read_bytes()


@pytest.mark.long("kills a study and computes it again")
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_a_stopped_study_goes_on_where_it_was(undisturbed, tmp_path, number):
    study = write_study(tmp_path)
    process = subprocess.Popen(command(study, "--workers", 2), stderr=subprocess.PIPE, text=True, start_new_session=True)
    folder, began = tmp_path / "study", time.monotonic()
    while len(done_runs(folder)) < 3 and process.poll() is None and time.monotonic() < began + LONGEST:
        time.sleep(0.02)
    os.killpg(process.pid, number) if number == signal.SIGINT else process.kill()  # a terminal's Ctrl-C reaches the group
    stderr = process.communicate(timeout=LONGEST)[1]
    assert process.returncode == (130 if number == signal.SIGINT else -9), stderr
    if number == signal.SIGINT:
        assert stderr.splitlines()[-1] == "palpate sweep: stopped; the same command continues.", stderr
        assert "Traceback" not in stderr
    earlier = done_runs(folder)
    before = {path: path.read_bytes() for path in (folder / "runs").glob("*.shard")}
    finished = sweep(folder, "--workers", 2)
    assert (finished.returncode, finished.stderr) == (0, "")
    assert run_hashes(folder) == run_hashes(undisturbed)
    assert earlier and all(path.read_bytes().startswith(content) for path, content in before.items())
    found = [digest for _, _, table in ShardScan(folder / "runs").new_groups() for digest in names(table)]
    assert all(found.count(digest) == 1 for digest in earlier), "it was computed again"
    assert not list((folder / "runs").glob(".*"))


@pytest.mark.slow("starts the command twice")
def test_another_study_in_the_same_folder_is_refused(undisturbed, tmp_path):
    study = write_study(tmp_path, STUDY.replace("24", "25").replace("2e-3", "3e-3"))
    refused = sweep(study, "--out", undisturbed)
    assert refused.returncode == 1
    (line,) = refused.stderr.splitlines()
    assert "samples was 24 and is 25" in line
    assert "press.depth was" in line
    assert sweep(undisturbed, "--status").stdout == "24 runs: 24 done, 0 failed, 0 left\n"


def test_a_misspelt_name_is_one_line_and_begins_nothing(tmp_path):
    refused = sweep(write_study(tmp_path, STUDY.replace("Pad.k", "Pad.kk")))
    assert refused.returncode == 1
    assert refused.stderr == "palpate sweep: There is no 'Pad.kk' to vary in 'tiny': did you mean 'Pad.k'?\n"
    assert not (tmp_path / "study").exists()


def test_names_are_listed_for_a_study_with_a_wrong_one_and_for_a_scene(tmp_path):
    study = write_study(tmp_path, STUDY.replace("Pad.k", "Pad.kk"))
    for place in (study, tmp_path / "tiny.npz"):
        listed = sweep(place, "--list")
        assert (listed.returncode, listed.stderr) == (0, "")
        assert listed.stdout.startswith("tiny:\n  Pad.k N/m: a value above zero\n")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["study.toml", "tiny.npz"]


@pytest.mark.long("a dry run and a study from the command line")
def test_a_study_may_change_after_a_dry_run_and_a_folder_named_as_the_package_does_no_harm(tmp_path):
    """A bake leaves a folder `palpate` beside its .blend, and Python looks in its working folder first."""
    (tmp_path / "palpate").mkdir()
    (tmp_path / "palpate" / "__init__.py").write_text("raise ImportError('this is a bake')\n", encoding="utf-8")
    study = write_study(tmp_path)
    script = "from palpate.commands import run_process; run_process()"
    words = [sys.executable, "-P", "-c", script, "sweep", study.name]
    options = {"cwd": tmp_path, "capture_output": True, "text": True, "timeout": LONGEST, "check": False}
    tried = subprocess.run([*words, "--dry-run"], **options)
    assert (tried.returncode, tried.stderr) == (0, "")
    assert "24 runs, " in tried.stdout
    assert not (tmp_path / "study").exists()
    write_study(tmp_path, STUDY.replace("samples = 24", "samples = 2"))
    done = subprocess.run([*words, "--workers", "1"], **options)
    assert (done.returncode, done.stderr) == (0, "")
    assert "2 runs: 2 done, 0 failed, 0 left" in done.stdout


def test_a_study_of_a_billion_runs_is_one_line_and_begins_nothing(tmp_path):
    refused = sweep(write_study(tmp_path, STUDY.replace("samples = 24", "samples = 1000000000")), "--out", tmp_path / "out")
    assert refused.returncode == 1
    (line,) = refused.stderr.splitlines()
    assert "asks for 1e+09 runs, at most 1000000 are possible" in line
    assert not (tmp_path / "out").exists()


def test_workers_that_do_not_start_are_one_sentence(monkeypatch):
    """Dask says so by a RuntimeError, whatever ended them: a kill, or a limit of memory."""

    def end_at_once(**_words):
        raise RuntimeError("Nanny failed to start.")

    monkeypatch.setattr("distributed.LocalCluster", end_at_once)
    said = "The 2 worker processes did not start .Nanny failed to start.*same command again"
    with pytest.raises(PalpateError, match=said), dask_client(None, 2):
        pass


def test_other_limits_hold_for_the_same_study(undisturbed, tmp_path):
    """No result depends on them, and the message of a run that was too slow or too large advises to raise one."""
    folder = tmp_path / "out"
    shutil.copytree(undisturbed, folder)
    file = write_study(tmp_path, STUDY.replace("fps = 200", "fps = 200\nrun_limit = 77\nrun_memory = 999"))
    study = begin_study(file, folder, lambda blend, target: None).study
    assert (study.run_limit, study.run_memory) == (77.0, 999.0)


@pytest.fixture
def by_hand(tmp_path):
    """A folder of a study with three runs, the second of which cannot be computed."""
    text = STUDY.replace('design = "latin-hypercube"\nsamples = 24', 'design = "random"\nsamples = 3')
    make_folders(tmp_path)
    write_study(tmp_path, text)
    save_scenario(tmp_path / SCENES / "tiny.npz", tiny_scene())
    yield tmp_path
    end_children()


def words_of(index: int, **values) -> dict:
    return {"index": index, "scene": "tiny", "values": values, "digest": f"{index:024x}"}


def test_a_run_that_fails_leaves_the_others_alone(by_hand):
    runs = [words_of(0), words_of(1, **{"Pad.mus": 0.0}), words_of(2)]
    assert [answer["status"] for answer in compute_batch(str(by_hand), runs)] == ["done", "failed", "done"]
    assert done_runs(by_hand) == {runs[0]["digest"], runs[2]["digest"]}
    said = (by_hand / "failed" / f"{runs[1]['digest']}.txt").read_text(encoding="utf-8")
    assert said.startswith("mud of sensor 'Pad' (0.23) is larger than mus (0)")
    assert said.count("\n") == 1


@pytest.mark.slow("computes until its limit of five seconds")
def test_a_run_that_never_ends_is_ended(by_hand):
    slow = words_of(1, **{"press.speed": 1e-9})  # frames for weeks
    answers = compute_batch(str(by_hand), [slow, words_of(2)], Limits(5.0))
    assert [answer["status"] for answer in answers] == ["failed", "done"]
    assert "ended after its limit of 5 s" in answers[0]["sentence"]


@pytest.mark.long("fills memory until its limit")
def test_a_run_that_eats_memory_is_ended(by_hand):
    """It gets a second, fresh process, since the first one has computed another run before; the worker goes on."""
    hungry = words_of(1, **{"press.speed": 1e-9})  # its frames fill some 40 MB a second
    child = Child(str(by_hand))
    try:
        with run_batch(by_hand) as batch:
            child.compute(words_of(0), batch.place)
        limit = round(child.memory() / 1e6) + 60
    finally:
        child.kill()
    answers = compute_batch(str(by_hand), [words_of(3), hungry, words_of(2)], Limits(LONGEST, limit))
    assert [answer["status"] for answer in answers] == ["done", "failed", "done"]
    said = (by_hand / "failed" / f"{hungry['digest']}.txt").read_text(encoding="utf-8")
    assert said == (
        f"Run 1 was ended because it held more than its limit of {limit} MB: raise run_memory, or vary less widely.\n"
    )


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="how Linux chooses what it ends")
def test_the_system_ends_a_run_before_its_worker(by_hand):
    child = Child(str(by_hand))
    try:
        own, worker = (int(Path(f"/proc/{name}/oom_score_adj").read_text()) for name in (child.process_id, "self"))
    finally:
        child.kill()
    assert own > worker


def test_a_run_that_is_done_is_not_computed_again(by_hand):
    write_failure(by_hand, words_of(0)["digest"], "An earlier failure.")
    compute_batch(str(by_hand), [words_of(0)])
    assert not list((by_hand / "failed").iterdir())
    before = {path: path.read_bytes() for path in (by_hand / "runs").iterdir()}
    assert compute_batch(str(by_hand), [words_of(0)])[0]["status"] == "done"
    assert {path: path.read_bytes() for path in (by_hand / "runs").iterdir()} == before


@pytest.mark.long("computes a study in five commands")
def test_parts_make_the_whole(undisturbed, tmp_path):
    """As on a farm: the study is begun, its parts are computed by themselves, and a last command makes the dataset."""
    study, out = write_study(tmp_path), tmp_path / "out"
    refused = sweep(study, "--out", out, "--part", "1/2")
    assert (refused.returncode, refused.stderr.count("\n")) == (1, 1)
    assert "--begin" in refused.stderr
    begun = sweep(study, "--out", out, "--begin")
    assert (begun.returncode, begun.stderr) == (0, "")
    assert not done_runs(out)
    for part, count in (("2/2", 12), ("1/2", 24)):
        finished = sweep(out, "--part", part, "--workers", 1)
        assert (finished.returncode, finished.stderr) == (0, "")
        assert len(done_runs(out)) == count
    assert not (out / "dataset").exists()
    finished = sweep(out)
    assert (finished.returncode, finished.stderr) == (0, "")
    assert run_hashes(out) == run_hashes(undisturbed)
    assert (out / "dataset").is_dir()


def test_runs_have_images_where_the_study_asks_for_them(by_hand):
    text = (by_hand / "study.toml").read_text(encoding="utf-8")
    (by_hand / "study.toml").write_text(text.replace("fps = 200", "fps = 200\nimages = true"), encoding="utf-8")
    assert compute_batch(str(by_hand), [words_of(0)])[0]["status"] == "done"
    folder = by_hand / "runs" / words_of(0)["digest"] / "Pad"
    assert read_manifest(folder).has_images
    for name, sha256 in read_checksums(folder / IMAGE_LIST_NAME):
        check_sha256(folder / name, sha256)
    recording = load_recording(folder / "recording.npz")
    frame = int(recording.frames[len(recording.frames) // 2])
    channels, _ = read_exr(folder / frame_file(frame))
    total = recording.at(frame).sensors["Pad"].normal_force.sum()
    assert channels["R"].sum() == pytest.approx(total, rel=1e-6) and total > 0.0  # images have 32 bits
    assert len(list(folder.glob("*.exr"))) == len(recording.frames)
