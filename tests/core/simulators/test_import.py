# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors of MJCF, URDF, probe lists and OpenRAVE's XML, also damaged and hostile ones."""

from __future__ import annotations

import numpy as np
import pytest
from exported_sensors import FLOAT32, ball, pad
from scipy.spatial.transform import Rotation

from palpate.core.errors import FileError, PalpateError, SensorError
from palpate.core.geometry.mesh import TriangleMesh, vertex_normals
from palpate.core.geometry.point_surface import triangles_between
from palpate.core.simulators.sensor_format import export_sensors, import_sensors

SENSORS = (pad(), pad(radius=0.02, name="Bent"), ball(painted=False))
TACTILE = """<mujoco><compiler angle="radian"/><asset>{mesh}</asset><worldbody><body pos="1 2 3" euler="0 0 1.5707963267948966">
<body pos="0.5 0 0"><geom name="g" type="mesh" mesh="m" quat="1 0 0 0" contype="0" conaffinity="0"/><geom size="0.01"/></body>
</body></worldbody>
<sensor><tactile name="skin" geom="g" mesh="m"/></sensor></mujoco>"""
MESH = '<mesh name="m" inertia="shell" vertex="0 0 0 1 0 0 0 1 0 1 1 0" face="0 1 3 0 3 2"/>'
GRID = """<mujoco><extension><plugin plugin="mujoco.sensor.touch_grid"/></extension><worldbody>
<site name="s" pos="0 0 1" size="0.01"/></worldbody><sensor>
<plugin name="touch" plugin="mujoco.sensor.touch_grid" objtype="site" objname="s">{config}</plugin></sensor></mujoco>"""
CONFIG = '<config key="size" value="7 5"/><config key="fov" value="45 30"/>'
CONFIG += '<config key="gamma" value="0.4"/><config key="nchannel" value="1"/>'
ROBOT = '<robot name="r"><link name="skin"/>{joints}</robot>'
JOINT = (
    '<link name="skin_sensor_{n}"/><joint name="j{n}" type="fixed"><origin xyz="{xyz}" rpy="0 0 0"/>{axis}'
    '<parent link="skin"/><child link="skin_sensor_{n}"/></joint>'
)


def read(folder, text, name="file.xml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return import_sensors(path)[1]


@pytest.mark.parametrize("kind", ["mjcf", "urdf", "probes", "usd"])
@pytest.mark.parametrize("item", SENSORS, ids=lambda item: item.name)
def test_what_was_written_is_read_back(item, kind, tmp_path):
    path = export_sensors([item], kind, tmp_path).files[1 if kind == "urdf" else 0]
    how, (found,) = import_sensors(path)
    assert how.name == kind
    texels = found.on_mesh().sensor.texels
    for name in ("position", "normal", "tangent"):
        assert getattr(texels, name) == pytest.approx(getattr(item.sensor.texels, name), abs=1e-9), name
    joined = TriangleMesh(found.position, found.faces)
    assert (np.einsum("ij,ij->i", vertex_normals(joined), found.normal) > 0.8).all()
    if kind in ("urdf", "usd"):
        assert len(found.surface.triangles) == len(item.mesh.triangles)
    if kind != "urdf":
        assert found.frame_position == pytest.approx(item.position, abs=1e-9)
        assert abs(found.frame_quaternion @ item.quaternion) == pytest.approx(1.0, abs=1e-9)
        if kind != "usd":  # it has points and no triangles between them
            assert sorted(map(sorted, found.faces.tolist())) == sorted(map(sorted, item.faces.tolist()))
    if kind in ("probes", "usd"):
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
    "no mesh": (TACTILE.format(mesh=""), "MuJoCo cannot compile .*mesh 'm' not found"),
    "no geom": (TACTILE.format(mesh=MESH).replace('geom="g"', 'geom="h"'), "unrecognized name 'h'"),
    "words": (TACTILE.format(mesh=MESH.replace("1 1 0", "1 one 0")), "bad format in attribute 'vertex'"),
    "NaN": (TACTILE.format(mesh=MESH.replace("1 1 0", "1 nan 0")), "is not finite"),
    "odd": (TACTILE.format(mesh=MESH.replace(" 1 1 0", " 1 1")), "must be a multiple of 3"),
    "a wrong face": (TACTILE.format(mesh=MESH.replace("0 3 2", "0 3 9")), "does not exist"),
    "half a face": (TACTILE.format(mesh=MESH.replace("0 3 2", "0 3")), "must be a multiple of 3"),
    "included": ("<mujocoinclude/>", "give the file that includes it"),
    "no file": (
        TACTILE.format(mesh='<mesh name="m" file="gone.stl"/>'),
        "Error opening file 'gone.stl'.*give the file that includes it, with its meshes",
    ),
    "no quaternion": (TACTILE.format(mesh=MESH).replace("1 0 0 0", "0 0 0 0"), "zero quaternion"),
    "deep": ("<mujoco><worldbody>" + "<body>" * 300 + "</body>" * 300 + "</worldbody></mujoco>", "nests more than"),
    "no site": (
        GRID.format(config=CONFIG).replace('objname="s"', 'objname="t"'),
        "unrecognized name 't'.*give the file that includes it",
    ),
    "no size": (GRID.format(config=""), "resolutions must be specified"),
    "one bin": (GRID.format(config=CONFIG.replace("7 5", "1 5")), "two each way"),
    "huge": (GRID.format(config=CONFIG.replace("7 5", "1e9 5")), "resolutions are too large"),
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


@pytest.mark.parametrize("size", ["0", "-1 0.1"])
def test_a_touch_grid_without_a_size_is_one_sentence(tmp_path, size):
    with pytest.raises(FileError, match="size 0 must be positive in"):
        read(tmp_path, GRID.format(config=CONFIG).replace('size="0.01"', f'size="{size}"'))


def test_a_texel_that_is_immeasurably_far_is_one_sentence():
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1e308, 1.0, 0.0]])
    with pytest.raises(SensorError, match="Texel 3 is immeasurably far"):
        triangles_between(points, np.tile([0.0, 0.0, 1.0], (4, 1)))


