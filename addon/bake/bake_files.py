# SPDX-License-Identifier: GPL-3.0-or-later
"""The files of a bake: images are written frame by frame into temporary folders, which replace the old ones at the end.

A kill at any moment leaves either the old bake or the new one (:mod:`.folder_swap`), and a checkpoint from which the next bake
continues (:mod:`.bake_checkpoint`).
"""

from __future__ import annotations

import math
import os
import shutil
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

import bpy

from ... import __version__
from ...core.errors import FileError
from ...core.io.bake_folder import (
    MANIFEST_NAME,
    RECORDING_NAME,
    Manifest,
    folder_names,
    frame_file,
    read_manifest,
    write_manifest,
)
from ...core.io.file_writing import writable_folder
from ...core.io.recording_npz import save_recording
from ...core.io.sensor_npz import SENSOR_NAME, save_sensor
from ...core.io.tactile_exr import describe, write_exrs
from ...core.model.recording import Frame, Recording
from ...core.model.scenario import Scenario
from ...core.model.sensor import Sensor
from . import folder_swap
from .background_writer import BackgroundWriter
from .bake_checkpoint import BakeCheckpoint
from .folder_lock import FolderLock
from .folder_swap import partial_folder

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
        self.folder = writable_folder(folder, create=True)
        self._sensors = {sensor.name: sensor for sensor in scenario.sensors if sensor.readout}
        names = folder_names(self._sensors)
        self.folders = {name: self.folder / names[name] for name in self._sensors}
        self._scenario, self._digest = scenario, scenario.digest()
        self._lock = FolderLock(self.folder)
        self._checkpoint = BakeCheckpoint(self.folder, self._digest)
        self._writer = BackgroundWriter()
        self._unwritten: list[Frame] = []
        folder_swap.wait_for_removals()
        try:
            for sensor_folder in self.folders.values():
                folder_swap.repair(sensor_folder)
                _check_replaceable(sensor_folder, self._blend)
        except FileError:
            self.discard()
            raise
        except OSError as error:
            self.discard()
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
        partials = [partial_folder(folder) for folder in self.folders.values()]
        frames = self._checkpoint.restore(simulation) if all(folder.is_dir() for folder in partials) else None
        try:
            if frames is None:
                self._remove_unfinished()
                for folder in partials:
                    folder.mkdir()
        except OSError as error:
            raise _write_error(self.folder, error) from error
        return frames or []

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
            self._writer.finish()  # the images of a checkpoint have to exist before it
            self._checkpoint.save(simulation, frames)

    def finish(self, recording: Recording) -> None:
        """Write the recordings, then let the new folders replace the old ones: all of them or none.

        Raises
        ------
        FileError
            A file cannot be written, or a folder cannot be replaced. The old bake is unchanged.
        """
        self._submit_images()
        for name, folder in self.folders.items():
            self._write_recording(name, partial_folder(folder), recording)
        self._writer.finish()
        self._writer.stop()
        for folder in self.folders.values():
            _check_replaceable(folder, self._blend)  # again, because the user may have put files there during the bake
        if CAN_SYNC_ALL:
            os.sync()  # once for all files, because nobody sees them before the swap
        try:
            folder_swap.swap(list(self.folders.values()))
            self._checkpoint.remove()
        except OSError as error:
            raise _write_error(self.folder, error) from error
        self._lock.release()

    def discard(self) -> None:
        """Remove the unfinished files and release the folder."""
        self._writer.stop()
        self._remove_unfinished()
        self._lock.release()

    def _submit_images(self) -> None:
        """Hand the images of the frames so far to the writer's thread."""
        frames, self._unwritten = self._unwritten, []
        for name, folder in self.folders.items():
            if frames:
                self._writer.submit(partial(self._write_images, self._sensors[name], partial_folder(folder), frames))

    def _write_images(self, sensor: Sensor, folder: Path, frames: list[Frame]) -> None:
        paths = [folder / frame_file(frame.frame) for frame in frames]
        headers = [describe(sensor, frame, self._digest) for frame in frames]
        write_exrs(paths, sensor.texels.layout, [frame.sensors[sensor.name] for frame in frames], headers)

    def _write_recording(self, name: str, folder: Path, recording: Recording) -> None:
        """Write the recording of one sensor, what its texels are, and the manifest."""
        sensor, atomic = self._sensors[name], not CAN_SYNC_ALL
        save_recording(folder / RECORDING_NAME, replace(recording, sensors={name: recording.sensors[name]}), atomic=atomic)
        save_sensor(folder / SENSOR_NAME, sensor.texels, sensor.painted, atomic=atomic)
        write_manifest(folder, self._manifest(sensor, recording), atomic=atomic)

    def _manifest(self, sensor: Sensor, recording: Recording) -> Manifest:
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
        )

    def _remove_unfinished(self) -> None:
        self._checkpoint.remove()
        for folder in self.folders.values():
            shutil.rmtree(partial_folder(folder), ignore_errors=True)


def _check_replaceable(folder: Path, blend: Path | None) -> None:
    """Raise FileError if a sensor's folder holds other files than a bake, or the bake of another .blend beside this one."""
    if not folder.exists():
        return
    if not (folder / MANIFEST_NAME).exists():
        if any(folder.iterdir()):
            raise FileError(f"'{folder}' holds other files than a bake: rename it, or choose another bake folder.")
        return
    other = _other_blend(folder, blend) if blend else ""
    if other:
        raise FileError(
            f"'{folder}' holds the bake of '{other}', which lies beside '{blend.name}': choose another bake folder."
        )


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
