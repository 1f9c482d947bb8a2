# SPDX-License-Identifier: GPL-3.0-or-later
"""HDF5: one file for the whole bake, one group per sensor, with units as attributes."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import PalpateError
from ...figures.figure_style import FigureStyle
from ...io.bake_reader import Bake
from ...io.file_writing import write_file
from ...jobs.progress import Job
from ..exporter import UNITS, Exporter, bake_arrays, sensor_progress

_BLOCK_BYTES = 1 << 22
"""Size of the rows of an array that are written at once; a whole number of the library's chunks."""


class UnbreakableFile:
    """A file that takes every write, because the library crashes on one that fails, as on a full disk.

    Parameters
    ----------
    file : BufferedRandom

    Attributes
    ----------
    error : BaseException or None
        The first that occurred. What was written since is lost.
    """

    def __init__(self, file: io.BufferedRandom):
        self._file, self._at, self._size = file, 0, 0
        self.error: BaseException | None = None

    def seek(self, offset: int, whence: int = 0) -> int:
        """Go to a place, and return it."""
        self._at = offset + (0, self._at, self._size)[whence]
        return self._at

    def tell(self) -> int:
        """Return the present place."""
        return self._at

    def write(self, content: Any) -> int:
        """Write, or lose, the content, and return how many bytes it has."""
        size = memoryview(content).nbytes
        self._try(lambda: (self._file.seek(self._at), self._file.write(content)))
        self._at += size
        self._size = max(self._size, self._at)
        return size

    def read(self, size: int = -1) -> bytes:
        """Return what is there. The library takes objects with this method for files, and calls the others."""
        content = bytearray(max(0, self._size - self._at) if size < 0 else size)
        self.readinto(content)
        return bytes(content)

    def readinto(self, buffer: Any) -> int:
        """Fill a buffer with what is there, and with zeros where that was lost."""
        view = memoryview(buffer).cast("B")
        view[:] = bytes(view.nbytes)
        self._try(lambda: (self._file.seek(self._at), self._file.readinto(view)))
        self._at += view.nbytes
        return view.nbytes

    def truncate(self, size: int | None = None) -> int:
        """Give the file a size, and return it."""
        self._size = self._at if size is None else size
        self._try(lambda: self._file.truncate(self._size))
        return self._size

    def flush(self) -> None:
        """Hand what was written to the operating system."""
        self._try(lambda: self._file.flush())

    def _try(self, do: Callable[[], object]) -> None:
        if self.error is None:
            try:
                do()
            except BaseException as error:  # Ctrl-C, too: it goes on when the library has returned
                self.error = error


def write_hdf5(bake: Bake, folder: Path, _style: FigureStyle) -> Job[list[Path]]:
    """Write ``palpate.h5``."""
    try:
        import h5py
    except ImportError as error:
        raise PalpateError("HDF5 needs the package h5py, which is not installed: run 'pip install h5py'.") from error
    recording, path = bake.recording, folder / "palpate.h5"
    with write_file(path) as temporary, _unbreakable(temporary) as output, h5py.File(output, "w") as file:
        file.attrs.update({"format": "palpate-hdf5/1", "digest": recording.digest, "dt": recording.dt})
        _dataset(file, "frame", recording.frames, "1")
        _dataset(file, "time", recording.times, "s")
        bodies = file.create_group("bodies")
        for i, body in enumerate(recording.body_names):
            group = bodies.create_group(_hdf5_name(body, bodies))
            group.attrs["name"] = body
            _dataset(group, "pose", recording.poses[:, i], "m, 1 (w x y z)")
            _dataset(group, "velocity", recording.velocities[:, i], "m/s, rad/s")
        sensors = file.create_group("sensors")
        for name in bake.texels:
            yield sensor_progress(bake, name)
            group = sensors.create_group(_hdf5_name(name, sensors))
            group.attrs["name"], group.attrs["unit"] = name, bake.parameters[name].unit
            group.attrs["parameters"] = json.dumps(asdict(bake.parameters[name]))
            channels = recording.sensors[name].channels
            if channels is not None:
                group.attrs["channels_names"] = list(channels.names)
            for key, array in bake_arrays(bake, name).items():
                _dataset(group, key, array, _unit(bake, name, key))
                if output.error is not None:
                    raise output.error
    return [path]


@contextmanager
def _unbreakable(path: Path) -> Iterator[UnbreakableFile]:
    """Open a new file for the library, and raise the error that it was not told of, if there is one."""
    with open(path, "w+b") as file:
        output = UnbreakableFile(file)
        try:
            yield output
            output.flush()
        finally:
            if output.error is not None:  # whatever the library makes of what is lost
                raise output.error


def _hdf5_name(name: str, group: Any) -> str:
    """Return a name for a new group. A slash in it would make a group inside a group."""
    plain = name.replace("/", "_").strip(".") or "_"
    while plain in group:
        plain += "_"
    return plain


def _dataset(group: Any, name: str, array: np.ndarray, unit: str) -> None:
    """Write an array; a large one by blocks of rows, so that a long recording never is in memory as a whole."""
    if array.size <= 4096:
        group.create_dataset(name, data=array, track_times=False).attrs["unit"] = unit
        return
    packed = {"compression": "gzip", "compression_opts": 4, "shuffle": True}
    written = group.create_dataset(name, array.shape, array.dtype, track_times=False, **packed)
    written.attrs["unit"] = unit
    rows = written.chunks[0]
    rows *= max(1, _BLOCK_BYTES * len(array) // (array.nbytes * rows))
    for first in range(0, len(array), rows):
        written[first : first + rows] = array[first : first + rows]


def _unit(bake: Bake, name: str, key: str) -> str:
    channels = bake.recording.sensors[name].channels
    if channels is not None and key == "channels":
        return channels.unit
    return bake.parameters[name].unit if key == "reading" else UNITS.get(key, "1")


EXPORTER = Exporter("hdf5", "HDF5", "One file with units; needs the package h5py", 2, write_hdf5)
