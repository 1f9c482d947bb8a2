# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate fit`` and ``palpate openrave`` from the command line."""

import bpy
import numpy as np
import pytest
from blender_scenes import press, save

from palpate.commands import main
from palpate.core.simulators.openrave_file import read_openrave


def test_stiffness_from_foam(tmp_path, capfd, refused):
    x = np.linspace(0.5, 4, 8)
    table = "\n".join(f"{a:.3f},{3.924e3 * (a - 0.3) / 9.80665 * 804.25e-6 * 1e3:.6f}" for a in x)
    (tmp_path / "foam.csv").write_text(f"compression (mm),mass (g)\n{table}\n", encoding="utf-8")
    words = ["fit", "stiffness", str(tmp_path / "foam.csv"), "--area", "0.00125", "--texels", "84"]
    assert main([*words, "--weight-area", "804.25e-6", "--plot", str(tmp_path / "foam.png")]) == 0
    out = capfd.readouterr().out
    assert "58.39 N/m" in out  # the slope 3.924 MPa/m is that of 9810 Pa at 2.5 mm
    assert "dead zone of 0.3 mm" in out
    assert (tmp_path / "foam.png").read_bytes().startswith(b"\x89PNG")
    assert "on which area" in refused(*words)


def test_a_sensor_goes_out_and_comes_in_exactly(tmp_path, capfd):
    press()
    pad = bpy.data.objects["Pad"]
    pad.palpate.k, pad.palpate.mus, pad.palpate.max_penetration = 123.4, 0.61, 0.0083
    path = save(tmp_path)
    xml = tmp_path / "sensor.xml"
    assert main(["openrave", "export", str(path), "--out", str(xml)]) == 0
    (sensor,) = read_openrave(xml)
    found = sensor.parameters
    assert (sensor.link, found.k, found.mus, found.max_penetration) == ("Pad", 123.4, 0.61, 0.0083)
    changed = tmp_path / "changed.xml"
    changed.write_text(xml.read_text().replace("<k>123.4</k>", "<k>77.7</k>"), encoding="utf-8")
    assert main(["openrave", "import", str(changed), str(path), "--save-as", str(tmp_path / "other.blend")]) == 0
    assert bpy.data.objects["Pad"].palpate.k == pytest.approx(77.7, rel=1e-6)
    capfd.readouterr()
    assert main(["openrave", "export", str(tmp_path / "other.blend")]) == 0
    assert capfd.readouterr().out == changed.read_text()
    assert main(["openrave", "show", str(changed)]) == 0
    assert "77.7" in capfd.readouterr().out


def test_mistakes_are_one_line(tmp_path, refused):
    press()
    path = save(tmp_path)
    xml = tmp_path / "two.xml"
    assert main(["openrave", "export", str(path), "--out", str(xml)]) == 0
    one = xml.read_text()
    xml.write_text(one + one.replace('name="', 'name="other '), encoding="utf-8")
    assert "several sensors" in refused("openrave", "import", xml, path)
    assert "no sensor 'x'" in refused("openrave", "import", xml, path, "--from", "x")
    assert "no file" in refused("openrave", "import", tmp_path / "none.xml", path)
    assert "no sensor 'Nobody'" in refused("openrave", "export", path, "--sensor", "Nobody")
