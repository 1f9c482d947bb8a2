# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate fit`` and ``palpate openrave`` from the command line."""

import bpy
import numpy as np
import pytest
from blender_scenes import press, save

from palpate.commands import main
from palpate.core.simulators.openrave_file import read_openrave


def test_stiffness_from_foam(tmp_path, capfd):
    x = np.linspace(0.5, 4, 8)
    table = "\n".join(f"{a:.3f},{3.924e3 * (a - 0.3) / 9.80665 * 804.25e-6 * 1e3:.6f}" for a in x)
    (tmp_path / "foam.csv").write_text(f"compression (mm),mass (g)\n{table}\n", encoding="utf-8")
    words = ["fit", "stiffness", str(tmp_path / "foam.csv"), "--area", "0.00125", "--texels", "84"]
    assert main([*words, "--weight-area", "804.25e-6", "--plot", str(tmp_path / "foam.png")]) == 0
    out = capfd.readouterr().out
    assert "58.39 N/m" in out  # the slope 3.924 MPa/m is that of 9810 Pa at 2.5 mm
    assert "dead zone of 0.3 mm" in out
    assert (tmp_path / "foam.png").read_bytes().startswith(b"\x89PNG")
    assert main(words) == 1
    assert "on which area" in capfd.readouterr().err


def test_a_sensor_goes_out_and_comes_in_exactly(tmp_path, capfd):
    press()
    pad = next(obj for obj in bpy.data.objects if obj.palpate.role == "SENSOR")
    name = pad.name
    pad.palpate.k, pad.palpate.mus, pad.palpate.max_penetration = 123.4, 0.61, 0.0083
    path = save(tmp_path)
    xml = tmp_path / "sensor.xml"
    assert main(["openrave", "export", str(path), "--out", str(xml)]) == 0
    (sensor,) = read_openrave(xml)
    assert (sensor.link, sensor.parameters.k, sensor.parameters.mus, sensor.parameters.max_penetration) == (
        name,
        123.4,
        0.61,
        0.0083,
    )
    changed = tmp_path / "changed.xml"
    changed.write_text(xml.read_text().replace("<k>123.4</k>", "<k>77.7</k>"), encoding="utf-8")
    assert main(["openrave", "import", str(changed), str(path), "--save-as", str(tmp_path / "other.blend")]) == 0
    assert bpy.data.objects[name].palpate.k == pytest.approx(77.7, rel=1e-6)
    capfd.readouterr()
    assert main(["openrave", "export", str(tmp_path / "other.blend")]) == 0
    assert capfd.readouterr().out == changed.read_text()
    assert main(["openrave", "show", str(changed)]) == 0
    assert "77.7" in capfd.readouterr().out


def test_mistakes_are_one_line(tmp_path, capfd):
    press()
    path = save(tmp_path)
    xml = tmp_path / "two.xml"
    assert main(["openrave", "export", str(path), "--out", str(xml)]) == 0
    one = xml.read_text()
    xml.write_text(one + one.replace('name="', 'name="other '), encoding="utf-8")
    capfd.readouterr()
    for words, reason in (
        (["import", str(xml), str(path)], "several sensors"),
        (["import", str(xml), str(path), "--from", "x"], "no sensor 'x'"),
        (["import", str(tmp_path / "none.xml"), str(path)], "no file"),
        (["export", str(path), "--sensor", "Nobody"], "no sensor 'Nobody'"),
    ):
        assert main(["openrave", *words]) == 1
        err = capfd.readouterr().err.splitlines()
        assert len(err) == 1 and reason in err[0]
