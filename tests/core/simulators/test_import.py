# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors of MJCF, URDF, probe lists and OpenRAVE's XML, also damaged and hostile ones."""

from __future__ import annotations

import numpy as np
import pytest
from bad_files import TOUCH_GRID
from exported_sensors import FLOAT32, ball, pad
from scipy.spatial.transform import Rotation

from palpate.core.errors import FileError, PalpateError, SensorError
from palpate.core.geometry.mesh import TriangleMesh, vertex_normals
from palpate.core.geometry.point_surface import triangles_between
from palpate.core.simulators.registry import export_sensors, import_sensors

SENSORS = (pad(), pad(radius=0.02, name="Bent"), ball(painted=False))
TACTILE = """<mujoco><compiler angle="radian"/><asset>{mesh}</asset><worldbody><body pos="1 2 3" euler="0 0 1.5707963267948966">
<body pos="0.5 0 0"><geom name="g" type="mesh" mesh="m" quat="1 0 0 0"/></body></body></worldbody>
<sensor><tactile name="skin" geom="g" mesh="m"/></sensor></mujoco>"""
MESH = '<mesh name="m" vertex="0 0 0 1 0 0 0 1 0 1 1 0" face="0 1 3 0 3 2"/>'
GRID = """<mujoco><worldbody><site name="s" pos="0 0 1" size="0.01"/></worldbody><sensor><plugin name="touch"
plugin="mujoco.sensor.touch_grid" objtype="site" objname="s">{config}</plugin></sensor></mujoco>"""
CONFIG = '<config key="size" value="7 5"/><config key="fov" value="45 30"/><config key="gamma" value="0.4"/>'
ROBOT = '<robot name="r"><link name="skin"/>{joints}</robot>'
JOINT = (
    '<link name="skin_sensor_{n}"/><joint name="j{n}" type="fixed"><origin xyz="{xyz}" rpy="0 0 0"/>{axis}'
    '<parent link="skin"/><child link="skin_sensor_{n}"/></joint>'
)


