# SPDX-License-Identifier: GPL-3.0-or-later
"""The checkpoint of a running bake: after a kill, the next bake of the same scene continues from it.

A folder beside those of the sensors holds the frames so far, in pieces, and the state of the solver after the last of them. The
state is written after its frames and says how many pieces belong to it, so a kill between the two leaves the previous
checkpoint valid.
"""

from __future__ import annotations

import json
import shutil
import time
from pathlib import Path

import numpy as np

from ... import __version__
from ...core.errors import FileError
from ...core.io.file_writing import atomic_write
from ...core.io.npz import DAMAGED
from ...core.io.recording_npz import load_recording, save_recording
from ...core.io.regular_file import open_regular
from ...core.model.recording import Frame, Recording
from ...core.solver import checkpoint

CHECKPOINT_FOLDER = "unfinished.partial"
STATE_FILE = "state.npz"
CHECKPOINT_INTERVAL = 5.0
"""Seconds between two checkpoints: a kill loses no more solver time than this."""


class BakeCheckpoint:
    """The checkpoint folder of one running bake.

    Parameters
    ----------
    folder : Path
        The bake folder.
    digest : str
        Digest of the scenario. A checkpoint of another scenario is ignored.
    """

    def __init__(self, folder: Path, digest: str):
        self.folder = folder / CHECKPOINT_FOLDER
        self._key = {"palpate": __version__, "digest": digest}
        self._saved_pieces = 0
        self._saved_frames = 0
        self._last_save = time.monotonic()

    def restore(self, simulation) -> list[Frame] | None:
        """Bring a new simulation to the checkpoint and return the frames so far; None if there is no usable checkpoint."""
        try:
            with open_regular(self.folder / STATE_FILE) as file, np.load(file, allow_pickle=False) as members:
                packed = {name: members[name] for name in members.files}
            about = json.loads(str(packed.pop("about")))
            if about["key"] != self._key:
                return None
            pieces = [load_recording(self.folder / _piece(i)) for i in range(about["pieces"])]
            frames = [piece.at(int(number)) for piece in pieces for number in piece.frames]
            checkpoint.unpack(simulation, packed)
        except (OSError, FileError, *DAMAGED):
            return None  # the bake starts again, which costs only time
        self._saved_pieces, self._saved_frames = len(pieces), len(frames)
        return frames

    def is_due(self, frames: list[Frame]) -> bool:
        """Return True if the last checkpoint is old enough and there are new frames."""
        return time.monotonic() - self._last_save >= CHECKPOINT_INTERVAL and len(frames) > self._saved_frames

    def save(self, simulation, frames: list[Frame]) -> None:
        """Save the frames since the last checkpoint and the present state of the solver."""
        self.folder.mkdir(exist_ok=True)
        names = [body.name for body in simulation.scenario.bodies]
        piece = Recording.stack(frames[self._saved_frames :], names, simulation.dt)
        save_recording(self.folder / _piece(self._saved_pieces), piece)
        about = {"key": self._key, "pieces": self._saved_pieces + 1}
        with atomic_write(self.folder / STATE_FILE) as temporary, open(temporary, "wb") as file:
            np.savez(file, about=np.array(json.dumps(about)), **checkpoint.pack(simulation))
        self._saved_pieces, self._saved_frames = self._saved_pieces + 1, len(frames)
        self._last_save = time.monotonic()

    def remove(self) -> None:
        """Remove the checkpoint, because the bake has finished or was cancelled."""
        shutil.rmtree(self.folder, ignore_errors=True)


def _piece(number: int) -> str:
    return f"frames_{number:05d}.npz"
