# SPDX-License-Identifier: GPL-3.0-or-later
"""Kills of every process of a study, faults at its file operations, full and read-only disks, and two drivers at once.

After each, the same command again ends with the bytes of an undisturbed study, and nothing is computed twice but what was
being computed, or was not yet on the disk, when a process was killed.
"""

from __future__ import annotations

import gc
import os
import random
import shutil
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from palpate.core.errors import PalpateError
from palpate.core.solver import precompile
from palpate.core.study.run_files import done_runs, failed_runs

from .area import CLEAR, HUNG, LOST, TRACEBACK, WRONG, Area, Case, Outcome
from .injector import KILL, KINDS, Injector, Stopped
from .sweep_starts import count_starts, environment
from .sweep_study import results, sweep_here, write_study
from .trees import differences, put_back, tree

LONGEST = 900.0
"""Seconds after which a command counts as hung; the first one on a machine compiles the solver."""
RUNS, KILLS = 1000, 20
"""Of a round of kills, unless there are few tries."""
HOLD = 3.0
"""Of its presses, s: shorter runs were done before the last kills on a busy machine."""
VICTIMS = ("child", "worker", "scheduler", "driver")
FAULTY_RUNS, EARLIER_RUNS = 4, 2
"""Runs of the study whose file operations fail, and how many of them were done and published before."""
DISK_RUNS, DISKS = 12, (40, 900)
"""Runs of the study on a small disk, and kilobytes that are free there."""
MINE = ("notes.txt", "failed/notes.txt", "runs/thesis/notes.txt")
"""Files of the user's in the folder of the study."""
PUBLISHED = ("dataset/", "runs.parquet")


