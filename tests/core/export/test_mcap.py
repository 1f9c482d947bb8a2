# SPDX-License-Identifier: GPL-3.0-or-later
"""What an MCAP file of a bake says, read by other people's libraries, is what was recorded, to the last bit of a float32."""

from __future__ import annotations

import json
import sys
from dataclasses import replace

import numpy as np
import pytest
from sample_bake import grid_texels, recording_of, round_texels, write_sensor

from palpate.core.errors import PalpateError
from palpate.core.export.exporter import export
from palpate.core.export.formats.mcap_messages import topic_names
from palpate.core.io.bake_reader import read_bake
from palpate.core.jobs import run_job
from palpate.core.model.sensor_parameters import SensorParameters

mcap_reader = pytest.importorskip("mcap.reader")


def recorded(texels, seed):
    """A recording in which every number differs from the others."""
    recording = recording_of(texels)
    random = np.random.default_rng(seed)
    (own,) = recording.sensors.values()
    for name in ("normal_force", "shear", "depth", "slip", "reading", "net_force", "net_torque", "centre_of_pressure"):
        setattr(own, name, random.random(getattr(own, name).shape))
    recording.poses[..., :3] = np.random.default_rng(8).normal(size=recording.poses.shape[:2] + (3,))
    return recording


@pytest.fixture
def bake(tmp_path):
    for seed, (name, texels) in enumerate((("pad", grid_texels()), ("tip/1", round_texels()))):
        write_sensor(tmp_path / "bake", name, texels, None, recorded(texels, seed), SensorParameters(unit="V", gain=2.0))
    return read_bake(tmp_path / "bake")


def messages(path):
    """All messages of a file by topic, decoded by rosbags from the definitions in the file, and their times in ns."""
    stores = pytest.importorskip("rosbags.typesys")
    store, known, found = stores.get_typestore(stores.Stores.EMPTY), set(), {}
    with path.open("rb") as file:
        for schema, channel, message in mcap_reader.make_reader(file, validate_crcs=True).iter_messages():
            assert schema.encoding == "ros2msg" and channel.message_encoding == "cdr"
            if schema.name not in known:
                types = stores.get_types_from_msg(schema.data.decode(), schema.name)
                store.register({name: kind for name, kind in types.items() if name not in store.fielddefs})
                known.add(schema.name)
            found.setdefault(channel.topic, []).append((message.log_time, store.deserialize_cdr(message.data, schema.name)))
    return found


def points_of(cloud):
    kinds = {7: "<f4", 2: "u1"}
    names, formats, offsets = zip(*((item.name, kinds[item.datatype], item.offset) for item in cloud.fields))
    kind = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": cloud.point_step})
    return np.frombuffer(cloud.data.tobytes(), kind)


def test_every_number_comes_back_in_float32(bake, tmp_path):
    (path,) = run_job(export(bake, "mcap", tmp_path / "out"))
    found, recording = messages(path), bake.recording
    assert set(found) == {"/tf"} | {
        f"/{name}/{what}" for name in ("pad", "tip_1") for what in ("texels", "tactile_image", "wrench", "centre_of_pressure")
    }
    for sensor, topic in (("pad", "/pad"), ("tip/1", "/tip_1")):
        own, texels = recording.sensors[sensor], bake.texels[sensor]
        assert len(found[f"{topic}/texels"]) == len(recording.frames)
        for i, (time, cloud) in enumerate(found[f"{topic}/texels"]):
            stamp = cloud.header.stamp
            assert time == round(recording.times[i] * 1e9) == stamp.sec * 10**9 + stamp.nanosec
            assert cloud.header.frame_id == bake.manifests[sensor].body or bake.manifests[sensor].body == ""
            points = points_of(cloud)
            assert (cloud.height, cloud.width, cloud.row_step) == (1, len(texels), len(texels) * cloud.point_step)
            for name in ("normal_force", "depth", "slip", "reading"):
                assert np.array_equal(points[name], getattr(own, name)[i].astype(np.float32))
            assert np.array_equal(np.stack([points["shear_x"], points["shear_y"]], 1), own.shear[i].astype(np.float32))
            assert np.array_equal(np.stack([points[axis] for axis in "xyz"], 1), texels.position.astype(np.float32))
            assert np.array_equal(points["contact"].astype(bool), own.contact[i])
        for i, (_, image) in enumerate(found[f"{topic}/tactile_image"]):
            pixels = np.frombuffer(image.data.tobytes(), "<f4").reshape(image.height, image.width)
            assert image.encoding == "32FC1" and image.step == 4 * image.width
            assert np.array_equal(pixels[::-1], texels.layout.image(own.normal_force[i]).astype(np.float32))
        for i, (_, wrench) in enumerate(found[f"{topic}/wrench"]):
            assert [getattr(wrench.wrench.force, axis) for axis in "xyz"] == own.net_force[i].tolist()
            assert [getattr(wrench.wrench.torque, axis) for axis in "xyz"] == own.net_torque[i].tolist()
        for i, (_, place) in enumerate(found[f"{topic}/centre_of_pressure"]):
            assert [getattr(place.point, axis) for axis in "xyz"] == own.centre_of_pressure[i].tolist()


def test_poses_are_transforms_of_the_world(bake, tmp_path):
    (path,) = run_job(export(bake, "mcap", tmp_path / "out"))
    for i, (_, message) in enumerate(messages(path)["/tf"]):
        assert [one.child_frame_id for one in message.transforms] == list(bake.recording.body_names)
        for one, pose in zip(message.transforms, bake.recording.poses[i], strict=True):
            place, turn = one.transform.translation, one.transform.rotation
            assert one.header.frame_id == "world"
            assert [place.x, place.y, place.z, turn.w, turn.x, turn.y, turn.z] == pose.tolist()


def test_what_does_not_change_is_attached(bake, tmp_path):
    (path,) = run_job(export(bake, "mcap", tmp_path / "out"))
    with path.open("rb") as file:
        attached = {one.name: json.loads(one.data) for one in mcap_reader.make_reader(file).iter_attachments()}
    assert set(attached) == {"pad.json", "tip_1.json"} and attached["tip_1.json"]["sensor"] == "tip/1"
    assert attached["pad.json"]["normal"] == bake.texels["pad"].normal.tolist() and attached["pad.json"]["unit"] == "V"
    assert attached["pad.json"]["row"] == bake.texels["pad"].layout.row.tolist()


def test_equal_bakes_give_equal_bytes(bake, tmp_path):
    (one,) = run_job(export(bake, "mcap", tmp_path / "one"))
    (two,) = run_job(export(bake, "mcap", tmp_path / "two"))
    assert one.read_bytes() == two.read_bytes()


def test_topics_are_names_that_ros_allows_and_differ():
    assert topic_names(["Finger A", "Finger/A", "Finger__A", "1", "Äö"]) == {
        "Finger A": "/Finger_A",
        "Finger/A": "/Finger_A_2",
        "Finger__A": "/Finger_A_3",
        "1": "/sensor_1",
        "Äö": "/sensor_",
    }


def test_a_body_called_world_is_no_circle_of_frames(bake, tmp_path):
    recording = replace(bake.recording, body_names=("world", *bake.recording.body_names[1:]))
    (path,) = run_job(export(replace(bake, recording=recording), "mcap", tmp_path / "out"))
    _, message = messages(path)["/tf"][0]
    assert message.transforms[0].child_frame_id == "world_"


def test_without_the_package_one_sentence_says_how_to_get_it(bake, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    with pytest.raises(PalpateError, match="pip install mcap"):
        run_job(export(bake, "mcap", tmp_path / "out"))
