# SPDX-License-Identifier: GPL-3.0-or-later
"""Ways of damaging a bake: each takes the folder of a good bake of the sensors ``pad`` and ``cap`` and spoils it.

Every way is tried on a bake without checksums, as older versions wrote it, where the content alone must betray it, and on one
with checksums. :func:`judge` says what a reader made of it.
"""

from __future__ import annotations

import json
import os
import shutil
import warnings
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from palpate.attack.sample_bake import grid_texels, recording_of, round_texels, write_sensor
from palpate.core.errors import PalpateError
from palpate.core.io.bake_folder import IMAGE_LIST_NAME, MANIFEST_NAME, RECORDING_NAME, read_manifest, write_manifest
from palpate.core.io.bake_switch import SWITCH_NAME
from palpate.core.io.file_writing import file_sha256
from palpate.core.io.npz import write_arrays
from palpate.core.io.private_folder import make_private_folder
from palpate.core.io.sensor_npz import SENSOR_NAME
from palpate.core.io.tactile_exr import read_exr, write_exr

Damage = Callable[[Path], None]
Change = Callable[[np.ndarray], np.ndarray | None]

CLEAR, HARMLESS, WRONG, TRACEBACK = "clear", "harmless", "wrong", "traceback"


@dataclass(frozen=True)
class Way:
    """One way of damaging a bake.

    Attributes
    ----------
    name : str
        Unique.
    damage : callable
        Spoils the bake in a folder.
    harmless : bool
        The format allows it, so a reader may accept it: it then reads a whole bake.
    needs : str
        A file of the bake without which there is nothing to damage.
    """

    name: str
    damage: Damage
    harmless: bool = False
    needs: str = ""

    def applies(self, bake: Path) -> bool:
        """Return True if the bake in a folder can be damaged in this way."""
        return not self.needs or (bake / self.needs).is_file()


def ways() -> list[Way]:
    """Return all ways, always in the same order."""
    found = [
        *_of_arrays(),
        *_of_values(),
        *_of_archives(),
        *_of_headers(),
        *_of_manifests(),
        *_of_images(),
        *_of_image_lists(),
        *_of_folders(),
    ]
    names = [way.name for way in found]
    assert len(set(names)) == len(names)
    return found


