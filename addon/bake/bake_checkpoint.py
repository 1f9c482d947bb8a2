# SPDX-License-Identifier: GPL-3.0-or-later
"""What a bake puts aside while it runs, so that one that was killed goes on where it was.

A folder beside those of the sensors holds the frames so far, in pieces, and the solver's state at the last of them. The state
is written after its frames and names how many pieces belong to it: a kill in between leaves the earlier state, as good a one.
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
from ...core.model.recording import Frame, Recording
from ...core.solver import checkpoint

CHECKPOINT_FOLDER = "unfinished.partial"
STATE_FILE = "state.npz"
CHECKPOINT_INTERVAL = 5.0
"""Seconds of work between two states: what a kill costs at the most, beside the reading of the scene."""


class BakeCheckpoint:
    """The folder of one running bake.

    Parameters
    ----------
    folder : Path
        The bake folder.
    digest : str
        Of the scenario: a state of another one is of no use.
    """

    def __init__(self, folder: Path, digest: str):
        self.place = folder / CHECKPOINT_FOLDER
        self._key = {"palpate": __version__, "digest": digest}
        self._pieces = 0
        self._kept = 0
        self._last = time.monotonic()

    def restore(self, simulation) -> list[Frame] | None:
        """Bring a new simulation to where a killed bake was, and return the frames so far; None when there is none."""
        try:
            with np.load(self.place / STATE_FILE, allow_pickle=False) as members:
                packed = {name: members[name] for name in members.files}
            about = json.loads(str(packed.pop("about")))
            if about["key"] != self._key:
                return None
            pieces = [load_recording(self.place / _piece(i)) for i in range(about["pieces"])]
            frames = [piece.at(int(number)) for piece in pieces for number in piece.frames]
            checkpoint.unpack(simulation, packed)
        except (OSError, FileError, *DAMAGED):
            return None  # begun anew, nothing is lost but time
        self._pieces, self._kept = len(pieces), len(frames)
        return frames

    def is_due(self, frames: list[Frame]) -> bool:
        """Whether enough work has come together to be put aside."""
        return time.monotonic() - self._last >= CHECKPOINT_INTERVAL and len(frames) > self._kept

    def save(self, simulation, frames: list[Frame]) -> None:
        """Put the work aside."""
        self.place.mkdir(exist_ok=True)
        names = [body.name for body in simulation.scenario.bodies]
        piece = Recording.stack(frames[self._kept :], names, simulation.dt)
        save_recording(self.place / _piece(self._pieces), piece)
        about = {"key": self._key, "pieces": self._pieces + 1}
        with atomic_write(self.place / STATE_FILE) as temporary, open(temporary, "wb") as file:
            np.savez(file, about=np.array(json.dumps(about)), **checkpoint.pack(simulation))
        self._pieces, self._kept = self._pieces + 1, len(frames)
        self._last = time.monotonic()

    def remove(self) -> None:
        """Remove it: the bake is finished, or was stopped on purpose."""
        shutil.rmtree(self.place, ignore_errors=True)


def _piece(number: int) -> str:
    return f"frames_{number:05d}.npz"
