# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors from grids, meshes and files, and files for other simulators."""

from __future__ import annotations

import re

import numpy as np
import pytest
import trimesh

import palpate as pp


def test_a_grid_lies_about_the_origin_with_normals_up():
    pad = pp.Sensor.grid(14, 6, 4e-3, k=1000.0, mus=0.2)
    assert pad.texels.position.mean(axis=0) == pytest.approx([0, 0, 0], abs=1e-15)
    assert np.ptp(pad.texels.position, axis=0) == pytest.approx([5 * 4e-3, 13 * 4e-3, 0])
    assert (pad.texels.normal == [0, 0, 1]).all()
    assert pad.parameters.cn == pytest.approx(10.0)  # 1 % of k, as in rigs
    assert pad.parameters.mud == 0.2  # dynamic friction does not exceed static friction
    assert repr(pad) == "<Sensor 'pad': 14 × 6 texels, k 1000 N/m>"
    assert pad._repr_html_().count("<circle") == 84


def test_texels_are_spread_over_a_region():
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.02)
    top = ball.vertices[:, 2] > 0.01
    skin = pp.Sensor.from_mesh(ball, texels=84, region=top, name="skin")
    assert abs(len(skin.texels) - 84) <= 4
    assert skin.texels.position[:, 2].min() > 0.008
    assert len(skin.surface.vertices) == len(ball.vertices)
    whole = pp.Sensor.from_mesh((ball.vertices, ball.faces), region=np.flatnonzero(top), k=58.5)
    assert set(whole.texels.vertex) <= set(np.flatnonzero(top))


def test_a_mesh_from_a_file_gives_its_name(tmp_path):
    trimesh.creation.box((0.01, 0.01, 0.01)).export(tmp_path / "tip.stl")
    assert pp.Sensor.from_mesh(tmp_path / "tip.stl").name == "tip"
    assert repr(pp.Body.from_mesh(tmp_path / "tip.stl", mass=0.5)) == "<Body 'tip': 10 × 10 × 10 mm, free, 0.5 kg>"


def test_a_sensor_is_saved_and_read(tmp_path):
    pad = pp.Sensor.grid(7, 3, (3e-3, 4e-3), name="fingertip", k=321.5, unit="V", gain=0.2).with_effects("creep")
    pad.save(tmp_path / "sensor.toml")
    read = pp.read_sensor(tmp_path / "sensor.toml")
    assert (read.name, read.parameters, read.effects) == (pad.name, pad.parameters, pad.effects)
    assert read.texels.position == pytest.approx(pad.texels.position)
    pp.Sensor.from_mesh(trimesh.creation.icosphere(radius=0.01), k=2.0).save(tmp_path / "ball.toml")
    with pytest.raises(pp.PalpateError, match="does not say where the texels are"):
        pp.read_sensor(tmp_path / "ball.toml")


def test_an_unknown_format_and_a_missing_file_are_refused(tmp_path):
    with pytest.raises(pp.PalpateError, match="Sensors are not written as 'mjfc'"):
        pp.export_sensor(pp.Sensor.grid(4, 4, 1e-3), "mjfc", tmp_path)
    with pytest.raises(pp.PalpateError, match=r"There is no sensor '.*none\.toml'"):
        pp.read_sensor(tmp_path / "none.toml")


@pytest.mark.parametrize("body", [
    pp.Body.box(0.02), pp.Body.sphere(0.01), pp.Body.capsule(0.005, 0.01), pp.Body.plane(0.1),
], ids=lambda body: body.name)  # fmt: skip
def test_bodies_know_their_shape_and_press_with_it(body):
    """The mesh stands for it elsewhere; a moved body keeps its shape, and one of a mesh has none."""
    assert body.shape is not None
    assert body.moved([[0.0, 0.0, 0.0]]).shape == body.shape
    assert pp.Body.from_mesh((body.mesh.vertices, body.mesh.triangles)).shape is None
    half = {"box": 0.01, "sphere": 0.01, "capsule": 0.01, "plane": 0.0}[body.name]
    assert body.mesh.vertices[:, 2].max() == pytest.approx(half, abs=1e-9)
    level = np.array([1.0, 0.0, 0.0, 0.0]) if half else np.array([0.0, 1.0, 0.0, 0.0])
    pressed = pp.PressedSensor(pp.Sensor.grid(3, 3, pitch=1e-3), body, dt=1e-3)
    contact = pressed.step(([0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]), ([0.0, 0.0, half - 1e-4], level))
    assert contact.texels.depth.max() == pytest.approx(1e-4, abs=1e-12)