def judge(way: Way, read: Callable[[], Any]) -> tuple[str, str]:
    """Let a reader read a damaged bake.

    Returns
    -------
    (str, str)
        CLEAR (one sentence), HARMLESS (read, and the format allows it), WRONG (read in silence) or TRACEBACK; and the words.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)  # NaN and overflow would be reckoned with
            read()
    except PalpateError as error:
        text = str(error)
        good = text.strip() and len(text.splitlines()) == 1 and "'" in text and text.endswith((".", "'"))
        return (CLEAR, text) if good else (WRONG, f"no clear sentence: {text!r}")
    except Exception as error:  # noqa: BLE001 - whatever it is, it is a finding
        return TRACEBACK, f"{type(error).__name__}: {error}"
    return (HARMLESS if way.harmless else WRONG), "believed"


# --- arrays

RECORDED = ["frames", "times", "poses", "velocities"] + [
    f"sensor_0/{name}"
    for name in (
        *("normal_force", "shear", "friction", "depth", "slip", "contact", "reading"),
        *("net_force", "net_torque", "centre_of_pressure"),
    )
]
OF_TEXELS = ["vertex", "position", "normal", "tangent", "area"]
OF_GRID = ["layout/row", "layout/column", "layout/triangles"]
OF_MAP = ["layout/triangles", "layout/corner_uv"]
PLACES = [
    *((f"pad/{RECORDING_NAME}", name) for name in RECORDED),
    *((f"pad/{SENSOR_NAME}", name) for name in (*OF_TEXELS, *OF_GRID, "painted/k")),
    *((f"cap/{SENSOR_NAME}", name) for name in OF_MAP),
]
SHAPES: dict[str, Change] = {
    "left out": lambda array: None,
    "one entry fewer": lambda array: array[:-1],
    "one entry more": lambda array: np.concatenate([array, array[-1:]]),
    "one axis more": lambda array: array[..., None],
    "flat and doubled": lambda array: np.concatenate([array.ravel(), array.ravel()]),
    "a single value": lambda array: array.flat[0],
    "empty": lambda array: array[:0],
    "complex": lambda array: array + 1j,
    "text": lambda array: array.astype("U8"),
    "dates": lambda array: np.zeros(array.shape, "datetime64[s]"),
    "bytes": lambda array: np.zeros(array.shape, "S3"),
    "records": lambda array: np.zeros(array.shape, [("a", "f8"), ("b", "i4")]),
}
ALLOWED = {
    *(("painted/k", what) for what in ("left out",)),
    *(("layout/triangles", what) for what in ("left out", "empty", "one entry fewer", "one entry more")),
}
"""Painted factors and what has a default may be left out; a grid may have any of its triangles."""


def change_array(bake: Path, file: str, name: str, change: Change) -> None:
    """Write an archive of a bake again with one array changed; None leaves it out."""
    with np.load(bake / file) as members:
        arrays = {key: members[key] for key in members.files}
    changed = change(arrays.pop(name))
    write_arrays(bake / file, arrays if changed is None else {**arrays, name: np.asarray(changed)})


def _of_arrays() -> Iterator[Way]:
    """Every array in another shape or of another type."""
    for file, name in PLACES:
        for what, change in SHAPES.items():
            allowed = (name, what) in ALLOWED and (file.startswith("pad") or what == "one entry more")
            yield Way(f"{file}: {name} {what}", partial(change_array, file=file, name=name, change=change), allowed)


def _put(value: float, place: int = -1) -> Change:
    """Return a change that puts a value into one place of an array."""

    def change(array: np.ndarray) -> np.ndarray:
        array = array.copy()
        array.flat[place] = value
        return array

    return change


def _of_values() -> Iterator[Way]:
    """Values that no bake has."""
    for name in RECORDED[1:]:
        if not name.endswith("contact"):
            for value in (np.nan, np.inf, -np.inf):
                yield _value(f"pad/{RECORDING_NAME}", name, value)
    for name in ("normal_force", "shear", "depth", "slip", "reading"):
        for value in (1e308, 0.7):
            yield _value(f"pad/{RECORDING_NAME}", f"sensor_0/{name}", value)
    for name in ("friction", "depth", "slip"):
        yield _value(f"pad/{RECORDING_NAME}", f"sensor_0/{name}", -1.0)
    changes: list[tuple[str, str, str, Change]] = [
        ("recording", "frames", "twice the last but one", lambda frames: np.r_[frames[:-1], frames[-2]]),
        ("recording", "frames", "backwards", lambda frames: frames[::-1]),
        ("recording", "frames", "one later", lambda frames: frames + 1),
        ("recording", "frames", "with a gap", lambda frames: np.r_[frames[:-1], frames[-1] + 1]),
        ("recording", "frames", "at 2^62", lambda frames: frames + 2**62),
        ("recording", "frames", "unsigned below zero", lambda frames: (frames - 2).astype("u8")),
        ("recording", "frames", "halves", lambda frames: frames + 0.5),
        ("recording", "times", "in milliseconds", lambda times: times * 1e3),
        ("recording", "times", "all zero", lambda times: times * 0),
        ("recording", "times", "backwards", lambda times: times[::-1]),
        ("recording", "poses", "turned by a quaternion of length two", lambda poses: poses * [1, 1, 1, 2, 2, 2, 2]),
        ("recording", "poses", "without rotation", lambda poses: poses * [1, 1, 1, 0, 0, 0, 0]),
        ("recording", "sensor_0/normal_force", "reversed in time", lambda force: force[::-1]),
        ("recording", "sensor_0/normal_force", "reversed in texels", lambda force: force[:, ::-1]),
        ("recording", "sensor_0/normal_force", "in millinewtons", lambda force: force * 1e3),
        ("recording", "sensor_0/reading", "in other units", lambda reading: reading * 2),
        ("sensor", "normal", "doubled", lambda normal: normal * 2),
        ("sensor", "tangent", "zero", lambda tangent: tangent * 0),
        ("sensor", "vertex", "negative", lambda vertex: -1 - vertex),
        ("sensor", "area", "negative", lambda area: -area),
        ("sensor", "layout/row", "all the same", lambda row: row * 0),
        ("sensor", "layout/row", "upside down", lambda row: row.max() - row),
        ("sensor", "layout/column", "mirrored", lambda column: column.max() - column),
        ("sensor", "layout/rows", "one more", lambda rows: rows + 1),
        ("sensor", "layout/columns", "a million", lambda columns: columns * 0 + 10**6),
        ("sensor", "layout/columns", "negative", lambda columns: -columns),
        ("sensor", "layout", "a map", lambda layout: np.array("uv")),
        ("sensor", "layout", "unknown", lambda layout: np.array("cube")),
        ("sensor", "format", "of the future", lambda text: np.array("palpate-sensor/99")),
        ("sensor", "format", "a number", lambda text: np.array(1)),
        ("recording", "header", "a number", lambda text: np.array(1)),
        ("recording", "header", "not JSON", lambda text: np.array("{")),
        ("recording", "header", "deeply nested", lambda text: np.array("[" * 100_000)),
    ]
    for archive, name, what, change in changes:
        file = f"pad/{archive}.npz"
        yield Way(f"{file}: {name} {what}", partial(change_array, file=file, name=name, change=change))
    for name, value in (("position", np.nan), ("position", np.inf), ("normal", 2.0), ("tangent", np.nan), ("area", np.nan)):
        yield _value(f"pad/{SENSOR_NAME}", name, value)
    for name, value in (("layout/row", 99), ("layout/row", -1), ("layout/column", 1), ("layout/triangles", 99)):
        yield _value(f"pad/{SENSOR_NAME}", name, value)
    for value in (0.0, -1.0, np.nan, np.inf):
        yield _value(f"pad/{SENSOR_NAME}", "painted/k", value)
    for name, value in (
        *(("layout/triangles", -1), ("layout/triangles", 99), ("layout/corner_uv", 7.0), ("layout/corner_uv", np.nan)),
        *(("layout/margin", -3), ("layout/height", 10**9), ("layout/width", 0), ("layout/cell", -1)),
    ):
        yield _value(f"cap/{SENSOR_NAME}", name, value)


def _value(file: str, name: str, value: float) -> Way:
    return Way(f"{file}: {name} has {value:g}", partial(change_array, file=file, name=name, change=_put(value)))


# --- archives


def _of_archives() -> Iterator[Way]:
    for file in (f"pad/{RECORDING_NAME}", f"pad/{SENSOR_NAME}"):
        for share in (0.0, 0.01, 0.3, 0.7, 0.99):
            yield Way(f"{file}: cut at {share:g}", partial(_cut, file=file, share=share))
        for seed in range(6):
            yield Way(f"{file}: byte {seed} flipped", partial(_flip, file=file, seed=seed), harmless=True)
        yield Way(f"{file}: zeros", partial(_replace, file=file, content=bytes(4096)))
        yield Way(f"{file}: text", partial(_replace, file=file, content=b"what did you expect?"))
        yield Way(f"{file}: an empty zip", partial(_replace, file=file, content=b"PK\5\6" + bytes(18)))
        yield Way(f"{file}: objects", partial(_pickled, file=file))
        yield Way(f"{file}: a member of 10^15 numbers", partial(_claim, file=file))
        yield Way(f"{file}: an array that is none", partial(_member, file=file, content=b"no array"))
        yield Way(f"{file}: a header of code", partial(_member, file=file, content=_npy_header("__import__('os').abort()")))
        yield Way(f"{file}: a folder", partial(_as_folder, file=file))
        yield Way(f"{file}: missing", partial(_missing, file=file))
        yield Way(f"{file}: a link to nothing", partial(_link, file=file, target="nowhere"))
        yield Way(f"{file}: a link to a device", partial(_link, file=file, target="/dev/zero"))
        yield Way(f"{file}: a FIFO", partial(_fifo, file=file))
        yield Way(f"{file}: a member twice", partial(_doubled, file=file), harmless=True)
        yield Way(f"{file}: a member with a path", partial(_with_path, file=file), harmless=True)


def _cut(bake: Path, file: str, share: float) -> None:
    content = (bake / file).read_bytes()
    (bake / file).write_bytes(content[: int(share * len(content))])


def _flip(bake: Path, file: str, seed: int) -> None:
    content = bytearray((bake / file).read_bytes())
    content[int(np.random.default_rng(seed).integers(len(content)))] ^= 0x10
    (bake / file).write_bytes(content)


def _replace(bake: Path, file: str, content: bytes) -> None:
    (bake / file).write_bytes(content)


def _pickled(bake: Path, file: str) -> None:
    with np.load(bake / file) as members:
        arrays = {key: members[key] for key in members.files}
    name = next(reversed(arrays))
    with (bake / file).open("wb") as opened:
        np.savez(opened, **{**arrays, name: np.array([{"a": 1}, None], object)})


def _npy_header(text: str) -> bytes:
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()


def _member(bake: Path, file: str, content: bytes) -> None:
    """Give the last member of an archive another content."""
    with zipfile.ZipFile(bake / file) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    members[next(reversed(members))] = content
    with zipfile.ZipFile(bake / file, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)


def _claim(bake: Path, file: str) -> None:
    _member(bake, file, _npy_header("{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000000,), }\n") + bytes(80))


def _as_folder(bake: Path, file: str) -> None:
    (bake / file).unlink()
    (bake / file).mkdir()


def _missing(bake: Path, file: str) -> None:
    (bake / file).unlink()


def _link(bake: Path, file: str, target: str) -> None:
    (bake / file).unlink()
    (bake / file).symlink_to(target)


def _fifo(bake: Path, file: str) -> None:
    (bake / file).unlink()
    os.mkfifo(bake / file)


def _doubled(bake: Path, file: str) -> None:
    """Append a member once more, with the same content."""
    with warnings.catch_warnings(), zipfile.ZipFile(bake / file, "a") as archive:
        warnings.simplefilter("ignore")
        name = archive.namelist()[0]
        archive.writestr(name, archive.read(name))


def _with_path(bake: Path, file: str) -> None:
    with zipfile.ZipFile(bake / file, "a") as archive:
        archive.writestr("../../evil.npy", b"")
        archive.writestr("/tmp/evil.npy", b"")


# --- the header of a recording

HEADERS: dict[str, dict[str, Any]] = {
    "of no sensor": {"sensors": []},
    "of another sensor": {"sensors": ["cap"]},
    "of the sensor twice": {"sensors": ["pad", "pad"]},
    "of more sensors than it has": {"sensors": ["pad", "other"]},
    "of a sensor that is a number": {"sensors": [3]},
    "with sensors as text": {"sensors": "pad"},
    "with a NUL in its sensor": {"sensors": ["pad\0"]},
    "of another body": {"bodies": ["other"]},
    "of no body": {"bodies": []},
    "of more bodies": {"bodies": ["pad", "other"]},
    "with bodies as a number": {"bodies": 3},
    "with another digest": {"digest": "another"},
    "with a digest that is a list": {"digest": ["d"]},
    "with another time step": {"dt": 2e-4},
    "with a time step as text": {"dt": "short"},
    "with a time step of NaN": {"dt": float("nan")},
    "with an endless time step": {"dt": 10**400},
    "with warnings as a number": {"warnings": 3},
    "of a format of the future": {"format": "palpate-recording/99"},
    "of no format": {"format": None},
}


def _of_headers() -> Iterator[Way]:
    for what, change in HEADERS.items():
        yield Way(f"the header of a recording {what}", partial(_change_header, change=change))
    for key in ("format", "sensors", "bodies", "dt", "digest", "warnings"):
        yield Way(f"the header of a recording without {key}", partial(_change_header, change={}, without=key))


def _change_header(bake: Path, change: dict[str, Any], without: str = "") -> None:
    def changed(text: np.ndarray) -> np.ndarray:
        header = {**json.loads(str(text)), **change}
        header.pop(without, None)
        return np.array(json.dumps(header))

    change_array(bake, f"pad/{RECORDING_NAME}", "header", changed)


# --- manifests

MANIFESTS: dict[str, list[Any]] = {
    "sensor": ["", "cap", "other", "a\0b", "A" * 5000, "../../etc/passwd", 3, None, ["pad"]],
    "palpate": [3, None],
    "frame_start": [0, 2, -(10**30), 10**400, 1.5, "1", None, True],
    "frame_end": [3, 5, 0, -1, 10**12, 10**400, 4.5, "4", None],
    "fps": [0.0, -24.0, 25.0, 1e308, 1e-308, float("nan"), float("inf"), "24", None, [24]],
    "dt": [0.0, -1e-4, 2e-4, 1e308, float("nan"), "1e-4", None],
    "digest": ["another", "", 3, None],
    "unit": ["kN", "V", 3, None],
    "shape": [[0, 3], [3, 5], [10**9, 10**9], [1e300, 1], [5.5, 3], [5], [5, 3, 1], "5×3", None, [], [[5], [3]], [-5, -3]],
    "parameters": [
        *({"k": value} for value in ("stiff", -1.0, 0.0, float("nan"), float("inf"), 10**400, None, [1], True)),
        *({"unit": 3}, {"unit": "V"}, {"points_per_texel": 5}, {"mud": 1e9}, {"gain": 0.0}, [], None, "k"),
    ],
    "warnings": ["careful", 3, None],
    "complete": ["yes", 1, None],
    "scene_file": [3, ["a.blend"]],
    "body": ["other", 3, "pad\0"],
    "files": [{"../pad/recording.npz": "0"}, {"/etc/passwd": "0"}, {"recording.npz": 3}, {"recording.npz": "0" * 64}, []],
    "format": ["palpate-bake/99", 1, None, ["palpate-bake/1"], "A" * 5000],
}
MEANT = {("parameters", json.dumps({"gain": 0.0}))}


def _of_manifests() -> Iterator[Way]:
    for key, values in MANIFESTS.items():
        for value in values:
            text = json.dumps(value)
            yield Way(f"manifest: {key} is {text[:60]}", partial(change_manifest, change={key: value}), (key, text) in MEANT)
    for key in (
        "sensor",
        "palpate",
        "frame_start",
        "frame_end",
        "fps",
        "dt",
        "digest",
        "unit",
        "shape",
        "parameters",
        "format",
    ):
        yield Way(f"manifest: no {key}", partial(change_manifest, change={}, without=key))
    contents = {
        "empty": b"",
        "half": b'{"format": "palpate-bake/1", "sen',
        "a list": b"[]",
        "null": b"null",
        "not UTF-8": b"\xff\xfe\x00",
        "deeply nested": b"[" * 100_000,
        "deeply nested in a key": b'{"format": "palpate-bake/1", "parameters": ' + b'{"a": ' * 50_000 + b"1" + b"}" * 50_001,
        "NUL": bytes(100),
        "a long number": b'{"format": "palpate-bake/1", "fps": 1' + b"0" * 100_000 + b"}",
    }
    for what, content in contents.items():
        yield Way(f"manifest: {what}", partial(_replace, file=f"pad/{MANIFEST_NAME}", content=content))
    file = f"pad/{MANIFEST_NAME}"
    yield Way("manifest: a folder", partial(_as_folder, file=file))
    yield Way("manifest: a FIFO", partial(_fifo, file=file))
    yield Way("manifest: a link to a device", partial(_link, file=file, target="/dev/zero"))


def change_manifest(bake: Path, change: dict[str, Any], without: str = "") -> None:
    """Write other values into the manifest of ``pad``."""
    path = bake / "pad" / MANIFEST_NAME
    content = {**json.loads(path.read_text(encoding="utf-8")), **change}
    content.pop(without, None)
    path.write_text(json.dumps(content), encoding="utf-8")


# --- tactile images


def _of_images() -> Iterator[Way]:
    file = "pad/tactile_0002.exr"
    for share in (0.0, 0.3, 0.9):
        yield Way(f"image: cut at {share:g}", partial(_cut, file=file, share=share))
    for seed in range(6):
        yield Way(f"image: byte {seed} flipped", partial(_flip, file=file, seed=seed), harmless=True)
    yield Way("image: zeros", partial(_replace, file=file, content=bytes(512)))
    yield Way("image: a picture of another kind", partial(_replace, file=file, content=b"\x89PNG\r\n\x1a\n" + bytes(64)))
    yield Way("image: missing", partial(_missing, file=file))
    yield Way("image: a folder", partial(_as_folder, file=file))
    yield Way("image: a FIFO", partial(_fifo, file=file))
    yield Way("image: a link to a device", partial(_link, file=file, target="/dev/zero"))
    yield Way("image: of the next frame", partial(_copy, source="pad/tactile_0003.exr", file=file))
    yield Way("image: of another sensor", partial(_copy, source="cap/tactile_0002.exr", file=file))
    yield Way("image: of another bake", partial(_image_again, file=file, change=lambda frame: frame, digest="another"))
    for what, factor in (("doubled", 2.0), ("with NaN", np.nan), ("with the other sign", -1.0)):
        yield Way(f"image: {what}", partial(_raw_image, file=file, factor=factor))
    yield Way("image: of another size", partial(_other_size, file=file))
    yield Way("image: without its header", partial(_raw_image, file=file, factor=2.0, header=False))


def _of_image_lists() -> Iterator[Way]:
    """The list of the images' checksums, which older bakes do not have."""
    file = f"pad/{IMAGE_LIST_NAME}"
    changes: dict[str, Damage] = {
        "missing": partial(_missing, file=file),
        "empty": partial(_cut, file=file, share=0.0),
        "cut": partial(_cut, file=file, share=0.5),
        "one line fewer": partial(_change_lines, file=file, change=lambda lines: lines[:-1]),
        "one line more": partial(_change_lines, file=file, change=lambda lines: [*lines, lines[-1]]),
        "in another order": partial(_change_lines, file=file, change=lambda lines: lines[::-1]),
        "of another sensor": partial(_copy, source=f"cap/{IMAGE_LIST_NAME}", file=file),
        "text": partial(_replace, file=file, content=b"what did you expect?\n"),
        "not UTF-8": partial(_replace, file=file, content=b"\xff\xfe\n"),
        "a path out": partial(_change_lines, file=file, change=lambda lines: [b"0" * 64 + b"  ../../etc/passwd\n", *lines[1:]]),
        "a FIFO": partial(_fifo, file=file),
        "a link to a device": partial(_link, file=file, target="/dev/zero"),
    }
    for what, damage in changes.items():
        yield Way(f"list of images: {what}", damage, needs=file)
        if what not in ("missing", "a FIFO", "a link to a device"):
            yield Way(f"list of images: {what}, and vouched for", partial(_vouched, damage=damage, file=file), needs=file)


