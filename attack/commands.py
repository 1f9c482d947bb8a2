# SPDX-License-Identifier: GPL-3.0-or-later
"""Hostile arguments, folders and .blend files, over all commands: one sentence or a whole result, in time, and nothing lost.

Each case gives a command one odd argument, in a folder with a bake, exports, measurements and odd files, or a scene as a
stranger might send it. Where root allows it, commands also run on small disks that fill up.
"""

from __future__ import annotations

import os
import random
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from .area import CLEAR, HUNG, LOST, TRACEBACK, WRONG, Area, Case, Outcome
from .hostile_scenes import MARK_OF_SCRIPTS
from .jobs import BLEND, EXPORTS, JOBS, MEASURED, MINE, Job, Stage
from .trees import put_back, tree
from .worker import Crashed, Failed, Hung, Worker

LONGEST = 120.0
"""Seconds after which a command counts as hung; none of them has much to do."""
DISK_SHARE = 0.25
"""Part of the cases that run on a small disk."""
SCENES_SHARE = 0.15
"""Part of the cases that are hostile scenes."""
DISKS = (60, 900)
"""Smallest and largest number of free kilobytes on a small disk."""

NUMBERS = ("0", "-1", "1", "99999999999", "1e308", "nan", "inf", "-inf", "", " ", "1_0", "٣", "0x10", "--", "1e-320")
NAMES = (
    "", " ", ".", "..", "/", "~", "a/b", "../../x", "A" * 300, "a\nb", "\u202etxt", "=cmd|' /C calc'!A0", "-", "--", "-rf", "*",
    "Pad", "Pad.old", ".palpate", "palpate-bake/.palpate", "/dev/null", "/dev/zero", "/dev/full", "/proc/self/mem", "fifo",
    "folder", "link to nowhere", "link to itself", "socket", "empty", "noise", "scene.blend", "rig.toml", "palpate-bake",
    "palpate-bake/Pad", "palpate-bake/Pad/manifest.json", "locked", "\udcff\udcfe", "con", "ä" * 200,
)  # fmt: skip
"""Odd names: some of nothing, some of what :func:`furnish` has put there."""
TEMPLATES: tuple[tuple[str, ...], ...] = (
    ("bake", "NAME"),
    ("bake", BLEND, "--out", "NAME"),
    ("bake", BLEND, "--out", "new", "--sensor", "NAME"),
    ("bake", BLEND, "--out", "new", "--frames", "NUMBER", "NUMBER"),
    ("bake", BLEND, "--out", "new", "--frames", "2", "3", "--model", "NAME"),
    ("bake", BLEND, "--out", "new", "--frames", "2", "3", "--save-as", "NAME"),
    ("bake", BLEND, "--out", "new", "--time-limit", "NUMBER", "--frames", "2", "3"),
    ("bake", BLEND, "--out", "new", "--memory-limit", "NUMBER", "--frames", "2", "3"),
    ("export", "NAME"),
    ("export", "palpate-bake", "--out", "NAME"),
    ("export", "palpate-bake", "--sensor", "NAME", "--out", "new"),
    ("export", "palpate-bake", "--format", "NAME", "--out", "new"),
    ("export", "palpate-bake", "--format", "png", "--color-map", "NAME", "--out", "new"),
    ("export", "palpate-bake", "--format", "hdf5", "--out", "NAME"),
    ("render", "NAME", "--only", "curves", "--format", "png", "--out", "new"),
    ("render", BLEND, "--only", "curves", "--format", "png", "--out", "NAME"),
    ("render", BLEND, "--only", "numbers", "--format", "png", "--out", "new", "--frame", "NUMBER"),
    ("render", BLEND, "--only", "curves", "--format", "png", "--out", "new", "--sensor", "NAME"),
    ("gap", "NAME", "--out", "new"),
    ("gap", "rig.toml", "--out", "new", "--blend", "NAME"),
    ("gap", "rig.toml", "--out", "new", "--blend", BLEND, "--sensor", "NAME"),
    ("fit", "stiffness", "NAME", "--area", "0.001", "--texels", "10"),
    ("fit", "stiffness", "foam.csv", "--area", "NUMBER", "--texels", "10"),
    ("fit", "stiffness", "foam.csv", "--area", "0.001", "--texels", "NUMBER"),
    ("fit", "stiffness", "foam.csv", "--area", "0.001", "--texels", "10", "--plot", "NAME"),
    ("fit", "friction", "NAME", "--normal-force", "NUMBER"),
    ("openrave", "show", "NAME"),
    ("openrave", "import", "NAME", BLEND),
    ("openrave", "import", "given.xml", "NAME", "--from", "T"),
    ("openrave", "import", "given.xml", BLEND, "--from", "NAME"),
    ("openrave", "import", "given.xml", BLEND, "--from", "T", "--sensor", "NAME"),
    ("openrave", "import", "given.xml", BLEND, "--from", "T", "--save-as", "NAME"),
    ("openrave", "export", "NAME"),
    ("openrave", "export", BLEND, "--out", "NAME"),
    ("openrave", "export", BLEND, "--robot", "NAME", "--out", "robot.xml"),
    ("NAME",),
)
"""Commands with odd arguments."""
STATUSES = (0, 1, 2)
"""Exit statuses of a command that was not interrupted."""


