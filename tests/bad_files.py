# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of every format, damaged with the structure of the format in mind, and the readers that have to refuse them.

Inputs are drawn by Hypothesis. A reader accepts what it read as a whole, or refuses it in one sentence; :func:`fault_of` says
what it did instead.
"""

from __future__ import annotations

import copy
import io
import json
import tempfile
import tomllib
import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from exported_sensors import pad
from hypothesis import strategies as st
from sample_bake import grid_texels, recording_of, round_texels
from small_study import STUDY, scenario

from palpate.core.errors import PalpateError
from palpate.core.gap.calibration.friction import read_friction
from palpate.core.gap.calibration.stiffness import read_foam
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.logs.answers import answers_of, read_answers
from palpate.core.gap.logs.log_file import read_log
from palpate.core.gap.logs.new_rig import write_rig
from palpate.core.gap.logs.proposal import propose
from palpate.core.gap.selection.diagnosis import diagnose
from palpate.core.gap.selection.search import ALONE
from palpate.core.io.csv_table import read_table
from palpate.core.io.recording_npz import load_recording, load_sensor, save_recording, save_sensor
from palpate.core.io.scenario_npz import load_scenario, save_scenario
from palpate.core.io.sensor_toml import FORMAT, read_sensor
from palpate.core.jobs import run_job
from palpate.core.model.sensor_parameters import Painted, SensorParameters
from palpate.core.simulators.openrave_file import OpenRaveSensor, openrave_xml, read_openrave
from palpate.core.simulators.sensor_format import FoundSensor, export_sensors, import_sensors
from palpate.core.study.study_file import Runs, plan_for, read_study

Files = dict[str, bytes]
"""Contents of files by their paths."""
Damaged = Callable[[bytes], st.SearchStrategy[bytes]]


@dataclass(frozen=True)
class Reader:
    """A reader and its inputs.

    Attributes
    ----------
    inputs : strategy
        Draws :data:`Files`.
    read : callable
        Takes the folder with the files. It raises AssertionError if it accepted something that is not whole.
    """

    inputs: st.SearchStrategy[Files]
    read: Callable[[Path], Any]


def fault_of(read: Callable[[], Any]) -> str:
    """Let a reader read; return what is wrong with its answer, or "" for a whole result or one sentence."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            read()
    except PalpateError as error:
        text = str(error).strip()
        return "" if text and len(text) < 20_000 and len(text.splitlines()) == 1 else f"no clear sentence: {text[:300]!r}"
    except AssertionError as error:
        return f"accepted: {error}"
    except Exception as error:  # noqa: BLE001 - a traceback is a finding, whichever it is
        return f"{type(error).__name__}: {error}"
    return ""


def fault_in(reader: Reader, files: Files) -> str:
    """Write files into a folder and let a reader read them, as :func:`fault_of`."""
    with tempfile.TemporaryDirectory() as name:
        write_files(Path(name), files)
        return fault_of(lambda: reader.read(Path(name)))


def write_files(folder: Path, files: Files) -> None:
    """Write files by their paths below a folder."""
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)


# --- how files are damaged

NUMBERS = [0, -1, 1, 3, 65537, 2**31, 2**63, 10**40, 10**400, -0.5, 1e-320, 1e300, 1.7e308, np.inf, -np.inf, np.nan]
TEXTS = ["", " ", "\0", "a\0b", "\n", "../../etc/passwd", "/dev/zero", "A" * 5000, "\u202e", "=cmd|' /C calc'!A0", "nan", "N"]
CELLS = ["", "0", "1e308", "-1e400", "nan", "inf", '"', '""', "1_0", "٣", "=1+1", "\0", "0x10", "1,5"]
WORDS = ["nan", "inf", "-1e308", "1e999", "0", "-1", "1e-320", "9" * 400, "", "x", "1 2", "0x10"]
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
        values = [0, 1, -1, 7, 99, 2**31 - 1] + [np.nan, np.inf, 1e308, -1e-320] * (array.dtype.kind == "f")
        array.flat[draw(st.integers(0, array.size - 1))] = draw(st.sampled_from(values))
    if what == "type":
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                array = array.astype(draw(st.sampled_from(["?", "i1", "u8", "f2", "f4", "c16", "U3", "S2", "M8[s]", ">f8"])))
            except ValueError:
                array = np.zeros(array.shape, "U1")
    if what == "shape":
        shapes = [array[..., None], array.ravel(), array.ravel()[0] if array.size else np.array(0), array.T]
        shapes += [array[:-1], array[:0], np.concatenate([array, array])] if array.ndim else []
        array = shapes[draw(st.integers(0, len(shapes) - 1))]
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
        if name == "header" and what == "change":  # JSON
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


