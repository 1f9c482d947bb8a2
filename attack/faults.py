# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults at every rename, unlink, mkdir, open, write and fsync of a command.

After each: files of the user's are there, the result is the old one or the new one as a whole, the command has said what is
wrong in one sentence, and the same command again ends with the bytes of an undisturbed run and leaves nothing behind.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

from .area import CLEAR, HUNG, LOST, TRACEBACK, WRONG, Area, Case, Outcome
from .injector import EXIT, KILL, KINDS
from .jobs import FORMATS, JOBS, MINE, Job, Stage, is_marked_unfinished, tree_without_ids
from .trees import FOLDER, differences, tree
from .worker import KILLED, Crashed, Failed, Hung, Worker

LONGEST = 300.0
"""Seconds after which a disturbed command counts as hung."""
EXIT_SHARE = 0.03
"""Part of the faults that really end the process, which has to be started again."""


class Faults(Area):
    """Faults in file operations."""

    short, long = 60, 700

    def __init__(self, seed: int, tries: int, folder: Path, jobs: tuple[Job, ...] = JOBS):
        super().__init__(seed, tries, folder)
        self._jobs = {job.name: job for job in jobs}
        self._worker = Worker(folder)
        self._stage = Stage(folder, self._worker)

    def close(self) -> None:
        self._worker.close()

    def cases(self) -> Iterator[Case]:
        dice = random.Random(self.seed)
        total = sum(job.share for job in self._jobs.values())
        for job in self._jobs.values():
            self._stage.start(job)
            self._remember(job)
            self._stage.expect(job)
            calls = self._count(job)
            every = [(at, kind) for at in range(1, calls + 1) for kind in KINDS]
            dice.shuffle(every)
            for at, kind in every[: max(1, round(self.tries * job.share / total))]:
                kind = EXIT if dice.random() < EXIT_SHARE else kind
                yield Case(f"{job.name}: {kind} at {at}", {"job": job.name, "at": at, "kind": kind})

    def attempt(self, case: Case) -> Outcome:
        job = self._jobs[case.data["job"]]
        try:
            outcome = self._attempt(job, case)
        except Hung as error:
            outcome = Outcome(HUNG, str(error))
        except Crashed as error:
            outcome = Outcome(TRACEBACK, f"the process ended: {error}")
        if outcome.kind == CLEAR:
            return outcome
        return Outcome(outcome.kind, outcome.seen, (self._stage.place,))

    def _remember(self, job: Job) -> None:
        self._worker.call("worker:checkpoints_always")
        if job.name == "gap":
            self._worker.call("scenes:remember_diagnosis")

    def _count(self, job: Job) -> int:
        """Return the number of operations of an undisturbed run."""
        self._stage.start(job)
        return len(self._stage.run(job.words, self._fault(0, KILL))["calls"])

    def _fault(self, at: int, kind: str) -> dict:
        return {"root": str(self._stage.place), "at": at, "kind": kind}

    def _attempt(self, job: Job, case: Case) -> Outcome:
        stage, kind = self._stage, case.data["kind"]
        stage.start(job)
        self._remember(job)
        stage.expect(job)
        stage.start(job)
        before = tree(stage.place)
        try:
            answer = stage.run(job.words, self._fault(case.data["at"], kind), LONGEST)
        except Crashed:
            if kind != EXIT:
                raise
            self._remember(job)
            answer = {"status": KILLED, "printed": "", "traceback": "", "calls": []}
        case.data["operation"] = answer["calls"][case.data["at"] - 1 :][:1]
        case.data["printed"] = answer["printed"][-2000:]
        if answer["status"] != KILLED and (answer["traceback"] or "Traceback" in answer["printed"]):
            return Outcome(TRACEBACK, answer["traceback"] or answer["printed"])
        if answer["status"] == 1 and len(answer["printed"].strip().splitlines()) != 1:
            return Outcome(WRONG, f"not one sentence: {answer['printed']}")
        return (
            self._check_now(job, answer["status"], before)
            or self._check_mine(job, before)
            or self._run_again(job, before)
            or Outcome(CLEAR)
        )

    def _check_mine(self, job: Job, before: dict[str, str]) -> Outcome | None:
        """Check that the user's files are as they were."""
        now = tree(self._stage.place)
        lost = [path for path in MINE[job.start] if now.get(path) != before[path]]
        return Outcome(LOST, f"{', '.join(lost)} is gone or was changed") if lost else None

    def _check_now(self, job: Job, status: int | str, before: dict[str, str]) -> Outcome | None:
        """Check that the result is the old one or the new one, as a whole."""
        stage, states = self._stage, {}
        try:
            if job.bakes:
                states["bake"] = stage.bake_now()
            if job.saves:
                states["blend"] = stage.blend_now(job.saves)
        except Failed as error:
            return Outcome(WRONG, f"what is there now cannot be read: {str(error).strip().splitlines()[-1]}")
        found = set()
        for what, state in states.items():
            old, new = stage.described[f"{job.name} {what}"]
            if state not in (old, new):
                return Outcome(WRONG, f"the {what} is neither the old one nor the new one")
            if old != new:
                found.add("old" if state == old else "new")
        if len(found) > 1:
            return Outcome(WRONG, f"bake and .blend do not belong together: {states}")
        if status == 0 and "old" in found:
            return Outcome(WRONG, "exit status 0, but the result is the old one")
        return self._check_output(job, status, before) if job.output else None

    def _check_output(self, job: Job, status: int | str, before: dict[str, str]) -> Outcome | None:
        """Check the files of an output: each is the old one or the new one, and a mixture of both says so."""
        old, new = before, self._stage.undisturbed[job.name]
        ages = set()
        for path, digest in tree_without_ids(self._stage.place).items():
            inside = path == job.output or path.startswith(job.output + "/")
            hidden = any(part.startswith(".") for part in Path(path).parts)
            if not inside or hidden or digest == FOLDER:
                continue
            if digest not in (old.get(path), new.get(path)):
                return Outcome(WRONG, f"{path} is neither the old file nor the new one")
            if old.get(path) != new.get(path):
                ages.add("old" if digest == old.get(path) else "new")
        if status == 0 and "old" in ages:
            return Outcome(WRONG, "exit status 0, but old files are there")
        if len(ages) > 1 and job.output in FORMATS and not is_marked_unfinished(self._stage.place / job.output, job.output):
            return Outcome(WRONG, "old and new files together pass for a complete export")
        return None

    def _run_again(self, job: Job, before: dict[str, str]) -> Outcome | None:
        """Run the same command undisturbed and compare with a run that never was disturbed."""
        again = self._stage.run(job.words, timeout=LONGEST)
        if again["traceback"]:
            return Outcome(TRACEBACK, f"the second run: {again['traceback']}")
        if again["status"] != 0:
            return Outcome(WRONG, f"the second run fails: {again['printed']}")
        found = differences(self._stage.undisturbed[job.name], tree_without_ids(self._stage.place))
        if found:
            return Outcome(WRONG, f"the second run does not end as an undisturbed one: {found}")
        return self._check_mine(job, before)


AREA = Faults