class Commands(Area):
    """Hostile arguments and files."""

    short, long = 120, 900

    def __init__(self, seed: int, tries: int, folder: Path, disks: bool = True, scenes: int | None = None):
        super().__init__(seed, tries, folder)
        self._disks, self._scenes = disks and os.geteuid() == 0 and sys.platform == "linux", scenes
        self._worker = Worker(folder)
        self._stage = Stage(folder, self._worker)
        self._jobs = {job.name: job for job in JOBS}

    def close(self) -> None:
        self._unmount()
        self._worker.close()

    def cases(self) -> Iterator[Case]:
        dice = random.Random(self.seed)
        every = [(template, at) for template in TEMPLATES for at, word in enumerate(template) if word in ("NAME", "NUMBER")]
        words = [(template, at, odd) for template, at in every for odd in (NAMES if template[at] == "NAME" else NUMBERS)]
        dice.shuffle(words)
        scenes = self._worker.call("hostile_scenes:kinds")
        dice.shuffle(scenes)
        scenes = scenes[: round(self.tries * SCENES_SHARE) if self._scenes is None else self._scenes]
        disks = round(self.tries * DISK_SHARE) if self._disks else 0
        for template, at, odd in words[: max(1, self.tries - disks - len(scenes))]:
            filled = ["3" if word == "NUMBER" else word for word in template]
            filled[at] = odd
            name = f"{' '.join(template)} [{at}] = {odd!r}"
            yield Case(name, {"words": [*filled]})
        for kind in scenes:
            yield Case(f"scene: {kind}", {"scene": kind, "words": ["bake", "hostile.blend", "--out", "new"]})
        for i in range(disks):
            job = dice.choice([job for job in JOBS if job.name != "gap"])
            yield Case(f"disk {i}: {job.name}", {"job": job.name, "kilobytes": dice.randint(*DISKS)})

    def attempt(self, case: Case) -> Outcome:
        try:
            outcome = self._on_small_disk(case) if "job" in case.data else self._with_words(case)
        except Hung as error:
            outcome = Outcome(HUNG, str(error))
        except Crashed as error:
            outcome = Outcome(TRACEBACK, f"the process ended: {error}")
        except Failed as error:
            outcome = Outcome(WRONG, str(error))
        return outcome

    def _with_words(self, case: Case) -> Outcome:
        """Give a command an odd argument, or a hostile scene."""
        stage = self._stage
        job = Job("", EXPORTS, tuple(case.data["words"]), 1.0)
        self._start_furnished(job)
        if "scene" in case.data:
            self._worker.call("hostile_scenes:make", kind=case.data["scene"], path=str(stage.place / "hostile.blend"))
        before = tree(stage.place)
        answer = stage.run(job.words, timeout=LONGEST)
        case.data["printed"], case.data["status"] = answer["printed"][-2000:], answer["status"]
        return (
            judge_words(answer)
            or self._judge_bake(answer)
            or judge_files(before, tree(stage.place), job.words, answer)
            or Outcome(CLEAR)
        )

    def _judge_bake(self, answer: dict) -> Outcome | None:
        """Check that a bake that was made is whole, and that an interrupted one left nothing in its place."""
        new = self._stage.place / "new"
        if not any(new.glob("*/manifest.json")):
            return None
        if answer["status"] != 0:
            return Outcome(WRONG, "the command failed and left a bake")
        problem = self._worker.call("hostile_scenes:problem_of_bake", folder=str(new))
        return Outcome(WRONG, problem) if problem else None

    def _start_furnished(self, job: Job) -> None:
        """Put the folder in place with measurements and odd files in it."""
        kept = self.folder / "furnished"
        if not kept.exists():
            self._stage.start(Job("", MEASURED, (), 1.0))
            rig = {path.name: path.read_bytes() for path in self._stage.place.iterdir() if path.is_file()}
            self._stage.start(job)
            for name, content in rig.items():
                (self._stage.place / name).write_bytes(content)
            self._worker.call("scenes:make_measurements", folder=str(self._stage.place))
            put_back(self._stage.place, kept)
            self._worker.call("scenes:remember_diagnosis")
        put_back(kept, self._stage.place)
        furnish(self._stage.place)

    # --- small disks

    def _on_small_disk(self, case: Case) -> Outcome:
        """Run a job on a disk that is nearly full: the old result or the new one, one sentence, and no crash of a library."""
        job, stage = self._jobs[case.data["job"]], self._stage
        stage.start(job)
        put_back(stage.place, self.folder / "on disk")
        shutil.rmtree(stage.place)
        stage.place.mkdir()
        kept = sum(path.stat().st_size + 4096 for path in (self.folder / "on disk").rglob("*"))
        size = kept + 1024 * case.data["kilobytes"]
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(stage.place)], capture_output=True)
        if mounted.returncode:
            return Outcome(CLEAR, "this system mounts no disk")
        try:
            shutil.copytree(self.folder / "on disk", stage.place, symlinks=True, dirs_exist_ok=True)
            before = tree(stage.place)
            answer = stage.run(job.words, timeout=LONGEST)
            case.data["printed"], case.data["status"] = answer["printed"][-2000:], answer["status"]
            lost = [path for path in MINE[job.start] if tree(stage.place).get(path) != before[path]]
            if lost:
                return Outcome(LOST, ", ".join(lost))
            if job.bakes:
                stage.bake_now()
            if job.saves:
                stage.blend_now(job.saves)
            return judge_words(answer) or Outcome(CLEAR)
        finally:
            self._unmount()

    def _unmount(self) -> None:
        if os.path.ismount(self._stage.place):
            self._worker.call("hostile_scenes:leave")
            if subprocess.run(["umount", str(self._stage.place)], capture_output=True).returncode:
                subprocess.run(["umount", "-l", str(self._stage.place)], capture_output=True)


