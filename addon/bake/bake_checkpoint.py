# SPDX-License-Identifier: GPL-3.0-or-later
"""The checkpoint of a running bake: after a kill or a power cut, the next bake of the same scene continues from it.

A folder beside those of the sensors holds the frames so far (:mod:`.frame_rows`) and the state of the solver after the last of
them. The state is written after everything it vouches for is on the disk: the first rows of the file of frames and the first
lines of the lists of images, each by its length and SHA-256. What a killed bake has written after them is cut off, and what a
power cut has damaged is found. A checkpoint writes what is new and the state, so it costs the same at any length of a bake.

A checkpoint may come from anywhere, as a bake folder does. What is damaged or does not fit is not used: the bake
starts from its first frame.
"""

from __future__ import annotations

import json
import os
import stat
import time
import zipfile
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
_SHA256 = "sha256"
"""Name of the member that has the SHA-256 of all others."""


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

    Attributes
    ----------
    damage : str
        What is wrong with the checkpoint; empty if there is none, or one of another scenario or version.
    """

    def __init__(self, folder: Path, digest: str):
        self.folder = folder / CHECKPOINT_FOLDER
        self.damage = ""
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
            _require_plain_files(self.folder.parent)
            packed = _read_state(self.folder / STATE_FILE)
            about = json.loads(str(packed["about"]))
            if about["key"] != self._key:
                return 0
            if packed.pop(_SHA256).tolist() != checkpoint.digest(packed):
                raise ValueError("its state does not have its checksum")
            vouched = Vouched(
                frames=int(about["frames"]),
                rows_sha256=str(about["rows_sha256"]),
                images={name: (int(length), str(sha256)) for name, (length, sha256) in about["images"].items()},
            )
            if vouched.frames < 1 or not check(vouched):
                raise ValueError("frames or images that it lists are not there, or are others")
            checkpoint.unpack(simulation, packed, simulation.scenario.frame_start + vouched.frames - 1)
        except FileNotFoundError:
            return 0  # killed before the first checkpoint
        except (OSError, FileError, *DAMAGED) as error:
            self.damage = " ".join(str(error).split())[:200] or type(error).__name__
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
        packed[_SHA256] = np.array(checkpoint.digest(packed))
        write_arrays(self.folder / STATE_FILE, packed, compress=False)
        self._saved_frames = vouched.frames
        self._last_save = time.monotonic()
        self._cost = self._last_save - began


def _read_state(path: Path) -> dict[str, np.ndarray]:
    """Return the arrays of a state. They are not compressed, so they need no more memory than the file says."""
    with open_regular(path) as file, np.load(file, allow_pickle=False) as members:
        if any(one.compress_type != zipfile.ZIP_STORED for one in members.zip.infolist()):
            raise ValueError("its state is compressed")
        return {name: members[name] for name in members.files}


def _require_plain_files(folder: Path) -> None:
    """Raise ValueError if a folder holds a link, a device or the like: a bake that goes on writes into its files."""
    for above, folders, files in os.walk(folder):
        for name in (*folders, *files):
            found = os.lstat(os.path.join(above, name))
            plain = stat.S_ISDIR(found.st_mode) or (stat.S_ISREG(found.st_mode) and found.st_nlink == 1)
            if not plain:
                raise ValueError(f"'{name}' is a link or no file")
