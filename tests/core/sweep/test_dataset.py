# SPDX-License-Identifier: GPL-3.0-or-later
"""The dataset says what the recordings say, in the layout of LeRobot v3, and equal runs give equal bytes."""

from __future__ import annotations

import errno
import gc
import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sample_bake import grid_texels, recording_of, round_texels
from sweep_runs import FRICTION, new_study, unit_sensor, write_failure, write_press, write_run

from palpate.core.errors import FileError
from palpate.core.io.recording_npz import load_recording
from palpate.core.io.sensor_npz import load_sensor
from palpate.core.model.sensor_parameters import SensorParameters
from palpate.core.response.metrics import slipping
from palpate.sweep import lerobot_writer, run_table
from palpate.sweep.dataset import publish

pyarrow = pytest.importorskip("pyarrow")
parquet = pytest.importorskip("pyarrow.parquet")

RUNS = 6


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """A study of some solved presses, two failures among them, that is published."""
    study = new_study(tmp_path_factory.mktemp("sweep") / "study")
    for index in range(RUNS):
        if index not in (2, 4):
            write_press(study, index)
    failed = [write_failure(study, 4, "The second sentence."), write_failure(study, 2, "The first sentence.")]
    publish(study, failed)
    return study


def made_up(tmp_path, sensors=(("pad", "grid"),), runs=3, name="study", scale=1.0, order=None):
    """A study of recordings that nobody solved, written in some order."""
    study = new_study(tmp_path / name)
    for index in order or range(runs):
        own = [unit_sensor(sensor, grid_texels() if kind == "grid" else round_texels()) for sensor, kind in sensors]
        arrays = {}
        for sensor in own:
            (arrays[sensor.name],) = recording_of(sensor.texels, 5 + index).sensors.values()
            arrays[sensor.name].normal_force = arrays[sensor.name].normal_force * scale * (1 + index)
        recording = replace(recording_of(own[0].texels, 5 + index), sensors=arrays)
        write_run(study, index, own, recording, {"mass": 0.1 * index, "shape": "ball" if index % 2 else "cube"})
    return study


