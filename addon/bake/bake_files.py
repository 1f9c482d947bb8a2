# SPDX-License-Identifier: GPL-3.0-or-later
"""The files of a bake: written into a hidden folder, they take the place of the earlier bake when all are complete."""

from __future__ import annotations

import hashlib
import json
import math
import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path

import bpy

from ...core.errors import FileError, os_error_reason
from ...core.io.bake_folder import (
    BAKE_FILE_NAMES,
    MANIFEST_FORMAT,
    MANIFEST_NAME,
    BakeOwner,
    begin_bake,
    discard_bake,
    folder_names,
    manifest_of,
    other_owner,
    publish_bake,
    read_manifest,
    write_arrays_of,
    write_image_of,
    write_manifest,
)
from ...core.io.file_writing import require_space, writable_folder
from ...core.io.hidden_folder import PRIVATE_FOLDER, is_private_folder, lock_folder
from ...core.io.input_files import read_bytes
from ...core.io.row_tables import FrameTable
from ...core.io.tactile_exr import CHANNELS
from ...core.model.recording import Frame, Recording
from ...core.model.scenario import Scenario

TEXEL_BYTES = 64
"""Most bytes of a texel at one frame: seven numbers, and whether it is in contact."""
IMAGE_BYTES, PIXEL_BYTES = 7000, 4
"""Most bytes of an image apart from its pixels: header, line in the list, rest of a block. And of a channel of a pixel."""


def bake_folder(scene) -> Path:
    """Return the absolute bake folder of a scene.

    Raises
    ------
    FileError
        The folder is empty, or relative to a .blend that has not been saved yet.
    """
    text = scene.palpate.folder
    if not text.strip():
        raise FileError(f"The bake folder of '{scene.name}' is empty: name one in Physics › Palpate › Bake.")
    if text.startswith("//") and not bpy.data.filepath:
        raise FileError(f"The bake folder '{text}' is relative to a file that is not saved yet: save the .blend first.")
    return Path(bpy.path.abspath(text))


def check_space(folder: Path, scenario: Scenario, images: bool = True) -> None:
    """Raise FileError if the disk cannot hold a new bake: its frames as they grow, recordings and images, uncompressed."""
    motion = 8 * (2 + 13 * len(scenario.bodies))  # bytes of a frame: its number and time, poses and velocities
    needed = motion
    for sensor in scenario.sensors:
        if not sensor.readout:
            continue
        layers, own = len(CHANNELS), TEXEL_BYTES * len(sensor.texels) + 8 * 9  # with force, torque and centre of pressure
        if sensor.channels is not None:
            none = sensor.channels.no_frames()
            layers += len(none.names)
            own += 9 * math.prod(none.values.shape[1:])  # values, and which are clipped
        needed += motion + 2 * own
        if images:
            needed += IMAGE_BYTES + PIXEL_BYTES * layers * math.prod(sensor.texels.layout.shape)
    require_space(folder, float(len(scenario.frames) * needed), "The bake")


@dataclass(frozen=True)
class BlendToSave:
    """A .blend that is saved with a bake, and takes its place in the same moment.

    Attributes
    ----------
    path : Path
        Absolute and without links.
    write : callable
        Writes the open scene to the path that it is given. Raises FileError.
    backups : int
        Number of earlier versions that are kept as ``<path>1``, ``<path>2``, …
    """

    path: Path
    write: Callable[[Path], None]
    backups: int = 0

    @property
    def waiting(self) -> Path:
        """Where the new .blend waits: beside its place."""
        return self.path.with_name(f".{self.path.name}.palpate-partial")

    def prepare(self) -> None:
        """Write the new .blend to where it waits, in the place of one that a killed process has left."""
        self.waiting.unlink(missing_ok=True)
        self.write(self.waiting)

    def exchange(self) -> None:
        """Put the new .blend into its place; raises OSError."""
        back_up(self.path, self.backups)
        os.replace(self.waiting, self.path)


def back_up(path: Path, backups: int) -> None:
    """Copy a file, if there is one, to ``<path>1``; that of before becomes ``<path>2``, and so on. Raises OSError."""
    versions = [path.with_name(f"{path.name}{number}") for number in range(1, backups + 1)]
    for older, newer in zip(reversed(versions), reversed(versions[:-1])):
        if newer.exists():
            os.replace(newer, older)
    if versions and path.exists():
        shutil.copy2(path, versions[0])