def read(folder, text, name="file.xml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return import_sensors(path)[1]


@pytest.mark.parametrize("kind", ["mjcf", "urdf", "probes"])
@pytest.mark.parametrize("item", SENSORS, ids=lambda item: item.name)
def test_what_was_written_is_read_back(item, kind, tmp_path):
    path = export_sensors([item], kind, tmp_path).files[1 if kind == "urdf" else 0]
    how, (found,) = import_sensors(path)
    assert how.name == kind
    assert found.position == pytest.approx(item.sensor.texels.position, abs=1e-9)
    assert found.normal == pytest.approx(item.sensor.texels.normal, abs=1e-8)
    joined = TriangleMesh(found.position, found.faces)
    assert (np.einsum("ij,ij->i", vertex_normals(joined), found.normal) > 0.8).all()
    if kind == "urdf":
        assert len(found.surface.triangles) == len(item.mesh.triangles)
    else:
        assert found.frame_position == pytest.approx(item.position, abs=1e-9)
        assert abs(found.frame_quaternion @ item.quaternion) == pytest.approx(1.0, abs=1e-9)
        assert sorted(map(sorted, found.faces.tolist())) == sorted(map(sorted, item.faces.tolist()))
    if kind == "probes":
        assert found.parameters == item.sensor.parameters


def test_a_tactile_is_placed_through_its_bodies(tmp_path):
    (found,) = read(tmp_path, TACTILE.format(mesh=MESH))
    assert found.name == "skin" and len(found.position) == 4
    assert found.frame_position == pytest.approx([1.0, 2.5, 3.0])
    assert Rotation.from_quat(np.roll(found.frame_quaternion, -1)).as_rotvec() == pytest.approx([0, 0, np.pi / 2])
    assert any("contact and joints were not imported" in note for note in found.notes)


def test_a_touch_grid_has_its_bins_where_mujoco_puts_a_contact(tmp_path):
    """Each texel's direction, given to the formulas of touch_grid.cc, falls into the bin of its row and column."""
    (found,) = read(tmp_path, GRID.format(config=CONFIG))
    x, y, z = found.position.T
    azimuth, elevation = np.arctan2(x, -z), np.arctan2(y, np.hypot(x, z))
    for values, index, count, fov in ((azimuth, found.column, 7, 45.0), (elevation, found.row, 5, 30.0)):
        edges = np.linspace(-1, 1, count + 1)
        edges = np.radians(fov) * (0.4 * edges**5 + 0.6 * edges)
        assert np.array_equal(np.searchsorted(edges, values) - 1, index)
    assert np.linalg.norm(found.position, axis=1) == pytest.approx(np.full(35, 0.01))
    out = vertex_normals(TriangleMesh(found.position, found.faces))
    assert (np.einsum("ij,ij->i", out, found.normal) > 0.9).all()


def test_gentacts_urdf_has_its_normals_as_axes(tmp_path):
    """Numbers are in the names, in no order; `axis` counts and not the frame."""
    places = {10: "0 0 0.1", 2: "0.01 0 0.1", 1: "0 0.01 0.1"}
    joints = "".join(JOINT.format(n=n, xyz=xyz, axis='<axis xyz="0 0 -2"/>') for n, xyz in places.items())
    (found,) = read(tmp_path, ROBOT.format(joints=joints), "skin.urdf")
    assert found.position.tolist() == [[0, 0.01, 0.1], [0.01, 0, 0.1], [0, 0, 0.1]]
    assert found.normal.tolist() == [[0, 0, -1]] * 3
    assert any("no mesh of its own" in note for note in found.notes) and any(
        "axes of the joints" in note for note in found.notes
    )


def test_openraves_xml_gives_parameters(tmp_path):
    text = '<AttachedSensor><link>Finger</link><sensor type="SimTactileSensor"><k>70</k></sensor></AttachedSensor>'
    (found,) = read(tmp_path, text)
    assert (found.name, found.position, found.parameters.k) == ("Finger", None, 70.0)


JOINTS = "".join(JOINT.format(n=n, xyz=f"{n} {n * n} 0", axis="") for n in range(4))
BROKEN = {
    "an entity": ('<!DOCTYPE r [<!ENTITY a "b">]><mujoco>&a;</mujoco>', "declares XML entities"),
    "UTF-16": ("<mujoco/>".encode("utf-16").decode("latin-1"), "not in UTF-8"),
    "no XML": ("<mujoco><sensor>", "is not XML"),
    "nothing": ("<mujoco/>", "has no <tactile>"),
    "another root": ("<sdf/>", "holds no sensor that can be read"),
    "no mesh": (TACTILE.format(mesh=""), "names the mesh 'm', which is not there"),
    "no geom": (TACTILE.format(mesh=MESH).replace('geom="g"', 'geom="h"'), "names the geom 'h'"),
    "words": (TACTILE.format(mesh=MESH.replace("1 1 0", "1 one 0")), "are not numbers"),
    "NaN": (TACTILE.format(mesh=MESH.replace("1 1 0", "1 nan 0")), "NaN or infinite"),
    "odd": (TACTILE.format(mesh=MESH.replace(" 1 1 0", " 1 1")), "11 coordinates"),
    "a wrong face": (TACTILE.format(mesh=MESH.replace("0 3 2", "0 3 9")), "does not exist"),
    "half a face": (TACTILE.format(mesh=MESH.replace("0 3 2", "0 3")), "not triples"),
    "built in": (TACTILE.format(mesh='<mesh name="m" builtin="plate" params="3 3"/>'), "made by MuJoCo"),
    "no file": (TACTILE.format(mesh='<mesh name="m" file="gone.stl"/>'), "no mesh file"),
    "no quaternion": (TACTILE.format(mesh=MESH).replace("1 0 0 0", "0 0 0 0"), "rotation of <geom>"),
    "deep": ("<mujoco><worldbody>" + "<body>" * 300 + "</body>" * 300 + "</worldbody></mujoco>", "nests more than"),
    "no site": (GRID.format(config=CONFIG).replace('objname="s"', 'objname="t"'), "names the site 't'"),
    "no size": (GRID.format(config=""), 'no <config key="size">'),
    "one bin": (GRID.format(config=CONFIG.replace("7 5", "1 5")), "two each way"),
    "huge": (GRID.format(config=CONFIG.replace("7 5", "1e9 5")), "two each way"),
    "two texels": (ROBOT.format(joints=JOINTS[: JOINTS.index('<link name="skin_sensor_2"')]), "three or more texels"),
    "one place": (ROBOT.format(joints=JOINTS.replace("3 9 0", "2 4 0")), "at the same place"),
    "zero axis": (ROBOT.format(joints=JOINTS.replace("<parent", '<axis xyz="0 0 0"/><parent')), "is zero"),
    "xacro": ('<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:x/></robot>', "run xacro on it"),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_broken_and_hostile_files_are_one_sentence(kind, tmp_path):
    text, says = BROKEN[kind]
    path = tmp_path / "file.xml"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(PalpateError, match=says) as caught:
        import_sensors(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["gone.xml", "gone.json", "gone.urdf", "a\0b.xml"])
def test_files_that_are_not_there_are_one_sentence(name, tmp_path):
    with pytest.raises(FileError):
        import_sensors(f"{tmp_path}/{name}")


def test_a_mesh_beside_the_file_is_read(tmp_path):
    import trimesh

    trimesh.creation.icosphere(subdivisions=1, radius=0.5).export(tmp_path / "ball.stl")
    (found,) = read(tmp_path, TACTILE.format(mesh='<mesh name="m" file="ball.stl" scale="0.1 0.1 0.1"/>'))
    assert len(found.position) == 42
    assert np.linalg.norm(found.position, axis=1) == pytest.approx(np.full(42, 0.05), abs=FLOAT32)


@pytest.mark.parametrize("size", ["", "0", "-1 0.1"])
def test_a_touch_grid_without_a_size_is_one_sentence(tmp_path, size):
    path = tmp_path / "grid.xml"
    path.write_text(TOUCH_GRID.replace('size="0.01"', f'size="{size}"'))
    with pytest.raises(FileError, match="'grid' in '.*' has no size above zero"):
        import_sensors(path)


def test_a_texel_that_is_immeasurably_far_is_one_sentence():
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1e308, 1.0, 0.0]])
    with pytest.raises(SensorError, match="Texel 3 is immeasurably far"):
        triangles_between(points, np.tile([0.0, 0.0, 1.0], (4, 1)))
