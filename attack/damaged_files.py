# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of every format, damaged with the structure of the format in mind, and the readers that have to say so.

Inputs are drawn by Hypothesis. :func:`judge` says what a reader made of one; tests and the attack both use it.
"""

from __future__ import annotations

import copy
import io
import json
import tempfile
import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from palpate.core.errors import PalpateError
from palpate.core.gap.calibration.friction import read_friction
from palpate.core.gap.calibration.stiffness import read_foam
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.io import bake_switch, exr_codec, exr_library, tactile_exr
from palpate.core.io.bake_folder import read_manifest
from palpate.core.io.bake_reader import read_bake
from palpate.core.io.csv_table import read_table
from palpate.core.io.openrave import OpenRaveSensor, openrave_xml, read_openrave
from palpate.core.io.private_folder import MARKER_FORMAT, MARKER_NAME, PRIVATE_FOLDER
from palpate.core.io.recording_npz import load_recording
from palpate.core.io.sensor_npz import load_sensor
from palpate.core.io.sensor_toml import FORMAT, read_sensor
from palpate.core.model.sensor_parameters import Painted, SensorParameters

from . import random_rigs, unfinished_bakes
from .area import CLEAR, TRACEBACK, WRONG
from .sample_bake import grid_texels, recording_of, round_texels, write_sensor

Files = dict[str, bytes]
"""Contents of files by their paths."""


@dataclass(frozen=True)
class Reader:
    """A reader and what it is given.

    Attributes
    ----------
    name : str
    inputs : strategy
        Draws :data:`Files`.
    read : callable
        Takes the folder with the files. It raises AssertionError if what it believed is no good.
    """

    name: str
    inputs: st.SearchStrategy[Files]
    read: Callable[[Path], Any]


def inputs_of(reader: Reader, number: int, start: int) -> list[Files]:
    """Draw inputs of a reader; the same numbers give the same inputs."""
    found: list[Files] = []

    @seed(start)
    @settings(
        max_examples=number, deadline=None, database=None, phases=[Phase.generate], suppress_health_check=list(HealthCheck)
    )
    @given(reader.inputs)
    def draw(files: Files) -> None:
        found.append(files)

    draw()
    return found


def judge(reader: Reader, files: Files) -> tuple[str, str]:
    """Let a reader read an input; return CLEAR, WRONG or TRACEBACK, and the words that say why."""
    with tempfile.TemporaryDirectory(prefix="palpate-attack-") as folder:
        for name, content in files.items():
            path = Path(folder) / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                reader.read(Path(folder))
        except PalpateError as error:
            text = str(error).strip()
            if not text or len(text) > 20_000 or len(text.splitlines()) != 1:
                return WRONG, f"no clear sentence: {text[:300]!r}"
        except AssertionError as error:
            return WRONG, f"believed: {error}"
        except Exception as error:
            return TRACEBACK, f"{type(error).__name__}: {error}"
    return CLEAR, ""


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
        if name in ("header", "tree", "about") and what == "change":  # JSON
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


# --- good files

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


XML = openrave_xml(
    [OpenRaveSensor("T1", "finger", SensorParameters()), OpenRaveSensor("T2", "tip", SensorParameters())], "hand"
)


@cache
def bake_files(kind):
    """The files of a sensor's bake, by name."""
    texels = grid_texels() if kind == "grid" else round_texels()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_sensor(folder, "pad", texels, Painted(k=np.ones(len(texels))))
        return {path.name: path.read_bytes() for path in (folder / "pad").iterdir()}


@cache
def image():
    """A tactile image as bytes."""
    texels = grid_texels()
    recording = recording_of(texels, frames=4)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "tactile.exr"
        tactile_exr.write_exr(path, texels.layout, recording.sensors["pad"].at(2), {"sensor": "pad", "time": "0.1"})
        return path.read_bytes()


# --- readers


def _file(name: str, contents: st.SearchStrategy[bytes]) -> st.SearchStrategy[Files]:
    """Draw one file."""
    return contents.map(lambda content: {name: content})


def _rigs() -> st.SearchStrategy[Files]:
    return st.builds(
        lambda rig, table: {"rig.toml": rig, "a.csv": table, "b.csv": TABLE.encode()},
        st.one_of(damaged_tree(RIG).map(toml_bytes), damaged_bytes(toml_bytes(RIG))),
        st.one_of(st.just(TABLE.encode()), damaged_table(TABLE, ",")),
    )


def _meshes() -> st.SearchStrategy[Files]:
    """Rigs whose sensor is a mesh, and the mesh is damaged."""
    rig = {**RIG, "sensor": {"mesh": "skin.ply", "k": 80.0, "thickness": 0.006}}
    return st.one_of(damaged_bytes(PLY.encode()), damaged_table(PLY, " ")).map(
        lambda mesh: {"rig.toml": toml_bytes(rig), "skin.ply": mesh, "a.csv": TABLE.encode(), "b.csv": TABLE.encode()}
    )


