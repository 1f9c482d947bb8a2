# SPDX-License-Identifier: GPL-3.0-or-later
"""Logs of magnetometers that cannot be what the rig says: one sentence each."""

import numpy as np
import pytest

import palpate as pp

TIME = np.linspace(0.0, 10.0, 101)
FORCE = 1.0 - np.cos(TIME)


def write_rig(folder, grid, table):
    names = [f"texel_{i}" for i in range(table.shape[1])]
    rows = [",".join("" if np.isnan(v) else f"{v:.6g}" for v in row) for row in np.column_stack([TIME, FORCE, table])]
    (folder / "a.csv").write_text("\n".join([",".join(["time", "force", *names]), *rows]) + "\n")
    lines = ['format = "palpate-rig/1"', "[sensor]", f"grid = {{ {grid}, pitch = 0.01 }}", 'unit = "uT"', "[[trial]]"]
    (folder / "rig.toml").write_text("\n".join([*lines, 'file = "a.csv"']) + "\n")
    return folder / "rig.toml"


def channels(count):
    return FORCE[:, None] * np.linspace(-2.0, 3.0, count)


def test_a_layout_that_does_not_fit_the_channels(tmp_path):
    with pytest.raises(pp.PalpateError, match="15 texel columns and the sensor has 16 texels"):
        pp.read_rig(write_rig(tmp_path, "rows = 4, columns = 4", channels(15)))


def test_channels_of_unlike_length(tmp_path):
    path = write_rig(tmp_path, "rows = 1, columns = 3", channels(3))
    lines = (tmp_path / "a.csv").read_text().splitlines()
    lines[7] = lines[7].rpartition(",")[0]
    (tmp_path / "a.csv").write_text("\n".join(lines))
    with pytest.raises(pp.PalpateError, match="Line 8 of 'a.csv' has 4 cells and the header has 5"):
        pp.read_rig(path)


def test_a_channel_that_says_nan(tmp_path):
    path = write_rig(tmp_path, "rows = 1, columns = 3", channels(3))
    text = (tmp_path / "a.csv").read_text().splitlines()
    text[5] = text[5].rpartition(",")[0] + ",nan"
    (tmp_path / "a.csv").write_text("\n".join(text))
    with pytest.raises(pp.PalpateError, match="Line 6 of 'a.csv' has nan for texel_2: write a number, or leave the cell empty"):
        pp.read_rig(path)


def test_missing_samples_of_a_channel_lose_nothing(tmp_path):
    table = channels(3)
    table[20:40, 1] = np.nan
    rig = pp.read_rig(write_rig(tmp_path, "rows = 1, columns = 3", table))
    reading = rig.trials[0].reading
    assert np.isnan(reading[20:40, 1]).all() and np.isfinite(np.delete(reading, 1, axis=1)).all()


def test_constant_channels_are_said(tmp_path):
    table = channels(4)
    table[:, 1] = 5.0
    warnings = pp.read_rig(write_rig(tmp_path, "rows = 1, columns = 4", table)).warnings
    assert len(warnings) == 1 and warnings[0].startswith("texel_1: one value only; check the connection")
    table[:] = 5.0
    with pytest.raises(pp.PalpateError, match="No channel of .* changes in the fitted recordings: check the connection"):
        pp.fit_readout(pp.read_rig(write_rig(tmp_path, "rows = 1, columns = 4", table)))
