# SPDX-License-Identifier: GPL-3.0-or-later
"""Shards: files of a study that hold the results of many runs each, and to which a process appends a group of runs at a time.

::

    runs/<16 digits>.shard       groups, one behind the other
    a group                      b"PALPRUN1", the number of its parts, the CRC-32 of its table; the table; the parts
    a row of the table           kind (1: a run, 2: what many runs have in common), name, length and CRC-32 of a part

A process writes to shards of its own. It appends a group only after the one before is on the disk, so all groups but the last
are whole wherever they can be read; that of the last is known from its checksums. What stands behind the last whole group was
cut off by a kill or a power cut, and counts for nothing: nobody appends to such a shard.
"""

from __future__ import annotations

import os
import secrets
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np

from ..errors import FileError, os_error_reason
from ..io.group_sync import sync_folder

SUFFIX = ".shard"
SHARD_BYTES = 2 << 30
"""Size from which on a process begins another shard: a million runs of 5 MB fill 2,500, and each process has one more."""
RUN, COMMON = 1, 2
"""Kinds of parts."""

_MAGIC = b"PALPRUN1"
_HEAD = struct.Struct("<8sII")
_ROW = np.dtype([("kind", "<u4"), ("name", "u1", 12), ("length", "<u8"), ("crc", "<u4")])
_PLACE = np.dtype([("shard", "<u4"), ("start", "<u8"), ("length", "<u8"), ("crc", "<u4")])
_BLOCK = 1 << 20


@dataclass
class _OpenShard:
    """A shard to which this process appends."""

    path: Path
    size: int
    common: set[str]


_open: dict[Path, _OpenShard] = {}
"""By the folder of runs. A shard is taken out while it is written to."""


def append(runs: Path, place: Path, found: Mapping[str, bytes], common: Mapping[str, bytes]) -> None:
    """Bring results of runs onto the disk together, in a shard of this process.

    Parameters
    ----------
    runs : Path
        Folder of the shards.
    place : Path
        A hidden folder on the same disk, in which a new shard is begun.
    found : mapping of str to bytes
        Results by the digests of their runs, 24 hexadecimal digits.
    common : mapping of str to bytes
        What they have in common, by such names; a shard holds it once.

    Raises
    ------
    OSError
        It cannot be written. The shard is as it was, or nobody appends to it again.
    """
    shard = _open.pop(runs, None)
    if shard is not None and (shard.size >= SHARD_BYTES or _size_of(shard.path) != shard.size):
        shard = None
    fresh = {name: content for name, content in common.items() if shard is None or name not in shard.common}
    content = _group(found, fresh)
    if shard is None:
        shard = _OpenShard(runs / f"{secrets.token_hex(8)}{SUFFIX}", 0, set())
        _write(place / shard.path.name, 0, content, "xb")
        os.rename(place / shard.path.name, shard.path)
        sync_folder(runs)
    else:
        try:
            _write(shard.path, shard.size, content, "rb+")
        except OSError:
            with suppress(OSError):
                os.truncate(shard.path, shard.size)
            raise
    shard.size += len(content)
    shard.common |= fresh.keys()
    _open[runs] = shard


