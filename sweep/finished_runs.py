# SPDX-License-Identifier: GPL-3.0-or-later
"""The runs of a study as they stand in its folder: those that finished, those that failed, and the study's name."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..core.errors import FileError, os_error_reason
from ..core.io.input_files import read_bytes
from ..core.model.shared_results import SharedResults
from ..core.study.run_files import FAILED, RUNS, STUDY_NAME, done_runs, failed_runs, run_folders
from ..core.study.run_record import RunRecord, Value, read_run_record, values_read
from ..core.study.run_shards import ShardIndex, damaged, names_of
from ..core.study.study_file import Run, read_study
from .encoded_run import EncodedRun, encode_run, record_of, unpack_layout, unpack_run
from .features import FrameStyle, Layout, read_frames

RUNS_AT_ONCE = 10_000
"""Planned runs that are looked up together."""
UNNAMED_STUDY = "study of a tactile sensor"
"""Name of a study whose file gives none. The name of its folder does not serve, so that equal studies give equal files."""


@dataclass(frozen=True)
class FailedRun:
    """One run that failed: why, in one sentence, and which one it was, as far as the study is known."""

    digest: str
    sentence: str
    index: int | None = None
    values: dict[str, Value] = field(default_factory=dict)


class StoredRuns:
    """Reads runs of a study by their digests, whether they stand in shards with others or in folders of their own.

    Parameters
    ----------
    folder : Path
        Of the study.
    """

    def __init__(self, folder: Path):
        self._runs = folder / RUNS
        self._shared = SharedResults()
        self._layouts: dict[str, Layout] = {}

    @cached_property
    def shards(self) -> ShardIndex:
        """Where the runs in shards are."""
        return ShardIndex(self._runs)

    @cached_property
    def _style(self) -> FrameStyle:
        return FrameStyle.of(read_study(self._runs.parent / STUDY_NAME))

    @property
    def bytes_in_shards(self) -> int:
        """Bytes of the runs in shards."""
        return self.shards.size

    def record(self, digest: str) -> RunRecord:
        """Return the numbers of a run.

        Raises
        ------
        FileError
            It is missing or damaged.
        """
        if digest not in self.shards:
            return read_run_record(self._runs / digest)
        path = self.shards.path(digest)
        try:
            return record_of(lambda most: self.shards.start(digest, most), path)
        except (ValueError, LookupError, TypeError) as error:
            raise damaged(path) from error

    def run(self, digest: str) -> tuple[RunRecord, EncodedRun]:
        """Return a run with its frames; those of a run with a folder are encoded now.

        Raises
        ------
        FileError
            It is missing or damaged, or has no sensor.
        """
        if digest not in self.shards:
            record = self.record(digest)
            return record, encode_run(read_frames(record, self._shared, self._style))
        path = self.shards.path(digest)
        content = self.shards.read(digest)
        try:
            return unpack_run(content, path, self._layout)
        except (ValueError, LookupError, TypeError) as error:
            raise damaged(path) from error

    def _layout(self, name: str) -> Layout:
        if name not in self._layouts:
            self._layouts[name] = unpack_layout(self.shards.common(name))
        return self._layouts[name]


class RunOrder(Sequence[tuple[int, str]]):
    """Index and digest of finished runs, in the order of the design: of a study, this is all in memory, in 20 bytes a run.

    Parameters
    ----------
    indices : (n,) int
    names : (n, 12) uint8
        Digests as bytes.
    """

    def __init__(self, indices: np.ndarray, names: np.ndarray):
        by_name = np.lexsort((*names.T[::-1], indices))
        self._indices, self._names = indices[by_name], names[by_name]

    def __len__(self) -> int:
        return len(self._indices)

    def __getitem__(self, at: Any) -> Any:
        return int(self._indices[at]), self._names[at].tobytes().hex()


def run_order(folder: Path, planned: Sequence[Run] = ()) -> RunOrder:
    """Return index and digest of each finished run, in the order of the design, whatever the order of finishing.

    Parameters
    ----------
    folder : Path
        Of the study.
    planned : sequence of Run
        All runs of the study, as far as they are known. The places of others are read from their files.

    Raises
    ------
    FileError
        There is no study in the folder, or a run is damaged.
    """
    if not (folder / STUDY_NAME).is_file():
        raise FileError(f"'{folder}' holds no study: give the folder that `palpate sweep` wrote.")
    runs = StoredRuns(folder)
    left, unplanned = run_folders(folder), np.ones(len(runs.shards), bool)
    indices, names = [np.zeros(0, np.int64)], [np.zeros((0, 12), np.uint8)]
    for at in range(0, len(planned), RUNS_AT_ONCE):
        some = planned[at : at + RUNS_AT_ONCE]
        own = names_of([run.digest for run in some])
        rows = runs.shards.rows(own)
        unplanned[rows[rows >= 0]] = False
        in_folder = {run.digest for run in some} & left
        left -= in_folder
        done = (rows >= 0) | np.array([run.digest in in_folder for run in some], bool)
        indices.append(np.array([run.index for run in some], np.int64)[done])
        names.append(own[done])
    others = [*sorted(left), *(own.tobytes().hex() for own in runs.shards.names(np.flatnonzero(unplanned)))]
    if others:
        others = list(dict.fromkeys(others))  # a run may be in two shards, or have a folder as well
        indices.append(np.array([runs.record(digest).index for digest in others], np.int64))
        names.append(names_of(others))
    return RunOrder(np.concatenate(indices), np.concatenate(names))


def finished_runs(folder: Path, order: RunOrder | None = None) -> Iterator[RunRecord]:
    """Yield the finished runs in the order of the design.

    Parameters
    ----------
    folder : Path
        Of the study.
    order : RunOrder, optional
        What :func:`run_order` returned, to read the same runs again though more may have finished.

    Raises
    ------
    FileError
        As :func:`run_order`.
    """
    runs = StoredRuns(folder)
    for _, digest in run_order(folder) if order is None else order:
        yield runs.record(digest)


def failures(folder: Path, planned: Sequence[Run] = ()) -> list[FailedRun]:
    """Return the failed runs of a study, those with a known place in the design first, in its order.

    Parameters
    ----------
    folder : Path
        Of the study.
    planned : sequence of Run
        All runs of the study. A failure's file has only its digest, so its place and values are looked up here.

    Raises
    ------
    FileError
        A file cannot be read.
    """
    digests = failed_runs(folder)
    if digests:
        digests -= done_runs(folder)
    known = {run.digest: run for run in planned if run.digest in digests}
    found = []
    for digest in sorted(digests):
        sentence = _sentence(folder / FAILED / f"{digest}.txt")
        run = known.get(digest)
        found.append(
            FailedRun(digest, sentence, run.index, values_read(dict(run.values))) if run else FailedRun(digest, sentence)
        )
    return sorted(found, key=lambda run: (run.index is None, run.index or 0, run.digest))


def _sentence(path: Path) -> str:
    try:
        text = read_bytes(path).decode("utf-8", "replace")
    except OSError as error:
        raise FileError(f"'{path}' could not be read ({os_error_reason(error)}): check its permissions.") from error
    return next((line.strip() for line in text.splitlines() if line.strip()), "The run failed and left no message.")


def study_name(folder: Path) -> str:
    """Return the name that the study's file gives, :data:`UNNAMED_STUDY` where it gives none.

    Raises
    ------
    FileError
        The file is missing or says what no study can say.
    """
    return read_study(folder / STUDY_NAME).name or UNNAMED_STUDY
