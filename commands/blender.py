# SPDX-License-Identifier: GPL-3.0-or-later
"""Starts Blender for the commands, and opens and saves .blend files with error messages that say what to do."""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..core.errors import FileError, PalpateError, read_errors_said
from ..core.io.file_writing import writable_file
from ..core.io.input_files import open_regular, require_regular
from . import console

if TYPE_CHECKING:
    from ..addon.bake.bake_files import BlendToSave

_COMPRESSED = (b"\x28\xb5\x2f\xfd", b"\x1f\x8b")  # Zstandard, and gzip in files from before Blender 3.0
_SEEKABLE_END = b"\xb1\xea\x92\x8f"
"""Last bytes of Zstandard's seekable format, in which Blender compresses."""
REFUSE, IGNORE, ALLOW = "refuse", "ignore", "allow"
"""Treatment of the Python in a .blend: not run, and the file refused if a driver needs it; not run; run."""
MOST_NAMED = 5
"""Most drivers that a message names."""


def start_blender() -> Any:
    """Start Blender if it does not run yet, register what scenes need of the add-on, and return bpy.

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
        importlib.import_module(__package__.rpartition(".")[0]).register(window=False)
    console.Interrupt.check()
    return bpy


def add_script_arguments(parser: argparse.ArgumentParser) -> None:
    """Add --allow-scripts and --ignore-scripts, which set `scripts`."""
    choice = parser.add_mutually_exclusive_group()
    choice.add_argument(
        "--allow-scripts",
        dest="scripts",
        action="store_const",
        const=ALLOW,
        help="run the Python in the .blend (drivers and registered texts): only for files that you trust",
    )
    choice.add_argument(
        "--ignore-scripts",
        dest="scripts",
        action="store_const",
        const=IGNORE,
        help="run no Python in the .blend, even where drivers need it, which then count as zero",
    )
    parser.set_defaults(scripts=REFUSE)


def open_scene(path: str | os.PathLike, scripts: str = REFUSE) -> Any:
    """Start Blender, open a .blend and return its scene; raises what :func:`start_blender` and :func:`open_blend` raise."""
    bpy = start_blender()
    open_blend(path, scripts)
    console.Interrupt.check()
    return bpy.context.scene


def open_blend(path: str | os.PathLike, scripts: str = REFUSE) -> None:
    """Open a .blend.

    Parameters
    ----------
    path : path
    scripts : REFUSE, IGNORE or ALLOW
        What is done about the Python in the file.

    Raises
    ------
    FileError
        The file is missing, is not a .blend, is damaged, or comes from a newer Blender; or drivers in it need Python and
        `scripts` is REFUSE.
    """
    import bpy

    path = Path(path)
    require_utf8(path)
    if os.path.isdir(path):
        raise FileError(f"'{path}' is a folder: give the name of a .blend file in it.")
    with read_errors_said(path), open_regular(path) as file:
        magic = file.read(7)
    if magic != b"BLENDER" and not magic.startswith(_COMPRESSED):
        raise FileError(f"'{path}' is not a .blend file: give a file that was saved by Blender.")
    try:
        # A file from another person must not run its code in a batch job.
        bpy.ops.wm.open_mainfile(filepath=str(path.absolute()), load_ui=False, use_scripts=scripts == ALLOW)
    except RuntimeError as error:
        reason = str(error).strip().splitlines()[-1].rpartition(": ")[2].strip().rstrip(".")
        raise FileError(
            f"'{path}' cannot be opened by Blender {bpy.app.version_string} ({reason}): it is damaged, cut short, "
            "or not a .blend; save it again or take a backup (.blend1)."
        ) from error
    if bpy.context.object is not None and bpy.context.object.mode != "OBJECT":  # files store the mode in which they were saved
        bpy.ops.object.mode_set(mode="OBJECT")
    if scripts == REFUSE:
        _refuse_blocked_drivers(path)


def _refuse_blocked_drivers(path: Path) -> None:
    """Raise FileError if Blender did not evaluate a driver of the open file because it needs Python; name texts not run."""
    import bpy

    bpy.context.view_layer.update()  # Blender finds out when it evaluates a driver
    blocked = [
        f"{curve.data_path} of '{owner.name}' ({' '.join(curve.driver.expression.split())[:60]})"
        for owner in _animated()
        for curve in owner.animation_data.drivers
        if curve.driver.type == "SCRIPTED" and not curve.driver.is_simple_expression and not curve.driver.is_valid
    ]
    if blocked:
        more = f" and {len(blocked) - MOST_NAMED} others" if len(blocked) > MOST_NAMED else ""
        raise FileError(
            f"Drivers of '{path}' need Python, which was not run, and would count as zero: "
            f"{', '.join(blocked[:MOST_NAMED])}{more}: add --allow-scripts if you trust the file, or --ignore-scripts."
        )
    texts = ", ".join(f"'{text.name}'" for text in bpy.data.texts if text.use_module)
    if texts:
        print(f"note: scripts in '{path}' were not run: {texts}; --allow-scripts runs them", file=sys.stderr)


def _animated() -> Iterator:
    """Yield everything in the open file that has drivers."""
    import bpy

    for kind in bpy.data.bl_rna.properties:
        for block in getattr(bpy.data, kind.identifier) if kind.type == "COLLECTION" else ():
            for owner in (block, getattr(block, "node_tree", None)):
                if getattr(owner, "animation_data", None) is not None:
                    yield owner


def require_utf8(path: str | os.PathLike) -> None:
    """Raise FileError if a path is not UTF-8: Blender would end in a crash."""
    try:
        os.path.abspath(path).encode("utf-8")
    except UnicodeEncodeError as error:
        raise FileError(f"{str(path)!r} has a name that is not UTF-8, which Blender cannot take: rename it.") from error


def check_writable(path: Path) -> None:
    """Raise FileError if a .blend of this name could not be saved; folders above it that are missing are made."""
    require_utf8(path)
    require_regular(path)
    if os.path.isdir(path):
        raise FileError(f"'{path}' is a folder: give the name of a .blend file in it.")
    writable_file(path)


def save_blend(path: str | os.PathLike, backup: bool = True) -> None:
    """Save the open scene, compressed. With `backup`, an existing file becomes .blend1, as in Blender itself.

    At every moment there is a file of this name, the old one or the new one. A symbolic link stays a link. Blender goes on with
    the file that is open.

    Raises
    ------
    FileError
        The file cannot be written. An existing file is unchanged.
    """
    blend = blend_to_save(path)
    if not backup:
        blend = replace(blend, backups=0)
    with _save_errors(path):
        try:
            blend.prepare()
            blend.exchange()
        finally:
            blend.waiting.unlink(missing_ok=True)


def blend_to_save(path: str | os.PathLike) -> BlendToSave:
    """Return how the open scene is saved to `path` together with a bake.

    Raises
    ------
    FileError
        The file cannot be written.
    """
    import bpy

    from ..addon.bake.bake_files import BlendToSave

    check_writable(Path(path))
    target = Path(os.path.realpath(path))
    check_writable(target)
    versions = bpy.context.preferences.filepaths.save_version
    return BlendToSave(target, lambda waiting: _write_copy(waiting, target), versions)


def _write_copy(waiting: Path, target: Path) -> None:
    """Write the open scene to `waiting`, which lies beside `target` and will replace it."""
    import bpy

    with _save_errors(target):
        bpy.ops.wm.save_as_mainfile(filepath=str(waiting), compress=True, copy=True, relative_remap=not _is_open_file(target))
        if not _is_whole(waiting):
            raise OSError("it was cut short")


def _is_open_file(path: Path) -> bool:
    """Return True if this is the .blend that is open."""
    import bpy

    opened = bpy.data.filepath
    return bool(opened) and path.exists() and os.path.exists(opened) and path.samefile(opened)


@contextmanager
def _save_errors(path: str | os.PathLike) -> Iterator[None]:
    """Raise FileError for an error of Blender or of the operating system while a .blend is saved."""
    try:
        yield
    except (RuntimeError, OSError) as error:
        reason = " ".join(str(error).removeprefix("Error:").split()).rstrip(".")
        raise FileError(f"'{path}' could not be saved ({reason}): check the folder and the space left on the disk.") from error


def _is_whole(path: Path) -> bool:
    """Return True if a compressed .blend ends with its table of frames: on a full disk Blender truncates it silently."""
    with path.open("rb") as file:
        file.seek(-len(_SEEKABLE_END), os.SEEK_END)
        return file.read() == _SEEKABLE_END
