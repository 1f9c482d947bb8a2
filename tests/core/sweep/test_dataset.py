# SPDX-License-Identifier: GPL-3.0-or-later
"""The dataset says what was recorded, in the layout of LeRobot v3, and equal runs give equal bytes."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path

import numpy as np
import pytest
from sample_bake import grid_texels, round_texels
from small_study import tree
from sweep_runs import FRICTION, failed, made_up, new_study, press, published, solved_press

from palpate.core.errors import FileError, PalpateError
from palpate.core.model.sensor_parameters import SensorParameters
from palpate.core.response import slipping
from palpate.core.study.study_file import read_study
from palpate.sweep import dataset, lerobot
from palpate.sweep.dataset import publish

pyarrow = pytest.importorskip("pyarrow")
parquet = pytest.importorskip("pyarrow.parquet")

DONE = (0, 1, 3, 5)
TEXELS = press(0)[0].sensors[0].texels


@pytest.fixture(scope="module")
def runs():
    """Some solved presses with their recordings."""
    return [solved_press(index) for index in DONE]


@pytest.fixture(scope="module")
def solved(runs, tmp_path_factory):
    """A study of these, two failures among them, that is published."""
    lost = [failed(4, "The second sentence.", press(4)[1]), failed(2, "The first sentence.", press(2)[1])]
    return published(new_study(tmp_path_factory.mktemp("sweep") / "study"), [*(run for run, _ in runs), *lost], 2)


def loads(count: int, **words):
    return [made_up(i, {"mass": 0.1 * i, "shape": "ball" if i % 2 else "cube"}, load=1.0 + i, **words) for i in range(count)]


def rows(study, part=""):
    return parquet.read_table(study / "dataset" / part / "data" / "chunk-000" / "file-000.parquet")


def column(table, name, shape):
    return np.array(table.column(name).to_pylist()).reshape(len(table), *shape)


def test_frames_hold_what_was_recorded(solved, runs):
    table, layout = rows(solved), TEXELS.layout
    at = touched = slid = 0
    for run, recording in runs:
        pad, part = recording.sensors["pad"], table.slice(at, len(recording.frames))
        seen = column(part, "observation.tactile.pad", (*layout.shape, 3))[:, layout.row, layout.column]
        np.testing.assert_array_equal(seen[:, :, 0], pad.normal_force.astype(np.float32))
        np.testing.assert_array_equal(seen[:, :, 1:], pad.shear.astype(np.float32))
        slips = slipping(pad, SensorParameters(k=run.run.values["pad.k"], **FRICTION))
        for name, expected in (("contact.touch.pad", pad.contact), ("contact.slip.pad", slips)):
            np.testing.assert_array_equal(column(part, name, layout.shape)[:, layout.row, layout.column], expected)
        reading = column(part, "observation.reading.pad", layout.shape)[:, layout.row, layout.column]
        np.testing.assert_array_equal(reading, pad.reading.astype(np.float32))
        np.testing.assert_array_equal(column(part, "observation.net_force.pad", (3,)), pad.net_force.astype(np.float32))
        np.testing.assert_array_equal(column(part, "observation.state", (2, 7)), recording.poses.astype(np.float32))
        assert set(part.column("varied.pad.k").to_pylist()) == {run.run.values["pad.k"]}
        at += len(recording.frames)
        touched, slid = touched + pad.contact.sum(), slid + slips.sum()
    assert at == len(table)
    assert touched > 100 and slid > 10, "the presses must touch and slip, or the test shows nothing"


def test_what_lerobot_expects_of_the_tables(solved):
    meta = solved / "dataset" / "meta"
    info = json.loads((meta / "info.json").read_text(encoding="utf-8"))
    episodes = parquet.read_table(meta / "episodes" / "chunk-000" / "file-000.parquet").to_pylist()
    table = rows(solved)
    assert info["codebase_version"] == "v3.0"
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (len(DONE), len(table), 1)
    assert info["fps"] == 50 and info["splits"] == {"train": f"0:{len(DONE)}"}
    assert set(info["features"]) == set(table.column_names)
    assert [episode["run"] for episode in episodes] == list(DONE)
    for number, episode in enumerate(episodes):
        begin, end = episode["dataset_from_index"], episode["dataset_to_index"]
        part = table.slice(begin, end - begin)
        assert set(part.column("episode_index").to_pylist()) == {number}
        assert part.column("index").to_pylist() == list(range(begin, end))
        assert part.column("frame_index").to_pylist() == list(range(episode["length"]))
        times = np.array(part.column("timestamp").to_pylist())
        np.testing.assert_allclose(times, np.arange(len(part)) / info["fps"], atol=1e-6)  # rounding to 32 bits
    assert parquet.read_table(meta / "tasks.parquet").to_pydict() == {"task_index": [0], "task": ["presses"]}


def test_statistics_are_those_of_all_frames(tmp_path, monkeypatch):
    """Also where groups of rows are joined."""
    monkeypatch.setattr(lerobot, "GROUP_BYTES", 3000)
    study = published(new_study(tmp_path / "study"), loads(7))
    table = rows(study)
    assert parquet.read_metadata(study / "dataset" / "data" / "chunk-000" / "file-000.parquet").num_row_groups > 2
    image = column(table, "observation.tactile.pad", (5, 3, 3))
    found = json.loads((study / "dataset" / "meta" / "stats.json").read_text())["observation.tactile.pad"]
    assert found["count"] == [len(table)]
    for name, expected in (("min", image.min(0)), ("max", image.max(0)), ("mean", image.mean(0)), ("std", image.std(0))):
        np.testing.assert_allclose(found[name], expected, rtol=1e-9, atol=1e-12)  # float64 sums in another order


def test_texels_have_their_places(solved):
    table = parquet.read_table(solved / "dataset" / "meta" / "texels.parquet").to_pydict()
    np.testing.assert_array_equal(np.stack([table[f"position_{axis}"] for axis in "xyz"], axis=1), TEXELS.position)
    assert table["row"] == TEXELS.layout.row.tolist() and table["column"] == TEXELS.layout.column.tolist()


def test_a_row_for_each_run_finished_or_failed(solved):
    table = parquet.read_table(solved / "runs.parquet").to_pylist()
    assert [(row["run"], row["status"]) for row in table] == [(i, "finished" if i in DONE else "failed") for i in range(6)]
    assert [table[i]["message"] for i in (2, 4)] == ["The first sentence.", "The second sentence."]
    assert all(row["varied.depth"] > 0 for row in table)
    assert all(table[i]["metric.largest_force"] > 0 for i in DONE) and table[2]["metric.largest_force"] is None
    assert "seconds" not in table[0]
    timings = (solved / "timings.csv").read_text().splitlines()
    assert timings[0] == "run,digest,seconds" and len(timings) == 1 + len(DONE)


@pytest.mark.parametrize("at_once", [1, 3])
def test_equal_runs_give_equal_bytes_whichever_were_computed_together(tmp_path, monkeypatch, at_once):
    monkeypatch.setattr(dataset, "ROWS_OF_GROUP", 4)
    monkeypatch.setattr(lerobot, "GROUP_BYTES", 3000)
    first = published(new_study(tmp_path / "a"), loads(9))
    second = published(new_study(tmp_path / "b"), loads(9)[::-1], at_once)
    assert tree(first / "dataset") == tree(second / "dataset")
    assert (first / "runs.parquet").read_bytes() == (second / "runs.parquet").read_bytes()
    assert parquet.read_metadata(first / "runs.parquet").num_row_groups == 3
    publish(first, read_study(first / "study.toml"))
    assert tree(first / "dataset") == tree(second / "dataset"), "and once more over the dataset of before"


def test_files_follow_each_other(tmp_path, monkeypatch):
    """Small limits give many files; together they hold what one file holds."""
    expected = rows(published(new_study(tmp_path / "whole"), loads(7))).to_pylist()
    for name, value in {"GROUP_BYTES": 1, "FILE_MEGABYTES": 0, "FILES_PER_CHUNK": 3}.items():
        monkeypatch.setattr(lerobot, name, value)
    split = published(new_study(tmp_path / "split"), loads(7)) / "dataset"
    files = sorted((split / "data").glob("*/*.parquet"))
    names = [path.relative_to(split / "data").as_posix() for path in files]
    assert names == [f"chunk-{number // 3:03d}/file-{number % 3:03d}.parquet" for number in range(7)]
    assert [row for path in files for row in parquet.read_table(path).to_pylist()] == expected
    for episode in parquet.read_table(split / "meta" / "episodes").to_pylist():
        path = files[3 * episode["data/chunk_index"] + episode["data/file_index"]]
        assert set(parquet.read_table(path).column("episode_index").to_pylist()) == {episode["episode_index"]}


def test_texels_without_rows_are_lists(tmp_path):
    study = published(new_study(tmp_path / "study"), loads(3, texels={"cap": round_texels(), "pad/1": grid_texels()}))
    info = json.loads((study / "dataset" / "meta" / "info.json").read_text(encoding="utf-8"))
    assert info["features"]["observation.tactile.cap"]["shape"] == [13, 3]
    assert info["features"]["observation.tactile.cap"]["palpate"]["channels"] == ["normal_force", "shear_x", "shear_y"]
    (other,) = [name for name in info["features"] if name.startswith("observation.tactile.pad_1-")]
    assert info["features"][other]["shape"] == [5, 3, 3]
    assert info["features"]["varied.shape"]["dtype"] == "string"


def test_runs_with_other_sensors_become_datasets_of_their_own(tmp_path):
    study = new_study(tmp_path / "study")
    published(study, [made_up(0, {"mass": 0.0}, {"cap": round_texels()})])
    published(study, [made_up(index, {"mass": 0.1 * index}) for index in (1, 2)])
    parts = {path.name: json.loads((path / "meta" / "info.json").read_text()) for path in (study / "dataset").iterdir()}
    assert {name: info["total_episodes"] for name, info in parts.items()} == {"part-000": 1, "part-001": 2}
    assert len(parquet.read_table(study / "runs.parquet")) == 3


def test_a_study_without_finished_runs_has_no_dataset(tmp_path):
    study = published(new_study(tmp_path / "study"), loads(1))
    for path in (study / "parts").iterdir():
        path.unlink()
    published(study, [failed(0, "It failed.")])
    assert not (study / "dataset").exists()
    assert parquet.read_table(study / "runs.parquet").to_pylist()[0]["message"] == "It failed."


def test_a_file_of_the_users_in_the_dataset_is_named_and_stays(tmp_path):
    study = published(new_study(tmp_path / "study"), loads(2))
    (study / "dataset" / "data" / "thesis.txt").write_text("mine")
    before = tree(study / "dataset")
    with pytest.raises(FileError, match=r"thesis.txt' was not written by `palpate sweep`.*move it away"):
        published(study, [])
    assert tree(study / "dataset") == before


def test_a_dataset_that_cannot_take_its_place_leaves_the_earlier_one(tmp_path, monkeypatch):
    study = published(new_study(tmp_path / "study"), loads(2))
    before, rename = tree(study / "dataset"), os.rename

    def refuse(source, target):
        if Path(target) == study / "dataset" and Path(source).name != "earlier":
            raise OSError(errno.EIO, "input/output error")
        rename(source, target)

    monkeypatch.setattr(os, "rename", refuse)
    with pytest.raises(FileError, match="could not be written"):
        published(study, [])
    assert tree(study / "dataset") == before


def test_a_study_may_ask_for_points_and_half_precision(tmp_path):
    """Lists in the order of meta/texels.parquet hold what pictures hold, and 16 bits hold it with the error that is stated."""
    plain = published(new_study(tmp_path / "plain"), loads(3))
    points = published(new_study(tmp_path / "points"), loads(3, points=True, half_precision=True))
    info = json.loads((points / "dataset" / "meta" / "info.json").read_text(encoding="utf-8"))["features"]
    for name, shape in (("observation.tactile.pad", [15, 3]), ("observation.reading.pad", [15]), ("contact.touch.pad", [15])):
        assert info[name]["shape"] == shape
    assert info["observation.tactile.pad"]["dtype"] == "float16" and info["observation.net_force.pad"]["dtype"] == "float32"
    assert "relative error of 2^-11" in info["observation.tactile.pad"]["palpate"]["about"]
    texels = parquet.read_table(points / "dataset" / "meta" / "texels.parquet").to_pydict()
    pictures = column(rows(plain), "observation.tactile.pad", (5, 3, 3))[:, texels["row"], texels["column"]]
    values = column(rows(points), "observation.tactile.pad", (15, 3))
    error = np.abs(values - pictures)
    assert (error <= np.maximum(2.0**-11 * np.abs(pictures), 3e-8)).all() and error.max() > 0.0


@pytest.mark.parametrize(("is_half", "load", "bits"), [(False, 1e40, 32), (True, 1e6, 16)])
def test_a_number_that_its_bits_cannot_hold_is_refused(is_half, load, bits):
    with pytest.raises(PalpateError, match=f"A number of 'observation.tactile.pad' is too large for {bits} bits"):
        made_up(5, {}, load=load, half_precision=is_half)