def _change_lines(bake: Path, file: str, change: Callable[[list[bytes]], list[bytes]]) -> None:
    (bake / file).write_bytes(b"".join(change((bake / file).read_bytes().splitlines(keepends=True))))


def _vouched(bake: Path, damage: Damage, file: str) -> None:
    """Damage a file, and let the manifest vouch for the result."""
    damage(bake)
    manifest = read_manifest((bake / file).parent)
    name = Path(file).name
    write_manifest((bake / file).parent, replace(manifest, files={**manifest.files, name: file_sha256(bake / file)}))


def _copy(bake: Path, source: str, file: str) -> None:
    shutil.copy(bake / source, bake / file)


def _image_again(bake: Path, file: str, change: Callable[[Any], Any], digest: str) -> None:
    """Write the image of frame 2 again with another digest."""
    texels = grid_texels()
    frame = change(recording_of(texels, 7).at(2).sensors["pad"])
    about = {**read_exr(bake / file)[1], "digest": digest}
    write_exr(bake / file, texels.layout, frame, about)


def _raw_image(bake: Path, file: str, factor: float, header: bool = True) -> None:
    """Write an image whose forces are multiplied; NaN as well, which Palpate would not write."""
    import OpenEXR

    pictures, about = read_exr(bake / file)
    pixels = {
        name: np.ascontiguousarray(
            picture[::-1] * np.float32(factor if name == "R" else 1) + np.float32(name == "R" and factor)
        )
        for name, picture in pictures.items()
    }
    attributes = {f"palpate.{key}": value for key, value in about.items()} if header else {}
    kinds = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File({**kinds, **attributes}, pixels) as image:
        image.write(str(bake / file))


