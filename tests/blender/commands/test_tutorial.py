# SPDX-License-Identifier: GPL-3.0-or-later
"""The tutorial of the README, step by step: its numbers and its words are true."""

import os
import re

import bpy
import pytest
from blender_scenes import visible
from processes import python

from palpate.commands import main
from palpate.core.io.recording_npz import load_recording


def test_the_tutorial_does_what_it_says(scene, tmp_path, repository):
    readme = (repository / "README.md").read_text(encoding="utf-8")
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=5, y_subdivisions=13, size=0.05)
    grid = bpy.context.object
    bpy.ops.transform.resize(value=(0.4, 1.0, 1.0))
    assert bpy.ops.palpate.sensor_add() == {"FINISHED"}
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.015, location=(0.0, 0.0, 0.02))
    sphere = bpy.context.object
    assert bpy.ops.palpate.role_set(role="TARGET") == {"FINISHED"}
    scene.frame_set(1)
    sphere.keyframe_insert("location")
    scene.frame_set(30)
    bpy.ops.transform.translate(value=(0.0, 0.0, -0.0075))
    sphere.keyframe_insert("location")
    scene.frame_end = 60
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "press.blend"))
    bpy.context.view_layer.objects.active = grid
    assert bpy.ops.palpate.bake() == {"FINISHED"}

    felt = load_recording(tmp_path / "palpate-bake" / "Grid" / "recording.npz").sensors["Grid"]
    assert felt.normal_force.shape == (60, 84)
    images = sorted(path.name for path in (tmp_path / "palpate-bake" / "Grid").glob("*.exr"))
    assert images[0] == "tactile_0001.exr"
    assert len(images) == 60
    promised = float(re.search(r"about ([\d.]+) N at frame 60", readme).group(1))
    assert felt.normal_force[-1].sum() == pytest.approx(promised, abs=0.05)
    nearest = 0.002**2 + (0.05 / 26) ** 2  # the texels next to the middle are half a pitch off, where the sphere is higher
    assert felt.depth.max() == pytest.approx(0.0025 - nearest / (2 * 0.015), abs=5e-5)


@pytest.mark.slow("runs the page for scripts as it stands")
def test_a_sensor_made_without_a_window(tmp_path, repository):
    """The script in docs/authoring.md runs in a Python of its own, and its scene is baked with another sensor's file."""
    page = (repository / "docs" / "authoring.md").read_text(encoding="utf-8")
    script = re.search(r"## Without a window.*?```python\n(.*?)```", page, re.DOTALL).group(1)
    head = 'format = "palpate-sensor-toml/1"\n[sensor]\ncn = 1.0\n'
    (tmp_path / "soft.toml").write_text(f"{head}k = 100.0\n", encoding="utf-8")
    (tmp_path / "stiff.toml").write_text(f"{head}k = 400.0\n", encoding="utf-8")
    here = {**os.environ, "PWD": str(tmp_path)}  # Blender goes by it, as a shell sets it
    python(script, cwd=tmp_path, env=here, check=True)
    felt = {}
    for name in ("soft", "stiff"):
        words = ["--model", str(tmp_path / f"{name}.toml"), "--out", str(tmp_path / name)]
        assert main(["bake", str(tmp_path / "scene.blend"), *words]) == 0
        (sensor,) = (tmp_path / name / folder for folder in visible(tmp_path / name))
        felt[name] = load_recording(sensor / "recording.npz").sensors[sensor.name]
    assert felt["soft"].normal_force.max() > 0
    hold = felt["soft"].normal_force.sum(axis=1).argmax()
    assert felt["stiff"].depth[hold].max() == pytest.approx(felt["soft"].depth[hold].max())  # the same motion
    assert felt["stiff"].normal_force.max() > 3 * felt["soft"].normal_force.max()