DEFAULTS = """<mujoco><compiler eulerseq="ZYX"/><default><site size="0.03"/><mesh scale="0.001 0.001 0.001"/>
<default class="fine"><site size="0.02" zaxis="0 1 0"/></default></default>
<extension><plugin plugin="mujoco.sensor.touch_grid"/></extension>
<asset><mesh name="m" inertia="shell" vertex="0 0 0 10 0 0 0 10 0 10 10 3" face="0 1 3 0 3 2"/></asset>
<worldbody><body name="finger" pos="0 0 0.1" euler="20 30 40" childclass="fine"><geom name="tip" type="capsule" size="0.01"
fromto="0 0 0 0.02 0.01 0"/><site name="fine"/><site name="coarse" class="main" euler="30 40 25"/></body></worldbody>
<sensor><tactile name="skin" geom="tip" mesh="m"/>{grids}</sensor></mujoco>"""


def test_defaults_classes_and_rotations_are_those_of_mujoco(tmp_path):
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo compiles the model: pip install mujoco")
    grids = "".join(
        GRID[GRID.index("<plugin name") : GRID.index("</sensor>")].replace('"touch"', f'"{name}"').replace('"s"', f'"{name}"')
        for name in ("fine", "coarse")
    ).format(config=CONFIG)
    text = DEFAULTS.format(grids=grids)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    found = {one.name: one for one in read(tmp_path, text)}
    for name in ("fine", "coarse"):
        site, turn = model.site(name), Rotation.from_quat(np.roll(found[name].frame_quaternion, -1)).as_matrix()
        assert np.linalg.norm(found[name].position, axis=1) == pytest.approx(np.full(35, site.size[0]))
        assert turn == pytest.approx(data.site(name).xmat.reshape(3, 3), abs=1e-12)
        assert found[name].frame_position == pytest.approx(data.site(name).xpos, abs=1e-15)
    skin, geom = found["skin"], data.geom("tip")
    turn = Rotation.from_quat(np.roll(skin.frame_quaternion, -1)).as_matrix()
    places = model.mesh_vert @ geom.xmat.reshape(3, 3).T + geom.xpos  # where MuJoCo's tactile sensor has its vertices
    assert skin.position @ turn.T + skin.frame_position == pytest.approx(places, abs=1e-8)
    assert np.ptp(skin.position, axis=0) == pytest.approx([0.01, 0.01, 0.003], abs=1e-12)


def test_included_files_are_read_and_a_part_alone_says_so(tmp_path):
    sensor = GRID[GRID.index("<sensor>") :].format(config=CONFIG)
    (tmp_path / "sensors.xml").write_text(f"<mujoco>{sensor}")
    (found,) = read(tmp_path, GRID[: GRID.index("<sensor>")] + '<include file="sensors.xml"/></mujoco>', "scene.xml")
    assert len(found.position) == 35
    with pytest.raises(FileError, match="unrecognized name 's'.*give the file that includes it"):
        import_sensors(tmp_path / "sensors.xml")