def furnish(place: Path) -> None:
    """Put odd things into a folder."""
    (place / "folder").mkdir()
    (place / "locked").mkdir()
    (place / "empty").write_bytes(b"")
    (place / "noise").write_bytes(random.Random(5).randbytes(4000))
    os.symlink("nowhere", place / "link to nowhere")
    os.symlink("link to itself", place / "link to itself")
    if hasattr(os, "mkfifo"):
        os.mkfifo(place / "fifo")
        os.mknod(place / "socket", 0o140644)
    os.chmod(place / "locked", 0o500)


def judge_words(answer: dict) -> Outcome | None:
    """Check that a command ended as it should and said why, if it did not succeed."""
    printed = answer["printed"]
    if answer["traceback"] or "Traceback (most recent" in printed:
        return Outcome(TRACEBACK, answer["traceback"] or printed)
    if answer["status"] not in STATUSES:
        return Outcome(WRONG, f"exit status {answer['status']}")
    said = [line for line in printed.splitlines() if re.match(r"palpate[ \w-]*: ", line)]
    if answer["status"] == 2 and printed.startswith("usage: palpate"):  # argparse says it, or the help does
        return None
    if answer["status"] != 0 and len(said) != 1:
        return Outcome(WRONG, f"exit status {answer['status']} and not one sentence: {printed[-500:]!r}")
    return None


def judge_files(before: dict[str, str], after: dict[str, str], words: tuple[str, ...], answer: dict) -> Outcome | None:
    """Check that nothing was changed by a command that failed, and the user's files by none."""
    gone = [path for path in before if path not in after and "/.palpate/" not in path and not _is_listed(path)]
    if gone:
        return Outcome(LOST, f"gone: {', '.join(gone[:5])}")
    changed = [path for path in before if after.get(path) != before[path] and path not in gone and not _is_listed(path)]
    own = [path for path in changed if not _may_write(path, words)]
    if own or (changed and answer["status"] not in (0, None)):
        return Outcome(LOST, f"changed: {', '.join(own[:5] or changed[:5])}, exit status {answer['status']}")
    if any(path.endswith(MARK_OF_SCRIPTS) for path in after):
        return Outcome(WRONG, "Python in the .blend was run")
    left = [path for path in after if path not in before and re.search(r"\.[0-9a-f]{8,16}\.partial", path)]
    return Outcome(WRONG, f"left behind: {left[:5]}") if left else None


def _is_listed(path: str) -> bool:
    """Return True for a file of an earlier export, which the next one may replace or remove."""
    return path.startswith(("csv/", "npz/", "hdf5/", "png/", "figures/")) and not path.endswith("notes.txt")


def _may_write(path: str, words: tuple[str, ...]) -> bool:
    """Return True for a file that the command was told to write."""
    named = [word for word in words if word and (path == word or path.startswith(f"{word.rstrip('/')}/"))]
    return bool(named) and not path.endswith("notes.txt") or path.endswith((".blend1", ".blend2"))


AREA = Commands