def _other_size(bake: Path, file: str) -> None:
    """Put the image of another sensor in the place of one, which says that it is of this one."""
    texels, (_, about) = round_texels(), read_exr(bake / file)
    write_exr(bake / file, texels.layout, recording_of(texels, 7).at(2).sensors["pad"], about)


# --- folders


def _of_folders() -> Iterator[Way]:
    yield Way("folder: the sensors of pad and cap exchanged", partial(_exchange, file=SENSOR_NAME))
    yield Way("folder: the recordings of pad and cap exchanged", partial(_exchange, file=RECORDING_NAME))
    yield Way("folder: the manifests of pad and cap exchanged", partial(_exchange, file=MANIFEST_NAME))
    yield Way("folder: a sensor missing", lambda bake: shutil.rmtree(bake / "pad"), harmless=True)
    yield Way("folder: a manifest missing", partial(_missing, file=f"pad/{MANIFEST_NAME}"))
    yield Way("folder: a sensor twice", lambda bake: shutil.copytree(bake / "pad", bake / "pad copy"))
    yield Way("folder: a sensor of another bake", _another_bake)
    yield Way("folder: a sensor that moved differently", _moved_differently)
    yield Way("folder: all empty", _emptied)
    yield Way("folder: missing", shutil.rmtree)
    yield Way("folder: a file", _a_file)
    yield Way("folder: a link to itself", _linked_to_itself)
    yield Way("folder: names that are other names", _renamed, harmless=True)
    yield Way("folder: a record of a switch that is none", partial(_record, content=b"{"))
    yield Way("folder: a record that leads out", partial(_record, content=_leading_out()))


