# SPDX-License-Identifier: GPL-3.0-or-later
"""A sensor with a read-out of several channels: what a run records of it, and what files keep."""

from dataclasses import replace

import numpy as np
import pytest
from solver_scenes import pad, pressed, shape
from trimesh.creation import icosphere

from palpate.core.errors import FileError, SensorError
from palpate.core.io.recording_npz import load_recording, save_recording
from palpate.core.io.row_tables import FrameTable
from palpate.core.io.scenario_npz import load_scenario, save_scenario
from palpate.core.model.recording import Recording
from palpate.core.skins.channel_readouts import MagneticReadout, net_force_of, with_clipping_warnings
from palpate.core.skins.magnetic_skin import Magnetometers, Magnets, magnetic_skin, texel_displacements
from palpate.core.solver.simulation import Simulation


def skin_under(texels, magnet=3e-3, chip=7e-3):
    """A magnet and a magnetometer under each texel, so many metres below it; the layer is 6 mm thick."""
    count = len(texels)
    magnets = Magnets(texels.position - [0, 0, magnet], np.tile([0.0, 0.0, 4e-3], (count, 1)))
    axes, zero = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
    return magnetic_skin(texels, magnets, Magnetometers(texels.position - [0, 0, chip], axes, 50e-3, zero), 6e-3)


def scene(readout=None, texels=None, frames=9):
    """A ball that is pressed 1 mm into a pad, and then moved 0.4 mm along x."""
    t = np.linspace(0.0, 2.0, frames)
    path = np.stack([4e-4 * np.maximum(t - 1, 0), 0 * t, 8e-3 + 1e-4 - 1.1e-3 * np.minimum(t, 1)], axis=1)
    ball = shape(icosphere(subdivisions=3, radius=8e-3))
    texels = pad(6, 5) if texels is None else texels
    scenario = pressed(ball, path, texels, mus=1.5, mud=1.5, sigma0=400.0)
    return replace(scenario, sensors=(replace(scenario.sensors[0], channels=readout),))


@pytest.fixture(scope="module")
def run():
    texels = pad(6, 5)
    readout = MagneticReadout(skin_under(texels), texels, 60.0)
    scenario = scene(readout, texels)
    return scenario, readout, Simulation(scenario).advance_all()


def test_a_run_records_the_field_of_the_magnets_that_its_texels_move(run):
    scenario, readout, recording = run
    felt, texels = recording.sensors["pad"], scenario.sensors[0].texels
    moved = texel_displacements(texels, felt.depth, felt.shear, 60.0)
    assert felt.depth.max() > 7e-4 and np.abs(moved[-1, :, 0]).max() > 1e-5  # it is pressed and sheared
    np.testing.assert_array_equal(felt.channels.values, readout.skin.readings(moved).values)
    assert felt.channels.values.shape == (9, 30, 3) and felt.channels.unit == "T"


def test_frame_by_frame_has_the_bits_of_all_frames_at_once(run):
    scenario, _, recording = run
    simulation = Simulation(scenario)
    frames = [simulation.observe()] + [simulation.advance() for _ in range(8)]
    values = np.stack([frame.sensors["pad"].channels.values for frame in frames])
    assert values.tobytes() == recording.sensors["pad"].channels.values.tobytes()


def test_the_forces_are_those_without_a_read_out(run):
    _, _, recording = run
    plain = Simulation(scene()).advance_all()
    for one, other in zip(recording.sensors["pad"].arrays(), plain.sensors["pad"].arrays(), strict=False):
        assert one.tobytes() == other.tobytes()
    assert plain.sensors["pad"].channels is None and recording.digest != plain.digest


def test_a_load_cell_reads_the_net_force():
    """On a flat pad whose texels push along its normal: under a ball the two differ by the slopes of its surface."""
    texels = pad(6, 5)
    felt = Simulation(scene(net_force_of(texels), texels)).advance_all().sensors["pad"]
    assert felt.channels.values.shape == (9, 1, 3) and felt.channels.unit == "N"
    scale = np.abs(felt.net_force).max()
    np.testing.assert_allclose(felt.channels.values[:, 0, :2], felt.net_force[:, :2], atol=1e-12 * scale)
    np.testing.assert_allclose(felt.channels.values[:, 0, 2], -felt.normal_force.sum(axis=1), atol=1e-12 * scale)


def test_a_magnet_that_is_pressed_into_a_magnetometer_is_clipped_and_the_run_goes_on():
    texels = pad(3, 3)
    readout = MagneticReadout(skin_under(texels, magnet=1e-4, chip=8e-4), texels, 60.0)
    felt = Simulation(scene(readout, texels)).advance_all()
    channels = felt.sensors["pad"].channels
    assert np.isfinite(channels.values).all() and channels.clipped[4, 4].all()
    assert any("beyond the range" in warning for warning in felt.warnings)


def test_a_skin_of_other_texels_is_one_sentence():
    with pytest.raises(SensorError, match="The skin has 30 texels and its sensor 9"):
        MagneticReadout(skin_under(pad(6, 5)), pad(3, 3), 60.0)


def test_parts_of_a_recording_keep_the_channels(run):
    _, _, recording = run
    whole = recording.sensors["pad"].channels
    parts = [recording.part(frames).sensors["pad"].channels for frames in (slice(0, 4), slice(4, 9))]
    joined = replace(parts[0], **{key: np.concatenate([getattr(p, key) for p in parts]) for key in ("values", "clipped")})
    stacked = Recording.stack([recording.at(int(i)) for i in recording.frames], recording.body_names, recording.dt)
    for found in (joined, stacked.sensors["pad"].channels):
        assert found.values.tobytes() == whole.values.tobytes() and found.unit == "T"
        np.testing.assert_array_equal(found.clipped, whole.clipped)
    assert with_clipping_warnings(recording) is recording


def test_a_file_of_a_recording_and_a_table_of_frames_keep_them(run, tmp_path):
    scenario, readout, recording = run
    save_recording(tmp_path / "recording.npz", recording)
    rows = FrameTable([body.name for body in scenario.bodies])
    for frame in recording.frames:
        rows.append(recording.at(int(frame)))
    for found in (load_recording(tmp_path / "recording.npz"), rows.recording(1e-4, "", (), "")):
        own = found.sensors["pad"].channels
        assert own.values.tobytes() == recording.sensors["pad"].channels.values.tobytes()
        np.testing.assert_array_equal(own.place, readout.skin.magnetometers.place)


def test_channels_of_unlike_length_are_one_sentence(run, tmp_path):
    _, _, recording = run
    felt = recording.sensors["pad"]
    short = replace(felt, channels=replace(felt.channels, clipped=felt.channels.clipped[:, :-1]))
    save_recording(tmp_path / "recording.npz", replace(recording, sensors={"pad": short}))
    with pytest.raises(FileError, match="its channels have the shapes"):
        load_recording(tmp_path / "recording.npz")


def test_a_file_of_a_scenario_keeps_the_read_out(run, tmp_path):
    scenario, _, recording = run
    save_scenario(tmp_path / "scenario.npz", scenario)
    found = load_scenario(tmp_path / "scenario.npz")
    assert found.digest() == scenario.digest()
    again = Simulation(found).advance_all().sensors["pad"].channels
    assert again.values.tobytes() == recording.sensors["pad"].channels.values.tobytes()
