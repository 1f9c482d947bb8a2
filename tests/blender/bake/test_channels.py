# SPDX-License-Identifier: GPL-3.0-or-later
"""A painted sensor with several channels, from its placing to the files of its bake, and what a user can do wrong."""

import csv
import json

import bpy
import numpy as np
import pytest
from blender_scenes import baked, press, refusal, reopen, save, scenario_of, visible
from sample_bake import read_exr

from palpate import sensors_from_blend
from palpate.addon.scene import scene_fingerprint
from palpate.core.errors import PalpateError
from palpate.core.export.exporter import export
from palpate.core.io.bake_folder import read_manifest
from palpate.core.io.bake_reader import read_bake
from palpate.core.io.tactile_exr import channel_layout
from palpate.core.jobs import run_job
from palpate.core.skins import skin_presets
from palpate.panels import sensor as panel


def pressed_skin(frames=5):
    """A pad of 50 mm under a ball, with a skin that the operator placed."""
    scene, pad, *_ = press(frames=frames)
    bpy.context.view_layer.objects.active = pad
    assert bpy.ops.palpate.magnetic_skin_place(preset="uskin") == {"FINISHED"}
    bpy.context.view_layer.update()
    return scene, pad


def read(scene):
    return scenario_of(scene).sensors[0]


def parts(pad, part):
    return [obj for obj in pad.palpate.readout.collection.objects if obj.palpate.magnetic.part == part]


def test_a_placed_skin_is_the_preset(tmp_path):
    scene, pad = pressed_skin()
    own = read(scene).channels.skin
    pad.palpate.readout.kind = "USKIN"
    preset = read(scene).channels.skin
    np.testing.assert_allclose(own.magnets.place, preset.magnets.place, atol=1e-8)  # empties have 32 bits
    np.testing.assert_allclose(own.magnets.moment, preset.magnets.moment, atol=1e-8)
    np.testing.assert_allclose(own.magnetometers.place, preset.magnetometers.place, atol=1e-8)
    assert len(own.magnetometers.place) == 16 and (own.magnetometers.full_scale == 0.05).all()


def test_a_skin_moves_with_a_sensor_that_is_turned_shifted_and_scaled():
    scene, pad = pressed_skin()
    before = read(scene).channels.skin
    pad.location, pad.rotation_euler, pad.scale = (0.1, -0.2, 0.3), (0.4, 1.1, -0.5), (1.0, 1.0, 1.0)
    bpy.context.view_layer.update()
    after = read(scene).channels.skin
    np.testing.assert_allclose(after.magnets.place, before.magnets.place, atol=1e-7)
    np.testing.assert_allclose(after.magnetometers.axes, before.magnetometers.axes, atol=1e-6)
    np.testing.assert_allclose(after.magnets.moment, before.magnets.moment, atol=1e-8)


def test_a_bake_holds_the_channels_in_all_of_its_files(tmp_path):
    scene, pad = pressed_skin()
    blend = save(tmp_path)
    result = baked(scene)
    folder = result.folders["Pad"]
    with pytest.raises(PalpateError, match="The sensor 'Pad' of '.*scene.blend' has channels, which loops of other programs"):
        sensors_from_blend(blend)
    images = [f"tactile_{frame:04d}.exr" for frame in range(1, 6)]
    assert visible(folder) == sorted(["images.sha256", "manifest.json", "recording.npz", "sensor.npz", *images])
    manifest = read_manifest(folder)
    assert manifest.channels["unit"] == "T" and manifest.channels["names"] == ["x", "y", "z"]
    assert len(manifest.channels["place"]) == 16
    found = read_bake(tmp_path / "palpate-bake")  # checks the images' checksums
    channels = found.recording.sensors["Pad"].channels
    assert channels.values.tobytes() == result.recording.sensors["Pad"].channels.values.tobytes()
    change = channels.values[-1] - channels.values[0]
    assert channels.values.shape == (5, 16, 3) and np.abs(change).max() > 1e-4 and not channels.clipped.any()
    pictures, about = read_exr(folder / "tactile_0005.exr")
    texels = found.texels["Pad"]
    nearest = np.argmin(np.linalg.norm(texels.position[:, None] - channels.place, axis=2), axis=1)
    assert len(np.unique(nearest)) == 8  # texels are 10 mm apart in one direction
    for i, name in enumerate("XYZ"):
        expected = texels.layout.image(channels.values[-1, nearest, i]).astype(np.float32)
        np.testing.assert_array_equal(pictures[f"channels.{name}"], expected)
        assert about[f"unit.channels.{name}"] == "T"
    assert {"R", "G", "B", "reading", "depth", "slip", "contact"} < set(pictures)