PLY = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
end_header
0 0 0
0.01 0 0
0.01 0.01 0
0 0.01 0
3 0 1 2
3 0 2 3
"""


def _openrave_files() -> st.SearchStrategy[bytes]:
    words = st.sampled_from(["58.5", "T1", "SimTactileSensor", "thickness", "AttachedSensor", "finger"])
    return st.one_of(
        damaged_bytes(XML.encode()),
        st.tuples(words, st.text(max_size=8)).map(lambda change: XML.replace(*change).encode("utf-8", "replace")),
        st.tuples(st.sampled_from(["0.0583", "0.435"]), st.sampled_from(NUMBERS)).map(
            lambda change: XML.replace(change[0], str(change[1])).encode()
        ),
    )


def _bakes(file: str, damaged: Callable[[bytes], st.SearchStrategy[bytes]]) -> st.SearchStrategy[Files]:
    """Bakes of one sensor in which a file is damaged."""

    def bakes(kind: str) -> st.SearchStrategy[Files]:
        good = {f"bake/pad/{name}": content for name, content in bake_files(kind).items()}
        return damaged(bake_files(kind)[file]).map(lambda content: {**good, f"bake/pad/{file}": content})

    return st.sampled_from(["grid", "uv"]).flatmap(bakes)


def _json_files(content: bytes) -> st.SearchStrategy[bytes]:
    tree = damaged_tree(json.loads(content)).map(lambda table: json.dumps(table).encode())
    return st.one_of(tree, damaged_bytes(content))


def _switches() -> st.SearchStrategy[Files]:
    """Bake folders with a record of a switch, or a marker of the hidden folder, that is damaged."""
    good = {f"bake/pad/{name}": content for name, content in bake_files("grid").items()}
    marker = {"format": MARKER_FORMAT, "id": "0" * 32}
    record = {"format": bake_switch.SWITCH_FORMAT, "run": "0" * 16, "folders": ["pad"], "blend": "", "backups": 0}
    private = f"bake/{PRIVATE_FOLDER}"
    marked = {**good, f"{private}/{MARKER_NAME}": json.dumps(marker).encode()}
    return st.one_of(
        _json_files(json.dumps(record).encode()).map(lambda text: {**marked, f"{private}/{bake_switch.SWITCH_NAME}": text}),
        _json_files(json.dumps(marker).encode()).map(lambda text: {**good, f"{private}/{MARKER_NAME}": text}),
    )


def _read_table(folder: Path) -> None:
    found = read_table(folder / "table.csv")
    assert not np.isinf(found.values).any(), "a number that is not finite"


def _read_typed(folder: Path) -> None:
    content = (folder / "foam.csv").read_bytes()
    (folder / "slide.csv").write_bytes(content.replace(b"compression (mm)", b"velocity_mm/s"))
    for read in (partial(read_foam, folder / "foam.csv", 0.001), partial(read_friction, folder / "slide.csv")):
        try:
            read()
        except PalpateError as error:
            assert len(str(error).splitlines()) == 1, f"no clear sentence: {error}"


def _read_bake(folder: Path) -> None:
    """Read the files of a sensor one by one, then the bake; what is believed can be drawn."""
    own = folder / "bake" / "pad"
    for read, path in ((read_manifest, own), (load_recording, own / "recording.npz"), (load_sensor, own / "sensor.npz")):
        try:
            read(path)
        except PalpateError as error:
            assert len(str(error).splitlines()) == 1, f"no clear sentence: {error}"
    bake = read_bake(folder / "bake")
    for name, texels in bake.texels.items():
        readings = bake.recording.sensors[name].normal_force
        assert np.isfinite(texels.layout.image(readings[-1])).all(), "an image that is not finite"
        assert texels.layout.uv().shape == (len(texels), 2), "no place for each texel"


def _read_image(codec: Any, folder: Path) -> None:
    """Read a tactile image with one of the two codecs."""

    class Chosen:
        module = codec

    before = tactile_exr.backend
    tactile_exr.backend = lambda: Chosen  # type: ignore[assignment]
    try:
        tactile_exr.read_exr(folder / "tactile.exr")
    finally:
        tactile_exr.backend = before


@cache
def readers() -> dict[str, Reader]:
    """Return all readers by name."""
    sensors = st.one_of(damaged_tree(SENSOR).map(toml_bytes), damaged_bytes(toml_bytes(SENSOR)))
    found = [
        Reader("sensor.toml", _file("sensor.toml", sensors), lambda folder: read_sensor(folder / "sensor.toml")),
        Reader("rig", _rigs(), lambda folder: read_rig(folder / "rig.toml")),
        Reader("rig of any words", st.integers(0, 2**32).map(random_rigs.random_rig), random_rigs.read_and_fit),
        Reader("mesh", _meshes(), lambda folder: read_rig(folder / "rig.toml")),
        Reader("recorded table", _file("table.csv", damaged_table(TABLE, ",")), _read_table),
        Reader("typed table", _file("foam.csv", damaged_table(FOAM, ";")), _read_typed),
        Reader("OpenRAVE", _file("robot.xml", _openrave_files()), lambda folder: read_openrave(folder / "robot.xml")),
        Reader("manifest", _bakes("manifest.json", _json_files), _read_bake),
        Reader("recording", _bakes("recording.npz", damaged_archive), _read_bake),
        Reader("sensor.npz", _bakes("sensor.npz", damaged_archive), _read_bake),
        Reader("switch", _switches(), _read_bake),
        Reader("unfinished bake", unfinished_bakes.inputs(damaged_archive, damaged_bytes), unfinished_bakes.read),
        Reader("image, library", _file("tactile.exr", damaged_bytes(image())), partial(_read_image, exr_library)),
        Reader("image, codec", _file("tactile.exr", damaged_bytes(image())), partial(_read_image, exr_codec)),
    ]
    return {reader.name: reader for reader in found}
