# SPDX-License-Identifier: GPL-3.0-or-later
"""The checkpoint of a running bake: after a kill or a power cut, the next bake of the same scene continues from it.

A folder beside those of the sensors holds the frames so far (:mod:`.frame_rows`) and the state of the solver after the last of
them. The state is written after everything it vouches for is on the disk: the first rows of the file of frames and the first
lines of the lists of images, each by its length and SHA-256. What a killed bake has written after them is cut off, and what a
power cut has damaged is found. A checkpoint writes what is new and the state, so it costs the same at any length of a bake.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from ...core.errors import FileError
from ...core.io.npz import DAMAGED, write_arrays
from ...core.io.regular_file import open_regular
from ...core.solver import checkpoint
from ...core.version import VERSION

CHECKPOINT_FOLDER = "checkpoint"
STATE_FILE = "state.npz"
FRAMES_FILE = "frames.rows"
CHECKPOINT_INTERVAL = 5.0
"""Seconds between two checkpoints: a kill loses no more solver time than this."""
MAX_COST_SHARE = 0.03
"""Largest share of a bake's time that checkpoints may take: where a checkpoint is slow, the interval grows."""


@dataclass(frozen=True)
class Vouched:
    """What a checkpoint vouches for.

    Attributes
    ----------
    frames : int
        Number of frames so far.
    rows_sha256 : str
        SHA-256 of their rows.
    images : dict of str to (int, str)
        Length and SHA-256 of each list of images, by the name of its folder; empty for a bake without images.
    """

    frames: int
    rows_sha256: str
    images: dict[str, tuple[int, str]]


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
        self._key = {"palpate": VERSION, "digest": digest}
        self._saved_frames = 0
        self._last_save = time.monotonic()
        self._cost = 0.0

    def restore(self, simulation, check: Callable[[Vouched], bool]) -> int:
        """Bring a new simulation to the checkpoint.

        Parameters
        ----------
        simulation : Simulation
        check : callable
            Takes over the files that the checkpoint vouches for; returns False if they are not what they were.

        Returns
        -------
        int
            Number of frames so far; zero if there is no usable checkpoint, and the bake starts again, which costs only time.
        """
        try:
            with open_regular(self.folder / STATE_FILE) as file, np.load(file, allow_pickle=False) as members:
                packed = {name: members[name] for name in members.files}
            about = json.loads(str(packed.pop("about")))
            if about["key"] != self._key:
                return 0
            vouched = Vouched(
                frames=int(about["frames"]),
                rows_sha256=str(about["rows_sha256"]),
                images={name: (int(length), str(sha256)) for name, (length, sha256) in about["images"].items()},
            )
            if vouched.frames < 1 or not check(vouched):
                return 0
            checkpoint.unpack(simulation, packed)
        except (OSError, FileError, *DAMAGED):
            return 0
        self._saved_frames = vouched.frames
        return vouched.frames

    def is_due(self, frames: int) -> bool:
        """Return True if the last checkpoint is old enough and there are new frames; `frames` is the number so far."""
        interval = max(CHECKPOINT_INTERVAL, self._cost / MAX_COST_SHARE)
        return time.monotonic() - self._last_save >= interval and frames > self._saved_frames

    def save(self, simulation, sync: Callable[[], Vouched]) -> None:
        """Save the present state of the solver.

        Parameters
        ----------
        simulation : Simulation
        sync : callable
            Brings all frames and images so far onto the disk and returns what the checkpoint may vouch for.
        """
        began = time.monotonic()
        vouched = sync()
        about = {"key": self._key, **asdict(vouched)}
        packed = {"about": np.array(json.dumps(about)), **checkpoint.pack(simulation)}
        write_arrays(self.folder / STATE_FILE, packed, compress=False)
        self._saved_frames = vouched.frames
        self._last_save = time.monotonic()
        self._cost = self._last_save - began
