# SPDX-License-Identifier: GPL-3.0-or-later
"""The files of a bake. They grow in folders named ``<sensor>.partial``, which take the sensors' places when all is done.

A kill at any moment leaves the old bake or the new one. Between the two renames of a swap the old one is called
``<sensor>.old``; the next bake puts that right.
"""

from __future__ import annotations

import shutil
from dataclasses import asdict, replace
from pathlib import Path

from .. import __version__
from ..core.errors import FileError
from ..core.formats.archive import load_recording, save_recording
from ..core.formats.exr import write_exr
from ..core.formats.files import (
    MANIFEST_NAME,
    RECORDING_NAME,
    Manifest,
    folder_names,
    frame_file,
    read_manifest,
    writable_folder,
    write_manifest,
)
from ..core.recording import Frame, Recording
from ..core.scenario import Scenario


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


class Files:
    """The growing files of one bake.

    Parameters
    ----------
    folder : Path
        The bake folder; made when only it is missing.
    scenario : Scenario

    Raises
    ------
    FileError
        The folder cannot be made or written to.
    """

    def __init__(self, folder: Path, scenario: Scenario):
        self.folder = writable_folder(folder, create=True)
        self._sensors = {sensor.name: sensor for sensor in scenario.sensors if sensor.readout}
        names = folder_names(self._sensors)
        self.folders = {name: self.folder / names[name] for name in self._sensors}
        self._scenario, self._digest = scenario, scenario.digest()
        try:
            for place in self.folders.values():
                _recover(place)
                _check_replaceable(place)
                _beside(place, "partial").mkdir()
        except FileError:
            self.discard()
            raise
        except OSError as error:
            self.discard()
            raise _problem(self.folder, error) from error

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
            done=((scenario.frame_start, scenario.frame_end),),
            complete=True,
        )

    def write_frame(self, frame: Frame) -> None:
        """Write the tactile image of every sensor."""
        for name, place in self.folders.items():
            sensor = self._sensors[name]
            about = {
                "sensor": name,
                "unit": sensor.parameters.unit,
                "frame": str(frame.frame),
                "time": repr(float(frame.time)),
                "digest": self._digest,
            }
            path = _beside(place, "partial") / frame_file(frame.frame)
            write_exr(path, sensor.texels.layout, frame.sensors[name], about)

    def finish(self, recording: Recording) -> None:
        """Write the recordings and let the new folders take the place of the old ones."""
        for name, place in self.folders.items():
            partial = _beside(place, "partial")
            save_recording(partial / RECORDING_NAME, replace(recording, sensors={name: recording.sensors[name]}))
            write_manifest(partial, self._manifest(name, recording))
        try:
            for place in self.folders.values():
                _swap(place)
        except OSError as error:
            raise _problem(self.folder, error) from error

    def discard(self) -> None:
        """Remove what is unfinished."""
        for place in self.folders.values():
            shutil.rmtree(_beside(place, "partial"), ignore_errors=True)


def stored_recording(folder: Path) -> Recording:
    """Read the recording of one sensor's folder."""
    return load_recording(folder / RECORDING_NAME)


def is_bake(folder: Path) -> bool:
    """Whether a folder holds a finished bake of this version."""
    if not (folder / MANIFEST_NAME).is_file():
        return False
    try:
        return read_manifest(folder).complete
    except FileError:
        return False


def _beside(place: Path, ending: str) -> Path:
    return place.with_name(f"{place.name}.{ending}")


def _recover(place: Path) -> None:
    """Put right what a kill left: an unfinished bake goes, a swap that was cut in two is taken back."""
    partial, old = _beside(place, "partial"), _beside(place, "old")
    if partial.exists():
        shutil.rmtree(partial)
    if old.exists() and not place.exists():
        old.rename(place)
    if old.exists():
        shutil.rmtree(old)


def _check_replaceable(place: Path) -> None:
    if place.exists() and not (place / MANIFEST_NAME).exists() and any(place.iterdir()):
        raise FileError(f"'{place}' holds other files than a bake: rename it, or choose another bake folder.")


def _swap(place: Path) -> None:
    old = _beside(place, "old")
    if place.exists():
        _check_replaceable(place)  # again: a bake takes long enough for somebody to put something there
        place.rename(old)
    _beside(place, "partial").rename(place)
    shutil.rmtree(old, ignore_errors=True)


def _problem(folder: Path, error: OSError) -> FileError:
    reason = (error.strerror or str(error)).lower()
    return FileError(f"The bake could not be written to '{folder}' ({reason}): check its permissions or choose another.")