@pytest.mark.parametrize("made_at", [(0.0, 0.0, 0.0), (0.0, 0.0, 0.1)])
def test_a_pressed_sensor_begins_at_its_first_step_wherever_the_body_was_made(made_at):
    """A box 0.5 mm inside 90 of 100 texels of 1000 N/m: 45 N, at the first step and at the second."""
    pad, level = pp.Sensor.grid(10, 10, pitch=4e-3, k=1000.0), [1.0, 0.0, 0.0, 0.0]
    still, pose = ([0.0, 0.0, 0.0], level), ([0.01, 0.0, 0.0245], level)
    pressed = pp.PressedSensor(pad, pp.Body.box(0.05, position=made_at), 1e-3)
    for _ in range(2):
        assert pressed.step(still, pose).force_on_target == pytest.approx([0.0, 0.0, 45.0], abs=1e-9)
    joined = [np.concatenate(one) for one in (still, pose)]
    assert pp.PressedSensor(pad, pp.Body.box(0.05), 1e-3, *joined).step(*joined).force_on_target[2] == pytest.approx(45.0)
    many = pp.PressedSensors(pad, pp.Body.box(0.05), 1, 1e-3)
    pairs = [tuple(np.array([part]) for part in one) for one in (still, pose)]
    assert many.step(*pairs).wrench[0, 2] == pytest.approx(45.0)
    far = pp.PressedSensor(pad, pp.Body.box(0.05), 1e-3, still, ([0.0, 0.0, 0.1], level))
    with pytest.raises(pp.PalpateError, match="0.0762 m in 0.001 s, 76.2 m/s: give the poses at the start"):
        far.step(still, pose)


def balls(count):
    return trimesh.util.concatenate(
        [trimesh.creation.icosphere(2, 0.005).apply_translation((0.012 * i, 0.0, 0.0)) for i in range(count)]
    )


@pytest.mark.parametrize("texels", [10, 30, 35])
def test_texels_are_spread_over_every_island_with_the_normals_of_the_surface(texels):
    sensor = pp.Sensor.from_mesh(balls(10), texels=texels)
    place, normal = sensor.texels.position, sensor.texels.normal
    ball = np.round(place[:, 0] / 0.012)
    assert len(sensor.texels) == texels and set(ball) == set(range(10))
    radial = place - np.column_stack([0.012 * ball, 0.0 * ball, 0.0 * ball])
    radial /= np.linalg.norm(radial, axis=1)[:, None]
    assert (np.einsum("ij,ij->i", radial, normal) > 0.999).all()  # the facets deviate by 9 degrees


def test_both_sides_of_a_thin_plate_have_texels_and_their_own_normals():
    sensor = pp.Sensor.from_mesh(trimesh.creation.box((0.02, 0.02, 0.0005)), texels=40)
    side = np.sign(sensor.texels.position[:, 2])
    faces = np.abs(sensor.texels.normal[:, 2]) > 0.9
    assert (faces & (side > 0)).sum() >= 15 and (faces & (side < 0)).sum() >= 15
    assert np.allclose(sensor.texels.normal[faces, 2], side[faces])


def test_islands_that_get_no_texel_are_named():
    with pytest.warns(UserWarning, match=r"no texel on 7 islands of its surface, around \(.*\) and 4 more m: ask for more"):
        pp.Sensor.from_mesh(balls(10), texels=3)


def test_every_format_that_is_offered_is_written(tmp_path, repository):
    """The list of the docstring, the table of docs/simulators.md and the choices of the command are the same, and all work."""
    from palpate.core.simulators.sensor_format import written_formats

    offered = set(re.findall(r'"(\w+)"', pp.export_sensor.__doc__.partition("(docs/simulators.md)")[0]))
    page = (repository / "docs" / "simulators.md").read_text(encoding="utf-8")
    assert (
        offered
        == set(written_formats())
        == set(re.findall(r"^\| `(\w+)` \|", page.partition("## From other")[0], re.MULTILINE))
    )
    for kind in offered:
        assert pp.export_sensor(pp.Sensor.grid(3, 3, pitch=2e-3), kind, tmp_path / kind).files
