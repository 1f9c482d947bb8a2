# SPDX-License-Identifier: GPL-3.0-or-later
"""A finished bake, read from its folder without Blender and checked; figures and exports are made from it.

A file that opens may still hold what was never baked: an array of another shape or type, a NaN, a frame twice, the texels of
another sensor. Every such fault is found here once, so that whoever draws or exports a bake may rely on it. An image with its
SHA-256 in the manifest or the list of images is what was baked. Any other, as in older bakes, is compared with the recording.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import zip_longest
from pathlib import Path

import numpy as np

from ..errors import FileError, PalpateError
from ..geometry.layout.grid_layout import GridLayout
from ..geometry.layout.texture_maps import OverlapError, UVLayout
from ..geometry.texels import Texels
from ..model.recording import Recording, SensorFrame, SensorRecording, row_blocks
from ..model.sensor_parameters import Painted, SensorParameters
from ..model.vector_readings import VectorReadings
from .bake_folder import (
    IMAGE_LIST_NAME,
    MANIFEST_NAME,
    RECORDING_NAME,
    Manifest,
    check_sha256,
    folder_names,
    frame_file,
    read_manifest,
)
from .bake_replacement import is_interrupted
from .hidden_folder import PRIVATE_FOLDER
from .recording_npz import described, load_recording
from .sensor_npz import SENSOR_NAME, load_sensor
from .sensor_toml import stated_parameters
from .tactile_exr import CHANNELS, exr_channels, read_exr


@dataclass(frozen=True)
class Bake:
    """The recordings and descriptions of some sensors.

    Attributes
    ----------
    recording : Recording
    texels, painted, parameters, folders, manifests : dict
        By sensor name; the last two are empty for a recording that comes from no folder.
    """

    recording: Recording
    texels: dict[str, Texels]
    painted: dict[str, Painted]
    parameters: dict[str, SensorParameters]
    folders: dict[str, Path]
    manifests: dict[str, Manifest]

    def select(self, names: Sequence[str]) -> Bake:
        """Return the bake of some of the sensors, in the order of `names`.

        Raises
        ------
        FileError
            There is no such sensor.
        """
        for name in names:
            if name not in self.recording.sensors:
                raise FileError(f"There is no sensor '{name}' in this bake: choose from {', '.join(self.recording.sensors)}.")
        sensors = {name: self.recording.sensors[name] for name in names}
        tables = {item.name: getattr(self, item.name) for item in fields(self)[1:]}
        parts = {key: {name: table[name] for name in names if name in table} for key, table in tables.items()}
        return Bake(recording=replace(self.recording, sensors=sensors), **parts)


def read_bake(folder: str | os.PathLike, images: bool = True) -> Bake:
    """Read a bake folder, or the folder of one sensor in it, and check all of its files; the images only with `images`.

    Raises
    ------
    FileError
        There is no bake, a file of it is damaged, or its sensors do not belong to the same run.
    """
    if not os.fspath(folder) or not os.path.isdir(folder):  # an empty name would be the present folder
        raise FileError(f"The folder '{folder}' does not exist: bake first, or choose another.")
    folder = Path(folder)
    if os.path.lexists(folder / MANIFEST_NAME):
        return read_sensors([folder], images)
    folders = [place for place in sorted(folder.iterdir()) if place.name != PRIVATE_FOLDER and _is_bake(place)]
    if not folders and is_interrupted(folder):
        raise FileError(f"A bake in '{folder}' was interrupted while it took the place of the earlier one: bake again.")
    if not folders:
        raise FileError(f"'{folder}' holds no bake: bake first, or choose the folder that Physics › Palpate › Bake names.")
    bake = read_sensors(folders, images)
    expected = dict.fromkeys(name for manifest in bake.manifests.values() for name in manifest.sensors)
    for name in expected:
        if name not in bake.texels:
            raise FileError(
                f"The sensor '{name}' is missing from the bake in '{folder}', which had {_quoted(expected)}: bake again, or "
                "choose the folder of one sensor."
            )
    return bake


def _quoted(names: Iterable[str]) -> str:
    return ", ".join(f"'{name}'" for name in names)


def read_sensors(folders: Sequence[Path], images: bool = True) -> Bake:
    """Read the folders of some sensors of one bake.

    Parameters
    ----------
    folders : sequence of Path
    images : bool
        Check the tactile images as well, every one of which is read for that.

    Raises
    ------
    FileError
        As :func:`read_bake`.
    """
    manifests = {folder: read_manifest(folder) for folder in folders}
    first = manifests[folders[0]]
    for folder, manifest in manifests.items():
        if manifest.digest != first.digest or (manifest.bake_id and first.bake_id and manifest.bake_id != first.bake_id):
            raise FileError(
                f"The sensors '{first.sensor}' and '{manifest.sensor}' in '{folder.parent}' are of different bakes: "
                "bake again, or choose the folder of one sensor."
            )
    read: dict[str, SensorFiles] = {}
    for folder, manifest in manifests.items():
        if manifest.sensor in read:
            raise FileError(
                f"'{folder}' and '{read[manifest.sensor].folder}' both hold the sensor '{manifest.sensor}': "
                "move one of them out of the bake folder."
            )
        for name in (RECORDING_NAME, SENSOR_NAME):
            manifest.check_file(folder, name)
        recording, (texels, painted) = load_recording(folder / RECORDING_NAME), load_sensor(folder / SENSOR_NAME)
        read[manifest.sensor] = SensorFiles(folder, manifest, recording, texels, painted)
    parameters = {name: checked_parameters(files.folder, files.manifest) for name, files in read.items()}
    check_bake(read)
    for files in read.values() if images else ():
        check_images(files)
    sensors = {name: files.recording.sensors[name] for name, files in read.items()}
    return Bake(
        recording=replace(next(iter(read.values())).recording, sensors=sensors),
        texels={name: files.texels for name, files in read.items()},
        painted={name: files.painted for name, files in read.items()},
        parameters=parameters,
        folders={name: files.folder for name, files in read.items()},
        manifests={name: files.manifest for name, files in read.items()},
    )


def _is_bake(folder: Path) -> bool:
    """Return True if a folder in a bake folder holds a sensor's bake, even a damaged one.

    A copy of one that an older version has left is none.
    """
    if not any(os.path.lexists(folder / file) for file in (MANIFEST_NAME, RECORDING_NAME, SENSOR_NAME)):
        return False
    if not folder.name.endswith((".partial", ".old")):
        return True
    sensor = read_manifest(folder).sensor
    return folder_names([sensor])[sensor] == folder.name


def frame_index(recording: Recording, frame: int) -> int:
    """Return the index of a frame in a recording.

    Raises
    ------
    FileError
        The frame was not baked.
    """
    (found,) = np.nonzero(recording.frames == frame)
    if len(found) == 0:
        raise FileError(f"Frame {frame} is not in the bake: choose from {recording.frames[0]} to {recording.frames[-1]}.")
    return int(found[0])


MOST_PIXELS = 1 << 26
"""Pixels of a tactile image above which its size is taken for damage."""
FRAME_RATES = (1e-6, 1e10)
"""Least and most frames per second; Blender's lie far inside."""
LARGEST = float(np.finfo(np.float32).max)
"""Largest value of a texel, because its pixels have 32 bits."""
UNIT_TOLERANCE = 1e-6
"""By how much the length of a unit vector or a quaternion may differ from one."""
ROUNDING = 1e-5
"""Share of an image's largest value by which a pixel may differ from the recording, which another order of sums explains."""

