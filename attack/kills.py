# SPDX-License-Identifier: GPL-3.0-or-later
"""Kills at random moments of every command: a process of its own each time, SIGKILL, and the same command again."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from .area import CLEAR, HUNG, LOST, TRACEBACK, WRONG, Area, Case, Outcome
from .jobs import JOBS, MINE, Job, Stage, tree_without_ids
from .trees import differences, tree
from .worker import Crashed, Failed, Hung, Worker

LONGEST = 300.0
"""Seconds after which a command counts as hung."""
SLOW = ("gap", "render")
"""Jobs that get fewer kills because they take long."""


class Kills(Area):
    """Kills at random moments."""

    short, long = 12, 90

    def __init__(self, seed: int, tries: int, folder: Path, jobs: tuple[Job, ...] = JOBS):
        super().__init__(seed, tries, folder)
        self._worker = Worker(folder)
        self._stage = Stage(folder, self._worker)
        self._jobs = {job.name: job for job in jobs}
        self._seconds: dict[str, float] = {}

    def close(self) -> None:
        self._worker.close()

    def cases(self) -> Iterator[Case]:
        dice = random.Random(self.seed)
        total = sum(self._share(job) for job in self._jobs.values())
        for job in self._jobs.values():
            for i in range(round(self.tries * self._share(job) / total)):
                yield Case(f"{job.name}: {i}", {"job": job.name, "share": dice.random()})

    @staticmethod
    def _share(job: Job) -> float:
        return 0.5 if job.name in SLOW else 2.0 if job.bakes else 1.0

    def attempt(self, case: Case) -> Outcome:
        job = self._jobs[case.data["job"]]
        try:
            outcome = self._attempt(job, case)
        except (Hung, subprocess.TimeoutExpired) as error:
            outcome = Outcome(HUNG, str(error))
        except Crashed as error:
            outcome = Outcome(TRACEBACK, f"the process ended: {error}")
        except Failed as error:
            outcome = Outcome(WRONG, str(error))
        if outcome.kind == CLEAR:
            return outcome
        return Outcome(outcome.kind, outcome.seen, (self._stage.place,))

    def _attempt(self, job: Job, case: Case) -> Outcome:
        stage = self._stage
        if job.name not in self._seconds:
            stage.expect(job)
            stage.start(job)
            began = time.monotonic()
            self._start(job).wait(LONGEST)
            self._seconds[job.name] = time.monotonic() - began
        stage.start(job)
        before = tree(stage.place)
        process = self._start(job)
        try:
            process.wait(case.data["share"] * self._seconds[job.name])
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            process.wait()
        again = self._start(job, subprocess.PIPE)
        printed, _ = again.communicate(timeout=LONGEST)
        if again.returncode != 0:
            return Outcome(TRACEBACK if b"Traceback" in printed else WRONG, f"the second run fails: {printed[-3000:]!r}")
        found = differences(stage.undisturbed[job.name], tree_without_ids(stage.place))
        if found:
            return Outcome(WRONG, f"the second run does not end as an undisturbed one: {found}")
        for what, now in (("bake", stage.bake_now if job.bakes else None), ("blend", stage.blend_now if job.saves else None)):
            if now is not None:
                shown = now(job.saves) if what == "blend" else now()  # type: ignore[call-arg]
                if shown != stage.described[f"{job.name} {what}"][1]:
                    return Outcome(WRONG, f"the {what} is not the new one")
        mine = tree(stage.place)
        lost = [path for path in MINE[job.start] if mine.get(path) != before[path]]
        return Outcome(LOST, ", ".join(lost)) if lost else Outcome(CLEAR)

    def _start(self, job: Job, output: int = subprocess.DEVNULL) -> subprocess.Popen:
        """Start the command as a user does."""
        command = [sys.executable, "-P", "-m", "palpate.commands", *job.words]
        return subprocess.Popen(
            command,
            cwd=self._stage.place,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT if output == subprocess.PIPE else output,
            env={**os.environ, "BLENDER_USER_RESOURCES": str(self.folder / "blender")},
        )


AREA = Kills
