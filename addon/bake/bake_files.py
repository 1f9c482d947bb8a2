# SPDX-License-Identifier: GPL-3.0-or-later
"""The files of a bake: images are written frame by frame into a hidden folder, and replace the old bake in one step.

A kill at any moment leaves either the old bake or the new one (:mod:`.bake_switch`), and a checkpoint from which the next bake
continues (:mod:`.bake_checkpoint`).
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import secrets
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

import bpy

from ... import __version__
from ...core.errors import FileError
from ...core.io import bake_switch
from ...core.io.bake_folder import (
    BAKE_FILE_NAMES,
    MANIFEST_FORMAT,
    MANIFEST_NAME,
    RECORDING_NAME,
    Manifest,
    folder_names,
    frame_file,
    read_manifest,
    write_manifest,
)
from ...core.io.disk_space import least_image_bytes, require_space
from ...core.io.file_writing import file_sha256, remove_leftovers, sync_file, writable_folder
from ...core.io.folder_lock import FolderLock
from ...core.io.private_folder import PRIVATE_FOLDER, find_private_folder
from ...core.io.recording_npz import save_recording
from ...core.io.regular_file import read_bytes
from ...core.io.sensor_npz import SENSOR_NAME, save_sensor
from ...core.io.tactile_exr import describe, write_exrs
from ...core.model.recording import Frame, Recording
from ...core.model.scenario import Scenario
from ...core.model.sensor import Sensor
from .background_writer import BackgroundWriter
from .bake_checkpoint import BakeCheckpoint, ImageTable

MAX_BATCH_IMAGES, MAX_BATCH_PIXELS = 16, 16384
"""Most images of one sensor that are written together, and most pixels in them: one call for many small images is faster."""
CAN_SYNC_ALL = hasattr(os, "sync")
"""True where one call brings all written files onto the disk; elsewhere each file is synchronised by itself."""


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
    writable_folder(folder if folder.exists() else folder.parent)
    return folder


def check_space(folder: Path, scenario: Scenario) -> None:
    """Raise FileError if the disk cannot hold the images of a new bake; one that continues has some of them already."""
    if not any((folder / PRIVATE_FOLDER).glob("growing-*")):
        texels = [len(sensor.texels) for sensor in scenario.sensors if sensor.readout]
        frames = scenario.frame_end - scenario.frame_start + 1
        require_space(folder, least_image_bytes(texels, frames), "The bake")


class BakeFiles:
    """The files of one bake while it runs; as a context manager it discards them if the body raises.

    Parameters
    ----------
    folder : Path
        The bake folder. It is created if its parent exists.
    scenario : Scenario
    blend : str
        Path of the .blend that is baked; empty if the scene has not been saved.

    Attributes
    ----------
    folders : dict of str to Path
        Folder of each sensor that is read out, by the sensor's name.

    Raises
    ------
    FileError
        The folder cannot be created or written to, another bake is writing to it, or a sensor's folder holds something that
        must not be replaced.
    """

    def __init__(self, folder: Path, scenario: Scenario, blend: str = ""):
        self._blend = Path(blend) if blend else None
        self._sensors = {sensor.name: sensor for sensor in scenario.sensors if sensor.readout}
        self._names = folder_names(self._sensors)
        self._scenario, self._digest = scenario, scenario.digest()
        self.folder = Path(os.path.abspath(folder))
        self.folders = {name: self.folder / self._names[name] for name in self._sensors}
        self._writer = BackgroundWriter()
        self._unwritten: list[Frame] = []
        self._images: ImageTable = {self._names[name]: {} for name in self._sensors}
        self._unsaved: ImageTable = {}
        self._run, self._growing, self._checkpoint = "", None, None
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

    def resume(self, simulation) -> list[Frame]:
        """Bring a new simulation to the checkpoint of a killed bake of the same scenario.

        Returns
        -------
        list of Frame
            The frames up to the checkpoint; empty if there is none.

        Raises
        ------
        FileError
            The temporary folders cannot be created.
        """
        private = self.folder / PRIVATE_FOLDER
        frames: list[Frame] = []
        try:
            for growing in bake_switch.growing_folders(private):
                restored = None if self._growing else self._restored(growing, simulation)
                if restored is None:
                    bake_switch.remove_growing(growing)
                    continue
                self._grow_in(growing)
                frames, self._images = restored
                for name in self._sensors:
                    remove_leftovers(self._new_folder(name))
            if self._growing is None:
                self._grow_in(bake_switch.growing_folder(private, secrets.token_hex(8)))
                self._growing.mkdir()
                (self._growing / "sensors").mkdir()
                for name in self._sensors:
                    self._new_folder(name).mkdir()
        except OSError as error:
            raise _write_error(self.folder, error) from error
        self._rewrite_damaged_images(frames)
        return frames

    def write_frame(self, frame: Frame) -> None:
        """Write the tactile image of every sensor, some frames together, while the solver continues."""
        self._unwritten.append(frame)
        pixels = max((math.prod(sensor.texels.layout.shape) for sensor in self._sensors.values()), default=1)
        if len(self._unwritten) >= min(MAX_BATCH_IMAGES, MAX_BATCH_PIXELS // pixels):
            self._submit_images()

    def save_checkpoint(self, simulation, frames: list[Frame]) -> None:
        """Save the frames and the state of the solver, if the last checkpoint is some seconds old."""
        if self._checkpoint.is_due(frames):
            self._submit_images()
            self._checkpoint.save(simulation, frames, self._synced_images)

    def finish(self, recording: Recording) -> None:
        """Write the recordings, then make the new bake the present one: all of its folders or none.

        Raises
        ------
        FileError
            A file cannot be written, or a folder cannot be replaced. The old bake is unchanged.
        """
        self.complete(recording)
        self.switch()

    def complete(self, recording: Recording) -> None:
        """Write the recordings and bring all files onto the disk; the old bake stays the present one.

        Raises
        ------
        FileError
            A file cannot be written.
        """
        self._submit_images()
        for name in self._sensors:
            self._write_recording(name, recording)
        self._writer.finish()
        self._writer.stop()
        table = json.dumps([self._digest, *(sorted(files.items()) for files in self._images.values())])
        bake_id = hashlib.sha256(table.encode("utf-8", "surrogatepass")).hexdigest()[:32]
        for name, sensor in self._sensors.items():
            manifest = self._manifest(sensor, recording, bake_id)
            write_manifest(self._new_folder(name), manifest, atomic=not CAN_SYNC_ALL)
        self._sync(self._images)

    def switch(self) -> None:
        """Make the complete bake the present one, in a single step.

        Raises
        ------
        FileError
            A folder cannot be replaced. The old bake is unchanged.
        """
        self._check_replaceable()  # again, because the user may have put files there during the bake
        record = bake_switch.Switch(self._run, tuple(self._names[name] for name in self._sensors))
        try:
            bake_switch.switch(self.folder, record)
        except OSError as error:
            raise _write_error(self.folder, error) from error
        self._lock.release()

    def discard(self) -> None:
        """Remove the unfinished files and release the folder."""
        self._writer.stop()
        if self._growing is not None and bake_switch.pending_switch(self.folder) is None:
            bake_switch.remove_growing(self._growing)
        self._lock.release()

    def _check_replaceable(self) -> None:
        for folder in self.folders.values():
            _check_replaceable(folder, self._blend)

    def _grow_in(self, growing: Path) -> None:
        self._growing, self._run = growing, growing.name.removeprefix(bake_switch.GROWING_PREFIX)
        if self._checkpoint is None:
            self._checkpoint = BakeCheckpoint(growing, self._digest)

    def _new_folder(self, name: str) -> Path:
        """Return where the new bake of a sensor grows."""
        return bake_switch.new_folder(self._growing, self._names[name])

    def _restored(self, growing: Path, simulation) -> tuple[list[Frame], ImageTable] | None:
        """Bring a new simulation to the checkpoint in a folder, if it is of this scene; else return None."""
        if not all(bake_switch.new_folder(growing, name).is_dir() for name in self._names.values()):
            return None
        point = BakeCheckpoint(growing, self._digest)
        restored = point.restore(simulation)
        if restored is None or set(restored[1]) - set(self._images):
            return None
        self._checkpoint = point
        return restored[0], {name: restored[1].get(name, {}) for name in self._images}

    def _rewrite_damaged_images(self, frames: list[Frame]) -> None:
        """Write again the images that a power cut has damaged, from the frames of the checkpoint."""
        for name in self._sensors:
            folder, table = self._new_folder(name), self._images[self._names[name]]
            damaged = [frame for frame in frames if not _is_whole(folder, frame_file(frame.frame), table)]
            for i in range(0, len(damaged), MAX_BATCH_IMAGES):
                self._writer.submit(partial(self._write_images, self._sensors[name], damaged[i : i + MAX_BATCH_IMAGES]))
        self._writer.finish()

    def _synced_images(self) -> ImageTable:
        """Bring all images so far onto the disk, and return the SHA-256 of those that no checkpoint has."""
        self._writer.finish()
        images, self._unsaved = self._unsaved, {}
        self._sync(images)
        return images

    def _sync(self, files: ImageTable) -> None:
        """Bring files in the new folders onto the disk."""
        if CAN_SYNC_ALL:
            os.sync()  # one call for all files is much faster than one for each
            return
        try:
            for folder, table in files.items():
                for name in table:
                    sync_file(bake_switch.new_folder(self._growing, folder) / name)
        except OSError as error:
            raise _write_error(self.folder, error) from error

    def _submit_images(self) -> None:
        """Hand the images of the frames so far to the writer's thread."""
        frames, self._unwritten = self._unwritten, []
        for name in self._sensors:
            if frames:
                self._writer.submit(partial(self._write_images, self._sensors[name], frames))

    def _write_images(self, sensor: Sensor, frames: list[Frame]) -> None:
        folder, files = self._new_folder(sensor.name), [frame_file(frame.frame) for frame in frames]
        headers = [describe(sensor, frame, self._digest) for frame in frames]
        write_exrs(
            [folder / file for file in files],
            sensor.texels.layout,
            [frame.sensors[sensor.name] for frame in frames],
            headers,
        )
        self._note(sensor.name, files)

    def _write_recording(self, name: str, recording: Recording) -> None:
        """Write the recording of one sensor, and what its texels are."""
        sensor, folder, atomic = self._sensors[name], self._new_folder(name), not CAN_SYNC_ALL
        save_recording(folder / RECORDING_NAME, replace(recording, sensors={name: recording.sensors[name]}), atomic=atomic)
        save_sensor(folder / SENSOR_NAME, sensor.texels, sensor.painted, atomic=atomic)
        self._note(name, [RECORDING_NAME, SENSOR_NAME])

    def _note(self, name: str, files: list[str]) -> None:
        """Note the SHA-256 of files that have just been written."""
        folder = self._new_folder(name)
        try:
            table = {file: file_sha256(folder / file) for file in files}
        except OSError as error:
            raise _write_error(self.folder, error) from error
        self._images[self._names[name]].update(table)
        self._unsaved.setdefault(self._names[name], {}).update(table)

    def _manifest(self, sensor: Sensor, recording: Recording, bake_id: str) -> Manifest:
        scenario = self._scenario
        return Manifest(
            sensor=sensor.name,
            palpate=__version__,
            frame_start=scenario.frame_start,
            frame_end=scenario.frame_end,
            fps=scenario.fps,
            dt=recording.dt,
            digest=self._digest,
            unit=sensor.parameters.unit,
            shape=tuple(int(side) for side in sensor.texels.layout.shape),
            parameters=asdict(sensor.parameters),
            warnings=recording.warnings,
            complete=True,
            scene_file=self._blend.name if self._blend else "",
            body=scenario.bodies[sensor.body].name,
            step_reason=recording.step_reason,
            bake_id=bake_id,
            sensors=tuple(self._sensors),
            files=dict(sorted(self._images[self._names[sensor.name]].items())),
        )