def _exchange(bake: Path, file: str) -> None:
    for source, target in (("pad", "waiting"), ("cap", "pad"), ("waiting", "cap")):
        (bake / "waiting").mkdir(exist_ok=True)
        os.replace(bake / source / file, bake / target / file)
    (bake / "waiting").rmdir()


def _another_bake(bake: Path) -> None:
    texels = grid_texels()
    recording = recording_of(texels, 7)
    recording.digest = "another"
    write_sensor(bake, "third", texels, recording=recording)


def _moved_differently(bake: Path) -> None:
    change_array(bake, f"pad/{RECORDING_NAME}", "velocities", _put(1.0))


def _emptied(bake: Path) -> None:
    for path in bake.rglob("*"):
        if path.is_file():
            path.write_bytes(b"")


def _a_file(bake: Path) -> None:
    shutil.rmtree(bake)
    bake.write_bytes(b"a file")


def _linked_to_itself(bake: Path) -> None:
    shutil.rmtree(bake)
    bake.symlink_to(bake.name)


def _renamed(bake: Path) -> None:
    """A user may call the folders as he likes: the manifests say whose they are."""
    os.replace(bake / "pad", bake / "waiting")
    os.replace(bake / "cap", bake / "pad")
    os.replace(bake / "waiting", bake / "cap")


def _record(bake: Path, content: bytes) -> None:
    (make_private_folder(bake) / SWITCH_NAME).write_bytes(content)


def _leading_out() -> bytes:
    record = {"format": "palpate-switch/1", "run": "0" * 16, "folders": ["../../etc"], "blend": "", "backups": 0}
    return json.dumps(record).encode()
