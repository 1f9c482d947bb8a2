# SPDX-License-Identifier: GPL-3.0-or-later
"""A new bake becomes the present one in a single step; a kill or a power cut at any moment leaves the old bake or the new one.

A bake is written whole into ``.palpate/growing-<id>/sensors``. When everything is on the disk, the record
``.palpate/switch.json`` is written. This is the step: without the record the old bake is the present one, with it the new one.
Then the sensors' folders are renamed, a .blend that belongs to the bake is exchanged, and the record is removed. Whoever finds
a record later carries it out first, or, where it cannot write, reads from the places that the record names.

Files in a replaced folder that no bake has written belong to the user and move into the new folder. Nothing else than the files
of a bake is removed.
"""

from __future__ import annotations

import glob
import json
import os
import re
import threading
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from ..errors import FileError
from .bake_folder import BAKE_FILE_NAMES
from .file_writing import (
    atomic_write,
    exchange_file,
    remove_leftovers,
    remove_leftovers_of,
    sync_file,
    sync_folder,
    write_file,
)
from .folder_lock import FolderLock
from .private_folder import PRIVATE_FOLDER, find_private_folder, remove_tree
from .regular_file import read_bytes
from .schema import read_json

SWITCH_NAME = "switch.json"
SWITCH_FORMAT = "palpate-switch/1"
GROWING_PREFIX = "growing-"
BLEND_NOTE = "blend"
"""File in the folder of a run: the path of the .blend that the run saves."""

_removals: list[threading.Thread] = []


@dataclass(frozen=True)
class Switch:
    """The record of a switch from the old bake to a new one.

    Attributes
    ----------
    run : str
        Random id of the run that wrote the new bake, 16 hexadecimal digits.
    folders : tuple of str
        Names of the sensors' folders.
    blend : str
        Absolute path of the .blend that is exchanged as well; empty if none is.
    backups : int
        Number of earlier versions of the .blend that are kept (.blend1 and so on).
    """

    run: str
    folders: tuple[str, ...]
    blend: str
    backups: int

    def new_blend(self) -> Path:
        """Return where the new .blend waits, beside the old one."""
        return waiting_blend(Path(self.blend), self.run)


def waiting_blend(blend: Path, run: str) -> Path:
    """Return the name under which a run writes a .blend, beside the old one."""
    return blend.with_name(f".{blend.name}.{run}.partial")


def announce_blend(bake_folder: Path, run: str, blend: Path) -> None:
    """Note that a .blend, which is about to be written, belongs to a run, and in which bake folder the run is.

    A kill leaves the waiting .blend; :func:`remove_growing` and :func:`settle_blend` find it by these notes.

    Raises
    ------
    FileError
        A note cannot be written.
    """
    with atomic_write(growing_folder(bake_folder / PRIVATE_FOLDER, run) / BLEND_NOTE) as temporary:
        temporary.write_bytes(os.fsencode(blend))
    with write_file(_folder_note(blend, run), atomic=False) as note:
        note.write_bytes(os.fsencode(bake_folder))
        sync_file(note)


def settle_blend(blend: Path) -> None:
    """Carry out a switch that was interrupted and that exchanges this .blend; see :func:`settle`."""
    target = Path(os.path.realpath(blend))
    for path in target.parent.glob(f".{glob.escape(target.name)}.*.bake"):
        if _folder_note(target, path.name[-21:-5]) == path and not path.is_symlink():
            bake_folder = Path(os.fsdecode(read_bytes(path)))
            settle(bake_folder)
            if pending_switch(bake_folder) is None and not os.path.lexists(waiting_blend(target, path.name[-21:-5])):
                with suppress(OSError):
                    path.unlink()


def _folder_note(blend: Path, run: str) -> Path:
    return blend.with_name(f".{blend.name}.{run}.bake")


def growing_folder(private: Path, run: str) -> Path:
    """Return the folder in which the bake of a run grows."""
    return private / f"{GROWING_PREFIX}{run}"


def new_folder(growing: Path, name: str) -> Path:
    """Return where the new bake of a sensor grows, whose folder has this name."""
    return growing / "sensors" / name


def growing_folders(private: Path) -> list[Path]:
    """Return the folders of all runs that have not been removed yet, sorted by name."""
    pattern = re.compile(rf"{GROWING_PREFIX}[0-9a-f]{{16}}")
    return sorted(path for path in private.iterdir() if pattern.fullmatch(path.name) and not path.is_symlink())