class Sweep(Area):
    """Studies under attack.

    Parameters
    ----------
    seed, tries, folder
        As of every area.
    runs, kills : int
        Of a round of kills.
    disks : bool
        Mount small disks; only where the user may.
    with_kills : bool
        Kill processes.
    """

    short, long = 80, 400

    def __init__(
        self,
        seed: int,
        tries: int,
        folder: Path,
        runs: int | None = None,
        kills: int | None = None,
        disks: bool = True,
        with_kills: bool = True,
    ):
        super().__init__(seed, tries, folder)
        is_whole = tries >= self.long
        self._runs, self._kills = runs or (RUNS if is_whole else 150), kills or (KILLS if is_whole else 5)
        self._disks = disks and os.geteuid() == 0 and sys.platform == "linux"
        self._with_kills_too = with_kills
        self._processes: list[subprocess.Popen] = []
        self._undisturbed: dict[str, dict[str, str]] = {}
        self._place = folder / "place"
        self._begun = 0  # runs, up to the last kill

    def close(self) -> None:
        self._end_processes()
        self._unmount()

    def cases(self) -> Iterator[Case]:
        dice = random.Random(self.seed)
        for kind in ("local", "scheduler") if self._with_kills_too else ():
            yield Case(f"kills: {kind}", {"kills": self._kills, "seed": dice.random()})
        for i in range(self.tries // 20 if self._disks else 0):
            yield Case(f"disk {i}", {"kilobytes": dice.randint(*DISKS)})
        if self._disks:
            yield Case("disk: read-only", {"kilobytes": 0})
        for i in range(max(1, self._kills // 4) if self._with_kills_too else 0):
            share = random.Random(f"{self.seed} drivers {i}").random() if i else 0.0  # at first both begin at once
            yield Case(f"two drivers {i}", {"share": share, "by its folder": i % 2 == 1})
        calls = self._count_faults()
        every = [(at, kind) for at in range(1, calls + 1) for kind in KINDS]
        dice.shuffle(every)
        for at, kind in every[: max(1, self.tries - self.tries // 20)]:
            yield Case(f"fault: {kind} at {at}", {"at": at, "kind": kind})

    def attempt(self, case: Case) -> Outcome:
        try:
            if "at" in case.data:
                outcome = self._with_fault(case)
            elif "share" in case.data:
                outcome = self._with_two_drivers(case)
            elif "kilobytes" in case.data:
                outcome = self._on_disk(case)
            else:
                outcome = self._with_kills(case)
        except subprocess.TimeoutExpired as error:
            outcome = Outcome(HUNG, str(error))
        finally:
            self._end_processes()
        return outcome if outcome.kind == CLEAR else Outcome(outcome.kind, outcome.seen, (self._place,))

    # --- kills

    def _with_kills(self, case: Case) -> Outcome:
        """Kill processes at random moments, give the same command again whenever the driver is gone, and compare."""
        dice, is_remote = random.Random(case.data["seed"]), case.name.endswith("scheduler")
        expected = self._expected("kills", self._runs, HOLD)
        shutil.rmtree(self._place, ignore_errors=True)
        study = write_study(self._place, self._runs, self.seed, hold=HOLD)
        (self.folder / "starts").unlink(missing_ok=True)
        self._begun = 0
        options = ["--workers", "2"]
        cluster = Cluster(self.folder, self._start) if is_remote else None
        if cluster is not None:
            options = ["--scheduler", cluster.address]
        driver, restarts, hits, lost_to_kills = self._sweep(study, options), 0, [], 0
        for victim, is_working in _planned_kills(case.data["kills"], dice):
            while driver.poll() is None and not self._can_be_hit(victim, is_working):
                time.sleep(0.01)
                if cluster is not None:
                    cluster.replace_dead()  # workers end where their scheduler is lost
            time.sleep(dice.uniform(0.0, 0.1 if is_working else 0.3))
            children = len(_descendants(os.getpid(), "child"))
            pid = driver.pid if victim == "driver" else self._pick(victim, driver, cluster, dice)
            if driver.poll() == 0:
                break  # the study is done
            if pid is None:
                continue
            hits.append(victim)
            self._begun = sum(count_starts(self.folder).values())
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
            lost_to_kills += 1 if victim == "child" else children + self._runs_in_flight()
            if cluster is not None and victim in ("scheduler", "worker"):
                time.sleep(0.2)
                cluster.replace_dead()
            if victim in ("driver", "scheduler"):  # a driver may find its scheduler again, where that was started again
                with suppress(subprocess.TimeoutExpired):
                    driver.wait(timeout=5)
            if driver.poll():
                said = driver.communicate(timeout=LONGEST)[1]
                if "Traceback" in said:
                    return Outcome(TRACEBACK, f"after a kill of the {victim}: {said[-3000:]}")
                driver, restarts = self._sweep(study, options), restarts + 1
        found = self._until_done(driver, study, options, cluster)
        case.data.update({"hits": hits, "restarts": restarts})
        starts = count_starts(self.folder)
        case.data["computed twice"] = sum(starts.values()) - len(starts)
        case.data["at work when killed"] = lost_to_kills
        print(
            f"{case.name}: {len(hits)} kills ({', '.join(hits)}), {restarts} restarts, {self._runs} runs, "
            f"{case.data['computed twice']} computed twice, {lost_to_kills} at work when killed",
            file=sys.stderr,
        )
        if found is not None:
            return found
        changed = differences(expected, results(self._place / "out"))
        if changed:
            return Outcome(WRONG, f"the study does not end as an undisturbed one: {changed}")
        if case.data["computed twice"] > lost_to_kills:
            return Outcome(WRONG, f"{case.data['computed twice']} runs computed twice, {lost_to_kills} were being computed")
        return Outcome(CLEAR)

    def _until_done(
        self, driver: subprocess.Popen, study: Path, options: list[str], cluster: Cluster | None = None
    ) -> Outcome | None:
        """Let a driver end, and give the command again where a lost scheduler has stopped it; None if all is well."""
        for _ in range(3):
            said = _words_at_end(driver, cluster)
            if driver.returncode == 0:
                return None
            if "Traceback" in said:
                return Outcome(TRACEBACK, said[-3000:])
            driver = self._sweep(study, options)
        return Outcome(WRONG, f"the command still fails: {said[-3000:]}")

    def _can_be_hit(self, victim: str, is_working: bool) -> bool:
        """Whether a process of a kind is there, and whether a run was begun since the last kill if that is asked for."""
        if victim in ("child", "worker") and not _descendants(os.getpid(), victim):
            return False
        return not is_working or sum(count_starts(self.folder).values()) > self._begun

    def _runs_in_flight(self) -> int:
        """Return how many runs were begun and are not in their places: what a worker has written is lost with it, too."""
        placed = done_runs(self._place / "out") | failed_runs(self._place / "out")
        return max(0, len(count_starts(self.folder)) - len(placed))

    @staticmethod
    def _pick(victim: str, driver: subprocess.Popen, cluster: Cluster | None, dice: random.Random) -> int | None:
        """Return a process of a kind; the scheduler of a local cluster is in the driver."""
        if victim == "scheduler":
            return driver.pid if cluster is None else cluster.scheduler.pid
        found = _descendants(os.getpid(), victim)
        return dice.choice(found) if found else None

    def _expected(self, name: str, runs: int, hold: float = 0.0) -> dict[str, str]:
        """Return the results of an undisturbed study."""
        if name not in self._undisturbed:
            place = self.folder / f"undisturbed {name}"
            precompile.compile_solver()  # else kills are spread over a minute of compiling, and most come too late
            driver = self._sweep(write_study(place, runs, self.seed, hold=hold), ["--workers", "2"])
            said = driver.communicate(timeout=LONGEST)[1]
            if driver.returncode:
                raise RuntimeError(f"the undisturbed study fails: {said}")
            self._undisturbed[name] = results(place / "out")
        return self._undisturbed[name]

    def _sweep(self, study: Path, options: list[str]) -> subprocess.Popen:
        """Start the command with the file of a study, or with the folder in which it goes on."""
        out = [] if study.is_dir() else ["--out", str(study.parent / "out")]
        return self._start([sys.executable, "-m", "palpate.commands", "sweep", str(study), *out, *options])

    def _start(self, words: list[str]) -> subprocess.Popen:
        process = subprocess.Popen(
            words,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment(self.folder),
        )
        self._processes.append(process)
        return process

    def _end_processes(self) -> None:
        for process in self._processes:
            for pid in [*_descendants(process.pid, ""), process.pid]:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            with suppress(subprocess.TimeoutExpired, ValueError):
                process.communicate(timeout=10)
        self._processes.clear()

    # --- two drivers

    def _with_two_drivers(self, case: Case) -> Outcome:
        """Give the command again while it is at work, after a share of the runs: one of the two says so and changes nothing."""
        expected = self._expected("kills", self._runs, HOLD)
        shutil.rmtree(self._place, ignore_errors=True)
        study, options = write_study(self._place, self._runs, self.seed, hold=HOLD), ["--workers", "2"]
        (self.folder / "starts").unlink(missing_ok=True)
        first, share = self._sweep(study, options), case.data["share"]
        while share and first.poll() is None and len(count_starts(self.folder)) <= share * self._runs:
            time.sleep(0.01)
        second = self._sweep(self._place / "out" if case.data["by its folder"] else study, options)
        said = [second.communicate(timeout=LONGEST)[1]]
        were_both_at_work = second.returncode == 0 and first.poll() is None
        said.append(first.communicate(timeout=LONGEST)[1])
        statuses = second.returncode, first.returncode
        case.data.update({"said": said, "statuses": statuses})
        if any("Traceback" in words for words in said):
            return Outcome(TRACEBACK, str(said)[-3000:])
        if 0 not in statuses or set(statuses) - {0, 1} or (were_both_at_work and 1 not in statuses):
            return Outcome(WRONG, f"the two commands end with {statuses}: {said}")
        for status, words in zip(statuses, said, strict=True):
            if status and not (words.count("\n") == 1 and "Another sweep is writing to" in words):
                return Outcome(WRONG, f"not one sentence about another command: {words!r}")
        changed = differences(expected, results(self._place / "out"))
        if changed:
            return Outcome(WRONG, f"the study does not end as one that was alone: {changed}")
        starts = count_starts(self.folder)
        if sum(starts.values()) != self._runs:
            return Outcome(WRONG, f"{sum(starts.values())} runs were begun instead of {self._runs}")
        return Outcome(CLEAR)

    # --- faults

    def _start_faults(self) -> Path:
        """Put a study in place of which two runs are done and published, with files of the user's beside."""
        kept = self.folder / "half"
        if not kept.exists():
            study = write_study(kept, FAULTY_RUNS, self.seed, fails=True)
            sweep_here(study, kept / "out", EARLIER_RUNS)
            for name in MINE:
                (kept / "out" / name).parent.mkdir(exist_ok=True)
                (kept / "out" / name).write_text(f"mine: {name}")
        put_back(kept, self._place)
        return self._place / "study.toml"

    def _count_faults(self) -> int:
        study = self._start_faults()
        self._before = tree(self._place / "out")
        with Injector(self._place) as injector:
            sweep_here(study, self._place / "out")
        self._undisturbed["faults"] = results(self._place / "out")
        return len(injector.calls)

    def _with_fault(self, case: Case) -> Outcome:
        study, out, kind = self._start_faults(), self._place / "out", case.data["kind"]
        said: Any = ""
        with Injector(self._place, case.data["at"], kind) as injector:
            try:
                sweep_here(study, out)
            except Stopped:
                said = KILL
            except PalpateError as error:
                said = str(error)
            except BaseException:
                return Outcome(TRACEBACK, traceback.format_exc())
        case.data.update({"operation": injector.calls[case.data["at"] - 1 :][:1], "said": said})
        gc.collect()  # a killed process lets go of its locks
        if "\n" in said or (said not in ("", KILL) and not said.endswith((".", "again"))):
            return Outcome(WRONG, f"not one sentence: {said!r}")
        now = results(out)
        found = self._judge_published(now, said)
        if found is not None:
            return found
        try:
            sweep_here(study, out)
        except BaseException:
            return Outcome(TRACEBACK, f"the second time: {traceback.format_exc()}")
        changed = differences(self._undisturbed["faults"], results(out))
        return Outcome(WRONG, f"the second time it does not end as undisturbed: {changed}") if changed else Outcome(CLEAR)

    def _judge_published(self, now: dict[str, str], said: str) -> Outcome | None:
        """Check that files of the user's are there, and that dataset and table are the old ones or the new ones."""
        for name in MINE:
            if now.get(name) != self._before[name]:
                return Outcome(LOST, f"{name} is gone or was changed")
        for part in PUBLISHED:
            mine, old, new = (
                {name: digest for name, digest in found.items() if name.startswith(part)}
                for found in (now, self._before, self._undisturbed["faults"])
            )
            if mine != new and mine != old and not (said == KILL and not mine):
                return Outcome(WRONG, f"'{part}' is neither the old one nor the new one")
            if said == "" and mine != new:
                return Outcome(WRONG, f"nothing was said, and '{part}' is the old one")
        return None

    # --- disks

    def _on_disk(self, case: Case) -> Outcome:
        """Sweep on a disk that is nearly full or cannot be written, then make room and go on."""
        expected = self._expected("disk", DISK_RUNS)
        shutil.rmtree(self._place, ignore_errors=True)
        self._place.mkdir()
        size = 1024 * max(100, case.data["kilobytes"])
        if subprocess.run(
            ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(self._place)], capture_output=True
        ).returncode:
            return Outcome(CLEAR, "this system mounts no disk")
        try:
            study = write_study(self._place, DISK_RUNS, self.seed)
            if case.data["kilobytes"] == 0:
                subprocess.run(["mount", "-o", "remount,ro", str(self._place)], check=True, capture_output=True)
            driver = self._sweep(study, ["--workers", "1"])
            said = driver.communicate(timeout=LONGEST)[1]
            case.data.update({"said": said, "status": driver.returncode})
            if "Traceback" in said:
                return Outcome(TRACEBACK, said[-3000:])
            lines = [line for line in said.splitlines() if "compiling its solver" not in line]
            if driver.returncode not in (0, 1) or (driver.returncode and len(lines) != 1):
                return Outcome(WRONG, f"status {driver.returncode} and not one sentence: {said[-1000:]!r}")
            subprocess.run(["mount", "-o", "remount,rw,size=64m", str(self._place)], check=True, capture_output=True)
            found = self._until_done(self._sweep(study, ["--workers", "1"]), study, ["--workers", "1"])
            changed = differences(expected, results(self._place / "out"))
            if found is None and changed:
                found = Outcome(WRONG, f"with more room it does not end as undisturbed: {changed}")
            return found or Outcome(CLEAR)
        finally:
            self._end_processes()
            self._unmount()

    def _unmount(self) -> None:
        if os.path.ismount(self._place) and subprocess.run(["umount", str(self._place)], capture_output=True).returncode:
            subprocess.run(["umount", "-l", str(self._place)], capture_output=True)


class Cluster:
    """A scheduler and two workers that were started by hand; what is killed is started again."""

    def __init__(self, folder: Path, start: Any):
        self._folder, self._start = folder, start
        self._port = _free_port()
        self.address = f"tcp://127.0.0.1:{self._port}"
        self.scheduler = self._start_scheduler()
        self.workers = [self._start_worker() for _ in range(2)]

    def _start_scheduler(self) -> subprocess.Popen:
        words = ["scheduler", "--host", "127.0.0.1", "--port", str(self._port), "--no-dashboard"]
        return self._start([sys.executable, "-m", "dask", *words])

    def _start_worker(self) -> subprocess.Popen:
        words = ["worker", self.address, "--nworkers", "1", "--nthreads", "1", "--no-dashboard"]
        return self._start([sys.executable, "-m", "dask", *words, "--local-directory", str(self._folder / "dask")])

    def replace_dead(self) -> None:
        """Start again what has ended, as whoever looks after a cluster does."""
        if self.scheduler.poll() is not None:
            self.scheduler = self._start_scheduler()
        self.workers = [worker if worker.poll() is None else self._start_worker() for worker in self.workers]


def _free_port() -> int:
    import socket

    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _words_at_end(driver: subprocess.Popen, cluster: Cluster | None) -> str:
    """Wait for the end of a driver, keep the cluster alive meanwhile, and return what it printed to standard error."""
    for _ in range(int(LONGEST)):
        with suppress(subprocess.TimeoutExpired):
            return str(driver.communicate(timeout=1)[1])
        if cluster is not None:
            cluster.replace_dead()
    raise subprocess.TimeoutExpired(driver.args, LONGEST)


def _planned_kills(count: int, dice: random.Random) -> list[tuple[str, bool]]:
    """Return which kinds are killed in which order, and whether while runs are computed or at any moment.

    At any moment alone, nearly all kills would hit a driver that starts, since a thousand runs take a few seconds.
    """
    plan = [(VICTIMS[number % len(VICTIMS)], number // len(VICTIMS) % 2 == 0) for number in range(count)]
    dice.shuffle(plan)
    return plan


def _descendants(root: int, kind: str) -> list[int]:
    """Return the processes below `root`: those that compute runs ("child"), Dask's workers ("worker"), or all (empty)."""
    import psutil

    marks = {"child": "palpate.sweep.child", "worker": "spawn_main", "": ""}
    found = []
    with suppress(psutil.NoSuchProcess):
        for process in psutil.Process(root).children(recursive=True):
            with suppress(psutil.NoSuchProcess, psutil.ZombieProcess):
                if marks[kind] in " ".join(process.cmdline()):
                    found.append(process.pid)
    return sorted(found)


AREA = Sweep
