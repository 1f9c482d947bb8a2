# SPDX-License-Identifier: GPL-3.0-or-later
"""The files of a bake. They grow in folders named ``<sensor>.partial``, which take the sensors' places when all is done.

A kill at any moment leaves the old bake or the new one, and an unfinished one that the next bake goes on with
(:mod:`.bake_checkpoint`). Between the two renames of a swap the old one is called
``<sensor>.old``; the next bake puts that right. What the user has put into a sensor's folder moves on into the new one. Then
the old one is removed while the user goes on (:func:`wait_for_removals` waits for it): that may take as long as the bake.
"""

from __future__ import annotations

import math
import os
import re
import shutil
import threading
from contextlib import suppress
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

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
from .background_writer import BackgroundWriter
from .bake_checkpoint import BakeCheckpoint
from .folder_lock import FolderLock

BAKE_FILE_NAMES = re.compile(rf"tactile_-?\d+\.exr|{'|'.join(map(re.escape, (RECORDING_NAME, SENSOR_NAME, MANIFEST_NAME)))}")
"""Names of the files in a sensor's folder that a bake writes and replaces."""
MAX_BATCH_IMAGES, MAX_BATCH_PIXELS = 16, 16384
"""Most images of a sensor, and pixels in them, that are written together: small ones cost little more than one then."""
CAN_SYNC_ALL = hasattr(os, "sync")
"""Whether all that was written can be brought onto the disk at once; else it is done file by file."""

_removals: list[threading.Thread] = []


def bake_folder(scene) -> Path:
    """Return the absolute bake folder of a scene.

    Raises
    ------
    FileError
        It is relative to a .blend that has not been saved yet, or empty.
    """
    import bpy

    text = scene.palpate.folder
    if not text.strip():
        raise FileError(f"The bake folder of '{scene.name}' is empty: name one in Physics › Palpate › Bake.")
    if text.startswith("//") and not bpy.data.filepath:
        raise FileError(f"The bake folder '{text}' is relative to a file that is not saved yet: save the .blend first.")
    return Path(bpy.path.abspath(text))


def check_folder(folder: Path) -> None:
    """Raise FileError when a bake could not be written to `folder`, which need not be there yet. Nothing is made."""
    writable_folder(folder if folder.exists() else folder.parent)


