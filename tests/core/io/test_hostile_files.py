# SPDX-License-Identifier: GPL-3.0-or-later
"""Every reader of files, fuzzed with the structure of its format in mind: only a PalpateError ever comes out."""

import copy
import io
import json
import os
import tempfile
import warnings
from dataclasses import asdict
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st

from palpate.attack.sample_bake import grid_texels, recording_of, round_texels, write_sensor
from palpate.core.errors import PalpateError
from palpate.core.gap.calibration.friction import read_friction
from palpate.core.gap.calibration.stiffness import read_foam
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.io import exr_codec, exr_library, tactile_exr
from palpate.core.io.bake_folder import read_manifest
from palpate.core.io.bake_reader import read_bake
from palpate.core.io.csv_table import read_table
from palpate.core.io.openrave import OpenRaveSensor, openrave_xml, read_openrave
from palpate.core.io.recording_npz import load_recording
from palpate.core.io.sensor_npz import load_sensor
from palpate.core.io.sensor_toml import FORMAT, read_sensor
from palpate.core.model.sensor_parameters import Painted, SensorParameters

EXAMPLES = int(os.environ.get("PALPATE_EXAMPLES", "150"))
"""Tries per reader."""

fuzzed = settings(
    max_examples=EXAMPLES,
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.large_base_example],
)

# --- how files are damaged

NUMBERS = [0, -1, 1, 3, 65537, 2**31, 2**63, 10**40, 10**400, -0.5, 1e-320, 1e300, 1.7e308, np.inf, -np.inf, np.nan]
TEXTS = ["", " ", "\0", "a\0b", "\n", "../../etc/passwd", "/dev/zero", "A" * 5000, "\u202e", "=cmd|' /C calc'!A0", "nan", "N"]
plain = st.one_of(st.sampled_from(NUMBERS), st.sampled_from(TEXTS), st.booleans(), st.none(), st.text(max_size=5))
anything = st.recursive(
    plain, lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=4), inner, max_size=3))
)


def places(tree, above=()):
    """Yield the path of everything inside of a tree of dictionaries and lists."""
    items = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    for key, value in items:
        yield (*above, key)
        yield from places(value, (*above, key))


@st.composite
def damaged_tree(draw, tree):
    """Change, remove, copy or add one to three things in a tree of dictionaries and lists."""
    tree = copy.deepcopy(tree)
    for _ in range(draw(st.integers(1, 3))):
        *above, key = draw(st.sampled_from(list(places(tree)) or [("x",)]))
        inner = tree
        for step in above:
            inner = inner[step]
        what = draw(st.sampled_from(["change", "change", "change", "remove", "swap", "add"]))
        if what == "remove" and key in (inner if isinstance(inner, dict) else range(len(inner))):
            del inner[key]
        elif what == "add" and isinstance(inner, dict):
            inner[draw(st.text(max_size=6))] = draw(anything)
        elif what == "swap" and isinstance(inner, dict):
            inner[key] = inner[draw(st.sampled_from(sorted(inner)))]
        else:
            inner[key] = draw(anything)
    return tree


