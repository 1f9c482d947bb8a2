# SPDX-License-Identifier: GPL-3.0-or-later
"""The tactile images of a bake while it runs: some frames are written together, and a list in each folder has their SHA-256.

The list grows with the images (:mod:`.growing_file`). A checkpoint keeps the length and the SHA-256 of each list, which
vouches for all images so far.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

from ...core.errors import FileError
from ...core.io.bake_folder import IMAGE_LIST_NAME, frame_file
from ...core.io.checksum_list import checksum_line, read_checksums
from ...core.io.file_writing import file_sha256
from ...core.io.growing_file import GrowingFile
from ...core.io.tactile_exr import describe, nearest_places, write_exrs
from ...core.model.recording import Frame
from ...core.model.sensor import Sensor
from .background_writer import BackgroundWriter

MAX_BATCH_IMAGES, MAX_BATCH_PIXELS = 16, 16384
"""Most images of one sensor that are written together, and most pixels in them: one call for many small images is faster."""

ListState = tuple[int, str]
"""Length of a list of images, bytes, and its SHA-256."""


class BakeImages:
    """The images of all sensors of one bake. Its methods raise OSError and FileError where a file cannot be written.

    Parameters
    ----------
    sensors : mapping of str to Sensor
        By the name of the folder.
    folders : mapping of str to Path
        Where the images are written, likewise.
    digest : str
        Of the scenario.
    writer : BackgroundWriter
    """

    def __init__(self, sensors: Mapping[str, Sensor], folders: Mapping[str, Path], digest: str, writer: BackgroundWriter):
        self._sensors, self._folders = dict(sensors), dict(folders)
        self._digest, self._writer = digest, writer
        self._lists = {name: GrowingFile(folder / IMAGE_LIST_NAME) for name, folder in folders.items()}
        self._nearest = {
            name: nearest_places(sensor.texels, sensor.channels and sensor.channels.no_frames())
            for name, sensor in self._sensors.items()
        }
        self._unwritten: list[Frame] = []
        self._new_files: list[Path] = []
        pixels = max((math.prod(sensor.texels.layout.shape) for sensor in self._sensors.values()), default=1)
        self._batch = max(1, min(MAX_BATCH_IMAGES, MAX_BATCH_PIXELS // pixels))

    def begin(self) -> None:
        """Make the lists."""
        for one in self._lists.values():
            one.begin()

    def restore(self, states: Mapping[str, ListState], frames: Sequence[int]) -> bool:
        """Take over the lists of a checkpoint.

        Returns
        -------
        bool
            False if one is missing, is not what the checkpoint vouches for, or does not name the images of these frames.

        Raises
        ------
        FileError
            A list is no list.
        """
        if not all(one.restore(*states[name]) for name, one in self._lists.items()):
            return False
        files = [frame_file(frame) for frame in frames]
        return all([file for file, _ in read_checksums(one.path)] == files for one in self._lists.values())

    def states(self) -> dict[str, ListState]:
        """Return the state of each list, by the name of the folder. All images are written (:meth:`finish`)."""
        return {name: (one.length, one.sha256) for name, one in self._lists.items()}

    def write(self, frame: Frame) -> None:
        """Write the images of a frame, some frames together, while the solver continues."""
        self._unwritten.append(frame)
        if len(self._unwritten) >= self._batch:
            self.submit()

    def submit(self) -> None:
        """Hand the images of the frames so far to the writer's thread."""
        frames, self._unwritten = self._unwritten, []
        if frames:
            for name in self._sensors:
                self._writer.submit(partial(self._write_and_list, name, frames))

    def finish(self) -> list[Path]:
        """Return once all images and lists are written: the files since the last call."""
        self.submit()
        self._writer.finish()
        for one in self._lists.values():
            one.flush()
        files, self._new_files = self._new_files, []
        return [*files, *(one.path for one in self._lists.values())]

    def close(self) -> None:
        """Close the lists."""
        for one in self._lists.values():
            one.close()

    def rewrite_damaged(self, frame_at: Callable[[int], Frame]) -> None:
        """Write again the listed images that a power cut has damaged; `frame_at` returns a frame by its index."""
        for name, own in self._lists.items():
            is_renewed = False
            for i, (file, sha256) in enumerate(read_checksums(own.path)):
                if _sha256_or_none(self._folders[name] / file) != sha256:
                    self._write(name, [frame_at(i)])
                    is_renewed |= file_sha256(self._folders[name] / file) != sha256
            if is_renewed:  # another library has written them: the list of the earlier one no longer holds
                files = [file for file, _ in read_checksums(own.path)]
                own.begin()
                self._list(name, files)

    def _write_and_list(self, name: str, frames: list[Frame]) -> None:
        self._write(name, frames)
        self._list(name, [frame_file(frame.frame) for frame in frames])

    def _write(self, name: str, frames: list[Frame]) -> None:
        sensor, paths = self._sensors[name], [self._folders[name] / frame_file(frame.frame) for frame in frames]
        headers = [describe(sensor, frame, self._digest) for frame in frames]
        own = [frame.sensors[sensor.name] for frame in frames]
        write_exrs(paths, sensor.texels.layout, own, headers, self._nearest[name])
        self._new_files += paths

    def _list(self, name: str, files: list[str]) -> None:
        """Note the SHA-256 of images that have just been written."""
        for file in files:
            self._lists[name].append(checksum_line(file, file_sha256(self._folders[name] / file)))


def _sha256_or_none(path: Path) -> str | None:
    """Return the SHA-256 of a file; None if it cannot be read."""
    try:
        return file_sha256(path)
    except (OSError, FileError):
        return None
