# SPDX-License-Identifier: GPL-3.0-or-later
"""Scripts take sensors and scenarios from objects of Blender, in an installed extension as well."""

import os
import subprocess
import sys

import bpy
import numpy as np
import pytest
from blender_scenes import press, save

import palpate as pp
from palpate.addon.timeline import live_cache
from palpate.core.io.bake_reader import read_bake
from palpate.core.simulators import baked_sensors


def test_a_scene_is_simulated_and_read_back(tmp_path):
    """A script gets the numbers of a bake."""
    scene, _, _ = press()
    save(tmp_path)
    bpy.ops.palpate.bake()
    found = pp.simulate(pp.scenario_of(scene))
    assert (found.normal_force == read_bake(tmp_path / "palpate-bake").recording.sensors["Pad"].normal_force).all()
    baked = pp.read_bake(tmp_path / "palpate-bake" / "Pad")
    assert (baked.normal_force == found.normal_force).all() and baked.unit == "N"
    assert (pp.read_recording(tmp_path / "palpate-bake" / "Pad" / "recording.npz").shear == found.shear).all()
    with pytest.raises(pp.PalpateError, match="duration is part of the scenario"):
        pp.simulate(pp.scenario_of(scene), duration=1.0)
    with pytest.raises(pp.PalpateError, match="does not say where its texels are"):
        pp.read_recording(tmp_path / "palpate-bake" / "Pad" / "recording.npz").show(t=0.0)


def test_a_scene_is_read_without_being_simulated(monkeypatch):
    """Frames change while it is read, which simulates a scene that is played."""
    scene, _, _ = press()
    simulated, advance = [], live_cache.advance
    monkeypatch.setattr(live_cache, "advance", lambda *words: simulated.append(words) or advance(*words))
    assert len(pp.scenario_of(scene).bodies[1].motion.times) == scene.frame_end
    assert not simulated
    for frame in (1, 2):
        scene.frame_set(frame)
    assert len(simulated) == 1, "playing simulates the frame"


def test_a_sensor_is_taken_from_an_object(tmp_path):
    _, pad, target = press()
    pad.location, pad.palpate.k = (0.1, 0.0, 0.02), 123.0
    sensor = pp.sensor_of(pad)
    assert (sensor.name, sensor.parameters.k, len(sensor.texels)) == ("Pad", pytest.approx(123.0), len(pad.data.vertices))
    assert sensor.position == pytest.approx([0.1, 0.0, 0.02])
    box = pp.Body.box(0.2, position=(0.1, 0.0, 0.1195))  # 0.5 mm deep
    found = pp.simulate(sensor, box, duration=0.1)
    assert found.normal_force[-1] == pytest.approx(np.full(len(sensor.texels), 123.0 * 0.5e-3))
    assert pp.export_sensor(sensor, "probes", tmp_path).files[0].is_file()
    with pytest.raises(pp.PalpateError, match="There is no sensor"):
        pp.sensor_of(target)
    with pytest.raises(pp.PalpateError, match="obj is 'Pad': give an object of Blender"):
        pp.sensor_of("Pad")


def test_an_extension_opens_the_same_door(tmp_path, repository):
    """Blender loads it as bl_ext.<repository>.palpate."""
    place = tmp_path / "bl_ext" / "user_default"
    place.mkdir(parents=True)
    (place / "palpate").symlink_to(repository, target_is_directory=True)
    code = (
        "import sys\nfrom bl_ext.user_default import palpate as pp\n"
        "assert not {'bpy', 'numpy', 'palpate'} & set(sys.modules)\n"
        "print(pp.Sensor.grid(2, 3, 1e-3), pp.Body.box(0.01), pp.PalpateError.__module__)\n"
        "assert 'palpate' not in sys.modules"
    )
    command = [sys.executable, "-P", "-c", code]
    run = subprocess.run(command, cwd=tmp_path, env={"PYTHONPATH": str(tmp_path)}, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert run.stdout.startswith("<Sensor 'pad': 2 × 3 texels, k 58.5 N/m> <Body 'box': 10 × 10 × 10 mm, fixed>")
    assert run.stdout.strip().endswith("bl_ext.user_default.palpate.core.errors")


def test_a_painted_blend_gives_its_sensors_without_blender(tmp_path):
    """From the files of a bake come the same forces as from the probe list that Blender writes."""
    scene, pad, _ = press()
    pad.location, pad.rotation_euler, pad.palpate.k = (0.1, 0.02, 0.0), (0.0, 0.0, 0.3), 123.0
    group = pad.vertex_groups.new(name="soft")
    for number in range(len(pad.data.vertices)):
        group.add([number], 0.1 + 0.01 * number, "REPLACE")
    pad.palpate.k_map, pad.palpate.k_factor = "soft", 3.0
    pad.palpate.effects.add().kind = "creep"
    blend = save(tmp_path)
    assert scene.palpate.folder == f"//{baked_sensors.DEFAULT_FOLDER}"
    bpy.ops.palpate.bake()
    bpy.ops.wm.save_mainfile(compress=False)  # the default of Blender 5 is a compressed file, in which no note is seen
    os.utime(blend, (2e9, 2e9))  # saved long after its bake, and unchanged
    found, expected = pp.sensors_from_blend(blend)["Pad"], pp.sensor_of(pad)
    assert found.effects == expected.effects and len(found.effects) == 1
    assert found.sensor.settings_digest == expected.sensor.settings_digest
    cube = pp.Body.box(0.2, position=(0.1, 0.02, 0.0995))
    forces = [
        pp.PressedSensor(one, cube, 1e-3).step((one.position, one.quaternion), (cube.position, cube.quaternion)).texels
        for one in (found, expected)
    ]
    assert (forces[0].normal_force == forces[1].normal_force).all() and np.ptp(forces[0].normal_force) > 0.01
    pad.palpate.k = 124.0
    bpy.ops.wm.save_mainfile()
    os.utime(blend, (2e9, 2e9))
    with pytest.raises(pp.PalpateError, match="was saved after its bake in .* and may have changed"):
        pp.sensors_from_blend(blend)