class BakeFiles:
    """The growing files of one bake.

    Parameters
    ----------
    folder : Path
        The bake folder; made when only it is missing.
    scenario : Scenario
    blend : str
        Path of the .blend that is baked; empty when it has none.

    Raises
    ------
    FileError
        The folder cannot be made or written to, another bake is writing to it, or a sensor's folder holds something that must
        not be replaced.
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
        self._waiting: list[Frame] = []
        wait_for_removals()
        try:
            for place in self.folders.values():
                _finish_interrupted_swap(place)
                self._check_replaceable(place)
        except FileError:
            self.discard()
            raise
        except OSError as error:
            self.discard()
            raise _write_error(self.folder, error) from error

    def resume(self, simulation) -> list[Frame]:
        """Bring a new simulation to where a killed bake of the same scenario was, and return its frames, if there are any.

        Raises
        ------
        FileError
            The folders cannot be made.
        """
        growing = [_sibling(place, "partial") for place in self.folders.values()]
        frames = self._checkpoint.restore(simulation) if all(place.is_dir() for place in growing) else None
        try:
            if frames is None:
                self._clean()
                for place in growing:
                    place.mkdir()
        except OSError as error:
            raise _write_error(self.folder, error) from error
        return frames or []

    def save_checkpoint(self, simulation, frames: list[Frame]) -> None:
        """Put the work so far aside, every few seconds, for the case that the process is killed."""
        if self._checkpoint.is_due(frames):
            self._write_waiting()
            self._writer.finish()  # a state belongs to images that are there
            self._checkpoint.save(simulation, frames)

    def _manifest(self, name: str, recording: Recording) -> Manifest:
        sensor, scenario = self._sensors[name], self._scenario
        return Manifest(
            sensor=name,
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

    def write_frame(self, frame: Frame) -> None:
        """Write the tactile image of every sensor, some frames at a time, while the solver goes on."""
        self._waiting.append(frame)
        pixels = max((math.prod(sensor.texels.layout.shape) for sensor in self._sensors.values()), default=1)
        if len(self._waiting) >= min(MAX_BATCH_IMAGES, MAX_BATCH_PIXELS // pixels):
            self._write_waiting()

    def _write_waiting(self) -> None:
        frames, self._waiting = self._waiting, []
        for name, place in self.folders.items():
            if frames:
                self._writer.submit(partial(self._write_images, self._sensors[name], _sibling(place, "partial"), frames))

    def _write_images(self, sensor: Sensor, folder: Path, frames: list[Frame]) -> None:
        paths = [folder / frame_file(frame.frame) for frame in frames]
        about = [describe(sensor, frame, self._digest) for frame in frames]
        write_exrs(paths, sensor.texels.layout, [frame.sensors[sensor.name] for frame in frames], about)

    def finish(self, recording: Recording) -> None:
        """Write the recordings, and let the new folders take the place of the old ones: all of them, or none."""
        self._write_waiting()
        for name, place in self.folders.items():
            growing = _sibling(place, "partial")
            own, sensor = replace(recording, sensors={name: recording.sensors[name]}), self._sensors[name]
            save_recording(growing / RECORDING_NAME, own, atomic=not CAN_SYNC_ALL)
            save_sensor(growing / SENSOR_NAME, sensor.texels, sensor.painted, atomic=not CAN_SYNC_ALL)
            write_manifest(growing, self._manifest(name, recording), atomic=not CAN_SYNC_ALL)
        self._writer.finish()
        self._writer.stop()
        for place in self.folders.values():
            self._check_replaceable(place)  # again: a bake takes long enough for somebody to put something there
        if CAN_SYNC_ALL:
            os.sync()  # once for all files: nobody sees them before the swap
        try:
            _swap(list(self.folders.values()))
            self._checkpoint.remove()
        except OSError as error:
            raise _write_error(self.folder, error) from error
        self._lock.release()

    def discard(self) -> None:
        """Remove what is unfinished."""
        self._writer.stop()
        self._clean()
        self._lock.release()

    def _clean(self) -> None:
        self._checkpoint.remove()
        for place in self.folders.values():
            shutil.rmtree(_sibling(place, "partial"), ignore_errors=True)

    def _check_replaceable(self, place: Path) -> None:
        if not place.exists():
            return
        if not (place / MANIFEST_NAME).exists():
            if any(place.iterdir()):
                raise FileError(f"'{place}' holds other files than a bake: rename it, or choose another bake folder.")
            return
        other = _other_blend(place, self._blend)
        if other:
            raise FileError(
                f"'{place}' holds the bake of '{other}', which lies beside '{self._blend.name}': choose another bake folder."
            )


def _sibling(place: Path, ending: str) -> Path:
    return place.with_name(f"{place.name}.{ending}")


def _finish_interrupted_swap(place: Path) -> None:
    """Put right what a kill left of a swap: one that was cut in two is taken back."""
    old = _sibling(place, "old")
    if old.exists() and not place.exists():
        old.rename(place)
    if old.exists():
        _move_foreign_files(old, place)
        shutil.rmtree(old)


def _other_blend(place: Path, blend: Path | None) -> str:
    """Return the name of another .blend in the same folder whose bake is at `place`; empty when there is none."""
    try:
        name = read_manifest(place).scene_file
    except FileError:
        return ""  # a bake that nobody can read may be replaced
    if blend is None or not name or name == blend.name:
        return ""
    other = blend.with_name(name)
    # where case does not count, the old name of a renamed file is still found
    return name if other.is_file() and not (blend.exists() and other.samefile(blend)) else ""


def _swap(places: list[Path]) -> None:
    """Put the new folders where the old ones are; when one of them cannot be moved, those moved before it go back."""
    try:
        for place in places:
            if place.exists():
                place.rename(_sibling(place, "old"))
            _sibling(place, "partial").rename(place)
    except BaseException:
        for place in places:
            with suppress(OSError):
                _swap_back(place)
        raise
    emptied = []
    for place in places:
        old = _sibling(place, "old")
        with suppress(OSError):  # the new bake is there; what could not be moved waits in the old folder for the next
            if old.exists():
                _move_foreign_files(old, place)
                emptied.append(old)
    _remove_in_background(emptied)


def _remove_in_background(folders: list[Path]) -> None:
    """Remove folders while the user goes on; Blender, or the command, does not end before it is done."""
    if folders:
        work = threading.Thread(
            target=lambda: [shutil.rmtree(old, ignore_errors=True) for old in folders], name="palpate-remover", daemon=False
        )
        _removals.append(work)
        work.start()


def wait_for_removals() -> None:
    """Return when the folders of bakes that were replaced are gone."""
    while _removals:
        _removals.pop().join()


def _swap_back(place: Path) -> None:
    partial, old = _sibling(place, "partial"), _sibling(place, "old")
    if not partial.exists():
        place.rename(partial)
    if old.exists() and not place.exists():
        old.rename(place)


def _move_foreign_files(old: Path, new: Path) -> None:
    """Move what no bake has written from one sensor's folder to another, unless something there has its name."""
    for path in old.iterdir():
        if not BAKE_FILE_NAMES.fullmatch(path.name) and not (new / path.name).exists():
            path.rename(new / path.name)


def _write_error(folder: Path, error: OSError) -> FileError:
    reason = (error.strerror or str(error)).lower()
    return FileError(f"The bake could not be written to '{folder}' ({reason}): check its permissions or choose another.")
