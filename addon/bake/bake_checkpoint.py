# SPDX-License-Identifier: GPL-3.0-or-later
"""The checkpoint of a running bake: after a kill or a power cut, the next bake of the same scene continues from it.

A folder beside those of the sensors holds the frames so far, in pieces, and the state of the solver after the last of them.
The state is written after its frames, and after everything it vouches for is on the disk. It says how many pieces belong to it,
so a kill between the two leaves the previous checkpoint valid. The SHA-256 of each piece and of each image so far is kept, so
that what a power cut has damaged is found.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ... import __version__
from ...core.errors import FileError
from ...core.io.file_writing import atomic_write, file_sha256
from ...core.io.npz import DAMAGED
from ...core.io.recording_npz import load_recording, save_recording
from ...core.io.regular_file import open_regular, read_bytes
from ...core.model.recording import Frame, Recording
from ...core.solver import checkpoint

CHECKPOINT_FOLDER = "checkpoint"
STATE_FILE = "state.npz"
CHECKPOINT_INTERVAL = 5.0
"""Seconds between two checkpoints: a kill loses no more solver time than this."""
MAX_COST_SHARE = 0.03
"""Largest share of a bake's time that checkpoints may take: where a checkpoint is slow, the interval grows."""

ImageTable = dict[str, dict[str, str]]
"""SHA-256 of images, by the sensor's folder name and the file's name."""


class BakeCheckpoint:
    """The checkpoint folder of one running bake.

    Parameters
    ----------
    folder : Path
        The folder in which the bake grows.
    digest : str
        Digest of the scenario. A checkpoint of another scenario is ignored.
    """

    def __init__(self, folder: Path, digest: str):
        self.folder = folder / CHECKPOINT_FOLDER
        self._key = {"palpate": __version__, "digest": digest}
        self._pieces: list[dict[str, str]] = []
        self._saved_frames = 0
        self._last_save = time.monotonic()
        self._cost = 0.0

    def restore(self, simulation) -> tuple[list[Frame], ImageTable] | None:
        """Bring a new simulation to the checkpoint.

        Returns
        -------
        (list of Frame, ImageTable) or None
            The frames so far and the SHA-256 of their images; None if there is no usable checkpoint.
        """
        try:
            with open_regular(self.folder / STATE_FILE) as file, np.load(file, allow_pickle=False) as members:
                packed = {name: members[name] for name in members.files}
            about = json.loads(str(packed.pop("about")))
            if about["key"] != self._key:
                return None
            frames: list[Frame] = []
            images: ImageTable = {}
            for i, piece in enumerate(about["pieces"]):
                for name, digest in piece.items():
                    if file_sha256(self.folder / name) != digest:
                        return None
                recording = load_recording(self.folder / _frames_file(i))
                frames += [recording.at(int(number)) for number in recording.frames]
                for name, files in json.loads(read_bytes(self.folder / _images_file(i))).items():
                    images.setdefault(name, {}).update(files)
            checkpoint.unpack(simulation, packed)
        except (OSError, FileError, *DAMAGED):
            return None  # the bake starts again, which costs only time
        self._pieces, self._saved_frames = about["pieces"], len(frames)
        return frames, images

    def is_due(self, frames: list[Frame]) -> bool:
        """Return True if the last checkpoint is old enough and there are new frames."""
        interval = max(CHECKPOINT_INTERVAL, self._cost / MAX_COST_SHARE)
        return time.monotonic() - self._last_save >= interval and len(frames) > self._saved_frames

    def save(self, simulation, frames: list[Frame], sync_images: Callable[[], ImageTable]) -> None:
        """Save the frames since the last checkpoint and the present state of the solver.

        Parameters
        ----------
        simulation : Simulation
        frames : list of Frame
            All frames so far.
        sync_images : callable
            Brings the images of all frames onto the disk and returns the SHA-256 of those since the last checkpoint.
        """
        began = time.monotonic()
        images = sync_images()
        self.folder.mkdir(exist_ok=True)
        names = [body.name for body in simulation.scenario.bodies]
        number = len(self._pieces)
        save_recording(self.folder / _frames_file(number), Recording.stack(frames[self._saved_frames :], names, simulation.dt))
        with atomic_write(self.folder / _images_file(number)) as temporary:
            temporary.write_text(json.dumps(images), encoding="utf-8")
        piece = {name: file_sha256(self.folder / name) for name in (_frames_file(number), _images_file(number))}
        about = {"key": self._key, "pieces": [*self._pieces, piece]}
        with atomic_write(self.folder / STATE_FILE) as temporary, open(temporary, "wb") as file:
            np.savez(file, about=np.array(json.dumps(about)), **checkpoint.pack(simulation))
        self._pieces, self._saved_frames = [*self._pieces, piece], len(frames)
        self._last_save = time.monotonic()
        self._cost = self._last_save - began


def _frames_file(number: int) -> str:
    return f"frames_{number:05d}.npz"


def _images_file(number: int) -> str:
    return f"images_{number:05d}.json"
