# SPDX-License-Identifier: GPL-3.0-or-later
"""Roads through the extension in a real Blender window; each is a file in roads/."""

from __future__ import annotations

import shutil

import pytest


def test_early_end(play_unseen):
    """Blender closes at once while the solver is being compiled, and nothing goes on."""
    assert play_unseen("early_end")["finished"]


def test_first_use(play_unseen):
    """The solver is compiled beside the window, with nothing in numba's cache."""
    result = play_unseen("first_use", timeout=1200)
    assert result["screenshots"] == ["preparing.png", "playing.png", "bake-slowly.png", "computed.png"]


def test_window(play_road):
    result = play_road("window")
    assert result["values"]["location"][0] == pytest.approx(2.5)
    assert len(result["screenshots"]) == 4


def test_sensor(play_road):
    result = play_road("sensor")
    assert result["values"]["k"] == pytest.approx(1234.5)
    assert result["values"]["k after undo"] != pytest.approx(1234.5)


def test_press(play_road):
    """Played, scrubbed, stopped by ESC, baked, undone."""
    result = play_road("press", timeout=900)
    assert result["values"]["largest while playing"] > 0.0
    assert result["values"]["files"][:4] == ["images.sha256", "manifest.json", "recording.npz", "sensor.npz"]
    assert result["values"]["files"][4:] == [f"tactile_{frame:04d}.exr" for frame in range(1, 41)]
    assert result["values"]["arrow"][0] > 0.0


def test_sample(play_road):
    """A sample scene is worth a picture at the moment when it opens."""
    assert play_road("sample", timeout=600)["values"]["force"] == pytest.approx(0.393, abs=0.005)


def test_tutorial(play_road):
    """The README's five minutes, word by word."""
    values = play_road("tutorial", timeout=1200)["values"]
    assert values["vertices"] == 84
    assert values["size"] == pytest.approx([0.02, 0.05, 0], abs=1e-6)
    assert values["force"] == pytest.approx(0.97, abs=0.005)
    assert values["files"] == 64  # an image for each frame, their checksums, the recording, the sensor and the manifest


def test_paint(play_road):
    """From nothing to the first tactile image of a painted fingertip in less than two minutes of a person's time."""
    values = play_road("paint", timeout=1200)["values"]
    assert values["seconds"] < 120
    assert values["largest"] > 0


def test_authoring(play_road):
    """Pads, laid texels, a problem put right, the sidebar, F3 and effects."""
    values = play_road("authoring", timeout=1200)["values"]
    assert values["texels"] > 50


def test_fits(play_road):
    """A preset, and parameters from measured files, by clicks; Table 2's friction comes out again."""
    values = play_road("fits", timeout=1200)["values"]
    assert values["preset"]["k"] not in (58.5, 1000.0)
    area, texels = 13 * 5 * 0.0034**2, 84  # 14 × 6 vertices span 13 × 5 faces
    assert values["k"] == pytest.approx(980.0 / 0.00025 * area / texels, rel=0.01)  # Eq. 18
    expected = {"mus": 0.435, "mud": 0.23, "x0": 0.3, "ct": 0.01}
    assert values["friction"] == pytest.approx(expected, rel=0.05)


def test_figures(play_road):
    """All figures by the panel's button, stopped once by ESC."""
    files = play_road("figures", timeout=900)["values"]["files"]
    expected = {f"{kind}.{ending}" for kind in ("strip", "curves") for ending in ("png", "pdf")} | {"video.mp4", "data_csv"}
    assert expected <= set(files)
    for start in ("scene_00", "scene_and_touch_00", "numbers_Left_finger_00", "numbers_Right_finger_00"):
        assert any(name.startswith(start) for name in files), start


def test_gap(play_road, real_blender, repository):
    """docs/gap.md on its sample rig: what was hidden in it is named, and ends up on the sensor."""
    shutil.copytree(repository / "docs" / "sample-rig", real_blender.work / "sample-rig", dirs_exist_ok=True)
    values = play_road("gap", timeout=1200)["values"]
    assert sorted(values["named"]) == ["creep", "gain-mismatch"]
    assert sorted(values["effects"]) == ["creep", "gain-mismatch"]
    assert {"gap: loading", "gap: hold", "gap: unloading"} <= set(values["markers"])


def test_fresh(play_road, real_blender, repository):
    """A new user's ways to an effect, a study and a planned experiment, in a file that was never saved."""
    shutil.copytree(repository / "docs" / "sample-rig", real_blender.work / "sample-rig", dirs_exist_ok=True)
    values = play_road("fresh", timeout=1200)["values"]
    assert "'Planned Probe'" in values["planned"] and "confidence" in values["planned"]
    assert values["role"] == "TARGET"


def test_out_of_date(play_road):
    """Numbers that are no longer true are taken away or named so, at once."""
    assert play_road("out_of_date", timeout=900)["screenshots"] == ["solid.png", "out-of-date.png", "opened.png", "renamed.png"]


def test_study(play_road):
    """A number is varied by right-click; the study is written, run beside the window, stopped by ESC, and goes on."""
    result = play_road("study", timeout=1200)
    assert 'scene = "scene.blend"' in result["values"]["file"]
    assert '"Cube.k"' in result["values"]["file"]
    assert result["screenshots"] == ["1-menu.png", "1-menu.png", "2-panel.png", "3-running.png", "4-done.png"]


def test_exchange(play_road):
    """A sensor goes to MuJoCo's file and comes back; two logs become a rig."""
    values = play_road("exchange", timeout=600)["values"]
    assert values["texels"] == [84, 84]
    assert values["asked"] > 0
    assert values["trials"] == 2
