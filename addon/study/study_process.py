# SPDX-License-Identifier: GPL-3.0-or-later
"""Computes the study of a scene beside Blender's window: ``palpate sweep`` in a process of its own, whose files are counted."""

from __future__ import annotations

import importlib.util
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

import bpy

from ...core.errors import FileError, PalpateError, SceneError
from ...core.io.input_files import read_toml
from ...core.jobs import Job, Progress
from ...core.study.study_file import FROZEN, STUDY_NAME, counted_runs
from ..properties.scene_properties import command_in_preferences

LOOK = 0.5
"""Seconds between two looks at the folder of a study."""
STOP_LIMIT = 20.0
"""Seconds that a study has to end when it is asked to, before it is killed; it goes on from its files either way."""
REPORT_NAME = "report.html"


def sweep_command() -> list[str]:
    """Return the command that computes studies.

    Raises
    ------
    PalpateError
        There is none.
    """
    chosen = bpy.path.abspath(command_in_preferences())
    if chosen:
        if not (os.path.isfile(chosen) and os.access(chosen, os.X_OK)):
            raise FileError(f"'{chosen}' is not a command: choose the file palpate under Preferences › Add-ons › Palpate.")
        return [chosen, "sweep"]
    root = __package__.removesuffix(".addon.study")
    has_sweep = importlib.util.find_spec(f"{root}.sweep") and importlib.util.find_spec("distributed")
    if not bpy.app.binary_path and has_sweep:  # bpy as a module: this Python is the one that pip installs into
        return [sys.executable, "-P", "-m", f"{root}.commands", "sweep"]
    found = shutil.which("palpate")
    if found is None:
        raise PalpateError(
            "No Palpate that computes studies is found: run pip install '.[sweep]' in a checkout of Palpate, in a Python of "
            "its own, and choose its command palpate under Edit › Preferences › Add-ons › Palpate."
        )
    return [found, "sweep"]


def run_study(file: Path, workers: int = 0) -> Job[str]:
    """Compute a study, or go on with it, and return what the command says at its end.

    Closing the job asks the command to stop; what is done stays, and the same study goes on from there.

    Parameters
    ----------
    file : Path
        Of the study.
    workers : int
        Processes that compute runs; 0: one for each core.

    Raises
    ------
    PalpateError
        The scene was changed since it was saved, there is no command, or the study ends with an error.
    """
    if bpy.data.is_dirty and not bpy.app.background:  # without a window, Blender does not note that it has saved
        raise SceneError("The scene was changed since it was saved, and runs read its file: save the .blend first.")
    folder = file.with_suffix("")
    command = [*sweep_command(), str(file), "--out", str(folder)]
    command += ["--workers", str(workers)] if workers else []
    with tempfile.TemporaryFile() as said, tempfile.TemporaryFile() as errors:
        process, looked = _started(command, said, errors), -LOOK
        try:
            while process.poll() is None:
                if time.monotonic() - looked >= LOOK:
                    progress, looked = _counted(folder), time.monotonic()
                yield progress
                time.sleep(0.01)  # a slice of a job lasts some of these
        finally:
            _stop(process)
        return _outcome(process.returncode, _text(said), _text(errors))


def _started(command: list[str], said, errors) -> subprocess.Popen:
    """Start the command in a group of its own, so that a signal reaches it and not Blender."""
    options = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP} if os.name == "nt" else {"start_new_session": True}
    # Blender's own Python sets what would mislead another one.
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONHOME", "BLENDER_USER_RESOURCES")}
    try:
        return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=said, stderr=errors, env=environment, **options)
    except OSError as error:
        raise FileError(f"'{command[0]}' could not be started ({(error.strerror or str(error)).lower()}): check it.") from error


def _stop(process: subprocess.Popen) -> None:
    """Ask the command to stop, and kill it if it does not."""
    if process.poll() is None:
        process.send_signal(signal.CTRL_BREAK_EVENT if os.name == "nt" else signal.SIGINT)
        try:
            process.wait(STOP_LIMIT)
        except subprocess.TimeoutExpired:
            process.kill()
    process.wait()


def _outcome(status: int, said: str, errors: str) -> str:
    if status:
        lines = [line for line in errors.replace("\r", "\n").splitlines() if line.strip()]
        words = lines[-1].strip() if lines else f"the command ended with status {status}"
        raise PalpateError(words.removeprefix("palpate sweep: "))
    found = [line for line in said.splitlines() if " runs: " in line]
    return found[-1] if found else "The study is done"


def _text(file) -> str:
    file.seek(0)
    return file.read().decode("utf-8", "replace")


def _counted(folder: Path) -> Progress:
    total = 0
    with suppress(FileError):  # before the study has begun
        total = read_toml(folder / STUDY_NAME, "study").get(FROZEN, {}).get("runs", 0)
    if not isinstance(total, int) or total < 1:
        return Progress("Reading the scene", 0, 1)
    done, failed = counted_runs(folder)
    text = f"Study: {min(total, done)} of {total} runs" + (f", {failed} failed" if failed else "")
    return Progress(text, min(total, done + failed), total)


def report_of(file: Path) -> Path:
    """Return the report of a study; raise :class:`FileError` where there is none."""
    report = file.with_suffix("") / REPORT_NAME
    if not report.is_file():
        raise FileError(f"There is no report '{report}' yet: run the study, its end writes the report.")
    return report
