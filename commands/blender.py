# SPDX-License-Identifier: GPL-3.0-or-later
"""Starts Blender for the commands, and opens and saves .blend files with error messages that say what to do."""

from __future__ import annotations

import importlib
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..core.errors import FileError, PalpateError
from ..core.io.regular_file import open_regular
from . import console

_COMPRESSED = (b"\x28\xb5\x2f\xfd", b"\x1f\x8b")  # Zstandard, and gzip in files from before Blender 3.0
_SEEKABLE_END = b"\xb1\xea\x92\x8f"
"""Last bytes of Zstandard's seekable format, in which Blender compresses."""


def start_blender():
    """Start Blender if it does not run yet, register the add-on, and return bpy.

    Raises
    ------
    PalpateError
        This Python has no Blender.
    """
    try:
        import bpy
    except ImportError as error:
        raise PalpateError(
            f"This Python has no Blender ({error}): run 'pip install bpy', or 'blender --command palpate …' instead."
        ) from error
    if not bpy.app.binary_path:  # bpy was imported as a module; the Blender program prints nothing at its end
        console.silence_at_exit()
    if not hasattr(bpy.types.Object, "palpate"):
        # The root package: "palpate" from pip, "bl_ext.<repository>.palpate" as an extension.
        importlib.import_module(__package__.rpartition(".")[0]).register()
    console.Interrupt.check()
    return bpy


def open_scene(path: str | os.PathLike):
    """Start Blender, open a .blend and return its scene; raises what :func:`start_blender` and :func:`open_blend` raise."""
    bpy = start_blender()
    open_blend(path)
    return bpy.context.scene


def open_blend(path: str | os.PathLike) -> None:
    """Open a .blend.

    Raises
    ------
    FileError
        The file is missing, is not a .blend, is damaged, or comes from a newer Blender.
    """
    import bpy

    path = Path(path)
    if path.is_dir():
        raise FileError(f"'{path}' is a folder: give the name of a .blend file in it.")
    try:
        with open_regular(path) as file:
            magic = file.read(7)
    except FileNotFoundError as error:
        raise FileError(f"There is no file '{path}': check its name and folder.") from error
    except OSError as error:
        raise FileError(f"'{path}' cannot be read ({error.strerror}): check its permissions.") from error
    if magic != b"BLENDER" and not magic.startswith(_COMPRESSED):
        raise FileError(f"'{path}' is not a .blend file: give a file that was saved by Blender.")
    try:
        # No scripts: a file from another person must not run its code in a batch job.
        bpy.ops.wm.open_mainfile(filepath=str(path.absolute()), load_ui=False, use_scripts=False)
    except RuntimeError as error:
        reason = str(error).strip().splitlines()[-1].rpartition(": ")[2].strip().rstrip(".")
        raise FileError(
            f"'{path}' cannot be opened by Blender {bpy.app.version_string} ({reason}): it is damaged, cut short, "
            "or not a .blend; save it again or take a backup (.blend1)."
        ) from error
    if bpy.context.object is not None and bpy.context.object.mode != "OBJECT":  # files store the mode in which they were saved
        bpy.ops.object.mode_set(mode="OBJECT")


def save_blend(path: str | os.PathLike, backup: bool = True) -> None:
    """Save the open scene, compressed. With `backup`, an existing file becomes .blend1, as in Blender itself.

    Raises
    ------
    FileError
        The file cannot be written. An existing file is unchanged.
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
        with _restored_on_error(path):
            bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True, relative_remap=True)
            if not _is_whole(path):
                raise OSError("it was cut short")
    except (RuntimeError, OSError) as error:
        reason = " ".join(str(error).removeprefix("Error:").split()).rstrip(".")
        raise FileError(f"'{path}' could not be saved ({reason}): check the folder and the space left on the disk.") from error
    finally:
        files.save_version = versions


def _is_whole(path: Path) -> bool:
    """Return True if a compressed .blend ends with its table of frames: on a full disk Blender truncates it silently."""
    with path.open("rb") as file:
        file.seek(-len(_SEEKABLE_END), os.SEEK_END)
        return file.read() == _SEEKABLE_END


@contextmanager
def _restored_on_error(path: Path) -> Iterator[None]:
    """Restore a file, or remove a new one, if the body raises. The copy is a hard link where the file system has them."""
    copy = path.with_name(f".{path.name}.{secrets.token_hex(4)}.partial") if path.exists() else None
    if copy is not None:
        try:
            os.link(path, copy)
        except OSError:  # the file system has no hard links
            shutil.copy2(path, copy)
    try:
        yield
    except BaseException:
        with suppress(OSError):
            os.replace(copy, path) if copy is not None else path.unlink()
        raise
    if copy is not None:
        copy.unlink()
