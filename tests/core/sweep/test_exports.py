# SPDX-License-Identifier: GPL-3.0-or-later
"""Exports hold the arrays of the dataset, and the dataset opens in the libraries that people use."""

from __future__ import annotations

import json

import numpy as np
import pytest
from sweep_runs import made_up, new_study, published

from palpate.core.errors import FileError
from palpate.sweep.exports import EXPORTS, export_hdf5, export_zarr

parquet = pytest.importorskip("pyarrow.parquet")

IMAGE = "observation.tactile.pad"


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = new_study(tmp_path_factory.mktemp("exports") / "study")
    return published(folder, [made_up(index, {"mass": 1.0 + index, "shape": "ball"}) for index in range(1, 4)])


def assert_same_arrays(study, arrays, episodes):
    table = parquet.read_table(study / "dataset" / "data" / "chunk-000" / "file-000.parquet")
    info = json.loads((study / "dataset" / "meta" / "info.json").read_text(encoding="utf-8"))
    for name, feature in info["features"].items():
        shape = () if feature["shape"] == [1] else feature["shape"]
        found = arrays(name)
        expected = np.array(table.column(name).to_pylist()).reshape(len(table), *shape)
        assert found.shape == expected.shape
        if feature["dtype"] == "string":
            assert [str(x) for x in found] == list(expected)
        else:
            np.testing.assert_array_equal(found, expected)
            assert found.dtype == feature["dtype"]
    np.testing.assert_array_equal(episodes("run"), [1, 2, 3])
    np.testing.assert_array_equal(episodes("dataset_to_index"), [6, 13, 21])


def test_hdf5(study):
    h5py = pytest.importorskip("h5py")
    (path,) = export_hdf5(study)
    with h5py.File(path) as file:
        assert file.attrs["fps"] == 24
        assert file[IMAGE].attrs["unit"] == "N" and list(file[IMAGE].attrs["channels"])[0] == "normal_force"
        read = {
            name: data.asstr()[:] if data.dtype.kind == "O" else data[:] for name, data in file.items() if name != "episodes"
        }
        assert_same_arrays(study, read.__getitem__, lambda name: file["episodes"][name][:])
    before = path.read_bytes()
    assert export_hdf5(study)[0].read_bytes() == before


def test_zarr(study):
    zarr = pytest.importorskip("zarr", exc_type=ImportError)
    group = zarr.open_group(export_zarr(study)[0], mode="r")
    assert group.attrs["fps"] == 24 and group[IMAGE].attrs["unit"] == "N"
    assert_same_arrays(study, lambda name: group[name][:], lambda name: group[f"episodes/{name}"][:])


@pytest.mark.parametrize("name", EXPORTS)
def test_without_a_dataset_there_is_nothing_to_export(tmp_path, name):
    pytest.importorskip({"hdf5": "h5py"}.get(name, name), exc_type=ImportError)
    with pytest.raises(FileError, match="has no dataset"):
        EXPORTS[name](new_study(tmp_path / "study"))


def test_pandas_opens_the_dataset(study):
    pandas = pytest.importorskip("pandas", exc_type=ImportError)
    frames, runs = pandas.read_parquet(study / "dataset" / "data"), pandas.read_parquet(study / "runs.parquet")
    assert len(frames) == 6 + 7 + 8 and list(runs["varied.mass"]) == [2.0, 3.0, 4.0]
    assert pandas.read_parquet(study / "dataset" / "meta" / "tasks.parquet").index[0] == "presses"


def test_duckdb_opens_the_dataset(study):
    duckdb = pytest.importorskip("duckdb", exc_type=ImportError)
    path = study / "dataset" / "data" / "*" / "*.parquet"
    found = duckdb.sql(
        f"select episode_index, count(*), max(\"{IMAGE}\"[1][1][1]) from '{path}' group by 1 order by 1"
    ).fetchall()
    assert [row[:2] for row in found] == [(0, 6), (1, 7), (2, 8)] and found[2][2] > 0


def test_datasets_opens_the_dataset_and_gives_images(study, tmp_path):
    datasets = pytest.importorskip("datasets", exc_type=ImportError)
    frames = datasets.load_dataset(str(study / "dataset"), split="train", cache_dir=str(tmp_path)).with_format("numpy")
    assert frames.num_rows == 21 and frames[:4][IMAGE].shape == (4, 5, 3, 3)


def test_lerobot_opens_the_dataset(study):
    lerobot = pytest.importorskip("lerobot.datasets.lerobot_dataset", exc_type=ImportError)
    frames = lerobot.LeRobotDataset("local/study", root=study / "dataset", delta_timestamps={IMAGE: [-1 / 24, 0.0]})
    item = frames[7]
    assert frames.num_episodes == 3 and item["task"] == "presses"
    assert tuple(item[IMAGE].shape) == (2, 5, 3, 3) and float(item["varied.mass"]) == 2.0