_NUMBER, _WHOLE, _FLAG = "f", "iu", "b"
"""Kinds of array types (:attr:`numpy.dtype.kind`)."""
_PER_TEXEL = {"normal_force": (), "shear": (2,), "friction": (), "depth": (), "slip": (), "contact": (), "reading": ()}
"""Arrays of a recording with a value per frame and texel, and the shape of each value."""


@dataclass(frozen=True)
class SensorFiles:
    """Content of the folder of one sensor.

    Attributes
    ----------
    folder : Path
    manifest : Manifest
    recording : Recording
        From the folder's ``recording.npz``.
    texels : Texels
    painted : Painted
    """

    folder: Path
    manifest: Manifest
    recording: Recording
    texels: Texels
    painted: Painted


def check_bake(sensors: Mapping[str, SensorFiles]) -> None:
    """Check the files of all sensors that are read together, each by itself and against the others.

    Parameters
    ----------
    sensors : mapping of str to SensorFiles
        By sensor name.

    Raises
    ------
    FileError
        A file is damaged or belongs to another bake; the message names it.
    """
    for files in sensors.values():
        check_sensor_files(files)
    if not sensors:
        return
    first, *others = sensors.values()
    for other in others:
        for name in ("frames", "times", "poses", "velocities"):
            if not _is_equal(getattr(first.recording, name), getattr(other.recording, name)):
                raise FileError(
                    f"'{other.folder / RECORDING_NAME}' and '{first.folder / RECORDING_NAME}' differ in '{name}', so they are "
                    "not of the same bake: bake again, or choose the folder of one sensor."
                )