def content(folder):
    """All files of a folder by name."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def rows(study, part=""):
    return parquet.read_table(study / "dataset" / part / "data" / "chunk-000" / "file-000.parquet")


def column(table, name, shape):
    return np.array(table.column(name).to_pylist()).reshape(len(table), *shape)


def recordings(study):
    """The solved recordings in the order of the design."""
    found = [(json.loads((path / "run.json").read_text()), path / "pad") for path in (study / "runs").iterdir()]
    return [(run, place) for run, place in sorted(found, key=lambda one: one[0]["index"])]


def test_frames_hold_what_was_recorded(solved):
    table = rows(solved)
    at = 0
    touched = slid = 0
    for run, place in recordings(solved):
        recording, (texels, _) = load_recording(place / "recording.npz"), load_sensor(place / "sensor.npz")
        pad, part = recording.sensors["pad"], table.slice(at, len(recording.frames))
        layout = texels.layout
        image = column(part, "observation.tactile.pad", (*layout.shape, 3))
        seen = image[:, layout.row, layout.column]
        np.testing.assert_array_equal(seen[:, :, 0], pad.normal_force.astype(np.float32))
        np.testing.assert_array_equal(seen[:, :, 1:], pad.shear.astype(np.float32))
        slips = slipping(pad, SensorParameters(k=run["values"]["pad.k"], **FRICTION))
        for name, expected in (("contact.touch.pad", pad.contact), ("contact.slip.pad", slips)):
            np.testing.assert_array_equal(column(part, name, layout.shape)[:, layout.row, layout.column], expected)
        reading = column(part, "observation.reading.pad", layout.shape)[:, layout.row, layout.column]
        np.testing.assert_array_equal(reading, pad.reading.astype(np.float32))
        np.testing.assert_array_equal(column(part, "observation.net_force.pad", (3,)), pad.net_force.astype(np.float32))
        np.testing.assert_array_equal(column(part, "observation.net_torque.pad", (3,)), pad.net_torque.astype(np.float32))
        np.testing.assert_array_equal(column(part, "observation.state", (2, 7)), recording.poses.astype(np.float32))
        assert set(part.column("varied.pad.k").to_pylist()) == {run["values"]["pad.k"]}
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
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (RUNS - 2, len(table), 1)
    assert info["fps"] == 50 and info["splits"] == {"train": f"0:{RUNS - 2}"}
    assert set(info["features"]) == set(table.column_names)
    assert [episode["run"] for episode in episodes] == [0, 1, 3, 5]
    for number, episode in enumerate(episodes):
        begin, end = episode["dataset_from_index"], episode["dataset_to_index"]
        part = table.slice(begin, end - begin)
        assert set(part.column("episode_index").to_pylist()) == {number}
        assert part.column("index").to_pylist() == list(range(begin, end))
        assert part.column("frame_index").to_pylist() == list(range(episode["length"]))
        times = np.array(part.column("timestamp").to_pylist())
        np.testing.assert_allclose(times, np.arange(len(part)) / info["fps"], atol=1e-6)  # rounding to 32 bits
        path = solved / "dataset" / info["data_path"].format(chunk_index=0, file_index=episode["data/file_index"])
        assert path.is_file()
    tasks = parquet.read_table(meta / "tasks.parquet").to_pydict()
    assert tasks == {"task_index": [0], "task": ["presses"]}


def test_statistics_are_those_of_all_frames(solved):
    stats = json.loads((solved / "dataset" / "meta" / "stats.json").read_text())
    table = rows(solved)
    image = column(table, "observation.tactile.pad", (14, 6, 3))
    found = stats["observation.tactile.pad"]
    assert found["count"] == [len(table)]
    for name, expected in (("min", image.min(0)), ("max", image.max(0)), ("mean", image.mean(0)), ("std", image.std(0))):
        np.testing.assert_allclose(found[name], expected, rtol=1e-9, atol=1e-12)  # float64 sums in another order


def test_texels_have_their_places(solved):
    (_, place), *_ = recordings(solved)
    texels, _ = load_sensor(place / "sensor.npz")
    table = parquet.read_table(solved / "dataset" / "meta" / "texels.parquet").to_pydict()
    np.testing.assert_array_equal(np.stack([table[f"position_{axis}"] for axis in "xyz"], axis=1), texels.position)
    assert table["row"] == texels.layout.row.tolist() and table["column"] == texels.layout.column.tolist()


def test_a_row_for_each_run_finished_or_failed(solved):
    table = parquet.read_table(solved / "runs.parquet").to_pylist()
    assert [(row["run"], row["status"]) for row in table] == [
        *((index, "finished") for index in (0, 1, 3, 5)),
        (2, "failed"),
        (4, "failed"),
    ]
    assert [row["message"] for row in table[-2:]] == ["The first sentence.", "The second sentence."]
    assert all(row["varied.depth"] > 0 for row in table)
    assert all(row["metric.largest_force"] > 0 for row in table[:4]) and table[-1]["metric.largest_force"] is None
    assert "seconds" not in " ".join(table[0])
    assert (solved / "timings.csv").read_text().splitlines()[0] == "run,digest,seconds"


def test_equal_runs_give_equal_bytes_in_any_order(tmp_path):
    first, second = made_up(tmp_path, name="a"), made_up(tmp_path, name="b", order=[2, 0, 1])
    run = next((second / "runs").iterdir()) / "run.json"
    run.write_text(run.read_text().replace('"seconds": 0.0', '"seconds": 7.0'))
    for study in (first, second):
        publish(study)
    assert content(first / "dataset") == content(second / "dataset")
    assert (first / "runs.parquet").read_bytes() == (second / "runs.parquet").read_bytes()
    publish(first)
    assert content(first / "dataset") == content(second / "dataset"), "and once more over the dataset of before"
    assert {path.name for path in first.iterdir()} == {"study.toml", "runs", "dataset", "runs.parquet", "timings.csv"}


def test_files_and_groups_of_rows_follow_each_other(tmp_path, monkeypatch):
    """Small limits give many files; together they hold what one file holds."""
    whole = made_up(tmp_path, runs=7, name="whole")
    publish(whole)
    expected = rows(whole).to_pylist()
    monkeypatch.setattr(lerobot_writer, "ROW_GROUP_BYTES", 1)
    monkeypatch.setattr(lerobot_writer, "FILE_MEGABYTES", 0)
    monkeypatch.setattr(lerobot_writer, "FILES_PER_CHUNK", 3)
    split = made_up(tmp_path, runs=7, name="split")
    publish(split)
    files = sorted((split / "dataset" / "data").glob("*/*.parquet"))
    assert [path.relative_to(split / "dataset" / "data").as_posix() for path in files] == [
        f"chunk-{number // 3:03d}/file-{number % 3:03d}.parquet" for number in range(7)
    ]
    assert [row for path in files for row in parquet.read_table(path).to_pylist()] == expected
    episodes = parquet.read_table(split / "dataset" / "meta" / "episodes").to_pylist()
    for episode in episodes:
        path = files[3 * episode["data/chunk_index"] + episode["data/file_index"]]
        assert set(parquet.read_table(path).column("episode_index").to_pylist()) == {episode["episode_index"]}


def test_short_runs_share_pages_and_long_ones_keep_theirs(tmp_path, monkeypatch):
    """Both say the same, and pages that are shared take less than those of each run."""
    sizes, frames = {}, {}
    for name, limit in (("shared", lerobot_writer.SHORT_BYTES), ("own", 0)):
        monkeypatch.setattr(lerobot_writer, "SHORT_BYTES", limit)
        study = made_up(tmp_path, runs=9, name=name)
        publish(study)
        (path,) = (study / "dataset" / "data").glob("*/*.parquet")
        group = parquet.read_metadata(path).row_group(0)
        columns = [group.column(number) for number in range(group.num_columns)]
        sizes[name] = sum(own.total_compressed_size for own in columns if own.path_in_schema.startswith("observation"))
        frames[name] = rows(study)
    assert frames["shared"].equals(frames["own"]) and len(frames["own"]) == sum(5 + index for index in range(9))
    assert sizes["shared"] < 0.8 * sizes["own"]


def test_a_table_of_many_rows_has_the_columns_of_all(tmp_path, monkeypatch):
    """Rows are put down in parts, in which names may be missing, and become groups of rows of their own size."""
    study = made_up(tmp_path, runs=7)
    for number, path in enumerate(sorted((study / "runs").glob("*/run.json"))):
        run = json.loads(path.read_text())
        path.write_text(json.dumps(run | {"metrics": {f"metric {run['index'] % 3}": float(number)}}))
    publish(study)
    expected = parquet.read_table(study / "runs.parquet")
    assert {name for name in expected.column_names if name.startswith("metric.")} == {f"metric.metric {i}" for i in range(3)}
    monkeypatch.setattr(run_table, "ROWS_AT_ONCE", 2)
    monkeypatch.setattr(run_table, "ROWS_OF_GROUP", 4)
    publish(study)
    assert parquet.read_metadata(study / "runs.parquet").num_row_groups == 2
    assert parquet.read_table(study / "runs.parquet").equals(expected)
    assert not list(study.glob("tmp*"))


def test_rows_about_runs_wait_in_tables(tmp_path, monkeypatch):
    whole, split = made_up(tmp_path, runs=7, name="whole"), made_up(tmp_path, runs=7, name="split")
    publish(whole)
    monkeypatch.setattr(lerobot_writer, "EPISODES_AT_ONCE", 2)
    monkeypatch.setattr(lerobot_writer, "EPISODES_OF_GROUP", 4)
    publish(split)
    (path,) = (split / "dataset" / "meta" / "episodes").glob("*/*.parquet")
    assert [parquet.read_metadata(path).row_group(number).num_rows for number in range(2)] == [4, 3]
    assert parquet.read_table(path).equals(parquet.read_table(whole / "dataset" / "meta" / "episodes"))


def test_texels_without_rows_are_lists(tmp_path):
    study = made_up(tmp_path, sensors=(("cap", "round"), ("pad/1", "grid")))
    publish(study)
    info = json.loads((study / "dataset" / "meta" / "info.json").read_text(encoding="utf-8"))
    assert info["features"]["observation.tactile.cap"]["shape"] == [13, 3]
    assert info["features"]["observation.tactile.cap"]["palpate"]["channels"] == ["normal_force", "shear_x", "shear_y"]
    (other,) = [name for name in info["features"] if name.startswith("observation.tactile.pad_1-")]
    assert info["features"][other]["shape"] == [5, 3, 3]
    assert info["features"]["varied.shape"]["dtype"] == "string"
    table = rows(study)
    (_, place), *_ = [
        (p, p / "cap") for p in sorted((study / "runs").iterdir()) if '"index": 0' in (p / "run.json").read_text()
    ]
    recorded = load_recording(place / "recording.npz").sensors["cap"]
    seen = column(table.slice(0, len(recorded.contact)), "observation.tactile.cap", (13, 3))
    np.testing.assert_array_equal(seen[:, :, 0], recorded.normal_force.astype(np.float32))


def test_runs_with_other_sensors_become_parts(tmp_path):
    study = made_up(tmp_path, runs=2)
    other = made_up(tmp_path, sensors=(("cap", "round"),), runs=1, name="other")
    for path in (other / "runs").iterdir():
        shutil.copytree(path, study / "runs" / path.name[::-1])
    publish(study)
    parts = {path.name: json.loads((path / "meta" / "info.json").read_text()) for path in (study / "dataset").iterdir()}
    assert sorted(parts) == ["part-000", "part-001"]
    assert sorted(info["total_episodes"] for info in parts.values()) == [1, 2]
    assert len(parquet.read_table(study / "runs.parquet")) == 3


def test_a_study_without_finished_runs_has_no_dataset(tmp_path):
    study = made_up(tmp_path)
    publish(study)
    shutil.rmtree(study / "runs")
    publish(study)
    assert not (study / "dataset").exists()
    assert len(parquet.read_table(study / "runs.parquet")) == 0


@pytest.mark.parametrize("damage", ["run.json", "recording.npz", "sensor.npz"])
def test_a_damaged_run_is_named_and_the_dataset_of_before_stays(tmp_path, damage):
    study = made_up(tmp_path)
    publish(study)
    before = content(study / "dataset")
    path = next((study / "runs").glob(f"*/**/{damage}"))
    path.write_bytes(path.read_bytes()[:40])
    with pytest.raises(FileError, match=f"{damage}' (is|could)"):
        publish(study)
    assert content(study / "dataset") == before
    assert not list(study.glob(".palpate*"))


def test_a_number_that_32_bits_cannot_hold_is_refused(tmp_path):
    study = made_up(tmp_path, scale=1e40)
    with pytest.raises(FileError, match="A number of 'observation.tactile.pad' has no place in 32 bits"):
        publish(study)


def test_a_folder_without_a_study_is_refused(tmp_path):
    with pytest.raises(FileError, match="holds no study"):
        publish(tmp_path)


def test_a_file_of_the_users_in_the_dataset_is_named_and_stays(tmp_path):
    study = made_up(tmp_path)
    publish(study)
    (study / "dataset" / "data" / "thesis.txt").write_text("mine")
    before = content(study / "dataset")
    with pytest.raises(FileError, match="thesis.txt' was not written by `palpate sweep`.*move it away"):
        publish(study)
    assert content(study / "dataset") == before


def test_a_dataset_that_cannot_take_its_place_leaves_the_earlier_one(tmp_path, monkeypatch):
    study = made_up(tmp_path)
    publish(study)
    before, rename = content(study / "dataset"), os.rename

    def refuse(source, target):
        if Path(target) == study / "dataset" and Path(source).name != "before":
            raise OSError(errno.EIO, "input/output error")
        rename(source, target)

    monkeypatch.setattr(os, "rename", refuse)
    with pytest.raises(FileError, match="could not be written"):
        publish(study)
    assert content(study / "dataset") == before


def test_nothing_is_printed_where_the_disk_is_full(tmp_path, monkeypatch, capfd):
    """An unfinished file is let go of; pyarrow would try once more when it is collected, and print a traceback."""
    study = made_up(tmp_path)

    def full(*_):
        raise OSError(errno.ENOSPC, "no space left on device")

    monkeypatch.setattr(lerobot_writer, "sync_file", full)
    monkeypatch.setattr(lerobot_writer, "ROW_GROUP_BYTES", 1)
    with pytest.raises(FileError, match="no space left on device.*free some space"):
        publish(study)
    gc.collect()
    assert capfd.readouterr().err == ""
    assert not (study / "dataset").exists() and not list(study.glob(".palpate*"))


def test_a_study_may_ask_for_points_and_half_precision(tmp_path):
    """Lists in the order of meta/texels.parquet hold what pictures hold, and 16 bits hold it with the error that is stated."""
    plain, points = made_up(tmp_path, name="plain"), made_up(tmp_path, name="points")
    study = points / "study.toml"
    study.write_text(study.read_text() + "points = true\nhalf_precision = true\n")
    publish(plain)
    publish(points)
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
    stats = json.loads((points / "dataset" / "meta" / "stats.json").read_text())["observation.tactile.pad"]
    np.testing.assert_allclose(stats["mean"], values.mean(0), rtol=1e-9)


def test_a_number_that_16_bits_cannot_hold_is_refused(tmp_path):
    study = made_up(tmp_path, scale=1e6)
    file = study / "study.toml"
    file.write_text(file.read_text() + "half_precision = true\n")
    with pytest.raises(FileError, match="observation.tactile.pad' has no place in 16 bits.*too large"):
        publish(study)