def test_a_touch_grid_by_an_instance_is_the_same(tmp_path):
    (plain,) = read(tmp_path, GRID.format(config=CONFIG))
    text = GRID.format(config="").replace('plugin="mujoco.sensor.touch_grid" objtype', 'instance="one" objtype')
    declared = f'<plugin plugin="mujoco.sensor.touch_grid"><instance name="one">{CONFIG}</instance></plugin>'
    (found,) = read(tmp_path, text.replace('<plugin plugin="mujoco.sensor.touch_grid"/>', declared))
    assert np.array_equal(found.position, plain.position)


@pytest.mark.parametrize(
    "name", ["skin_texel_{n}", "skin_taxel_{n}_link", "tip_taxel_0_{n}", "tactile_map_link{n}", "palm_sensor_pad_{n:03d}"]
)
def test_names_of_texels_as_robots_have_them(name, tmp_path):
    joints = "".join(
        JOINT.format(n=n, xyz=f"{0.001 * n} {0.001 * n * n} 0", axis="").replace(f"skin_sensor_{n}", name.format(n=n))
        for n in range(4)
    )
    (found,) = read(tmp_path, ROBOT.format(joints=joints), "hand.urdf")
    assert found.position[:, 0] == pytest.approx([0.0, 0.001, 0.002, 0.003])


def test_touch_sites_become_texels_out_of_the_surface_of_their_body(tmp_path):
    sites = "".join(
        f'<site name="{i}" size="0.002" pos="{x} {y} -0.01"/>' for i, (x, y) in enumerate([(0, 0), (5e-3, 0), (0, 6e-3)])
    )
    touch = "".join(f'<touch site="{i}"/>' for i in range(3))
    text = f"""<mujoco><worldbody><body name="finger" pos="1 0 0" euler="0 90 0"><geom size="0.01"/>{sites}</body></worldbody>
<sensor>{touch}</sensor></mujoco>"""
    (found,) = read(tmp_path, text)
    assert found.name == "finger" and found.frame_position == pytest.approx([1, 0, 0])
    assert found.position == pytest.approx(np.array([[0, 0, -0.01], [0.005, 0, -0.01], [0, 0.006, -0.01]]), abs=1e-15)
    radial = found.position / np.linalg.norm(found.position, axis=1)[:, None]
    assert np.einsum("ij,ij->i", radial, found.normal) == pytest.approx(np.ones(3), abs=1e-6)
    with pytest.raises(FileError, match="no <tactile>, <touch> on 2 sites and never on three of one body"):
        read(tmp_path, text.replace('<touch site="0"/>', ""))


def cap_of_urdf(count=10, radius=0.02, opening=0.4):
    """A patch of a sphere as links, whose frames say the normals; and its places."""
    angles = np.linspace(-opening, opening, count)
    a, b = (grid.ravel() for grid in np.meshgrid(angles, angles))
    out = np.stack([np.sin(a), np.sin(b) * np.cos(a), np.cos(a) * np.cos(b)], axis=1)
    joints = ""
    for number, (place, normal) in enumerate(zip(radius * out, out, strict=True)):
        turn = f"{np.arcsin(-normal[1])} {np.arctan2(normal[0], normal[2])} 0"
        xyz = " ".join(map(repr, place.tolist()))
        joints += JOINT.format(n=f"{number}_link", xyz=xyz, axis="").replace('rpy="0 0 0"', f'rpy="{turn}"')
    return ROBOT.format(joints=joints), out, radius * out


@pytest.mark.parametrize("count, depth", [(3, 0.004), (10, 0.001)])
def test_the_normals_of_a_file_are_kept_on_a_doubly_curved_patch(count, depth, tmp_path):
    import palpate as pp

    text, out, place = cap_of_urdf(count)
    path = tmp_path / "cap.urdf"
    path.write_text(text)
    sensor = pp.read_sensor(path)
    assert sensor.texels.normal == pytest.approx(out, abs=1e-12) and sensor.texels.position == pytest.approx(place, abs=1e-15)
    box, level = pp.Body.box((0.06, 0.06, 0.02)), [1.0, 0.0, 0.0, 0.0]
    pose = ([0.0, 0.0, 0.02 - depth + 0.01], level)
    read_out = pp.PressedSensor(sensor, box, 1e-3, ([0, 0, 0], level), pose).step(([0, 0, 0], level), pose)
    within = np.clip(place[:, 2] - (0.02 - depth), 0.0, None).sum()
    assert read_out.texels.normal_force.sum() == pytest.approx(sensor.parameters.k * within, rel=1e-9)


