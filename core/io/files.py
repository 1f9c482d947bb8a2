# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders and files of a bake: written whole or not at all, and described by a manifest.

A bake folder holds one folder per sensor, and in it one EXR per frame, ``recording.npz`` and
``manifest.json``. A kill at any moment leaves of each file the old or the new one, never a half; what is left
over has ``.partial`` in its name and goes with :func:`remove_leftovers`.
"""

from __future__ import annotations

import errno
import json
import math
import os
import re
import secrets
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from ..errors import FileError

MANIFEST_FORMAT = "palpate-bake/1"
MANIFEST_NAME = "manifest.json"
RECORDING_NAME = "recording.npz"

_RESERVED = {"con", "prn", "aux", "nul", *(f"{port}{i}" for port in ("com", "lpt") for i in range(1, 10))}


# --- writing whole files


@contextmanager
def atomic_write(path: str | os.PathLike) -> Iterator[Path]:
    """Write a file so that `path` has either its old content or all of the new.

    Parameters
    ----------
    path : path
        The file to make or to replace. Where it is a symbolic link, the file it points to is replaced.

    Yields
    ------
    Path
        A new, empty file beside `path`, with the same suffix, to be written and closed by the body. It takes
        the place of `path` when the body ends, and is removed when the body raises.

    Raises
    ------
    FileError
        The folder is missing, cannot be written to, is full, or `path` is a folder, a device or read-only.
    """
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise FileError(f"'{path}' is a folder: give the name of a file in it.")
    if target.exists() and not target.is_file():  # a rename would put a plain file in the place of /dev/null
        raise FileError(f"'{path}' is a device, not a file: give the name of a file.")
    if target.exists() and not os.access(target, os.W_OK):
        raise FileError(f"'{path}' is read-only: change its permissions or choose another name.")
    _require_folder(target.parent)
    temporary = _new_file_in(target.parent, target.stem, target.suffix)
    try:
        yield temporary
        with open(temporary, "rb+") as file:
            os.fsync(file.fileno())
        os.replace(temporary, target)
    except BaseException as error:
        with suppress(OSError):
            temporary.unlink()
        if isinstance(error, OSError):
            raise FileError(f"'{path}' could not be written ({_reason(error)}): {_remedy(error)}.") from error
        raise
    _sync_folder(target.parent)


@contextmanager
def written(path: str | os.PathLike, at_once: bool = True) -> Iterator[Path]:
    """Write a file whole or not at all (:func:`atomic_write`), or where it is.

    Parameters
    ----------
    path : path
    at_once : bool
        False writes `path` itself, which is a half one when that is interrupted, and does not wait until it lies on the disk:
        many times faster, for a folder that nobody reads before it is complete.

    Yields
    ------
    Path
        The file to write and close.

    Raises
    ------
    FileError
        As :func:`atomic_write`.
    """
    if at_once:
        with atomic_write(path) as temporary:
            yield temporary
        return
    try:
        yield Path(path)
    except OSError as error:
        raise FileError(f"'{path}' could not be written ({_reason(error)}): {_remedy(error)}.") from error


def writable_folder(path: str | os.PathLike, create: bool = False) -> Path:
    """Make sure that files can be written into a folder, by writing one.

    Parameters
    ----------
    path : path
    create : bool
        Make the folder when it is missing and the folder above it is there.

    Returns
    -------
    Path
        Absolute.

    Raises
    ------
    FileError
        There is no such folder, something else has its name, or it cannot be written to.
    """
    folder = Path(os.path.abspath(path))
    if create and not folder.exists():
        _require_folder(folder.parent)
        try:
            folder.mkdir(exist_ok=True)
        except OSError as error:
            raise FileError(f"The folder '{folder}' could not be made ({_reason(error)}): {_remedy(error)}.") from error
    _require_folder(folder)
    with suppress(FileNotFoundError):
        _new_file_in(folder, "check", "").unlink()
    return folder


def remove_leftovers(folder: str | os.PathLike) -> list[Path]:
    """Remove what an interrupted :func:`atomic_write` left in `folder`; not for use beside a running bake.

    Returns
    -------
    list of Path
        What was removed, in order of name.
    """
    removed = []
    for path in sorted(Path(folder).glob(".*.partial*")):
        if re.fullmatch(r"\..*\.[0-9a-f]{8}\.partial(\.[^.]*)?", path.name) and path.is_file():
            with suppress(OSError):
                path.unlink()
                removed.append(path)
    return removed


def _require_folder(folder: Path) -> None:
    if folder.is_dir():
        return
    if folder.exists():
        raise FileError(f"'{folder}' is a file where a folder is needed: choose another folder.")
    for above in folder.parents:
        if above.exists() and not above.is_dir():
            raise FileError(f"'{folder}' cannot be a folder because '{above}' is a file: choose another folder.")
    raise FileError(f"The folder '{folder}' does not exist: create it or choose another.")


def _new_file_in(folder: Path, stem: str, suffix: str) -> Path:
    """Make an empty file with a name of its own; the user's umask decides who may read it."""
    path = folder / f".{stem}.{secrets.token_hex(4)}.partial{suffix}"
    try:
        os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    except OSError as error:
        # only trying tells: root may write where permissions forbid it, and not where the file system does
        if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS) or not os.access(folder, os.W_OK):
            raise FileError(f"The folder '{folder}' is read-only: change its permissions or choose another.") from error
        raise FileError(f"No file can be made in the folder '{folder}' ({_reason(error)}): {_remedy(error)}.") from error
    return path


