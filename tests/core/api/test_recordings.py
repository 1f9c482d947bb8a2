# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings as files, tables and figures."""

from __future__ import annotations

import builtins

import numpy as np
import pytest

import palpate as pp
from palpate.core.io.recording_npz import load_recording


@pytest.fixture(scope="module")
def recording():
    pads = [
        pp.Sensor.grid(6, 4, 4e-3, name, k=500.0, unit="V", position=(x, 0, 0))
        for name, x in (("left", -0.02), ("right", 0.02))
    ]
    return pp.simulate(pads, pp.Body.sphere(0.03, mass=0.2, position=(0.012, 0, 0.0301)), duration=0.2, fps=50)


def test_a_saved_recording_is_read_with_its_sensors(recording, tmp_path):
    recording.save(tmp_path / "press.npz")
    read = pp.read_recording(tmp_path / "press.npz")
    assert read.sensors == recording.sensors
    for name in recording.sensors:
        assert (read[name].shear == recording[name].shear).all()
        assert (read[name].position == recording[name].position).all()
        assert read[name].unit == "V"
    assert read.dt == recording.dt
    recording.save(tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "press.npz").read_bytes()
    assert (load_recording(tmp_path / "press.npz").times == recording.time).all()  # the format of bakes still


def test_a_damaged_recording_is_refused(recording, tmp_path):
    recording.save(tmp_path / "press.npz")
    content = (tmp_path / "press.npz").read_bytes()
    (tmp_path / "cut.npz").write_bytes(content[: len(content) // 2])
    with pytest.raises(pp.PalpateError, match="cut.npz"):
        pp.read_recording(tmp_path / "cut.npz")
    with pytest.raises(pp.PalpateError, match="does not exist"):
        pp.read_recording(tmp_path / "none.npz")
    with pytest.raises(pp.PalpateError, match="path is 'press': end the name with .npz"):
        recording.save("press")


def test_tables_hold_the_arrays(recording):
    pytest.importorskip("pandas")
    xarray = pytest.importorskip("xarray")
    one = recording["left"]
    data = one.to_xarray()
    assert isinstance(data, xarray.Dataset)
    assert data["shear"].dims == ("time", "texel", "xy") and data["net_force"].dims == ("time", "xyz")
    assert (data["normal_force"].values == one.normal_force).all()
    assert data["reading"].attrs["units"] == "V" and data["depth"].attrs["units"] == "m"
    assert (data["x"].values == one.position[:, 0]).all()
    table = recording.to_dataframe()
    assert len(table) == 2 * len(recording) * 24
    row = table[(table.sensor == "right") & (table.texel == 5)].iloc[7]
    assert (row.time, row.shear_y) == (recording.time[7], recording["right"].shear[7, 5, 1])


def test_a_missing_package_is_named(recording, monkeypatch):
    plain = builtins.__import__
    import importlib

    def without(name, *rest):
        if name == "xarray":
            raise ImportError(name)
        return plain(name, *rest)

    monkeypatch.setattr(importlib, "import_module", without)
    with pytest.raises(pp.PalpateError, match="run 'pip install xarray'"):
        recording["left"].to_xarray()


def test_figures_are_shown_by_notebooks(recording):
    for figure in (
        recording.plot(),
        recording.plot("force", "slip"),
        recording.show(t=0.1),
        recording.show("pressure", (0.0, 0.2)),
    ):
        assert figure._repr_png_().startswith(b"\x89PNG")
    assert "data:image/png;base64," in recording._repr_html_()
    assert len(recording.show(t=(0.0, 0.1)).axes) == 2 * 2 + 1  # images of two sensors at two times, and the colour bar


def test_wrong_times_and_kinds_are_refused(recording):
    for call, message in (
        (lambda: recording.show(t=3.0), "t is .*: give times from 0 to 0.2 s"),
        (lambda: recording.show(t=np.nan), "t is NaN"),
        (lambda: recording.plot("forces"), "There are no curves of 'forces'"),
        (lambda: recording.show(quantity="stress"), "There is no quantity 'stress'"),
    ):
        with pytest.raises(pp.PalpateError, match=message):
            call()


@pytest.mark.parametrize("kind", ["csv", "npz"])
def test_a_recording_is_exported(recording, tmp_path, kind):
    assert {path.stem.split("_")[0] for path in recording.export(kind, tmp_path)} >= {"left", "right"}


def test_one_line_says_what_it_is(recording):
    force = max(recording[name].normal_force.sum(axis=1).max() for name in recording.sensors)
    assert repr(recording) == f"<Recording: 11 frames to 0.2 s, 'left' 24 texels, 'right' 24 texels, at most {force:.4g} N>"
