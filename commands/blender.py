# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender as the commands need it: with the add-on's classes, and with a file opened or a good reason why not."""

from __future__ import annotations

import importlib
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..core.errors import FileError, PalpateError
from . import console

_COMPRESSED = (b"\x28\xb5\x2f\xfd", b"\x1f\x8b")  # Zstandard, and gzip in files from before Blender 3.0
_SEEKABLE_END = b"\xb1\xea\x92\x8f"
"""Last bytes of Zstandard's seekable format, in which Blender compresses."""


def start_blender():
    """Start Blender where there is none yet; return bpy with the add-on's classes.

    Raises
    ------
    PalpateError
        There is no Blender in this Python.
    """
    try:
        import bpy
    except ImportError as error:
        raise PalpateError(
            f"This Python has no Blender ({error}): run 'pip install bpy', or 'blender --command palpate …' instead."
        ) from error
    if not bpy.app.binary_path:  # bpy as a module; Blender itself ends in its own way
        console.silence_at_exit()
    if not hasattr(bpy.types.Object, "palpate"):
        # The package's root: "palpate" from pip, "bl_ext.<repository>.palpate" as an extension.
        importlib.import_module(__package__.rpartition(".")[0]).register()
    console.Interrupt.check()
    return bpy


def open_blend(path: str | os.PathLike) -> None:
    """Open a .blend.

    Raises
    ------
    FileError
        It is missing, is no .blend, is damaged, or comes from a newer Blender.
    """
    import bpy

    path = Path(path)
    if path.is_dir():
        raise FileError(f"'{path}' is a folder: give the name of a .blend file in it.")
    try:
        with path.open("rb") as file:
            start = file.read(7)
    except FileNotFoundError as error:
        raise FileError(f"There is no file '{path}': check its name and folder.") from error
    except OSError as error:
        raise FileError(f"'{path}' cannot be read ({error.strerror}): check its permissions.") from error
    if start != b"BLENDER" and not start.startswith(_COMPRESSED):
        raise FileError(f"'{path}' is not a .blend file: give a file that was saved by Blender.")
    try:
        # No scripts: a file from somebody else must not run its own code in a batch job.
        bpy.ops.wm.open_mainfile(filepath=str(path.absolute()), load_ui=False, use_scripts=False)
    except RuntimeError as error:
        reason = str(error).strip().splitlines()[-1].rpartition(": ")[2].strip().rstrip(".")
        raise FileError(
            f"'{path}' cannot be opened by Blender {bpy.app.version_string} ({reason}): it is damaged, cut short, "
            "or not a .blend; save it again or take a backup (.blend1)."
        ) from error
    if bpy.context.object is not None and bpy.context.object.mode != "OBJECT":  # files keep the mode that they were saved in
        bpy.ops.object.mode_set(mode="OBJECT")


def save_blend(path: str | os.PathLike, backup: bool = True) -> None:
    """Save the open scene, compressed; with `backup` a file that was there becomes .blend1, as in Blender itself.

    Raises
    ------
    FileError
        It cannot be written. A file that was there is still as it was.
    """
    import bpy

    from ..core.io.file_writing import writable_folder

    path = Path(path).absolute()
    writable_folder(path.parent)
    if path.exists() and not os.access(path, os.W_OK):
        raise FileError(f"'{path}' is read-only: change its permissions or choose another name.")
    files = bpy.context.preferences.filepaths
    versions = files.save_version
    try:
        files.save_version = versions if backup else 0
        with _kept(path):
            bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True, relative_remap=True)
            if not _is_whole(path):
                raise OSError("it was cut short")
    except (RuntimeError, OSError) as error:
        reason = " ".join(str(error).removeprefix("Error:").split()).rstrip(".")
        raise FileError(f"'{path}' could not be saved ({reason}): check the folder and the space left on the disk.") from error
    finally:
        files.save_version = versions


def _is_whole(path: Path) -> bool:
    """Tell whether a compressed .blend ends with its table of frames: on a full disk Blender cuts it off and says nothing."""
    with path.open("rb") as file:
        file.seek(-len(_SEEKABLE_END), os.SEEK_END)
        return file.read() == _SEEKABLE_END


@contextmanager
def _kept(path: Path) -> Iterator[None]:
    """Put a file back, or remove what has come in its place, when the body raises; a second name of it takes no space."""
    second = path.with_name(f".{path.name}.{secrets.token_hex(4)}.partial") if path.exists() else None
    if second is not None:
        try:
            os.link(path, second)
        except OSError:  # a file system without links
            shutil.copy2(path, second)
    try:
        yield
    except BaseException:
        with suppress(OSError):
            os.replace(second, path) if second is not None else path.unlink()
        raise
    if second is not None:
        second.unlink()