def switch(bake_folder: Path, record: Switch) -> None:
    """Make a new bake the present one: all of its folders and its .blend, or nothing.

    The caller holds the lock of the folder, and everything in the new folders is on the disk.

    Raises
    ------
    FileError, OSError
        A folder cannot be moved. The old bake is the present one again.
    """
    private = bake_folder / PRIVATE_FOLDER
    path = private / SWITCH_NAME
    content = {
        "format": SWITCH_FORMAT,
        "run": record.run,
        "folders": list(record.folders),
        "blend": record.blend,
        "backups": record.backups,
    }
    try:
        with atomic_write(path) as temporary:
            temporary.write_bytes(json.dumps(content, indent=2).encode("utf-8", "surrogatepass"))
        _rename(bake_folder, record)
    except BaseException:
        with suppress(OSError):
            _rename_back(bake_folder, record)
            path.unlink(missing_ok=True)
            sync_folder(private)
        raise
    _conclude(bake_folder, record)


def pending_switch(bake_folder: Path) -> Switch | None:
    """Return the record of a switch that was interrupted; None if there is none.

    Raises
    ------
    FileError
        The record is damaged.
    """
    private = find_private_folder(bake_folder)
    path = None if private is None else private / SWITCH_NAME
    if path is None or path.is_symlink() or not path.is_file():
        return None
    try:
        record, _ = read_json(path, Switch, SWITCH_FORMAT, "delete it and bake again")
    except FileNotFoundError:
        return None  # another process has just carried it out
    fault = "" if re.fullmatch(r"[0-9a-f]{16}", record.run) else "its run is no id"
    for name in record.folders:
        if name != os.path.basename(name) or name.startswith(".") or not name.strip("."):
            fault = f"{name!r:.60} is no name of a folder"
    if fault:
        raise FileError(f"'{path}' is damaged ({fault}): delete it and bake again.")
    return record


def settle(bake_folder: Path) -> None:
    """Carry out a switch that was interrupted, where the folder can be written to and no other process does it.

    Raises
    ------
    FileError
        The record is damaged.
    """
    if pending_switch(bake_folder) is None:
        return
    try:
        lock = FolderLock(bake_folder)
    except FileError:
        return  # another process is at it; until it has finished, present_folder leads to the new files
    try:
        settle_locked(bake_folder)
    except OSError:
        return
    finally:
        lock.release()


def settle_locked(bake_folder: Path) -> None:
    """Carry out a switch that was interrupted; the caller holds the lock.

    Raises
    ------
    FileError
        The record is damaged.
    OSError
        A folder cannot be moved.
    """
    record = pending_switch(bake_folder)
    if record is not None:
        _rename(bake_folder, record)
        _conclude(bake_folder, record)


def present_folder(folder: Path) -> Path:
    """Return where the files of a sensor's folder are at present: elsewhere only while a switch waits to be carried out."""
    record = pending_switch(folder.parent)
    if record is None or folder.name not in record.folders:
        return folder
    new = new_folder(growing_folder(folder.parent / PRIVATE_FOLDER, record.run), folder.name)
    return new if new.is_dir() else folder


def present_folders(bake_folder: Path) -> Iterator[tuple[str, Path]]:
    """Yield the name of each folder in a bake folder, and where its files are at present; sorted by name."""
    record = pending_switch(bake_folder)
    names = {path.name for path in bake_folder.iterdir() if path.name != PRIVATE_FOLDER} | set(record.folders if record else ())
    for name in sorted(names):
        yield name, present_folder(bake_folder / name)


def remove_growing(growing: Path) -> None:
    """Remove what a run has left: the files of bakes only; a file of the user's goes back into its sensor's folder."""
    replaced = growing / "replaced"
    if replaced.is_dir():
        for old in replaced.iterdir():
            with suppress(OSError):
                _remove_replaced(old, growing.parent.parent / old.name)
        with suppress(OSError):
            replaced.rmdir()
    _remove_waiting_blend(growing)
    remove_tree(growing / "sensors")
    remove_tree(growing / "checkpoint")
    with suppress(OSError):
        growing.rmdir()