def _is_whole(folder: Path, file: str, table: dict[str, str]) -> bool:
    """Return True if a file is there with the content that the table vouches for."""
    try:
        return table.get(file) == file_sha256(folder / file)
    except OSError:
        return False


def _check_replaceable(folder: Path, blend: Path | None) -> None:
    """Raise FileError if a sensor's folder holds other files than a bake, or the bake of another .blend beside this one."""
    if not folder.exists():
        return
    if not _is_bake(folder):
        if not folder.is_dir() or any(folder.iterdir()):
            raise FileError(f"'{folder}' holds other files than a bake: rename it, or choose another bake folder.")
        return
    other = _other_blend(folder, blend) if blend else ""
    if other:
        raise FileError(
            f"'{folder}' holds the bake of '{other}', which lies beside '{blend.name}': choose another bake folder."
        )


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


def _other_blend(folder: Path, blend: Path) -> str:
    """Return the name of another .blend beside `blend` whose bake is in `folder`; empty if there is none."""
    try:
        name = read_manifest(folder).scene_file
    except FileError:
        return ""  # a bake that cannot be read may be replaced
    if not name or name == blend.name:
        return ""
    other = blend.with_name(name)
    # On a file system that ignores case, the old name of a renamed file still leads to the file.
    return name if other.is_file() and not (blend.exists() and other.samefile(blend)) else ""


def _write_error(folder: Path, error: OSError) -> FileError:
    reason = (error.strerror or str(error)).lower()
    return FileError(f"The bake could not be written to '{folder}' ({reason}): check its permissions or choose another.")
