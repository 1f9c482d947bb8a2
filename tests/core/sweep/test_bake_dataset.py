# SPDX-License-Identifier: GPL-3.0-or-later
"""A bake as a dataset is what a study with this one run would have published."""

from __future__ import annotations

import json

import numpy as np
import pytest
from sample_bake import grid_texels, recording_of, round_texels, write_sensor

from palpate.commands import export as export_command
from palpate.commands import main
from palpate.core.io.bake_reader import read_bake
from palpate.core.model.sensor_parameters import SensorParameters

pyarrow = pytest.importorskip("pyarrow")
parquet = pytest.importorskip("pyarrow.parquet")


def exported(folder, frames=10):
    bake, out = folder / f"bake-{frames}", folder / "out"
    for name, texels in (("pad", grid_texels()), ("tip/1", round_texels())):
        write_sensor(bake, name, texels, None, recording_of(texels, frames), SensorParameters(unit="V", gain=2.0))
    assert main(["export", str(bake), "--format", "lerobot", "--out", str(out)]) == 0
    return read_bake(bake), out / "lerobot"


def test_one_bake_is_one_episode(tmp_path):
    bake, found = exported(tmp_path)
    info = json.loads((found / "meta" / "info.json").read_text())
    assert (info["total_episodes"], info["total_frames"], info["codebase_version"]) == (1, 10, "v3.0")
    table = parquet.read_table(found / "data" / "chunk-000" / "file-000.parquet")
    force = np.array(table.column("observation.tactile.pad").to_pylist(), np.float32)
    assert force.shape == (10, 5, 3, 3)
    assert np.array_equal(force[..., 0].reshape(10, -1), bake.recording.sensors["pad"].normal_force.astype(np.float32))
    assert info["features"]["observation.reading.pad"]["palpate"]["unit"] == "V"
    assert parquet.read_table(found / "meta" / "texels.parquet").num_rows == sum(map(len, bake.texels.values()))
    assert not [name for name in info["features"] if name.startswith("varied.")]


def test_the_extension_without_studies_says_so(tmp_path, capsys, monkeypatch):
    bake, _ = exported(tmp_path)
    monkeypatch.setattr(export_command.importlib.util, "find_spec", lambda name: None)
    folder = str(bake.folders["pad"].parent)
    assert main(["export", folder, "--format", "lerobot", "--out", str(tmp_path / "two")]) == 1
    assert "pip install .[sweep]' in a checkout of Palpate" in capsys.readouterr().err