def _sync_folder(folder: Path) -> None:
    """Make the new name last through a power cut, where the system lets a folder be opened for that."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _reason(error: OSError) -> str:
    return (error.strerror or str(error) or type(error).__name__).lower()


def _remedy(error: OSError) -> str:
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return "free some space or choose another folder"
    if error.errno == errno.ENAMETOOLONG:
        return "choose a shorter name"
    return "close programs that use it, check its permissions, or choose another folder"


# --- names


def folder_names(names: Iterable[str]) -> dict[str, str]:
    """Give each sensor a folder name that every operating system accepts and that no other sensor has.

    Names made of letters, digits, blanks, dots, hyphens and underscores stay; in others the rest becomes ``_``
    and a checksum of the name is added. Names that differ in case only are told apart in the same way.
    """
    chosen: dict[str, str] = {}
    taken: set[str] = set()
    for name in dict.fromkeys(names):
        clean = "".join(c if c.isalnum() or c in " ._-" else "_" for c in name).strip(" .")[:60]
        if not clean or clean != name or clean.split(".")[0].lower() in _RESERVED or clean.casefold() in taken:
            base = f"{clean or 'sensor'}-{zlib.crc32(name.encode('utf-8', 'surrogatepass')):08x}"
            clean = base if clean.split(".")[0].lower() not in _RESERVED else f"_{base}"
        while clean.casefold() in taken:
            clean += "_"
        taken.add(clean.casefold())
        chosen[name] = clean
    return chosen


def frame_file(frame: int) -> str:
    """Return the name of a frame's tactile image; Blender plays files named like this as a sequence."""
    return f"tactile_{frame:04d}.exr"


# --- the manifest


