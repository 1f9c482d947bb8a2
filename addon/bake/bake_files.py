# SPDX-License-Identifier: GPL-3.0-or-later
"""The files of a bake: frames and images are written one by one into a hidden folder, and replace the old bake in one step.

A kill at any moment leaves either the old bake or the new one (:mod:`.bake_switch`), and a checkpoint from which the next bake
continues (:mod:`.bake_checkpoint`).
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import secrets
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import bpy
import numpy as np

from ...core.errors import FileError
from ...core.io import bake_switch
from ...core.io.bake_folder import (
    BAKE_FILE_NAMES,
    IMAGE_LIST_NAME,
    MANIFEST_FORMAT,
    MANIFEST_NAME,
    RECORDING_NAME,
    Manifest,
    folder_names,
    read_manifest,
    write_manifest,
)
from ...core.io.bake_owner import BakeOwner, other_owner
from ...core.io.disk_space import bake_bytes, require_space
from ...core.io.file_writing import file_sha256, remove_leftovers, sync_file, writable_folder
from ...core.io.folder_lock import FolderLock
from ...core.io.frame_rows import FrameRows
from ...core.io.private_folder import PRIVATE_FOLDER, find_private_folder
from ...core.io.recording_npz import save_recording
from ...core.io.regular_file import read_bytes
from ...core.io.sensor_manifest import manifest_of
from ...core.io.sensor_npz import SENSOR_NAME, save_sensor
from ...core.model.recording import Frame, Recording
from ...core.model.scenario import Scenario
from ...core.model.sensor import Sensor
from .background_writer import BackgroundWriter
from .bake_checkpoint import CHECKPOINT_FOLDER, FRAMES_FILE, BakeCheckpoint, Vouched
from .bake_images import BakeImages

CAN_SYNC_ALL = hasattr(os, "sync")
"""True where one call brings all written files onto the disk; elsewhere each file is synchronised by itself."""

THREADED_ROW_BYTES = 1 << 14
"""Size of a frame's row from which a thread writes it: its SHA-256 and its way to the disk then take the solver no time. For
smaller ones, handing over costs what it saves (5 kB are written in 12 µs, 23 kB in 33 µs, 900 kB in 2 ms)."""


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


def writable_bake_folder(scene) -> Path:
    """Return the absolute bake folder of a scene, which need not exist yet. Nothing is created.

    Raises
    ------
    FileError
        As :func:`bake_folder`, or a bake could not be written there.
    """
    folder = bake_folder(scene)
    writable_folder(folder if os.path.exists(folder) else folder.parent)
    return folder


def check_space(folder: Path, scenario: Scenario, images: bool = True) -> None:
    """Raise FileError if the disk cannot hold a new bake; one that continues has a part of its files already."""
    if not any((folder / PRIVATE_FOLDER).glob("growing-*")):
        read_out = [sensor for sensor in scenario.sensors if sensor.readout]
        texels = [len(sensor.texels) for sensor in read_out]
        shapes = [(0, 0, 0) if one.channels is None else one.channels.no_frames().values.shape for one in read_out]
        pixels = [math.prod(one.texels.layout.shape) * (7 + own[2]) // 7 for one, own in zip(read_out, shapes, strict=True)]
        channels = [count * each for _, count, each in shapes]
        require_space(
            folder,
            bake_bytes(len(scenario.frames), len(scenario.bodies), texels, pixels if images else [], channels),
            "The bake",
        )


@dataclass(frozen=True)
class BlendToSave:
    """A .blend that is written with a bake, and exchanged in the same step.

    Attributes
    ----------
    path : Path
        Absolute and without links.
    write : callable
        Writes the open scene to the path that it is given, and brings it onto the disk.
    backups : int
        Number of earlier versions that are kept.
    """

    path: Path
    write: Callable[[Path], None]
    backups: int = 0


class BakeFiles:
    """The files of one bake while it runs; as a context manager it discards them if the body raises.

    Parameters
    ----------
    folder : Path
        The bake folder. It is created if it is missing.
    scenario : Scenario
    owner : BakeOwner, optional
        The scene that is baked. Default: one that has neither an id nor a .blend.
    images : bool
        False writes no tactile images.

    Attributes
    ----------
    folders : dict of str to Path
        Folder of each sensor that is read out, by the sensor's name.
    bake_id : str
        Hash of all files of the bake; empty until it is complete.
    notes : list of str
        Sentences for the user that are no part of the bake.

    Raises
    ------
    FileError
        The folder cannot be created or written to, another bake is writing to it, or a sensor's folder holds something that
        must not be replaced.
    """

    def __init__(self, folder: Path, scenario: Scenario, owner: BakeOwner | None = None, images: bool = True):
        self._owner = BakeOwner() if owner is None else owner
        self.bake_id = ""
        self.notes: list[str] = []
        self._sensors = {sensor.name: sensor for sensor in scenario.sensors if sensor.readout}
        self._names = folder_names(self._sensors)
        self._scenario, self._digest = scenario, scenario.digest()
        self.folder = Path(os.path.abspath(folder))
        self.folders = {name: self.folder / self._names[name] for name in self._sensors}
        self._writer, self._row_writer = BackgroundWriter(), BackgroundWriter()
        self._has_images = images
        self._frames = 0
        self._files: dict[str, dict[str, str]] = {name: {} for name in self._sensors}
        self._run = ""
        self._growing: Path | None = None
        self._checkpoint: BakeCheckpoint | None = None
        self._rows: FrameRows | None = None
        self._images: BakeImages | None = None
        if find_private_folder(self.folder) is None:
            self._check_replaceable()  # before anything is made
        writable_folder(self.folder, create=True)
        bake_switch.wait_for_removals()
        self._lock = FolderLock(self.folder)
        try:
            bake_switch.settle_locked(self.folder)
            bake_switch.wait_for_removals()
            self._check_replaceable()
            remove_leftovers(self.folder / PRIVATE_FOLDER)
        except FileError:
            self._lock.release()
            raise
        except OSError as error:
            self._lock.release()
            raise _write_error(self.folder, error) from error

    def __enter__(self) -> BakeFiles:
        return self

    def __exit__(self, error_type, *_) -> None:
        if error_type is not None:
            self.discard()

    def resume(self, simulation) -> int:
        """Bring a new simulation to the checkpoint of a killed bake of the same scenario.

        Returns
        -------
        int
            Number of frames up to the checkpoint; zero if there is none.

        Raises
        ------
        FileError
            The temporary folders cannot be created.
        """
        private = self.folder / PRIVATE_FOLDER
        frames = 0
        try:
            for growing in bake_switch.growing_folders(private):
                frames = frames or self._restored(growing, simulation)
                if growing != self._growing:
                    bake_switch.remove_growing(growing)
            if not frames:
                self._begin(bake_switch.growing_folder(private, secrets.token_hex(8)))
            elif self._images is not None:
                self._images.rewrite_damaged(self._rows.frame)
        except OSError as error:
            raise _write_error(self.folder, error) from error
        self._frames = frames
        return frames

    def write_frame(self, frame: Frame) -> None:
        """Write a frame: its row, and the tactile image of every sensor, some frames together, while the solver continues."""
        with _refusals_named(self.folder):
            self._frames += 1
            if self._rows.row_bytes < THREADED_ROW_BYTES:
                self._rows.append(frame)
            else:
                self._row_writer.submit(partial(self._rows.append, frame))
            if self._images is not None:
                self._images.write(frame)

    def save_checkpoint(self, simulation) -> None:
        """Save the frames and the state of the solver, if the last checkpoint is some seconds old."""
        if self._checkpoint.is_due(self._frames):
            self._checkpoint.save(simulation, self._sync_frames)

    def recording(self, simulation, warnings: Sequence[str]) -> Recording:
        """Return what was written; a long one is a view of the file (:class:`.FrameRows`).

        Raises
        ------
        FileError
            It cannot be written or read.
        """
        with _refusals_named(self.folder):
            self._row_writer.finish()
            return self._rows.recording(simulation.dt, self._digest, warnings, simulation.step_reason)

    def complete(self, recording: Recording) -> None:
        """Write the recordings and bring all files onto the disk; the old bake stays the present one.

        Raises
        ------
        FileError
            A file cannot be written.
        """
        with _refusals_named(self.folder):
            if self._images is not None:
                self._images.submit()
        for name in self._sensors:
            self._files[name] |= dict.fromkeys((RECORDING_NAME, SENSOR_NAME), "")  # in this order, whichever is done first
            self._row_writer.submit(partial(self._write_sensor, name))
        for name in self._sensors:
            self._write_recording(name, recording)
        with _refusals_named(self.folder):
            self._row_writer.finish()
        written = [self._new_folder(name) / file for name in self._sensors for file in (RECORDING_NAME, SENSOR_NAME)]
        if self._images is not None:
            with _refusals_named(self.folder):
                written += self._images.finish()
            for name, (_, sha256) in self._images.states().items():
                self._files[name][IMAGE_LIST_NAME] = sha256
        self._stop_writers()
        table = json.dumps([self._digest, *(sorted(files.items()) for files in self._files.values())])
        self.bake_id = hashlib.sha256(table.encode("utf-8", "surrogatepass")).hexdigest()[:32]
        for name, sensor in self._sensors.items():
            manifest = self._manifest(sensor, recording)
            written.append(write_manifest(self._new_folder(name), manifest, atomic=not CAN_SYNC_ALL))
        self._sync(written)

    def switch(self, blend: BlendToSave | None = None) -> None:
        """Make the complete bake the present one, and a .blend with it, in a single step.

        Raises
        ------
        FileError
            The .blend cannot be written, or a folder cannot be replaced. The old bake and the old .blend are unchanged.
        """
        self._check_replaceable()  # again, because the user may have put files there during the bake
        record = bake_switch.Switch(self._run, tuple(self._names[name] for name in self._sensors), "", 0)
        try:
            if blend is not None:
                record = replace(record, blend=str(blend.path), backups=blend.backups)
                bake_switch.announce_blend(self.folder, self._run, blend.path)
                blend.write(record.new_blend())
            bake_switch.switch(self.folder, record)
        except OSError as error:
            raise _write_error(self.folder, error) from error
        self._close()
        self._lock.release()

    def discard(self) -> None:
        """Remove the unfinished files and release the folder."""
        self._stop_writers()
        self._close()
        if self._growing is not None and bake_switch.pending_switch(self.folder) is None:
            bake_switch.remove_growing(self._growing)
        self._lock.release()

    def _stop_writers(self) -> None:
        self._writer.stop()
        self._row_writer.stop()

    def _check_replaceable(self) -> None:
        for folder in self.folders.values():
            _check_replaceable(folder, self._owner)

    def _close(self) -> None:
        for part in (self._rows, self._images):
            if part is not None:
                with suppress(OSError):  # a disk that is full has been reported before
                    part.close()

    def _grow_in(self, growing: Path) -> None:
        """Choose the folder in which the bake grows. It need not exist."""
        self._growing, self._run = growing, growing.name.removeprefix(bake_switch.GROWING_PREFIX)
        self._checkpoint = BakeCheckpoint(growing, self._digest)
        texels = {name: len(sensor.texels) for name, sensor in self._sensors.items()}
        bodies = [body.name for body in self._scenario.bodies]
        channels = {name: own.channels.no_frames() for name, own in self._sensors.items() if own.channels is not None}
        self._rows = FrameRows(growing / CHECKPOINT_FOLDER / FRAMES_FILE, bodies, texels, channels)
        if self._has_images:
            folders = {name: self._new_folder(name) for name in self._sensors}
            self._images = BakeImages(self._sensors, folders, self._digest, self._writer)

    def _begin(self, growing: Path) -> None:
        """Make the files of a new bake."""
        self._grow_in(growing)
        for folder in (growing, growing / "sensors", growing / CHECKPOINT_FOLDER):
            folder.mkdir()
        for name in self._sensors:
            self._new_folder(name).mkdir()
        self._rows.begin()
        if self._images is not None:
            self._images.begin()

    def _new_folder(self, name: str) -> Path:
        """Return where the new bake of a sensor grows."""
        return bake_switch.new_folder(self._growing, self._names[name])

    def _restored(self, growing: Path, simulation) -> int:
        """Bring a new simulation to the checkpoint in a folder, if it is of this scene, and return the number of its frames."""
        if not all(bake_switch.new_folder(growing, name).is_dir() for name in self._names.values()):
            return 0
        self._grow_in(growing)
        frames = self._checkpoint.restore(simulation, self._take_over)
        if self._checkpoint.damage:
            self.notes.append(
                f"What a killed bake has left in '{self.folder}' is damaged ({self._checkpoint.damage}), "
                "so this bake began at its first frame."
            )
        if not frames:
            self._close()
            self._growing = self._rows = self._images = None
            return 0
        for name in self._sensors:
            remove_leftovers(self._new_folder(name))
        return frames

    def _take_over(self, vouched: Vouched) -> bool:
        """Take over the files of a checkpoint; return False if they are not what it vouches for."""
        if set(vouched.images) != (set(self._sensors) if self._has_images else set()):
            return False
        frames = self._scenario.frames[: vouched.frames]
        if len(frames) < vouched.frames or not self._rows.restore(vouched.frames, vouched.rows_sha256):
            return False
        times = (np.asarray(frames) - self._scenario.frame_start) / self._scenario.fps
        if not self._rows.are_of(frames, times):
            return False
        return self._images is None or self._images.restore(vouched.images, frames)

    def _sync_frames(self) -> Vouched:
        """Bring all frames and images so far onto the disk."""
        with _refusals_named(self.folder):
            files = [] if self._images is None else self._images.finish()
            self._row_writer.finish()
            self._rows.flush()
        self._sync([*files, self._growing / CHECKPOINT_FOLDER / FRAMES_FILE])
        images = {} if self._images is None else self._images.states()
        return Vouched(len(self._rows), self._rows.sha256, images)

    def _sync(self, files: Iterable[Path]) -> None:
        """Bring files onto the disk."""
        if CAN_SYNC_ALL:
            os.sync()  # one call for all files is much faster than one for each
            return
        try:
            for path in files:
                sync_file(path)
        except OSError as error:
            raise _write_error(self.folder, error) from error

    def _write_recording(self, name: str, recording: Recording) -> None:
        """Write the recording of one sensor."""
        path = self._new_folder(name) / RECORDING_NAME
        save_recording(path, replace(recording, sensors={name: recording.sensors[name]}), atomic=not CAN_SYNC_ALL)
        with _refusals_named(self.folder):
            self._files[name][RECORDING_NAME] = file_sha256(path)

    def _write_sensor(self, name: str) -> None:
        """Write what the texels of one sensor are."""
        sensor, path = self._sensors[name], self._new_folder(name) / SENSOR_NAME
        save_sensor(path, sensor.texels, sensor.painted, atomic=not CAN_SYNC_ALL)
        self._files[name][SENSOR_NAME] = file_sha256(path)

    def _manifest(self, sensor: Sensor, recording: Recording) -> Manifest:
        return replace(
            manifest_of(self._scenario, sensor, recording, self._files[sensor.name]),
            scene_file=self._owner.blend.name if self._owner.blend else "",
            bake_id=self.bake_id,
            scene_id=self._owner.scene_id,
            scene_path=self._owner.scene_path(self.folder),
        )


def _check_replaceable(folder: Path, owner: BakeOwner) -> None:
    """Raise FileError if a sensor's folder holds other files than a bake, or the bake of another scene."""
    if not folder.exists():
        return
    if not _is_bake(folder):
        if not folder.is_dir() or any(folder.iterdir()):
            raise FileError(f"'{folder}' holds other files than a bake: rename it, or choose another bake folder.")
        return
    try:
        manifest = read_manifest(folder)
    except FileError:
        return  # a bake that cannot be read may be replaced
    other = other_owner(manifest, folder.parent, owner)
    if other:
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
    """Raise FileError where the system refuses to write; the writer's thread may have met it some frames ago."""
    try:
        yield
    except OSError as error:
        raise _write_error(folder, error) from error


def _write_error(folder: Path, error: OSError) -> FileError:
    reason = (error.strerror or str(error)).lower()
    return FileError(f"The bake could not be written to '{folder}' ({reason}): check its permissions or choose another.")