def test_exports_hold_the_channels(tmp_path):
    from matplotlib.image import imread

    h5py = pytest.importorskip("h5py")
    scene, _ = pressed_skin()
    baked(scene, tmp_path)
    found = read_bake(tmp_path / "palpate-bake")
    channels, out = found.recording.sensors["Pad"].channels, tmp_path / "out"
    for kind in ("csv", "npz", "hdf5", "png", "mcap"):
        run_job(export(found, kind, out))
    with open(out / "Pad" / "channels.csv", newline="") as file:
        header, *rows = csv.reader(file)
    assert header[:5] == ["frame", "time", "0_x_T", "0_y_T", "0_z_T"] and len(header) == 2 + 48
    np.testing.assert_allclose(np.array(rows, float)[:, 2:], channels.values.reshape(5, 48), rtol=1e-8)
    with np.load(out / "Pad.npz") as members:
        assert members["channels"].tobytes() == channels.values.tobytes() and str(members["channels_unit"]) == "T"
    with h5py.File(out / "palpate.h5") as file:
        group = file["sensors/Pad"]
        assert group["channels"][()].tobytes() == channels.values.tobytes() and group["channels"].attrs["unit"] == "T"
        assert list(group.attrs["channels_names"]) == ["x", "y", "z"]
    scale = json.loads((out / "Pad" / "channels_scale.json").read_text())
    assert scale["last_colour"] == pytest.approx(np.abs(channels.values - channels.values[0]).max())
    assert len(list((out / "Pad").glob("channels_*.png"))) == 5
    # a picture has red where a channel has risen and blue where it has fallen; z is the third of three tiles
    picture = imread(out / "Pad" / "channels_0005.png")
    size = picture.shape[0] // 4
    tile = picture[size // 2 :: size, size // 2 :: size][::-1, 8:]
    change = channel_layout(found.texels["Pad"], channels).image(channels.values[-1, :, 2] - channels.values[0, :, 2])
    large = np.abs(change) > 0.3 * np.abs(change).max()
    assert large.any() and (np.sign(tile[..., 0] - tile[..., 2])[large] == np.sign(change)[large]).all()
    reader = pytest.importorskip("mcap.reader")
    with (out / "palpate.mcap").open("rb") as file:
        topics = [channel.topic for _, channel, _ in reader.make_reader(file).iter_messages()]
    assert topics.count("/Pad/channels") == 5


def test_files_reopen_with_their_skin_and_a_moved_magnet_makes_the_bake_stale(tmp_path):
    scene, pad = pressed_skin()
    path = save(tmp_path)
    before = scene_fingerprint.fingerprint(scene)
    first = read(scene).channels
    scene = reopen(path)
    pad = scene.objects["Pad"]
    assert scene_fingerprint.fingerprint(scene) == before
    np.testing.assert_array_equal(read(scene).channels.skin.magnets.place, first.skin.magnets.place)
    parts(pad, "MAGNET")[3].location.z -= 1e-4
    assert scene_fingerprint.fingerprint(scene) != before


def remove(pad, part):
    for obj in parts(pad, part):
        obj.palpate.magnetic.part = "NONE"


def test_what_a_user_can_do_wrong_is_one_sentence():
    def move_into_a_chip(pad):
        magnet, chip = parts(pad, "MAGNET")[0], parts(pad, "MAGNETOMETER")[0]
        magnet.location = chip.location
        pad.palpate.readout.thickness = 0.01

    faults = {
        "has no magnetometer": lambda pad: remove(pad, "MAGNETOMETER"),
        "has no magnet:": lambda pad: remove(pad, "MAGNET"),
        "no collection has its magnets": lambda pad: setattr(pad.palpate.readout, "collection", None),
        "Magnet 0 comes within .* inside its chip": move_into_a_chip,
        "below the texels and the layer is 1 mm": lambda pad: setattr(pad.palpate.readout, "thickness", 1e-3),
        "has a scale of zero": lambda pad: setattr(parts(pad, "MAGNET")[2], "scale", (0.0, 0.0, 0.0)),
        "NaN or infinite": lambda pad: setattr(parts(pad, "MAGNET")[2].location, "x", float("nan")),
    }
    for sentence, do in faults.items():
        scene, pad = pressed_skin(frames=2)
        do(pad)
        bpy.context.view_layer.update()
        with pytest.raises(PalpateError, match=rf"(?s)^Channels of sensor 'Pad'.*{sentence}"):
            read(scene)
        bpy.ops.wm.read_homefile(use_empty=True)


def test_a_pad_that_is_too_small_for_a_preset_is_one_sentence():
    scene, pad, *_ = press(frames=2)
    pad.scale = (0.1, 0.1, 1.0)
    bpy.context.view_layer.objects.active = pad
    bpy.context.view_layer.update()
    assert "use a larger pad" in refusal(bpy.ops.palpate.magnetic_skin_place, preset="uskin")
    assert pad.palpate.readout.kind == "NONE"


def test_what_is_beyond_the_range_is_clipped_and_said(tmp_path):
    scene, pad = pressed_skin()
    for chip in parts(pad, "MAGNETOMETER"):
        chip.palpate.magnetic.full_scale = 12.6e-3
    recording = baked(scene, tmp_path).recording
    assert any("beyond the range" in warning for warning in recording.warnings)
    channels = recording.sensors["Pad"].channels
    assert np.abs(channels.values).max() == 12.6e-3 and channels.clipped.any()
    assert "clipped" in panel._summary(channels.part(-1))


@pytest.mark.parametrize("name", list(skin_presets.PRESETS))
def test_a_preset_follows_a_curved_surface(name):
    """On a cylinder each magnet is as deep below the surface as on a flat pad."""
    preset, radius = skin_presets.PRESETS[name], 60e-3
    angle, y = np.meshgrid(np.linspace(-0.2, 0.2, 41), np.linspace(-11e-3, 11e-3, 23))
    normal = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=-1).reshape(-1, 3)
    position = radius * normal + np.column_stack([0 * y.ravel(), y.ravel(), 0 * y.ravel()])
    tangent = np.cross([0.0, 1.0, 0.0], normal)
    texels = type("", (), {"position": position, "normal": normal, "tangent": tangent, "area": np.full(len(normal), 1e-6)})
    magnets, chips = skin_presets.placed(preset, texels)
    depth = radius - np.hypot(magnets.place[:, 0], magnets.place[:, 2])
    np.testing.assert_allclose(depth, -preset.magnets[:, 2], atol=1e-5)  # the tangent plane of the nearest texel
    np.testing.assert_allclose(np.linalg.norm(magnets.moment, axis=1), np.linalg.norm(preset.moment))
    np.testing.assert_allclose(
        chips.axes @ np.swapaxes(chips.axes, 1, 2), np.tile(np.eye(3), (len(chips.axes), 1, 1)), atol=1e-12
    )