@dataclass(frozen=True)
class Manifest:
    """What one sensor's bake was made from.

    Attributes
    ----------
    sensor : str
    palpate : str
        Version of Palpate that wrote it.
    frame_start, frame_end : int
        Frames of the whole bake, both included.
    fps : float, frames per second
    dt : float, seconds
        Substep.
    step_reason : str
        Why that one; empty when the manifest is older.
    digest : str
        :meth:`.scenario.Scenario.digest` of what is solved; another digest makes the bake stale.
    unit : str
        Of the channel ``reading``.
    shape : (int, int)
        Height and width of the images, pixels.
    parameters : dict
        Of the sensor, JSON values.
    warnings : tuple of str
    complete : bool
        True once all images and the recording are written.
    scene_file : str
        Name, without its folder, of the .blend that was baked; empty when it had none, or when the manifest is older.
    body : str
        Name of the body that carries the sensor, among those of the recording; empty when the manifest is older.
    """

    sensor: str
    palpate: str
    frame_start: int
    frame_end: int
    fps: float
    dt: float
    digest: str
    unit: str
    shape: tuple[int, int]
    parameters: dict[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    complete: bool = False
    scene_file: str = ""
    body: str = ""
    step_reason: str = ""


def write_manifest(folder: str | os.PathLike, manifest: Manifest, at_once: bool = True) -> Path:
    """Write ``manifest.json`` into `folder`, as :func:`written` does, and return its path.

    Raises
    ------
    FileError
        It cannot be written.
    ValueError
        A number is not finite or a parameter is no JSON value (a fault of the program, not of the user).
    """
    content = {"format": MANIFEST_FORMAT, **asdict(manifest)}
    try:
        text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    except TypeError as error:
        raise ValueError(f"the manifest of '{manifest.sensor}' holds something that is not JSON: {error}") from error
    path = Path(folder) / MANIFEST_NAME
    with written(path, at_once) as temporary:
        temporary.write_bytes((text + "\n").encode("utf-8", "surrogatepass"))
    return path


def read_manifest(folder: str | os.PathLike) -> Manifest:
    """Read ``manifest.json`` of a sensor's bake folder.

    Raises
    ------
    FileError
        There is none, or it is not one that this version reads.
    """
    path = Path(folder) / MANIFEST_NAME
    try:
        content = json.loads(path.read_bytes().decode("utf-8", "surrogatepass"))
    except FileNotFoundError:
        raise FileError(f"'{path}' does not exist: bake first, or choose a sensor's folder inside the bake folder.") from None
    except OSError as error:
        raise FileError(f"'{path}' could not be read ({_reason(error)}): check its permissions.") from error
    except (ValueError, RecursionError) as error:
        raise FileError(f"'{path}' is damaged (not JSON): delete the folder and bake again.") from error
    if not isinstance(content, dict) or content.get("format") != MANIFEST_FORMAT:
        found = content.get("format") if isinstance(content, dict) else None
        raise FileError(f"'{path}' is not a '{MANIFEST_FORMAT}' file but {found!r}: bake again with this version.")
    try:
        return _manifest(content)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise FileError(f"'{path}' is damaged ({type(error).__name__}: {error}): delete the folder and bake again.") from error


def _manifest(content: dict[str, Any]) -> Manifest:
    height, width = content["shape"]
    manifest = Manifest(
        sensor=_typed(content, "sensor", str),
        palpate=_typed(content, "palpate", str),
        frame_start=_typed(content, "frame_start", int),
        frame_end=_typed(content, "frame_end", int),
        fps=float(_typed(content, "fps", (int, float))),
        dt=float(_typed(content, "dt", (int, float))),
        digest=_typed(content, "digest", str),
        unit=_typed(content, "unit", str),
        shape=(int(height), int(width)),
        parameters=_typed(content, "parameters", dict),
        warnings=tuple(str(warning) for warning in _typed(content, "warnings", list)),
        complete=_typed(content, "complete", bool),
        scene_file=_typed({"scene_file": "", **content}, "scene_file", str),
        body=_typed({"body": "", **content}, "body", str),
        step_reason=_typed({"step_reason": "", **content}, "step_reason", str),
    )
    if not (math.isfinite(manifest.fps) and math.isfinite(manifest.dt)):
        raise ValueError("fps and dt must be finite")
    return manifest


def _typed(content: dict[str, Any], key: str, kind: Any) -> Any:
    value = content[key]
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise TypeError(f"{key} is {value!r}")
    return value