def _size_of(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return -1


def _write(path: Path, at: int, content: bytes, mode: str) -> None:
    with open(path, mode) as file:
        file.seek(at)
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def _group(found: Mapping[str, bytes], common: Mapping[str, bytes]) -> bytes:
    parts = [(COMMON, name, content) for name, content in common.items()] + [(RUN, *one) for one in found.items()]
    table = np.zeros(len(parts), _ROW)
    for row, (kind, name, content) in zip(table, parts, strict=True):
        row["kind"], row["name"] = kind, np.frombuffer(bytes.fromhex(name), np.uint8)
        row["length"], row["crc"] = len(content), zlib.crc32(content)
    head = _HEAD.pack(_MAGIC, len(parts), zlib.crc32(table.tobytes()))
    return b"".join((head, table.tobytes(), *(content for _, _, content in parts)))


class ShardScan:
    """Looks through the groups of all shards, and later through those that have come since.

    Parameters
    ----------
    runs : Path
        Folder of the shards, which may be missing.
    """

    def __init__(self, runs: Path):
        self._runs = runs
        self._ends: dict[str, int] = {}

    def new_groups(self) -> Iterator[tuple[Path, int, np.ndarray]]:
        """Yield shard, place of the first part and table of each whole group that was not yielded before.

        Raises
        ------
        FileError
            A shard cannot be read.
        """
        sizes = {}
        with suppress(FileNotFoundError), os.scandir(self._runs) as entries:
            for entry in entries:
                if entry.name.endswith(SUFFIX) and not entry.name.startswith("."):
                    sizes[entry.name] = entry.stat().st_size
        for name in sorted(sizes):
            if sizes[name] > self._ends.get(name, 0):
                path = self._runs / name
                try:
                    with open(path, "rb") as file:  # a network file system knows the size best when a file is opened
                        yield from self._groups_of(path, file, os.fstat(file.fileno()).st_size)
                except OSError as error:
                    raise FileError(f"'{path}' could not be read ({os_error_reason(error)}): check its permissions.") from error

    def _groups_of(self, path: Path, file: IO[bytes], size: int) -> Iterator[tuple[Path, int, np.ndarray]]:
        at = self._ends.get(path.name, 0)
        found = _next_group(file, at, size)
        while found is not None:
            start, table, end = found
            following = _next_group(file, end, size)
            if following is None and not _is_whole(file, start, table):
                return
            yield path, start, table
            self._ends[path.name] = end
            found = following


def _next_group(file: IO[bytes], at: int, size: int) -> tuple[int, np.ndarray, int] | None:
    """Return where the parts of a group begin, its table, and where it ends; None where there is no more."""
    file.seek(at)
    head = file.read(_HEAD.size)
    if len(head) < _HEAD.size:
        return None
    magic, count, checksum = _HEAD.unpack(head)
    start = at + _HEAD.size + count * _ROW.itemsize
    if magic != _MAGIC or start > size:
        return None
    rows = file.read(count * _ROW.itemsize)
    if zlib.crc32(rows) != checksum:
        return None
    table = np.frombuffer(rows, _ROW)
    end = start + int(table["length"].sum())
    return (start, table, end) if end <= size else None


def _is_whole(file: IO[bytes], start: int, table: np.ndarray) -> bool:
    file.seek(start)
    for row in table:
        checksum, left = 0, int(row["length"])
        while left:
            block = file.read(min(left, _BLOCK))
            if not block:
                return False
            checksum, left = zlib.crc32(block, checksum), left - len(block)
        if checksum != row["crc"]:
            return False
    return True


def digests_in(runs: Path) -> set[str]:
    """Return the digests of the runs that are in the shards of a folder."""
    found: set[str] = set()
    for _, _, table in ShardScan(runs).new_groups():
        names = table["name"][table["kind"] == RUN].tobytes()
        found.update(names[at : at + 12].hex() for at in range(0, len(names), 12))
    return found


class KnownRuns:
    """The runs in the shards of a folder, in eight bytes each: a process that computes runs looks again and again.

    Parameters
    ----------
    runs : Path
    """

    def __init__(self, runs: Path):
        self._runs, self._scan = runs, ShardScan(runs)
        self._keys: list[np.ndarray] = []

    def among(self, digests: list[str]) -> set[str]:
        """Return those of some digests whose runs are in the shards now."""
        fresh = [_keys_of(table["name"][table["kind"] == RUN]) for _, _, table in self._scan.new_groups()]
        if fresh:
            self._keys.append(np.sort(np.concatenate(fresh)))
        while len(self._keys) > 1 and len(self._keys[-2]) <= 2 * len(self._keys[-1]):  # so that there are few of them
            self._keys[-2:] = [np.sort(np.concatenate(self._keys[-2:]))]
        asked = _keys_of(names_of(digests))
        likely = [digest for digest, key in zip(digests, asked, strict=True) if any(_holds(own, key) for own in self._keys)]
        return digests_in(self._runs) & set(likely) if likely else set()


def _keys_of(names: np.ndarray) -> np.ndarray:
    """Return the first eight bytes of (n, 12) names as numbers."""
    return np.ascontiguousarray(names[:, :8]).view(">u8").reshape(-1).astype(np.uint64)


def _low_of(names: np.ndarray) -> np.ndarray:
    """Return the last four bytes of (n, 12) names as numbers."""
    return np.ascontiguousarray(names[:, 8:]).view(">u4").reshape(-1).astype(np.uint32)


def _holds(keys: np.ndarray, key: np.uint64) -> bool:
    at = int(np.searchsorted(keys, key))
    return at < len(keys) and bool(keys[at] == key)


def names_of(digests: Sequence[str]) -> np.ndarray:
    """Return digests as the (n, 12) bytes that stand for them in a shard."""
    return np.frombuffer(bytes.fromhex("".join(digests)), np.uint8).reshape(-1, 12)


class ShardIndex:
    """Where the runs in the shards of a folder are, in 36 bytes each.

    Parameters
    ----------
    runs : Path

    Raises
    ------
    FileError
        A shard cannot be read.
    """

    def __init__(self, runs: Path):
        self._paths: list[Path] = []
        self._common: dict[str, tuple[Path, int, int, int]] = {}
        self._last: tuple[str, np.void | None] = "", None
        found = [self._places(path, start, table) for path, start, table in ShardScan(runs).new_groups()]
        names = np.concatenate([np.zeros((0, 12), np.uint8), *(own for own, _ in found)])
        places = np.concatenate([np.zeros(0, _PLACE), *(own for _, own in found)])
        found.clear()
        high, low = _keys_of(names), _low_of(names)
        order = np.lexsort((low, high))
        again = (np.diff(high[order]) == 0) & (np.diff(low[order]) == 0)  # two processes have computed the run
        order = np.delete(order, 1 + np.flatnonzero(again))
        self._table, self._high, self._low = places[order], high[order], low[order]

    def _places(self, path: Path, start: int, table: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return names and places of the runs in a group."""
        if not self._paths or self._paths[-1] != path:
            self._paths.append(path)
        offsets = start + np.cumsum(table["length"]) - table["length"]
        for row, offset in zip(table[table["kind"] == COMMON], offsets[table["kind"] == COMMON], strict=True):
            name = row["name"].tobytes().hex()
            self._common.setdefault(name, (path, int(offset), int(row["length"]), int(row["crc"])))
        mine = table["kind"] == RUN
        found = np.zeros(int(mine.sum()), _PLACE)
        found["shard"] = len(self._paths) - 1
        for name, values in (("start", offsets), ("length", table["length"]), ("crc", table["crc"])):
            found[name] = values[mine]
        return np.ascontiguousarray(table["name"][mine]), found

    def __len__(self) -> int:
        return len(self._table)

    def names(self, rows: np.ndarray) -> np.ndarray:
        """Return the (n, 12) names of runs by their rows, which are in the order of the names."""
        found = np.empty((len(rows), 12), np.uint8)
        found[:, :8] = self._high[rows].astype(">u8").view(np.uint8).reshape(-1, 8)
        found[:, 8:] = self._low[rows].astype(">u4").view(np.uint8).reshape(-1, 4)
        return found

    def rows(self, names: np.ndarray) -> np.ndarray:
        """Return the first rows of runs by their (n, 12) names; -1 where a run is in no shard."""
        high, low = _keys_of(names), _low_of(names)
        found = np.searchsorted(self._high, high)
        for at in np.flatnonzero(np.searchsorted(self._high, high, "right") - found > 1):  # equal in their first eight bytes
            own = self._row_at(high[at], low[at])
            found[at] = len(self) if own is None else own
        inside = np.minimum(found, max(len(self) - 1, 0))
        known = (found < len(self)) & (self._high[inside] == high) & (self._low[inside] == low) if len(self) else found < 0
        return np.where(known, found, -1)

    def __contains__(self, digest: str) -> bool:
        return self._row(digest) is not None

    @property
    def size(self) -> int:
        """Bytes of all runs."""
        return int(self._table["length"].sum())

    def path(self, digest: str) -> Path:
        """Return the shard of a run; raises KeyError where it is in none."""
        return self._paths[int(self._known(digest)["shard"])]

    def start(self, digest: str, most: int) -> bytes:
        """Return the first bytes of the results of a run, which may be damaged.

        Raises
        ------
        FileError
            They cannot be read.
        KeyError
            The run is in no shard.
        """
        row = self._known(digest)
        return _read(self.path(digest), int(row["start"]), min(most, int(row["length"])))

    def read(self, digest: str) -> bytes:
        """Return the results of a run; raises as :meth:`start`, and FileError where they are damaged."""
        row = self._known(digest)
        path = self.path(digest)
        return _checked(path, _read(path, int(row["start"]), int(row["length"])), int(row["crc"]))

    def common(self, name: str) -> bytes:
        """Return what runs have in common; raises as :meth:`read`."""
        path, offset, length, checksum = self._common[name]
        return _checked(path, _read(path, offset, length), checksum)

    def all_common(self) -> dict[str, bytes]:
        """Return all that runs have in common, by name; raises as :meth:`read`."""
        return {name: self.common(name) for name in self._common}

    def _known(self, digest: str) -> np.void:
        found = self._row(digest)
        if found is None:
            raise KeyError(digest)
        return found

    def _row(self, digest: str) -> np.void | None:
        if digest != self._last[0]:  # what is asked about a run is asked in turn
            at = self._row_at(np.uint64(int(digest[:16], 16)), np.uint32(int(digest[16:], 16)))
            self._last = digest, None if at is None else self._table[at]
        return self._last[1]

    def _row_at(self, high: np.uint64, low: np.uint32) -> int | None:
        begin, end = (int(np.searchsorted(self._high, high, side)) for side in ("left", "right"))
        at = begin + int(np.searchsorted(self._low[begin:end], low))
        return None if at == end or self._low[at] != low else at


def _read(path: Path, offset: int, length: int) -> bytes:
    try:
        with open(path, "rb") as file:
            file.seek(offset)
            return file.read(length)
    except OSError as error:
        raise FileError(f"'{path}' could not be read ({os_error_reason(error)}): check its permissions.") from error


def _checked(path: Path, content: bytes, checksum: int) -> bytes:
    if zlib.crc32(content) != checksum:
        raise damaged(path)
    return content


def damaged(path: Path) -> FileError:
    """Return the error about a shard in which a run is damaged."""
    return FileError(f"'{path}' is damaged: delete this file and run the sweep again, which computes its runs once more.")