TACTILE_TAGS = """<robot name="glove" xmlns="http://www.ros.org"><link name="palm"/>
<sensor name="skin"><parent link="palm"/><origin xyz="0 0 0.02" rpy="0 0 1.5707963267948966"/><tactile channel="data">
<array rows="4" cols="3" size="0.005 0.004" spacing="0.006 0.005" offset="0.001 0" order="{order}"/></tactile></sensor>
<sensor name="tips"><parent link="palm"/><tactile>{taxels}</tactile></sensor></robot>"""


@pytest.mark.parametrize("order", ["row-major", "column-major"])
def test_tactile_sensors_of_urdf_tactile_are_read(order, tmp_path):
    """Places as taxel_info_iterator.cpp of urdf_tactile computes them, in the frame of the link."""
    taxels = "".join(
        f'<taxel idx="{i}" xyz="{xyz}" rpy="0 1.5707963267948966 0"/>' for i, xyz in ((2, "0 0 1"), (0, "0 0 0"), (1, "0 1 0"))
    )
    skin, tips = read(tmp_path, TACTILE_TAGS.format(order=order, taxels=taxels), "glove.urdf")
    number = np.arange(12)
    row, column = (number // 3, number % 3) if order == "row-major" else (number % 4, number // 4)
    x, y = row * 0.006 - 0.001, column * 0.005
    assert skin.position == pytest.approx(np.stack([-y, x, 0.0 * x + 0.02], axis=1), abs=1e-15)
    assert skin.normal == pytest.approx(np.tile([0.0, 0.0, 1.0], (12, 1)), abs=1e-15)
    assert tips.position.tolist() == [[0, 0, 0], [0, 1, 0], [0, 0, 1]]
    assert tips.normal == pytest.approx(np.tile([1.0, 0.0, 0.0], (3, 1)), abs=1e-15)


def test_the_mesh_of_a_link_is_scaled_and_placed_as_its_urdf_says(tmp_path):
    import trimesh

    trimesh.creation.box((10.0, 20.0, 30.0)).export(tmp_path / "box.stl")
    link = """<link name="skin"><visual><origin xyz="0.1 0 0" rpy="0 0 1.5707963267948966"/><geometry>
<mesh filename="package://hand/box.stl" scale="0.001 0.001 0.001"/></geometry></visual></link>"""
    folder = tmp_path / "hand" / "urdf"
    folder.mkdir(parents=True)
    (tmp_path / "box.stl").rename(tmp_path / "hand" / "box.stl")
    (found,) = read(folder, ROBOT.format(joints=JOINTS).replace('<link name="skin"/>', link), "hand.urdf")
    assert np.ptp(found.surface.vertices, axis=0) == pytest.approx([0.02, 0.01, 0.03], abs=FLOAT32)
    assert found.surface.vertices.mean(axis=0) == pytest.approx([0.1, 0.0, 0.0], abs=FLOAT32)


def test_a_sensor_of_thirty_metres_is_refused_with_the_unit_that_makes_sense(tmp_path):
    import palpate as pp

    path = tmp_path / "skin.urdf"
    path.write_text(ROBOT.format(joints=JOINTS))
    with pytest.raises(SensorError, match="would be 9 m across, and lengths are metres: are its coordinates in millimetres"):
        pp.read_sensor(path)


def test_a_missing_package_is_one_sentence(tmp_path, monkeypatch):
    import sys

    for name, text in (("mujoco", GRID.format(config=CONFIG)), ("yourdfpy", ROBOT.format(joints=JOINTS))):
        monkeypatch.setitem(sys.modules, name, None)
        with pytest.raises(PalpateError, match=f"needs the package {name}, which is not installed: run 'pip install {name}'"):
            read(tmp_path, text)


def test_a_place_that_is_no_number_is_one_sentence(tmp_path):
    """MuJoCo compiles it all the same."""
    pytest.importorskip("mujoco", reason="MuJoCo reads the MJCF: pip install mujoco")
    with pytest.raises(FileError, match="The frame position of sensor '.*' in '.*' is NaN or infinite"):
        read(tmp_path, GRID.format(config=CONFIG).replace('pos="0 0 1"', 'pos="nan 0 1"'))
