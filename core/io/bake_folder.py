# SPDX-License-Identifier: GPL-3.0-or-later
"""A bake folder: names of its folders and files, which ``docs/files.md`` lists, and the manifest of each sensor's bake.

A bake belongs to the .blend whose path is in the manifest, as long as that file exists, and in it to the scene with the id that
the manifest has. So a .blend that was renamed or moved may replace its bake, and a copy may not replace that of its original.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from ..effects.engine.registry import to_dict
from ..errors import FileError, os_error_reason
from ..model.recording import Frame, Recording
from ..model.scenario import Scenario
from ..model.sensor import Sensor
from ..version import VERSION
from .file_writing import atomic_write, file_sha256
from .hidden_folder import PRIVATE_FOLDER
from .input_files import open_regular
from .recording_npz import SENSOR_NAME, described, save_recording, save_sensor
from .schema import read_json
from .tactile_exr import describe, nearest_places, write_exr

MANIFEST_FORMAT = "palpate-bake/1"
MANIFEST_NAME = "manifest.json"
OWN_DIGEST = "manifest_sha256"
"""Key of the SHA-256 of all that the manifest says otherwise."""
RECORDING_NAME = "recording.npz"
IMAGE_LIST_NAME = "images.sha256"
UNCHANGED_NOTE = "palpate-unchanged-since-bake:"
"""Begins the note, with the id of its bake, in a .blend whose settings, meshes and animation are those that were baked."""

_SINGLE_FILES = (RECORDING_NAME, SENSOR_NAME, MANIFEST_NAME, IMAGE_LIST_NAME)
BAKE_FILE_NAMES = re.compile(rf"tactile_-?\d+\.exr|{'|'.join(map(re.escape, _SINGLE_FILES))}")
"""Names of the files in a sensor's folder that a bake writes and replaces."""

_RESERVED = {"con", "prn", "aux", "nul", *(f"{port}{i}" for port in ("com", "lpt") for i in range(1, 10))}
"""Names that Windows reserves for devices."""


def folder_names(names: Iterable[str], blank: str = " ") -> dict[str, str]:
    """Return a unique folder name for each sensor that every operating system accepts.

    A name of letters, digits, blanks, dots, hyphens and underscores is kept. In any other name the remaining characters
    become ``_`` and a checksum of the name is appended. The same is done for names that differ only in case. A blank becomes
    `blank`.
    """
    chosen: dict[str, str] = {}
    taken: set[str] = set()
    for name in dict.fromkeys(names):
        clean = "".join(c if c.isalnum() or c in " ._-" else "_" for c in name).strip(" .")[:60]
        if not clean or clean != name or clean.split(".")[0].lower() in _RESERVED or clean.casefold() in taken:
            base = f"{clean or 'sensor'}-{zlib.crc32(name.encode('utf-8', 'surrogatepass')):08x}"
            clean = base if clean.split(".")[0].lower() not in _RESERVED else f"_{base}"
        clean = clean.replace(" ", blank)
        while clean.casefold() in taken:
            clean += "_"
        taken.add(clean.casefold())
        chosen[name] = clean
    return chosen


def frame_file(frame: int) -> str:
    """Return the name of a frame's tactile image; Blender plays files named like this as a sequence."""
    return f"tactile_{frame:04d}.exr"