def _is_equal(one: np.ndarray, other: np.ndarray) -> bool:
    return one.shape == other.shape and all(np.array_equal(one[rows], other[rows]) for rows in row_blocks(one))


def check_sensor_files(files: SensorFiles) -> None:
    """Check the manifest, the texels and the recording of one sensor; raises FileError as :func:`check_bake` does."""
    for name, check in ((MANIFEST_NAME, _check_manifest), (SENSOR_NAME, _check_texels), (RECORDING_NAME, _check_recording)):
        try:
            check(files)
        except Fault as fault:
            raise FileError(f"'{files.folder / name}' is damaged ({fault}): bake again.") from fault


def checked_parameters(folder: Path, manifest: Manifest) -> SensorParameters:
    """Return the parameters that a manifest holds; a parameter that an older version did not have keeps its default.

    Raises
    ------
    FileError
        A value is of another kind than its parameter, or has no meaning.
    """
    try:
        parameters = SensorParameters(**stated_parameters(manifest.parameters, "its parameters"))
        parameters.check(manifest.sensor)
    except PalpateError as error:
        raise FileError(f"'{folder / MANIFEST_NAME}' is damaged ({str(error).rstrip('.')}): bake again.") from error
    return parameters


class Fault(Exception):
    """What is wrong with a file, as words for the brackets of a message."""


def _require(good: object, fault: str) -> None:
    if not good:
        raise Fault(fault)


def _everywhere(test: Callable[[np.ndarray], np.ndarray], array: np.ndarray) -> bool:
    """Return True if a test holds for all of an array, which is gone through block by block."""
    return all(bool(test(array[rows]).all()) for rows in row_blocks(array))


def _is_unit(quaternions: np.ndarray) -> np.ndarray:
    return np.abs(np.linalg.norm(quaternions, axis=-1) - 1.0) < UNIT_TOLERANCE


def _check_array(name: str, array: object, kinds: str, shape: tuple[int | None, ...]) -> None:
    """Require an array of one of some kinds and of a shape, in which None is any length, without NaN or infinite values."""
    _require(isinstance(array, np.ndarray), f"'{name}' is no array")
    assert isinstance(array, np.ndarray)
    _require(array.dtype.kind in kinds and array.dtype.itemsize <= 8, f"'{name}' has the type {array.dtype}")
    fits = array.ndim == len(shape) and all(want is None or want == got for want, got in zip(shape, array.shape, strict=True))
    wanted = " × ".join("any" if side is None else str(side) for side in shape)
    _require(fits, f"'{name}' has the shape {' × '.join(map(str, array.shape)) or 'of a single value'} and not {wanted}")
    if array.dtype.kind == _NUMBER:
        _require(_everywhere(np.isfinite, array), f"'{name}' has values that are not finite")


# --- the manifest


def _check_manifest(files: SensorFiles) -> None:
    manifest = files.manifest
    _require(manifest.sensor, "the sensor has no name")
    _require(FRAME_RATES[0] <= manifest.fps <= FRAME_RATES[1], f"fps is {manifest.fps:g}")
    _require(manifest.dt > 0, f"dt is {manifest.dt:g}")
    unit = manifest.parameters.get("unit", manifest.unit)
    _require(unit == manifest.unit, f"its unit is {manifest.unit!r:.40}, that of its parameters {unit!r:.40}")
    _require(manifest.frame_start <= manifest.frame_end, f"frames run from {manifest.frame_start} to {manifest.frame_end}")
    height, width = manifest.shape
    _require(height > 0 and width > 0 and height * width <= MOST_PIXELS, f"shape is {height} × {width} pixels")


# --- texels


def _check_texels(files: SensorFiles) -> None:
    texels, manifest = files.texels, files.manifest
    _require(isinstance(texels.position, np.ndarray) and texels.position.ndim == 2, "'position' is no table")
    count = len(texels.position)
    _require(count > 0, "it has no texels")
    _check_array("vertex", texels.vertex, _WHOLE, (count,))
    for name in ("position", "normal", "tangent"):
        _check_array(name, getattr(texels, name), _NUMBER, (count, 3))
    _check_array("area", texels.area, _NUMBER, (count,))
    _require((texels.vertex >= 0).all(), "'vertex' has negative numbers")
    _require((texels.area >= 0).all(), "'area' has negative values")
    for name in ("normal", "tangent"):
        lengths = np.linalg.norm(getattr(texels, name), axis=1)
        _require((np.abs(lengths - 1.0) < UNIT_TOLERANCE).all(), f"'{name}' has vectors that are not of length one")
    if isinstance(texels.layout, GridLayout):
        _check_grid(texels.layout, count)
    else:
        _check_texture_map(texels.layout, count)
    shape = tuple(texels.layout.shape)
    _require(shape == manifest.shape, f"its images have {_by(shape)} pixels, those of the manifest {_by(manifest.shape)}")
    for item in fields(Painted):
        values = getattr(files.painted, item.name)
        if values is not None:
            _check_array(f"painted/{item.name}", values, _NUMBER, (count,))
    try:
        files.painted.check(manifest.sensor, count)
    except PalpateError as error:
        raise Fault(str(error).rstrip(".")) from error


