# SPDX-License-Identifier: GPL-3.0-or-later
"""What a study runs of others: Blender, which reads a .blend, and the Python file that ``job = …`` names.

A process that computes runs never loads Blender: what a scene leaves in its memory, or what ends it, concerns one run.

A job, the program of a study, computes its runs where no solver and no scene do. It has a function ``run(values, folder)``,
which may write files of its own into the folder and returns metrics, and perhaps a function ``fingerprint()``, which returns a
text that changes with what its results depend on beside the file. The study's folder keeps a copy as ``scenes/<name>.py``.
Python is run only where the command says ``--allow-scripts``, as that of a .blend.
"""

from __future__ import annotations

import hashlib
import importlib.util
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..core.errors import FileError, PalpateError, SceneError
from ..core.io.file_writing import file_sha256, os_error_reason
from ..core.study.study_file import SCENES, Study

SCRIPTS = REFUSE, IGNORE, ALLOW = ("refuse", "ignore", "allow")
"""Treatment of the Python in a .blend; the command line's --ignore-scripts and --allow-scripts."""
_COMMANDS = f"{__package__.rpartition('.')[0]}.commands"


def read_blend(blend: Path, target: Path, scripts: str, more: Sequence[str] = (), limit: float | None = None) -> None:
    """Let a Blender write the scenario of a .blend.

    Parameters
    ----------
    blend, target : Path
        The target ends with ``.npz``.
    scripts : str
        One of :data:`SCRIPTS`.
    more : sequence of str
        Further words for ``palpate bake``.
    limit : float, optional
        Seconds that this may take.

    Raises
    ------
    SceneError
        The scene makes no run, the limit is reached, or this Python has no Blender.
    """
    command = [sys.executable, "-P", "-m", _COMMANDS, "bake", str(blend), "--scenario", str(target), *more]
    command += [f"--{scripts}-scripts"] if scripts != REFUSE else []
    words: dict[str, Any] = {"stdin": subprocess.DEVNULL, "capture_output": True, "text": True, "errors": "replace"}
    try:
        finished = subprocess.run(command, **words, check=False, timeout=limit)
    except subprocess.TimeoutExpired as error:
        raise SceneError(f"Blender read '{blend.name}' for longer than the limit of {limit:g} s: raise run_limit.") from error
    if finished.returncode:
        said = [line for line in finished.stderr.strip().splitlines() if line.strip()]
        if finished.returncode < 0 or not said:
            said = [f"Blender ended with status {finished.returncode} while it read '{blend.name}': open the file in Blender."]
        raise SceneError(said[-1].removeprefix("palpate bake: "))


SUFFIX = ".py"
RunFunction = Callable[[dict[str, Any], Path], Mapping[str, Any]]
"""Takes the values of a run by name, and a folder; returns metrics by name."""


def require_allowed(study: Study, scripts: str) -> None:
    """Raise SceneError where a study has a program and the command does not allow its Python."""
    if study.is_job and scripts != ALLOW:
        raise SceneError(f"The study runs the Python of '{study.scenes[0]}': add --allow-scripts if you trust the file.")


def load_program(file: Path) -> tuple[RunFunction, str]:
    """Run the Python of a file, and return its ``run`` and a digest of the file and of what else its results depend on.

    Raises
    ------
    PalpateError
        It cannot be read or run, or has no ``run``.
    """
    sha256 = file_sha256(file)
    spec = importlib.util.spec_from_file_location(f"palpate_program_{sha256[:16]}", file)
    assert spec is not None and spec.loader is not None  # of a file that ends with .py
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
        found, more = getattr(module, "run", None), getattr(module, "fingerprint", str)()
    except Exception as error:
        raise PalpateError(f"The job '{file.name}' cannot be run ({type(error).__name__}: {error}): mend it.") from error
    if not callable(found):
        raise PalpateError(f"The job '{file.name}' has no function run(values, folder): write one.")
    return found, hashlib.sha256(f"{sha256} {more}".encode()).hexdigest()


def freeze_program(source: Path, target: Path) -> str:
    """Copy the file of a program, and return the program's digest; raise :class:`PalpateError` where that is not possible."""
    try:
        shutil.copyfile(source, target)
    except OSError as error:
        raise FileError(f"The job '{source}' could not be copied ({os_error_reason(error)}): check it.") from error
    return load_program(target)[1]


def frozen_program(study: Study, folder: Path, name: str) -> RunFunction:
    """Return the ``run`` of the program in a study's folder.

    Raises
    ------
    PalpateError
        It is no longer the one that the study began with, or cannot be run.
    """
    run, digest = load_program(folder / SCENES / f"{name}{SUFFIX}")
    if digest not in [one.digest for one in (study.frozen.scenes if study.frozen else ()) if one.name == name]:
        raise FileError(
            f"What the job '{study.scenes[0]}' computes with is not what the study in '{folder}' began with: go on with that, "
            "or give another folder with --out."
        )
    return run