@dataclass(frozen=True)
class Manifest:
    """Description of one sensor's bake: where it comes from and how to read it.

    Attributes
    ----------
    sensor : str
    palpate : str
        Version of Palpate that wrote it.
    frame_start, frame_end : int
        Frames of the whole bake, both included.
    fps : float, frames per second
    dt : float, seconds
        Substep.
    step_reason : str
        Why that one; empty when the manifest is older.
    digest : str
        :meth:`.scenario.Scenario.digest` of what was solved. Sensors of one bake have the same digest.
    unit : str
        Of the channel ``reading``.
    shape : (int, int)
        Height and width of the images, pixels.
    parameters : dict
        Of the sensor, JSON values.
    warnings : tuple of str
    complete : bool
        True once all images and the recording are written.
    scene_file : str
        Name, without its folder, of the .blend that was baked; empty when it had none, or when the manifest is older.
    body : str
        Name of the body that carries the sensor, among those of the recording; empty when the manifest is older.
    bake_id : str
        Hash of all files of the bake, the same for all of its sensors; empty when the manifest is older.
    scene_id : str
        Id of the scene that was baked, as stored in its .blend; empty when it stored none, or when the manifest is older.
    scene_path : str
        Path of the .blend, relative to the bake folder, with ``/``; empty as `scene_file`.
    sensors : tuple of str
        Names of all sensors of the bake; empty when the manifest is older.
    files : dict of str to str
        SHA-256 of each file in the folder except the manifest itself and the images, by name. Those of the images are in
        ``images.sha256``, which is one of these files.
    effects : list of dict, or None
        Of the sensor, each as :func:`.registry.to_dict` writes it; None when the manifest is older.
    channels : dict
        Of a sensor with several channels: their `unit` and `names`, and the `place` of each group of them
        (:func:`.recording_npz.described`). Others have none, and no such word.
    """

    sensor: str
    palpate: str
    frame_start: int
    frame_end: int
    fps: float
    dt: float
    digest: str
    unit: str
    shape: tuple[int, int]
    parameters: dict[str, Any]
    warnings: tuple[str, ...]
    complete: bool
    scene_file: str = ""
    body: str = ""
    step_reason: str = ""
    bake_id: str = ""
    scene_id: str = ""
    scene_path: str = ""
    sensors: tuple[str, ...] = ()
    files: dict[str, str] = field(default_factory=dict)
    effects: list[dict[str, Any]] | None = None
    channels: dict[str, Any] = field(default_factory=dict)

    @property
    def has_images(self) -> bool:
        """Whether the bake has tactile images."""
        return IMAGE_LIST_NAME in self.files

    def check_files(self, folder: Path, images: bool) -> None:
        """Check the files in the bake's folder against their SHA-256; the images, each of which is read for that, if asked.

        Raises
        ------
        FileError
            A file is missing or damaged.
        """
        for name, sha256 in self.files.items():
            check_sha256(folder / name, sha256)
        if images and self.has_images:
            for name, sha256 in read_checksums(folder / IMAGE_LIST_NAME):
                check_sha256(folder / name, sha256)


def check_sha256(path: Path, sha256: str) -> None:
    """Raise FileError if a file of a bake is missing or does not have this SHA-256."""
    try:
        found = file_sha256(path)
    except FileNotFoundError:
        raise FileError(f"'{path}' is missing from the bake: bake again.") from None
    except OSError as error:
        raise FileError(f"'{path}' could not be read ({os_error_reason(error)}): check its permissions.") from error
    if found != sha256:
        raise FileError(f"'{path}' is damaged (its content is not what was baked): bake again.")


def write_image_of(folder: Path, sensor: Sensor, frame: Frame, digest: str) -> None:
    """Write the tactile image of a frame of a sensor into its folder, and add its SHA-256 to the list there.

    Parameters
    ----------
    folder : Path
    sensor : Sensor
    frame : Frame
    digest : str
        Of the scenario.

    Raises
    ------
    FileError, OSError
        A file cannot be written.
    """
    path = folder / frame_file(frame.frame)
    nearest = nearest_places(sensor.texels, None if sensor.channels is None else sensor.channels.no_frames())
    write_exr(path, sensor.texels.layout, frame.sensors[sensor.name], describe(sensor, frame, digest), nearest)
    with (folder / IMAGE_LIST_NAME).open("a", encoding="ascii", newline="\n") as file:
        file.write(f"{file_sha256(path)}  {path.name}\n")


def write_arrays_of(folder: Path, sensor: Sensor, recording: Recording) -> dict[str, str]:
    """Write recording and texels of a sensor into its folder, and return the SHA-256 of all files there, by name.

    Raises
    ------
    FileError, OSError
        A file cannot be written.
    """
    own = replace(recording, sensors={sensor.name: recording.sensors[sensor.name]})
    save_recording(folder / RECORDING_NAME, own)
    save_sensor(folder / SENSOR_NAME, sensor.texels, sensor.painted)
    names = (RECORDING_NAME, SENSOR_NAME, IMAGE_LIST_NAME)
    return {name: file_sha256(folder / name) for name in names if (folder / name).exists()}


def read_checksums(path: Path) -> Iterator[tuple[str, str]]:
    """Yield the name and the SHA-256 of each file of a list, which has been checked itself; raises what opening it raises."""
    with open_regular(path, "r", encoding="ascii") as file:
        for line in file:
            sha256, _, name = line.rstrip("\n").partition("  ")
            yield name, sha256