def _by(shape: tuple[int, ...]) -> str:
    return " × ".join(str(side) for side in shape)


def _in_words(value: object) -> str:
    """Return a value as one line, whatever a file has in its place."""
    return f"an array of {_by(value.shape)}" if isinstance(value, np.ndarray) and value.ndim else f"{value!r:.40}"


def _check_sides(*sides: object) -> None:
    for side in sides:
        whole = isinstance(side, int | np.integer) and not isinstance(side, bool)
        _require(whole and 0 < side <= MOST_PIXELS, f"a side of its images is {_in_words(side)}")  # type: ignore[operator]


def _check_corners(triangles: object, count: int) -> None:
    """Require a table of triangles between `count` texels."""
    _check_array("layout/triangles", triangles, _WHOLE, (None, 3))
    assert isinstance(triangles, np.ndarray)
    _require(((triangles >= 0) & (triangles < count)).all(), "'layout/triangles' names texels that do not exist")


def _check_grid(layout: GridLayout, count: int) -> None:
    _check_sides(layout.rows, layout.columns)
    _check_array("layout/row", layout.row, _WHOLE, (count,))
    _check_array("layout/column", layout.column, _WHOLE, (count,))
    _require(((layout.row >= 0) & (layout.row < layout.rows)).all(), "'layout/row' leads out of the image")
    _require(((layout.column >= 0) & (layout.column < layout.columns)).all(), "'layout/column' leads out of the image")
    pixels = layout.row.astype(np.int64) * layout.columns + layout.column.astype(np.int64)
    _require(len(np.unique(pixels)) == count, "two texels have the same pixel")
    _check_corners(layout.triangles, count)


def _check_texture_map(layout: UVLayout, count: int) -> None:
    _check_sides(layout.height, layout.width)
    _check_corners(layout.triangles, count)
    _require(len(np.unique(layout.triangles)) == count, "'layout/triangles' leaves texels out")
    _check_array("layout/corner_uv", layout.corner_uv, _NUMBER, (len(layout.triangles), 3, 2))
    _require(((layout.corner_uv > -0.01) & (layout.corner_uv < 1.01)).all(), "'layout/corner_uv' leads out of the image")
    for name in ("cell", "margin"):
        value = getattr(layout, name)
        whole = isinstance(value, int) and not isinstance(value, bool)
        _require(whole and 0 <= value <= max(layout.shape), f"'layout/{name}' is {_in_words(value)}")
    _require(isinstance(layout.nearest, bool), f"'layout/nearest' is {_in_words(layout.nearest)}")
    _require(isinstance(layout.map_name, str), f"'layout/map_name' is {_in_words(layout.map_name)}")


# --- the recording


def _check_recording(files: SensorFiles) -> None:
    recording, manifest = files.recording, files.manifest
    _require(
        list(recording.sensors) == [manifest.sensor],
        f"it is of {', '.join(repr(name) for name in recording.sensors) or 'no sensor'} and not of '{manifest.sensor}'",
    )
    _require(recording.digest == manifest.digest, "its digest and that of the manifest differ")
    _require(recording.dt == manifest.dt, f"its time step is {recording.dt:g} s, that of the manifest {manifest.dt:g} s")
    _check_frames(recording, manifest)
    bodies, count = len(recording.body_names), len(recording.frames)
    _require(
        not manifest.body or manifest.body in recording.body_names, f"'{manifest.body}', which carries the sensor, is not in it"
    )
    _check_array("poses", recording.poses, _NUMBER, (count, bodies, 7))
    _check_array("velocities", recording.velocities, _NUMBER, (count, bodies, 6))
    _require(_everywhere(_is_unit, recording.poses[:, :, 3:]), "'poses' has quaternions that are not of length one")
    _check_channels(recording.sensors[manifest.sensor], count, len(files.texels))
    _check_vectors(recording.sensors[manifest.sensor].channels, files)


