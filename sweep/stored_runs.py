# SPDX-License-Identifier: GPL-3.0-or-later
"""The runs of a study by their digests, whether they stand in shards with others or in folders of their own."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

from ..core.model.shared_results import SharedResults
from ..core.study.run_files import RUNS
from ..core.study.run_record import RunRecord, read_run_record
from ..core.study.run_shards import ShardIndex, damaged
from .encoded_run import EncodedRun, encode_run, record_of, unpack_layout, unpack_run
from .features import Layout, read_frames


class StoredRuns:
    """Reads runs of a study.

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
    def _shards(self) -> ShardIndex:
        return ShardIndex(self._runs)

    @property
    def bytes_in_shards(self) -> int:
        """Bytes of the runs in shards."""
        return self._shards.size

    def record(self, digest: str) -> RunRecord:
        """Return the numbers of a run.

        Raises
        ------
        FileError
            It is missing or damaged.
        """
        if digest not in self._shards:
            return read_run_record(self._runs / digest)
        path = self._shards.path(digest)
        try:
            return record_of(lambda most: self._shards.start(digest, most), path)
        except (ValueError, LookupError, TypeError) as error:
            raise damaged(path) from error

    def run(self, digest: str) -> tuple[RunRecord, EncodedRun]:
        """Return a run with its frames; those of a run with a folder are encoded now.

        Raises
        ------
        FileError
            It is missing or damaged, or has no sensor.
        """
        if digest not in self._shards:
            record = self.record(digest)
            return record, encode_run(read_frames(record, self._shared))
        path = self._shards.path(digest)
        content = self._shards.read(digest)
        try:
            return unpack_run(content, path, self._layout)
        except (ValueError, LookupError, TypeError) as error:
            raise damaged(path) from error

    def _layout(self, name: str) -> Layout:
        if name not in self._layouts:
            self._layouts[name] = unpack_layout(self._shards.common(name))
        return self._layouts[name]