def manifest_of(scenario: Scenario, sensor: Sensor, recording: Recording, files: Mapping[str, str]) -> Manifest:
    """Return the manifest of a sensor, complete but for what a .blend and its bake add.

    Parameters
    ----------
    scenario : Scenario
        That was computed.
    sensor : Sensor
        One of its sensors.
    recording : Recording
        Of the scenario.
    files : mapping of str to str
        SHA-256 of the files in the sensor's folder, by name.
    """
    channels = recording.sensors[sensor.name].channels
    return Manifest(
        sensor=sensor.name,
        palpate=VERSION,
        frame_start=scenario.frame_start,
        frame_end=scenario.frame_end,
        fps=scenario.fps,
        dt=recording.dt,
        digest=recording.digest,
        unit=sensor.parameters.unit,
        shape=(int(sensor.texels.layout.shape[0]), int(sensor.texels.layout.shape[1])),
        parameters=asdict(sensor.parameters),
        warnings=recording.warnings,
        complete=True,
        body=scenario.bodies[sensor.body].name,
        step_reason=recording.step_reason,
        sensors=tuple(recording.sensors),
        files=dict(sorted(files.items())),
        effects=[to_dict(effect) for effect in sensor.effects],
        channels={} if channels is None else described(channels),
    )


def write_manifest(folder: str | os.PathLike, manifest: Manifest) -> Path:
    """Write ``manifest.json`` into `folder` atomically, and return its path.

    Raises
    ------
    FileError
        It cannot be written.
    ValueError
        A number is not finite or a parameter is no JSON value (a fault of the program, not of the user).
    """
    path = Path(folder) / MANIFEST_NAME
    content = {"format": MANIFEST_FORMAT, **{item.name: getattr(manifest, item.name) for item in fields(manifest)}}
    if manifest.effects is None:
        del content["effects"]
    if not manifest.channels:
        del content["channels"]
    try:
        content[OWN_DIGEST] = _own_digest(content)
        text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    except TypeError as error:
        raise ValueError(f"the manifest of '{manifest.sensor}' holds something that is not JSON: {error}") from error
    with atomic_write(path) as temporary:
        temporary.write_bytes((text + "\n").encode("utf-8", "surrogatepass"))
    return path


def read_manifest(folder: str | os.PathLike) -> Manifest:
    """Read ``manifest.json`` of a sensor's bake folder.

    Raises
    ------
    FileError
        There is none, or it is not one that this version reads.
    """
    path = Path(folder) / MANIFEST_NAME
    try:
        manifest, content = read_json(path, Manifest, MANIFEST_FORMAT, "bake again")
    except FileNotFoundError:
        raise FileError(f"'{path}' does not exist: bake first, or choose a sensor's folder inside the bake folder.") from None
    if OWN_DIGEST not in content or not manifest.files.keys() >= {RECORDING_NAME, SENSOR_NAME}:
        raise FileError(f"'{path}' is of an older version, which did not vouch for the files of a bake: bake again.")
    if content[OWN_DIGEST] != _own_digest(content) or not manifest.files.keys() <= set(_SINGLE_FILES):
        raise FileError(f"'{path}' is damaged (its content is not what was baked): bake again.")
    return manifest


def _own_digest(content: Mapping[str, Any]) -> str:
    """Return the SHA-256 of a manifest's content without this digest, whatever the order of its keys."""
    rest = {key: value for key, value in content.items() if key != OWN_DIGEST}
    return hashlib.sha256(json.dumps(rest, sort_keys=True).encode()).hexdigest()


@dataclass(frozen=True)
class BakeOwner:
    """The scene that is baked.

    Attributes
    ----------
    scene_id : str
        Id of the scene; empty where its .blend does not store one.
    blend : Path or None
        The .blend that the bake belongs to; None if the scene was never saved.
    source : Path or None
        The .blend that was opened, where the scene is saved to another one together with the bake.
    other_scenes : frozenset of str
        Ids of the other scenes in the same .blend.
    """

    scene_id: str = ""
    blend: Path | None = None
    source: Path | None = None
    other_scenes: frozenset[str] = frozenset()

    def scene_path(self, bake_folder: Path) -> str:
        """Return the path of the .blend as manifests hold it: with ``/``, and relative to the bake folder where possible."""
        if self.blend is None:
            return ""
        blend = os.path.realpath(self.blend)
        try:
            return Path(os.path.relpath(blend, os.path.realpath(bake_folder))).as_posix()
        except ValueError:  # Windows: another drive
            return Path(blend).as_posix()