class BakeFiles:
    """The files of one bake while it runs. As a context manager it removes what is not in its place in the end.

    Parameters
    ----------
    folder : Path
        The bake folder. It is created if it is missing.
    scenario : Scenario
    owner : BakeOwner
        The scene that is baked.
    images : bool
        False writes no tactile images.

    Attributes
    ----------
    folders : dict of str to Path
        Folder of each sensor that is read out, by the sensor's name.
    bake_id : str
        Hash of all files of the bake; empty until it is complete.

    Raises
    ------
    FileError
        The folder cannot be created or written to, another bake is writing to it, or a sensor's folder holds something that
        must not be replaced.
    """

    def __init__(self, folder: Path, scenario: Scenario, owner: BakeOwner, images: bool = True):
        self.folder = Path(os.path.abspath(folder))
        self.bake_id = ""
        self._scenario, self._owner, self._digest = scenario, owner, scenario.digest()
        self._sensors = {sensor.name: sensor for sensor in scenario.read_out}
        self._names = folder_names(self._sensors)
        self.folders = {name: self.folder / self._names[name] for name in self._sensors}
        if not is_private_folder(self.folder / PRIVATE_FOLDER):
            self._check_replaceable()  # before anything is made
        self._lock = lock_folder(writable_folder(self.folder, create=True))
        try:
            with _refusals_named(self.folder):
                new = begin_bake(self.folder)
                self._check_replaceable()
                self._new = {name: new / self._names[name] for name in self._sensors}
                for own in self._new.values():
                    own.mkdir()
        except BaseException:
            self._lock.release()
            raise
        self._frames = FrameTable([body.name for body in scenario.bodies], self.folder / PRIVATE_FOLDER)
        self._images = images

    def __enter__(self) -> BakeFiles:
        return self

    def __exit__(self, *_) -> None:
        with suppress(OSError):  # the next bake tries again
            discard_bake(self.folder)
        self._lock.release()

    def write(self, frame: Frame) -> None:
        """Write a frame: its row, and the tactile image of every sensor."""
        with _refusals_named(self.folder):
            self._frames.append(frame)
            for name, sensor in self._sensors.items() if self._images else ():
                write_image_of(self._new[name], sensor, frame, self._digest)

    def recording(self, dt: float, warnings: Sequence[str], step_reason: str) -> Recording:
        """Return the recording of the frames that were written; see :meth:`.FrameTable.recording`."""
        return self._frames.recording(dt, self._digest, warnings, step_reason)

    def seal(self, recording: Recording) -> None:
        """Write the recordings and manifests; the earlier bake stays in its place.

        Raises
        ------
        FileError
            A file cannot be written.
        """
        with _refusals_named(self.folder):
            files = {name: write_arrays_of(self._new[name], sensor, recording) for name, sensor in self._sensors.items()}
            table = json.dumps([self._digest, *(sorted(own.items()) for own in files.values())])
            self.bake_id = hashlib.sha256(table.encode("utf-8", "surrogatepass")).hexdigest()[:32]
            for name, sensor in self._sensors.items():
                manifest = replace(
                    manifest_of(self._scenario, sensor, recording, files[name]),
                    scene_file=self._owner.blend.name if self._owner.blend else "",
                    bake_id=self.bake_id,
                    scene_id=self._owner.scene_id,
                    scene_path=self._owner.scene_path(self.folder),
                )
                write_manifest(self._new[name], manifest)

    def publish(self, blend: BlendToSave | None = None) -> None:
        """Put the complete bake in the place of the earlier one, and a .blend with it.

        Raises
        ------
        FileError
            The .blend cannot be written, or a folder cannot be replaced. The earlier bake and .blend are unchanged.
        """
        self._check_replaceable()  # again, because the user may have put files there during the bake
        names = [self._names[name] for name in self._sensors]
        with _refusals_named(self.folder):
            if blend is None:
                publish_bake(self.folder, names)
                return
            try:
                blend.prepare()
                publish_bake(self.folder, names, blend.exchange)
            finally:
                blend.waiting.unlink(missing_ok=True)

    def _check_replaceable(self) -> None:
        """Raise FileError if a sensor's folder holds other files than a bake, or the bake of another scene."""
        for folder in self.folders.values():
            if not folder.exists():
                continue
            if not _is_bake(folder):
                if not folder.is_dir() or any(folder.iterdir()):
                    raise FileError(f"'{folder}' holds other files than a bake: rename it, or choose another bake folder.")
                continue
            try:
                manifest = read_manifest(folder)
            except FileError:
                continue  # a bake that cannot be read may be replaced
            if other := other_owner(manifest, folder.parent, self._owner):
                raise FileError(f"'{folder}' holds the bake of {other}: choose another bake folder, or rename this one.")


def _is_bake(folder: Path) -> bool:
    """Return True if a folder holds a manifest of Palpate, or a damaged manifest beside other files of a bake."""
    try:
        content = json.loads(read_bytes(folder / MANIFEST_NAME).decode("utf-8", "surrogatepass"))
    except (FileNotFoundError, NotADirectoryError):
        return False
    except (OSError, ValueError, RecursionError):
        others = {path.name for path in folder.iterdir()} - {MANIFEST_NAME}
        return any(BAKE_FILE_NAMES.fullmatch(name) for name in others)
    return isinstance(content, dict) and str(content.get("format")).partition("/")[0] == MANIFEST_FORMAT.partition("/")[0]


@contextmanager
def _refusals_named(folder: Path) -> Iterator[None]:
    """Raise FileError where the system refuses to write."""
    try:
        yield
    except OSError as error:
        raise FileError(
            f"The bake could not be written to '{folder}' ({os_error_reason(error)}): check its permissions or choose another."
        ) from error