@st.composite
def damaged_bytes(draw, content):
    """Cut, overwrite, repeat or flip pieces of a file."""
    content = bytearray(content)
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, max(len(content) - 1, 0)))
        what = draw(st.sampled_from(["flip", "overwrite", "cut", "repeat", "remove"]))
        if what == "flip" and content:
            content[at] ^= 1 << draw(st.integers(0, 7))
        elif what == "overwrite":
            content[at : at + 4] = draw(st.sampled_from([b"\0\0\0\0", b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0\0\0\x80"]))
        elif what == "cut":
            del content[at:]
        elif what == "repeat":
            content[at:at] = content[at : at + 40]
        else:
            del content[at : at + draw(st.integers(1, 40))]
    return bytes(content)


@st.composite
def damaged_array(draw, array):
    """Another type, shape or value."""
    array = np.array(array)
    what = draw(st.sampled_from(["value", "type", "shape", "other"]))
    if what == "value" and array.size and array.dtype.kind in "fiu":
        array.flat[draw(st.integers(0, array.size - 1))] = draw(st.sampled_from([0, 1, -1, 7, 99, 2**31 - 1]))
    if what == "value" and array.size and array.dtype.kind == "f":
        array.flat[draw(st.integers(0, array.size - 1))] = draw(st.sampled_from([np.nan, np.inf, 1e308, -1e-320]))
    if what == "type":
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                array = array.astype(draw(st.sampled_from(["?", "i1", "u8", "f2", "f4", "c16", "U3", "S2", "M8[s]", ">f8"])))
            except ValueError:
                array = np.zeros(array.shape, "U1")
    if what == "shape":
        shape = draw(st.sampled_from(["drop", "axis", "flat", "empty", "scalar", "twice", "transposed"]))
        array = {
            "drop": array[:-1] if array.ndim else array,
            "axis": array[..., None],
            "flat": array.ravel(),
            "empty": array[:0] if array.ndim else array,
            "scalar": array.ravel()[0] if array.size else np.array(0),
            "twice": np.concatenate([array, array]) if array.ndim else array,
            "transposed": array.T,
        }[shape]
    if what == "other":
        array = np.array(draw(st.sampled_from([0, 1.5, "text", True, -3])))
    return array


@st.composite
def damaged_archive(draw, content):
    """An .npz with one to three arrays changed, removed or exchanged, or with damaged bytes."""
    if draw(st.integers(0, 3)) == 0:
        return draw(damaged_bytes(content))
    with np.load(io.BytesIO(content)) as members:
        arrays = {name: members[name] for name in members.files}
    for _ in range(draw(st.integers(1, 3))):
        name = draw(st.sampled_from(sorted(arrays)))
        what = draw(st.sampled_from(["change", "change", "change", "remove", "exchange"]))
        if name == "header" and what == "change":
            try:
                header = json.loads(str(arrays[name]))
            except ValueError:
                continue
            arrays[name] = np.array(json.dumps(draw(damaged_tree(header))))
        elif what == "change":
            arrays[name] = draw(damaged_array(arrays[name]))
        elif what == "remove" and len(arrays) > 1:
            del arrays[name]
        else:
            arrays[name] = arrays[draw(st.sampled_from(sorted(arrays)))]
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


def assert_clear_errors(read, *arguments):
    """Call a reader: it returns, or raises a PalpateError of one line."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return read(*arguments)
    except PalpateError as error:
        assert str(error).strip() and len(str(error)) < 20_000
    return None


def assert_content_is_clear(read, name, content):
    """Let a reader read a file of some content."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(content)
        return assert_clear_errors(read, path)


# --- TOML: rigs and sensors

SENSOR = {
    "format": FORMAT,
    "name": "pad",
    "sensor": {
        **{key: value for key, value in asdict(SensorParameters()).items()},
        "grid": {"rows": 3, "columns": 2, "pitch": [0.003, 0.004]},
        "thickness": 0.006,
    },
    "effect": [{"name": "creep", "form": "exponential", "amount": 0.2, "time": 1.7}, {"name": "noise", "seed": 3}],
}
RIG = {
    "format": "palpate-rig/1",
    "name": "small",
    "sensor": {"grid": {"rows": 1, "columns": 2, "pitch": 0.003}, "k": 80.0, "thickness": 0.006},
    "indenter": {"shape": {"box": [0.01, 0.01, 0.01]}},
    "trial": [{"file": "a.csv"}, {"file": "b.csv", "use": "check"}],
}
TABLE = "time,x,y,z,texel_0,texel_1,force_z\n" + "".join(
    f"{0.02 * i:.2f},0,0,{0.006 - 0.0001 * i:.4f},{0.1 * i:.1f},{0.2 * i:.1f},{-0.3 * i:.1f}\n" for i in range(12)
)


def toml_bytes(table):
    """A table as TOML; what TOML cannot say becomes text."""

    def clean(value):
        if isinstance(value, dict):
            return {str(key): clean(inner) for key, inner in value.items()}
        if isinstance(value, list):
            return [clean(inner) for inner in value]
        return "none" if value is None else value

    return tomli_w.dumps(clean(table)).encode("utf-8", "replace")


@seed(1)
@fuzzed
@given(st.one_of(damaged_tree(SENSOR).map(toml_bytes), damaged_bytes(toml_bytes(SENSOR))))
def test_sensors_as_toml(content):
    assert_content_is_clear(read_sensor, "sensor.toml", content)


@seed(2)
@fuzzed
@given(
    st.one_of(damaged_tree(RIG).map(toml_bytes), damaged_bytes(toml_bytes(RIG))),
    st.one_of(st.just(TABLE.encode()), damaged_bytes(TABLE.encode())),
)
def test_rigs(content, table):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rig.toml"
        path.write_bytes(content)
        (Path(folder) / "a.csv").write_bytes(table)
        (Path(folder) / "b.csv").write_text(TABLE)
        assert_clear_errors(read_rig, path)


# --- tables

CELLS = st.one_of(
    st.sampled_from(["", "0", "1e308", "-1e400", "nan", "inf", '"', '""', "1_0", "٣", "=1+1", "\0", "0x10", "1,5"])
)
FOAM = "compression (mm);force [N];mass_g\n# typed\n0.1;1;2\n0.2;2;3\n0.4;3;4\n"


@st.composite
def damaged_table(draw, text, separator):
    """Change cells of a table, or its bytes."""
    if draw(st.booleans()):
        return draw(damaged_bytes(text.encode()))
    rows = [line.split(separator) for line in text.splitlines()]
    for _ in range(draw(st.integers(1, 4))):
        row = draw(st.sampled_from(rows))
        row[draw(st.integers(0, len(row) - 1))] = draw(CELLS)
    return "\n".join(separator.join(row) for row in rows).encode()


@seed(3)
@fuzzed
@given(damaged_table(TABLE, ","))
def test_recorded_tables(content):
    found = assert_content_is_clear(read_table, "table.csv", content)
    assert found is None or not np.isinf(found.values).any()


@seed(4)
@fuzzed
@given(damaged_table(FOAM, ";"), st.sampled_from([0.001, None, 0.0, np.nan, np.inf]))
def test_typed_tables(content, area):
    assert_content_is_clear(lambda path: read_foam(path, area), "foam.csv", content)
    assert_content_is_clear(read_friction, "slide.csv", content.replace(b"compression (mm)", b"velocity_mm/s"))


# --- OpenRAVE

XML = openrave_xml(
    [OpenRaveSensor("T1", "finger", SensorParameters()), OpenRaveSensor("T2", "tip", SensorParameters())], "hand"
)


@seed(5)
@fuzzed
@given(
    st.one_of(
        damaged_bytes(XML.encode()),
        st.tuples(
            st.sampled_from(["58.5", "T1", "SimTactileSensor", "thickness", "AttachedSensor", "finger"]), st.text(max_size=8)
        ).map(lambda change: XML.replace(*change).encode("utf-8", "replace")),
        st.tuples(st.sampled_from(["0.0583", "0.435"]), st.sampled_from(NUMBERS)).map(
            lambda change: XML.replace(change[0], str(change[1])).encode()
        ),
    )
)
def test_openrave(content):
    assert_content_is_clear(read_openrave, "robot.xml", content)


# --- bakes


@cache
def bake_files(kind):
    """The files of a sensor's bake, by name."""
    texels = grid_texels() if kind == "grid" else round_texels()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_sensor(folder, "pad", texels, Painted(k=np.ones(len(texels))))
        return {path.name: path.read_bytes() for path in (folder / "pad").iterdir()}


def assert_bake_is_clear(files):
    """Read a bake of one sensor from its files; what is believed can be drawn."""
    with tempfile.TemporaryDirectory() as name:
        own = Path(name) / "bake" / "pad"
        own.mkdir(parents=True)
        for file, content in files.items():
            (own / file).write_bytes(content)
        for read, path in ((read_manifest, own), (load_recording, own / "recording.npz"), (load_sensor, own / "sensor.npz")):
            assert_clear_errors(read, path)
        bake = assert_clear_errors(read_bake, own.parent)
    if bake is not None:
        readings = bake.recording.sensors["pad"].normal_force
        assert np.isfinite(bake.texels["pad"].layout.image(readings[-1])).all()
        assert bake.texels["pad"].layout.uv().shape == (len(bake.texels["pad"]), 2)
    return bake


@pytest.mark.parametrize("kind", ["grid", "uv"])
def test_the_undamaged_bake_is_read(kind):
    assert assert_bake_is_clear(bake_files(kind)) is not None


@seed(6)
@fuzzed
@given(st.data())
def test_manifests(data):
    content = bake_files("grid")["manifest.json"]
    tree = damaged_tree(json.loads(content)).map(lambda table: json.dumps(table).encode())
    assert_bake_is_clear({**bake_files("grid"), "manifest.json": data.draw(st.one_of(tree, damaged_bytes(content)))})


@seed(7)
@fuzzed
@given(st.data(), st.sampled_from(["grid", "uv"]))
def test_recordings(data, kind):
    files = bake_files(kind)
    assert_bake_is_clear({**files, "recording.npz": data.draw(damaged_archive(files["recording.npz"]))})


@seed(8)
@fuzzed
@given(st.data(), st.sampled_from(["grid", "uv"]))
def test_sensors_of_bakes(data, kind):
    files = bake_files(kind)
    assert_bake_is_clear({**files, "sensor.npz": data.draw(damaged_archive(files["sensor.npz"]))})


# --- tactile images


@cache
def image():
    """A tactile image as bytes."""
    texels = grid_texels()
    recording = recording_of(texels, frames=4)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "tactile.exr"
        tactile_exr.write_exr(path, texels.layout, recording.sensors["pad"].at(2), {"sensor": "pad", "time": "0.1"})
        return path.read_bytes()


@pytest.mark.parametrize("codec", [exr_library, exr_codec], ids=["library", "codec"])
def test_tactile_images(codec, monkeypatch):
    class Chosen:
        module = codec

    monkeypatch.setattr(tactile_exr, "backend", lambda: Chosen)

    @seed(9)
    @fuzzed
    @given(st.data())
    def try_out(data):
        assert_content_is_clear(tactile_exr.read_exr, "tactile.exr", data.draw(damaged_bytes(image())))

    try_out()