def _remove_waiting_blend(growing: Path) -> None:
    """Remove the .blend that a run has written, its notes, and what Blender leaves beside it when it is killed."""
    note, run = growing / BLEND_NOTE, growing.name.removeprefix(GROWING_PREFIX)
    with suppress(OSError, FileError, ValueError):
        blend = Path(os.fsdecode(read_bytes(note)))
        waiting = waiting_blend(blend, run)
        for path in (waiting, waiting.with_name(f"{waiting.name}@"), _folder_note(blend, run)):
            path.unlink(missing_ok=True)
        remove_leftovers_of(blend)  # the unfinished copy of an earlier version
    with suppress(OSError):
        note.unlink(missing_ok=True)
        remove_leftovers(growing)


def wait_for_removals() -> None:
    """Return once the folders of replaced bakes are removed."""
    while _removals:
        _removals.pop().join()


def _places(bake_folder: Path, record: Switch, name: str) -> tuple[Path, Path, Path]:
    """Return a sensor's new folder, its place, and where its old folder goes."""
    growing = growing_folder(bake_folder / PRIVATE_FOLDER, record.run)
    return new_folder(growing, name), bake_folder / name, growing / "replaced" / name


def _rename(bake_folder: Path, record: Switch) -> None:
    """Put the new folders and the new .blend in place; what an interrupted call has done already is left as it is."""
    growing = growing_folder(bake_folder / PRIVATE_FOLDER, record.run)
    replaced = growing / "replaced"
    if record.folders and growing.is_dir():
        replaced.mkdir(exist_ok=True)
    for name in record.folders:
        new, place, old = _places(bake_folder, record, name)
        if not os.path.lexists(new):
            continue
        if os.path.lexists(place):
            if os.path.lexists(old):
                raise FileError(f"'{place}' was made while a bake took its place: rename it, then try again.")
            place.rename(old)
        new.rename(place)
    for folder in (replaced, growing / "sensors", bake_folder):
        sync_folder(folder)
    if record.blend and os.path.lexists(record.new_blend()):
        exchange_file(record.new_blend(), Path(record.blend), record.backups)


def _rename_back(bake_folder: Path, record: Switch) -> None:
    """Put the old folders back in place."""
    for name in reversed(record.folders):
        new, place, old = _places(bake_folder, record, name)
        if not os.path.lexists(new) and os.path.lexists(place):
            place.rename(new)
        if os.path.lexists(old) and not os.path.lexists(place):
            old.rename(place)
    sync_folder(bake_folder)


def _conclude(bake_folder: Path, record: Switch) -> None:
    """Move the user's files into the new folders, remove the record, and let a thread remove the old folders."""
    private = bake_folder / PRIVATE_FOLDER
    for name in record.folders:
        _, place, old = _places(bake_folder, record, name)
        if old.is_dir():
            with suppress(OSError):  # a file that cannot be moved stays in the old folder, and the next bake tries again
                _move_user_files(old, place)
    with suppress(OSError):  # the new bake is in its place: who finds the record again has nothing left to do
        (private / SWITCH_NAME).unlink(missing_ok=True)
        sync_folder(private)
        if record.blend:
            _folder_note(Path(record.blend), record.run).unlink(missing_ok=True)
    thread = threading.Thread(
        target=remove_growing, args=(growing_folder(private, record.run),), name="palpate-remover", daemon=False
    )
    _removals.append(thread)
    thread.start()  # the process does not end before it is done


def _move_user_files(old: Path, new: Path) -> None:
    """Move the files that no bake has written, except those whose names exist in the new folder."""
    if old.is_symlink():
        return  # the user's folder stays where the link leads
    for path in old.iterdir():
        if not _is_bake_file(path) and not os.path.lexists(new / path.name):
            path.rename(new / path.name)


def _remove_replaced(old: Path, place: Path) -> None:
    """Remove the files of a replaced bake; what the user has put beside them moves into the sensor's folder."""
    if old.is_symlink():
        old.unlink()
        return
    if place.is_dir():
        _move_user_files(old, place)
    for path in old.iterdir():
        if _is_bake_file(path):
            path.unlink()
    old.rmdir()


def _is_bake_file(path: Path) -> bool:
    return BAKE_FILE_NAMES.fullmatch(path.name) is not None and (path.is_symlink() or not path.is_dir())
