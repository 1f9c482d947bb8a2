# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of other programs' sensors that ``palpate sensor import`` reads, damaged. GenTact's .blend files are not among them."""

from __future__ import annotations

import json
import tempfile
from functools import cache, partial
from pathlib import Path

import numpy as np
from hypothesis import strategies as st

from palpate.core.geometry.mesh import TriangleMesh
from palpate.core.geometry.sampling.texel_arrays import pad_array
from palpate.core.geometry.texels import texels_from_region
from palpate.core.io.openrave import OpenRaveSensor, openrave_xml
from palpate.core.model.sensor import Sensor
from palpate.core.model.sensor_parameters import SensorParameters
from palpate.core.simulators.registry import export_sensors, import_sensors
from palpate.core.simulators.sensor_on_mesh import SensorOnMesh

from .damaged_files import PLY, Files, Reader, damaged_bytes, damaged_tree

TOUCH_GRID = """<mujoco><extension><plugin plugin="mujoco.sensor.touch_grid"/></extension><worldbody><body pos="0 0 0.1">
<site name="pad" size="0.01" euler="0 90 0"/></body></worldbody><sensor><plugin name="grid" plugin="mujoco.sensor.touch_grid"
objtype="site" objname="pad"><config key="size" value="4 3"/><config key="fov" value="20 15"/><config key="gamma" value="0"/>
</plugin></sensor></mujoco>"""
MESH_FILE = """<mujoco><compiler meshdir="meshes"/><asset><mesh name="m" file="m.ply" scale="1 1 2"/></asset><worldbody>
<body pos="0.5 0 0" quat="1 0 0 1"><geom name="g" type="mesh" mesh="m"/></body></worldbody><sensor>
<tactile name="skin" geom="g" mesh="m"/></sensor></mujoco>"""
NUMBERS = ["nan", "inf", "-1e308", "1e999", "0", "-1", "1e-320", "9" * 400, "", "x", "1 2", "0x10"]


@cache
def exported(kind: str, ending: str) -> Files:
    """The files of a small exported pad by name, those with the sensor first."""
    array = pad_array(3, 2, (0.003, 0.003), 0.0)
    faces = [(face[0], face[i], face[i + 1]) for face in array.faces for i in range(1, len(face) - 1)]
    mesh = TriangleMesh(array.vertices, np.array(faces), np.array(array.faces))
    texels = texels_from_region(mesh, np.ones(len(mesh.vertices), bool))
    item = SensorOnMesh(Sensor("Pad", 0, texels, SensorParameters()), mesh)
    with tempfile.TemporaryDirectory() as folder:
        export_sensors([item], kind, folder)
        found = {path.name: path.read_bytes() for path in Path(folder).iterdir() if path.is_file()}
    return {name: found[name] for name in sorted(found, key=lambda name: not name.endswith(ending))}


@st.composite
def damaged_xml(draw, content):
    """Change an attribute's number, remove or repeat an element, or damage bytes."""
    if draw(st.integers(0, 2)) == 0:
        return draw(damaged_bytes(content))
    text = content.decode()
    for _ in range(draw(st.integers(1, 3))):
        parts = text.split('"')
        place = draw(st.integers(0, max((len(parts) - 1) // 2 - 1, 0))) * 2 + 1
        if place >= len(parts):
            break
        words = parts[place].split() or [""]
        what = draw(st.sampled_from(["word", "word", "all", "drop", "twice", "swap"]))
        if what == "word":
            words[draw(st.integers(0, len(words) - 1))] = draw(st.sampled_from(NUMBERS))
        elif what == "drop":
            words.pop()
        elif what == "twice":
            words += words
        parts[place] = " ".join(words) if what != "all" else draw(st.text(max_size=6)).replace('"', "")
        if what == "swap":
            parts[place] = draw(st.sampled_from(parts[1::2]))
        text = '"'.join(parts)
    return text.encode("utf-8", "replace")


def read(name: str, folder: Path) -> None:
    _, found = import_sensors(folder / name)
    assert found, "no sensor and no sentence"
    for sensor in found:
        for field, value in vars(sensor).items():
            if isinstance(value, np.ndarray) and value.dtype.kind == "f":
                assert np.isfinite(value).all(), f"{field} is not finite"


def _files(files: Files, damaged: st.SearchStrategy[bytes], name: str) -> st.SearchStrategy[Files]:
    return damaged.map(lambda content: {**files, name: content})


@cache
def readers() -> dict[str, Reader]:
    """Return all readers by name."""
    mjcf, urdf, probes = exported("mjcf", ".xml"), exported("urdf", ".urdf"), exported("probes", ".json")
    robot = openrave_xml([OpenRaveSensor("T1", "finger", SensorParameters())], "hand").encode()
    with_mesh = {"log.xml": MESH_FILE.encode(), "meshes/m.ply": PLY.encode()}
    tree = json.loads(probes["Pad.json"])
    lists = st.one_of(damaged_tree(tree).map(lambda table: json.dumps(table).encode()), damaged_bytes(probes["Pad.json"]))
    found = [
        Reader("sensor: MJCF", _files(mjcf, damaged_xml(mjcf["Pad.xml"]), "Pad.xml"), partial(read, "Pad.xml")),
        Reader("sensor: touch_grid", _files({}, damaged_xml(TOUCH_GRID.encode()), "grid.xml"), partial(read, "grid.xml")),
        Reader(
            "sensor: MJCF and mesh", _files(with_mesh, damaged_xml(MESH_FILE.encode()), "log.xml"), partial(read, "log.xml")
        ),
        Reader("sensor: mesh", _files(with_mesh, damaged_bytes(PLY.encode()), "meshes/m.ply"), partial(read, "log.xml")),
        Reader("sensor: URDF", _files(urdf, damaged_xml(urdf["Pad.urdf"]), "Pad.urdf"), partial(read, "Pad.urdf")),
        Reader("sensor: probe list", _files({}, lists, "Pad.json"), partial(read, "Pad.json")),
        Reader("sensor: OpenRAVE", _files({}, damaged_xml(robot), "hand.xml"), partial(read, "hand.xml")),
    ]
    return {reader.name: reader for reader in found}