def _check_frames(recording: Recording, manifest: Manifest) -> None:
    """Require the frames and times that the manifest promises, each once and in order."""
    frames = recording.frames
    _check_array("frames", frames, _WHOLE, (None,))
    count = len(frames)
    _require(count > 0, "it has no frames")
    _check_array("times", recording.times, _NUMBER, (count,))
    expected = np.arange(count) + int(manifest.frame_start)
    _require(np.array_equal(frames, expected), f"its frames do not follow each other from {manifest.frame_start}")
    last = int(frames[-1])
    good = last == manifest.frame_end if manifest.complete else last <= manifest.frame_end
    _require(good, f"its last frame is {last}, that of the manifest {manifest.frame_end}")
    seconds = np.arange(count) / manifest.fps
    _require(np.allclose(recording.times, seconds, rtol=1e-9, atol=1e-9), "'times' does not follow from the frames and fps")


def _check_vectors(channels: VectorReadings | None, files: SensorFiles) -> None:
    """Require the readings of several channels that the manifest promises, or none."""
    said = {} if channels is None else described(channels)
    _require(said == files.manifest.channels, "its channels and those of the manifest differ")
    if channels is None:
        return
    _check_array("channels/values", channels.values, _NUMBER, (len(files.recording.frames), None, len(channels.names)))
    _require(
        _everywhere(lambda part: np.abs(part) <= LARGEST, channels.values),
        "'channels/values' has values that no pixel can hold",
    )
    if channels.place is not None:
        _check_array("channels/place", channels.place, _NUMBER, (channels.values.shape[1], 3))


def _check_channels(sensor: SensorRecording, frames: int, texels: int) -> None:
    for name, value_shape in _PER_TEXEL.items():
        kinds = _FLAG if name == "contact" else _NUMBER
        values = getattr(sensor, name)
        _check_array(name, values, kinds, (frames, texels, *value_shape))
        _require(
            kinds == _FLAG or _everywhere(lambda part: np.abs(part) <= LARGEST, values),
            f"'{name}' has values that no pixel can hold",
        )
    for name in ("net_force", "net_torque", "centre_of_pressure"):
        _check_array(name, getattr(sensor, name), _NUMBER, (frames, 3))
    for name in ("friction", "depth", "slip"):
        _require(_everywhere(lambda part: part >= 0, getattr(sensor, name)), f"'{name}' has negative values")


# --- images


def check_images(files: SensorFiles) -> None:
    """Check the tactile images of one sensor, whose other files have been checked.

    Raises
    ------
    FileError
        An image is missing or damaged, or shows something else than the recording; the message names it.
    """
    recording, manifest, name = files.recording, files.manifest, files.manifest.sensor
    if not manifest.has_images:
        return
    if IMAGE_LIST_NAME in manifest.files:
        _check_listed(files)
        return
    for number in recording.frames:
        file = frame_file(int(number))
        if file in manifest.files:
            manifest.check_file(files.folder, file)
        else:
            fault = _fault(files, int(number), recording.at(int(number)).sensors[name])
            if fault:
                raise FileError(f"'{files.folder / file}' does not belong to its bake ({fault}): bake again.")


def _check_listed(files: SensorFiles) -> None:
    """Check the images that the list of the bake names, one for each frame."""
    listed = files.manifest.image_checksums(files.folder)
    for number, found in zip_longest(files.recording.frames, listed):
        if number is None or found is None or found[0] != frame_file(int(number)):
            raise FileError(f"'{files.folder / IMAGE_LIST_NAME}' does not list an image for each frame: bake again.")
        check_sha256(files.folder / found[0], found[1])


def _fault(files: SensorFiles, number: int, frame: SensorFrame) -> str:
    """Return what is wrong with the image of a frame; empty if nothing is."""
    found, about = read_exr(files.folder / frame_file(number))
    manifest = files.manifest
    said = {"sensor": manifest.sensor, "frame": str(number), "digest": manifest.digest, "unit": manifest.unit}
    for key, value in said.items():
        if about.get(key, value) != value:
            return f"its {key} is {about[key]!r:.60} and not {value!r:.60}"
    try:
        expected = exr_channels(files.texels.layout, frame)
    except OverlapError:
        path = files.folder / SENSOR_NAME
        raise FileError(f"'{path}' is damaged (two parts of the region cover one pixel): bake again.") from None
    for channel in CHANNELS:
        if channel not in found:
            return f"it has no channel {channel}"
        if found[channel].shape != manifest.shape:
            return f"it has {' × '.join(map(str, found[channel].shape))} pixels"
        difference = np.abs(found[channel] - expected[channel])
        if channel != "contact" and not (difference <= ROUNDING * np.abs(expected[channel]).max(initial=0.0)).all():
            return f"its channel {channel} differs from the recording"
    return ""