def other_owner(manifest: Manifest, bake_folder: Path, owner: BakeOwner) -> str:
    """Return whose bake a manifest describes, in words, if it belongs to another scene than `owner`; empty if not.

    Parameters
    ----------
    manifest : Manifest
        Of a sensor's folder in `bake_folder`.
    bake_folder : Path
    owner : BakeOwner
        The scene that would replace the bake.
    """
    if manifest.scene_id != owner.scene_id and manifest.scene_id in owner.other_scenes:
        return "another scene of the same .blend"
    stated = manifest.scene_path
    blend = Path(os.path.normpath(Path(os.path.realpath(bake_folder), stated)))
    if not stated or stated.startswith(("//", "\\\\")) or "\0" in stated or not os.path.isfile(blend):
        return ""
    is_ours = any(own is not None and own.is_file() and own.samefile(blend) for own in (owner.blend, owner.source))
    return "" if is_ours else f"'{blend}'"


# A bake is written into the folder ``new`` of the hidden folder. When it is complete, each sensor's folder is moved into the
# folder ``old``, and the new one into its place. An error takes all of this back. A kill may leave folders of both bakes, whose
# manifests have different ids, so that every reader says so, and the next bake replaces them. Files in a replaced folder that
# no bake has written belong to the user and move into the new folder.

NEW, OLD = "new", "old"


def is_interrupted(bake_folder: Path) -> bool:
    """Return True if a bake was killed while it took the place of the earlier one."""
    old = bake_folder / PRIVATE_FOLDER / OLD
    return old.is_dir() and any(old.iterdir())


def begin_bake(bake_folder: Path) -> Path:
    """Remove what a killed bake has left, and return the empty folder for the sensors' folders of a new one.

    The caller holds the lock of the bake folder. Raises OSError.
    """
    discard_bake(bake_folder)
    new = bake_folder / PRIVATE_FOLDER / NEW
    new.mkdir()
    return new


def publish_bake(bake_folder: Path, names: Sequence[str], last: Callable[[], None] = lambda: None) -> None:
    """Move the new folders of these names to their places, and do one more step; if anything fails, nothing has changed.

    Raises
    ------
    OSError
        A folder cannot be moved.
    """
    new, old = (bake_folder / PRIVATE_FOLDER / name for name in (NEW, OLD))
    old.mkdir(exist_ok=True)
    try:
        for name in names:
            if os.path.lexists(bake_folder / name):
                os.replace(bake_folder / name, old / name)
            os.replace(new / name, bake_folder / name)
        last()
    except BaseException:
        with suppress(OSError):  # what cannot be taken back now, the next bake tries again
            for name in names:
                if not os.path.lexists(new / name) and not os.path.lexists(old / name):
                    os.replace(bake_folder / name, new / name)  # it had no predecessor
            _take_back(bake_folder, new, old)
        raise
    with suppress(OSError):
        discard_bake(bake_folder)


def discard_bake(bake_folder: Path) -> None:
    """Remove a bake that is not complete, or one that was replaced; if a kill came between, the earlier bake returns.

    The caller holds the lock of the bake folder. Raises OSError.
    """
    new, old = (bake_folder / PRIVATE_FOLDER / name for name in (NEW, OLD))
    if old.is_dir():
        if new.is_dir() and any(new.iterdir()):
            _take_back(bake_folder, new, old)
        for replaced in sorted(old.iterdir()):
            if replaced.is_symlink():  # the user's folder stays where the link leads
                replaced.unlink()
            else:
                _remove_bake(replaced, bake_folder / replaced.name)
        old.rmdir()
    shutil.rmtree(new, ignore_errors=True)


def _take_back(bake_folder: Path, new: Path, old: Path) -> None:
    """Put the replaced folders into their places again."""
    for replaced in sorted(old.iterdir()):
        place = bake_folder / replaced.name
        if os.path.lexists(place):
            os.replace(place, new / place.name)
        os.replace(replaced, place)


def _remove_bake(replaced: Path, place: Path) -> None:
    """Remove a folder with the files of a bake; what the user has put beside them moves into the sensor's folder."""
    for path in replaced.iterdir():
        if BAKE_FILE_NAMES.fullmatch(path.name) and (path.is_symlink() or not path.is_dir()):
            path.unlink()
            continue
        target = place / path.name
        while os.path.lexists(target):
            target = target.with_name(f"{target.name}_")
        os.replace(path, target)
    replaced.rmdir()