@st.composite
def damaged_table(draw, content, separator=","):
    """Change cells of a table, or its bytes."""
    if draw(st.booleans()):
        return draw(damaged_bytes(content))
    rows = [line.split(separator) for line in content.decode().splitlines()]
    for _ in range(draw(st.integers(1, 4))):
        row = draw(st.sampled_from(rows))
        row[draw(st.integers(0, len(row) - 1))] = draw(st.sampled_from(CELLS))
    return "\n".join(separator.join(row) for row in rows).encode()


@st.composite
def damaged_xml(draw, content):
    """Change an attribute's words, or damage bytes."""
    if draw(st.integers(0, 2)) == 0:
        return draw(damaged_bytes(content))
    parts = content.decode().split('"')
    for _ in range(draw(st.integers(1, 3))):
        place = draw(st.integers(0, (len(parts) - 1) // 2 - 1)) * 2 + 1
        words = parts[place].split() or [""]
        what = draw(st.sampled_from(["word", "word", "all", "drop", "twice", "swap"]))
        if what == "word":
            words[draw(st.integers(0, len(words) - 1))] = draw(st.sampled_from(WORDS))
        elif what == "drop":
            words.pop()
        elif what == "twice":
            words += words
        parts[place] = " ".join(words) if what != "all" else draw(st.text(max_size=6)).replace('"', "")
        if what == "swap":
            parts[place] = draw(st.sampled_from(parts[1::2]))
    return '"'.join(parts).encode("utf-8", "replace")


def damaged_json(content: bytes) -> st.SearchStrategy[bytes]:
    """JSON with its tree or its bytes damaged."""
    tree = damaged_tree(json.loads(content)).map(lambda table: json.dumps(table).encode())
    return st.one_of(tree, damaged_bytes(content))


def damaged_toml(table: dict[str, Any]) -> st.SearchStrategy[bytes]:
    """TOML with its table or its bytes damaged."""
    return st.one_of(damaged_tree(table).map(toml_bytes), damaged_bytes(toml_bytes(table)))


def toml_bytes(table: Any) -> bytes:
    """A table as TOML; what TOML cannot say becomes text."""

    def clean(value: Any) -> Any:
        if isinstance(value, dict):
            return {str(key): clean(inner) for key, inner in value.items()}
        if isinstance(value, list):
            return [clean(inner) for inner in value]
        return "none" if value is None else value

    return tomli_w.dumps(clean(table)).encode("utf-8", "replace")


DAMAGE: dict[str, Damaged] = {
    ".json": damaged_json, ".npz": damaged_archive, ".csv": damaged_table, ".ply": damaged_table,
    ".xml": damaged_xml, ".urdf": damaged_xml,
}  # fmt: skip
"""How files with an ending are damaged; the bytes of all others are."""


def damaged(files: Files, *names: str) -> st.SearchStrategy[Files]:
    """Files of which one is damaged: any, or one of some names."""

    def one(name: str) -> st.SearchStrategy[Files]:
        damage = DAMAGE.get(Path(name).suffix, damaged_bytes)
        return damage(files[name]).map(lambda content: {**files, name: content})

    return st.sampled_from(sorted(names or files)).flatmap(one)


# --- good files

SENSOR = {
    "format": FORMAT,
    "name": "pad",
    "sensor": {
        **asdict(SensorParameters()),
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
TABLE = (
    "time,x,y,z,texel_0,texel_1,force_z\n"
    + "".join(f"{0.02 * i:.2f},0,0,{0.006 - 0.0001 * i:.4f},{0.1 * i:.1f},{0.2 * i:.1f},{-0.3 * i:.1f}\n" for i in range(12))
).encode()
EVERY_WORD = {
    "format": "palpate-rig/1",
    "clock": "own",
    "sensor": {
        "sensors": [[-0.005, 0.0], [0.005, 0.002]],
        "cover": {"size": [0.02, 0.012], "pitch": 0.004, "depth": 0.004},
        "k": 80.0,
        "contact_height": "free",
        "unit": "counts",
    },
    "indenter": {"shape": {"sphere": 0.008}},
    "probe": [{"name": "other", "shape": {"box": [0.004, 0.004, 0.01]}}],
    "data": {"correct": "all"},
    "trial": [
        {"file": "a.csv", "specimen": "A", "factor": "free", "zero": "free", "force_zero": "free", "probe": "other"},
        {"file": "b.csv", "specimen": "B", "factor": "free", "contact_height": 2e-4, "tared": True, "session": "s"},
        {"file": "c.csv", "use": "check"},
    ],
}
"""A rig with every word that belongs to none of the others, or to no grid."""
PRESSES = (
    "time,x,y,z,texel_0,texel_1,force_z\n"
    + "".join(
        f"{0.05 * i:.2f},0.001,0,{0.009 - 0.0015 * np.sin(0.2 * i):.5f},{0.1 * (i % 15)},{0.05 * (i % 15)},{-0.2 * (i % 15)}\n"
        for i in range(45)
    )
).encode()
FOAM = b"compression (mm),force [N],mass_g\n# typed\n0.1,1,2\n0.2,2,3\n0.4,3,4\n"
PLY = b"""ply
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
TOUCH_GRID = """<mujoco><extension><plugin plugin="mujoco.sensor.touch_grid"/></extension><worldbody><body pos="0 0 0.1">
<site name="pad" size="0.01" euler="0 90 0"/></body></worldbody><sensor><plugin name="grid" plugin="mujoco.sensor.touch_grid"
objtype="site" objname="pad"><config key="size" value="4 3"/><config key="fov" value="20 15"/><config key="gamma" value="0"/>
</plugin></sensor></mujoco>"""
MESH_FILE = """<mujoco><compiler meshdir="meshes"/><asset><mesh name="m" file="m.ply" scale="1 1 2"/></asset><worldbody>
<body pos="0.5 0 0" quat="1 0 0 1"><geom name="g" type="mesh" mesh="m"/></body></worldbody><sensor>
<tactile name="skin" geom="g" mesh="m"/></sensor></mujoco>"""
ROBOT = [OpenRaveSensor("T1", "finger", SensorParameters()), OpenRaveSensor("T2", "tip", SensorParameters())]

COUNT = 60
TIME = np.arange(COUNT) / 20.0
DEPTH = np.interp(TIME, [0.0, 1.0, 1.5, 2.0, 3.0], [0.0, 0.0, 1e-3, 1e-3, 0.0])
READING = 100.0 + 60e3 * DEPTH[:, None] * np.array([1.0, 0.9, 1.1, 1.0])
LOG = "t (s),depth (mm),R1,R2,R3,R4\n" + "".join(
    f"{t:.3f},{1e3 * d:.4f},{','.join(f'{value:.2f}' for value in row)}\n"
    for t, d, row in zip(TIME, DEPTH, READING, strict=True)
)
LOG_SENSOR = {"grid": {"rows": 2, "columns": 2, "pitch": [0.003, 0.003]}, "unit": "counts"}
ANSWERS = {
    "format": "palpate-log-answers/1",
    "name": "small",
    "sensor": LOG_SENSOR,
    "logger": [
        {
            "files": ["log.csv"],
            "columns": {
                "time": {"name": "t (s)", "unit": "s"},
                "depth": {"name": "depth (mm)", "unit": "mm", "zero": 0.0, "factor": 1.0},
                "texel": {"name": "R{}", "first": 1, "count": 4, "unit": "counts"},
            },
        }
    ],
    "recording": [{"name": "one", "files": ["log.csv"], "use": "fit", "from": 0.1, "to": 2.9}],
}


def files_of(write: Callable[[Path], Any]) -> Files:
    """All files that a function writes into a folder."""
    with tempfile.TemporaryDirectory() as name:
        write(Path(name))
        return {
            path.relative_to(name).as_posix(): path.read_bytes() for path in sorted(Path(name).rglob("*")) if path.is_file()
        }


def recording_files() -> Files:
    """A recording; a whole bake is believed by the SHA-256 of its files."""
    return files_of(lambda folder: save_recording(folder / "recording.npz", recording_of(grid_texels(), 4)))


def texel_files() -> Files:
    """The texels of a sensor with a texture map."""
    return files_of(lambda folder: save_sensor(folder / "sensor.npz", round_texels(), Painted(k=np.ones(13))))


def exported_sensor(kind: str) -> Files:
    """The files of a small pad exported for another program."""
    return files_of(lambda folder: export_sensors([pad(3, 2)], kind, folder))


def log_files(kind: str) -> Files:
    """One log of 60 samples in a format."""
    return files_of(lambda folder: LOG_WRITERS[kind](folder / f"log.{kind}"))


def _write_mat(path: Path) -> None:
    """Compressed arrays, which carry checksums: SciPy ends the process on some damaged files without (docs/security.md)."""
    from scipy.io import savemat

    savemat(
        path,
        {"time": TIME, "depth": DEPTH, "taxels": READING, "ft": {"force": 60e3 * DEPTH, "label": "pad"}},
        do_compression=True,
    )


def _write_hdf5(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as written:
        group = written.create_group("press")
        group.create_dataset("time", data=TIME, chunks=(20,), compression="gzip")
        group.create_dataset("depth", data=1e3 * DEPTH).attrs["unit"] = "mm"
        group.create_dataset("taxels", data=READING)


def _write_mcap(path: Path) -> None:
    """Messages in JSON without checksums, so that damage reaches the decoders."""
    from mcap.writer import CompressionType, Writer

    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE, enable_crcs=False, enable_data_crcs=False)
        writer.start()
        schema = writer.register_schema("Press", "jsonschema", b'{"type": "object"}')
        channel = writer.register_channel("/press", "json", schema)
        for i in range(COUNT):
            message = {"depth": float(DEPTH[i]), "taxels": READING[i].tolist()}
            writer.add_message(channel, round(1e9 * TIME[i]), json.dumps(message).encode(), round(1e9 * TIME[i]))
        writer.finish()


def write_bag(path: Path, storage: str = "SQLITE3") -> None:
    """A bag of ROS 1 (a file), or of ROS 2 (a folder): a wrench, and an array of readings that is recorded 3 ms later."""
    from rosbags import rosbag1, rosbag2
    from rosbags.rosbag2.enums import StoragePlugin
    from rosbags.typesys import Stores, get_typestore

    is_first = path.suffix == ".bag"
    store = get_typestore(Stores.ROS1_NOETIC if is_first else Stores.ROS2_HUMBLE)
    types = store.types
    wrench, array = "geometry_msgs/msg/WrenchStamped", "std_msgs/msg/Float64MultiArray"
    vector, stamps = types["geometry_msgs/msg/Vector3"], types["builtin_interfaces/msg/Time"]
    bag = rosbag1.Writer(path) if is_first else rosbag2.Writer(path, version=9, storage_plugin=StoragePlugin[storage])
    code = store.serialize_ros1 if is_first else store.serialize_cdr
    with bag as writer:
        force, taxels = (writer.add_connection(f"/{name}", name, typestore=store) for name in (wrench, array))
        for i in range(COUNT):
            stamp = round(1e9 * (100.0 + TIME[i]))
            header = types["std_msgs/msg/Header"](*((i,) if is_first else ()), stamps(*divmod(stamp, 10**9)), "tool")
            load = types["geometry_msgs/msg/Wrench"](vector(0.0, 0.0, 60e3 * float(DEPTH[i])), vector(0.0, 0.0, 0.0))
            writer.write(force, stamp + 3_000_000, code(types[wrench](header, load), wrench))
            layout = types["std_msgs/msg/MultiArrayLayout"]([], 0)
            writer.write(taxels, stamp + 3_000_000, code(types[array](layout, READING[i]), array))


LOG_WRITERS: dict[str, Callable[[Path], Any]] = {
    "csv": lambda path: path.write_text(LOG),
    "npz": lambda path: np.savez(path, time=TIME, depth=DEPTH, taxels=READING.reshape(COUNT, 2, 2)),
    "mat": _write_mat,
    "h5": _write_hdf5,
    "mcap": _write_mcap,
    "bag": write_bag,
    "db3": write_bag,
}


# --- readers


def _read_table(folder: Path) -> None:
    assert not np.isinf(read_table(folder / "table.csv").values).any(), "a number that is not finite"


def _read_typed(folder: Path) -> None:
    (folder / "slide.csv").write_bytes((folder / "foam.csv").read_bytes().replace(b"compression (mm)", b"velocity_mm/s"))
    for read in (partial(read_foam, folder / "foam.csv", 0.001), partial(read_friction, folder / "slide.csv")):
        assert not (fault := fault_of(read)), fault


def _read_rig(folder: Path) -> None:
    for trial in read_rig(folder / "rig.toml").trials:
        assert np.isfinite(trial.time).all() and (np.diff(trial.time) > 0).all(), "times that do not rise"


def _fit_rig(folder: Path) -> None:
    """Read a rig, look for faults of its data and fit the base model."""
    job = diagnose(read_rig(folder / "rig.toml"))
    for progress in job:
        if progress.done >= ALONE:
            break
    job.close()


def _read_study(folder: Path) -> None:
    study = read_study(folder / "study.toml")
    runs = Runs(study, {"pad": plan_for(study, scenario())}, {"pad": "d"})
    assert all(np.isfinite(value) for run in runs for value in run.values.values() if isinstance(value, float))


def import_all(name: str, folder: Path) -> list[FoundSensor]:
    _, found = import_sensors(folder / name)
    assert found, "no sensor and no sentence"
    for sensor in found:
        for field, value in vars(sensor).items():
            if isinstance(value, np.ndarray) and value.dtype.kind == "f":
                assert np.isfinite(value).all(), f"{field} is not finite"
    return found


def rig_from_log(name: str, folder: Path) -> None:
    """Read a log, propose its meaning, and write a rig where no question is open."""
    log = read_log(folder / name)
    for table in log.tables:
        assert {len(column) for column in table.columns.values()} == {table.sample_count}, "columns of several lengths"
        assert not any(np.isinf(column).any() for column in table.columns.values()), "a number that is not finite"
    found = propose([log]).confirmed()
    proposal = replace(found, guesses=tuple(one for one in found.guesses if one.table not in ("sensor", "indenter")))
    if not proposal.questions:
        run_job(write_rig([log], replace(answers_of(proposal), sensor=LOG_SENSOR), folder / "rig"))
        _read_rig(folder / "rig")


def _read_answers(folder: Path) -> None:
    answers = read_answers(folder / "answers.toml")
    run_job(write_rig([read_log(folder / "log.csv")], answers, folder / "rig"))
    _read_rig(folder / "rig")


def _toml(name: str, table: dict[str, Any], beside: Files | None = None) -> st.SearchStrategy[Files]:
    return damaged_toml(table).map(lambda content: {name: content, **(beside or {})})


def _rigs() -> st.SearchStrategy[Files]:
    good = {"rig.toml": toml_bytes(RIG), "a.csv": TABLE, "b.csv": TABLE}
    on_mesh = {**RIG, "sensor": {"mesh": "skin.ply", "k": 80.0, "thickness": 0.006}}
    with_mesh = {**good, "rig.toml": toml_bytes(on_mesh), "skin.ply": PLY}
    return st.one_of(_toml("rig.toml", RIG, {"a.csv": TABLE, "b.csv": TABLE}), damaged(good), damaged(with_mesh, "skin.ply"))


@cache
def readers() -> dict[str, Reader]:
    """Return a reader for each kind of file, by its name; good files are made when the first damaged one is drawn."""

    def later(make: Callable[[], Files]) -> st.SearchStrategy[Files]:
        return st.deferred(lambda: damaged(make()))

    study = STUDY.format(runs=6, seed=1, more="", hold=0.0)
    scene = later(lambda: files_of(lambda folder: save_scenario(folder / "pad.npz", scenario())))
    recordings = dict.fromkeys(("a.csv", "b.csv", "c.csv"), PRESSES)
    answers = st.deferred(lambda: _toml("answers.toml", ANSWERS, log_files("csv")))
    found = {
        "sensor.toml": Reader(_toml("sensor.toml", SENSOR), lambda folder: read_sensor(folder / "sensor.toml")),
        "rig": Reader(_rigs(), _read_rig),
        "rig of every word": Reader(_toml("rig.toml", EVERY_WORD, recordings), _fit_rig),
        "recorded table": Reader(damaged({"table.csv": TABLE}), _read_table),
        "typed table": Reader(damaged({"foam.csv": FOAM}), _read_typed),
        "study": Reader(_toml("study.toml", tomllib.loads(study)), _read_study),
        "scenario": Reader(scene, lambda folder: load_scenario(folder / "pad.npz")),
        "recording": Reader(later(recording_files), lambda folder: load_recording(folder / "recording.npz")),
        "texels": Reader(later(texel_files), lambda folder: load_sensor(folder / "sensor.npz")),
        "answers": Reader(answers, _read_answers),
    }
    for kind in LOG_WRITERS:
        found[f"log.{kind}"] = Reader(later(partial(log_files, kind)), partial(rig_from_log, f"log.{kind}"))
    robot = later(lambda: {"robot.xml": openrave_xml(ROBOT, "hand").encode()})
    sensors = {
        "Pad.xml": later(partial(exported_sensor, "mjcf")),
        "Pad.urdf": later(partial(exported_sensor, "urdf")),
        "Pad.json": later(partial(exported_sensor, "probes")),
        "grid.xml": damaged({"grid.xml": TOUCH_GRID.encode()}),
        "mesh.xml": damaged({"mesh.xml": MESH_FILE.encode(), "meshes/m.ply": PLY}),
        "robot.xml": robot,
    }
    for name, inputs in sensors.items():
        found[f"sensor in {name}"] = Reader(inputs, partial(import_all, name))
    return {**found, "OpenRAVE": Reader(robot, lambda folder: read_openrave(folder / "robot.xml"))}
