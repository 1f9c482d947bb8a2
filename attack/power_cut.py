# SPDX-License-Identifier: GPL-3.0-or-later
"""Power cuts in the middle of a bake: in simulation, and with a real file system where that is possible.

The simulation records a bake: names and contents before and after each operation, and what had been synchronised by then. A cut
at any moment leaves the names of some earlier moment, but none from before the last synchronisation, and of each file either
what was synchronised or anything else: nothing, half of it, zeros, or all. This is what file systems with a journal promise,
and less than ext4 keeps.

As root on Linux, a bake also runs on an ext4 of its own, whose block device is copied meanwhile and mounted again.

After each cut the present bake is the old one or the new one, as a whole; the same command again ends with the bytes of an
undisturbed run; and the user's files are there.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .area import CLEAR, HUNG, LOST, TRACEBACK, WRONG, Area, Case, Outcome
from .injector import Injector
from .jobs import BLEND, FOLDER, JOBS, MINE, Job, Stage, tree_without_ids
from .trees import differences, put_back, tree
from .worker import PACKAGE, Crashed, Failed, Hung, Worker, run_command

NOTHING, HALF, ZEROS, ALL = "nothing", "half", "zeros", "all"
LONGEST = 300.0
"""Seconds after which the run after a cut counts as hung."""
DEVICE_SHARE, LEAST_DEVICE_CUTS = 0.1, 12
"""Part of the cuts that are made with a real file system, and how many are wanted at least."""
CUT_JOBS = tuple(job for job in JOBS if job.name in ("bake", "bake --save", "export csv"))
"""Jobs that are cut in simulation."""
DEVICE_SIZE = 24 << 20
"""Bytes of its block device."""


# --- in the worker: record


@dataclass
class _File:
    """A file at one moment: which inode, and the hash of its content."""

    inode: int
    content: str


def record(argv: list[str], cwd: str, to: str) -> dict[str, Any]:
    """Run a command and record its moments into the file `to`; contents lie beside it, named by their hashes."""
    root, contents = Path(cwd), Path(to).parent / "contents"
    contents.mkdir(exist_ok=True)
    moments: list[dict[str, Any]] = []
    durable: dict[int, str] = {}

    def observe(operation: str, path: str, after: bool) -> None:
        files, folders = _snapshot(root, contents)
        present = {file.inode for file in files.values()}
        for inode in durable.keys() - present:
            del durable[inode]  # its number may be given to another file
        synced_names = ""
        if after and operation == "sync":
            durable.update({file.inode: file.content for file in files.values()})
            synced_names = "all"
        elif after and operation == "fsync" and os.path.isdir(path):
            synced_names = "folder"
        elif after and operation == "fsync":
            file = files.get(os.path.relpath(path, root))
            if file is not None:
                durable[file.inode] = file.content
        moments.append(
            {
                "operation": f"{operation} {os.path.relpath(path, root)}",
                "files": {name: [file.inode, file.content] for name, file in files.items()},
                "folders": folders,
                "durable": {str(inode): content for inode, content in durable.items()},
                "synced_names": synced_names,
            }
        )

    original = Injector.__init__

    def observed(self: Injector, *arguments: Any, **options: Any) -> None:
        original(self, *arguments, **options)
        self.observe = observe

    Injector.__init__ = observed  # type: ignore[method-assign]
    try:
        observe("sync", cwd, True)  # what was there before has been there for long
        answer = run_command(argv, cwd, {"root": cwd, "at": 0, "kind": "EIO"})
    finally:
        Injector.__init__ = original  # type: ignore[method-assign]
    Path(to).write_text(json.dumps(moments), encoding="utf-8")
    return answer


def _snapshot(root: Path, contents: Path) -> tuple[dict[str, _File], list[str]]:
    """Return all files and folders below the root, and keep the contents of the files."""
    import hashlib

    files, folders = {}, []
    for where, below, names in os.walk(root):
        folders += [os.path.relpath(os.path.join(where, name), root) for name in below]
        for name in names:
            path = os.path.join(where, name)
            number = os.open.__wrapped__ if hasattr(os.open, "__wrapped__") else os.open
            with suppress(FileNotFoundError):
                descriptor = number(path, os.O_RDONLY)
                try:
                    inode, data = os.fstat(descriptor).st_ino, os.read(descriptor, 1 << 24)
                finally:
                    os.close(descriptor)
                digest = hashlib.sha256(data).hexdigest()
                if not (contents / digest).exists():
                    (contents / digest).write_bytes(data)
                files[os.path.relpath(path, root)] = _File(inode, digest)
    return files, folders


# --- in the parent: cut


class Recorded:
    """A recorded command.

    Parameters
    ----------
    path : Path
        What :func:`record` has written.
    """

    def __init__(self, path: Path):
        self._moments = json.loads(path.read_text(encoding="utf-8"))
        self._contents = path.parent / "contents"

    def __len__(self) -> int:
        return len(self._moments)

    def cut(self, at: int, dice: random.Random, place: Path) -> str:
        """Fill `place` with what the disk holds after a cut right after a moment; say what it was."""
        last = max((i for i in range(at + 1) if self._moments[i]["synced_names"]), default=0)
        names = self._moments[dice.randint(last, at)]
        now = self._moments[at]
        contents = {inode: content for inode, content in now["files"].values()}
        for folder in sorted(names["folders"]):
            (place / folder).mkdir(parents=True, exist_ok=True)
        lost = 0
        for name, (inode, older) in names["files"].items():
            synced = now["durable"].get(str(inode), names["durable"].get(str(inode)))  # it may be removed by now
            present = contents.get(inode, older)
            data = self._content(present)
            if synced != present:
                lost += 1
                data = self._torn(self._content(synced) if synced else b"", data, dice)
            path = place / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
        return f"after '{now['operation']}', names as after '{names['operation']}', {lost} files not synchronised"

    def _content(self, digest: str) -> bytes:
        return (self._contents / digest).read_bytes()

    @staticmethod
    def _torn(synced: bytes, present: bytes, dice: random.Random) -> bytes:
        what = dice.choice((NOTHING, HALF, ZEROS, ALL))
        if what == HALF:
            return present[: len(present) // 2]
        if what == ZEROS:
            return bytes(len(present))
        return synced if what == NOTHING else present


class Device:
    """A small ext4 in a file, mounted at the place where jobs run.

    Parameters
    ----------
    folder : Path
    """

    def __init__(self, folder: Path):
        self.image, self.place = folder / "device.img", folder / "mounted"
        self.place.mkdir()

    @staticmethod
    def is_possible() -> bool:
        """Return True for root on Linux with the programs that are needed."""
        tools = all(shutil.which(name) for name in ("mkfs.ext4", "mount", "umount"))
        return sys.platform == "linux" and os.geteuid() == 0 and tools

    def make(self) -> bool:
        """Make and mount an empty file system; return False if the system does not let us."""
        self.image.unlink(missing_ok=True)  # the system may still keep blocks of the device that the old file was
        with open(self.image, "wb") as file:
            file.truncate(DEVICE_SIZE)
        made = subprocess.run(["mkfs.ext4", "-q", "-m", "0", str(self.image)], capture_output=True).returncode == 0
        return made and self.mount(self.image)

    def mount(self, image: Path) -> bool:
        """Mount a block device; return False if the system does not let us."""
        command = ["mount", "-o", "loop,commit=1", str(image), str(self.place)]
        return subprocess.run(command, capture_output=True).returncode == 0

    def unmount(self) -> None:
        """Unmount the device if it is mounted."""
        for _ in range(20):
            if not os.path.ismount(self.place):
                return
            if subprocess.run(["umount", str(self.place)], capture_output=True).returncode == 0:
                return
            time.sleep(0.1)


class PowerCut(Area):
    """Power cuts."""

    short, long = 30, 300

    def __init__(self, seed: int, tries: int, folder: Path, jobs: tuple[Job, ...] = CUT_JOBS):
        super().__init__(seed, tries, folder)
        self._worker = Worker(folder)
        self._stage = Stage(folder, self._worker)
        self._jobs = {job.name: job for job in jobs}
        self._recorded: dict[str, Recorded] = {}
        self._device: Device | None = None
        self._expected: dict[str, str] = {}

    def close(self) -> None:
        if self._device is not None:
            self._device.unmount()
        self._worker.close()

    def cases(self) -> Iterator[Case]:
        dice = random.Random(self.seed)
        total = sum(job.share for job in self._jobs.values())
        for name, job in self._jobs.items():
            self._record(job)
            count = max(1, round(self.tries * job.share / total))
            for i in range(count):  # spread over all moments
                at = min(len(self._recorded[name]) - 1, int((i + dice.random()) * len(self._recorded[name]) / count))
                yield Case(f"simulated {name}: {i}", {"job": name, "at": at, "seed": dice.randrange(1 << 30)})
        if Device.is_possible() and self.tries >= LEAST_DEVICE_CUTS:
            for i in range(max(LEAST_DEVICE_CUTS, round(self.tries * DEVICE_SHARE))):
                yield Case(f"device: {i}", {"share": dice.random()})

    def attempt(self, case: Case) -> Outcome:
        try:
            outcome = self._cut_device(case) if "share" in case.data else self._cut(case)
        except Hung as error:
            outcome = Outcome(HUNG, str(error))
        except Crashed as error:
            outcome = Outcome(TRACEBACK, f"the process ended: {error}")
        if outcome.kind == CLEAR:
            return outcome
        return Outcome(outcome.kind, outcome.seen, (self.folder / "cut",))

    def _record(self, job: Job) -> None:
        self._stage.start(job)
        self._stage.expect(job)
        self._stage.start(job)
        to = self.folder / f"recorded {job.name}" / "moments.json"
        to.parent.mkdir()
        answer = self._worker.call("power_cut:record", argv=list(job.words), cwd=str(self._stage.place), to=str(to))
        if answer["status"] != 0:
            raise Failed(f"{job.name}: {answer}")
        self._recorded[job.name] = Recorded(to)

    def _cut(self, case: Case) -> Outcome:
        """Cut in simulation."""
        job, stage = self._jobs[case.data["job"]], self._stage
        stage.start(job)
        before = tree(stage.place)
        shutil.rmtree(stage.place)
        stage.place.mkdir()
        dice = random.Random(case.data["seed"])
        case.data["cut"] = self._recorded[job.name].cut(case.data["at"], dice, stage.place)
        put_back(stage.place, self.folder / "cut")
        if job.bakes:
            old_new = stage.described[f"{job.name} bake"]
            try:
                if stage.bake_now() not in old_new:
                    return Outcome(WRONG, "the bake is neither the old one nor the new one")
                if job.saves and stage.blend_now(job.saves) not in stage.described[f"{job.name} blend"]:
                    return Outcome(WRONG, "the .blend is neither the old one nor the new one")
            except Failed as error:
                return Outcome(WRONG, f"what is there cannot be read: {str(error).strip().splitlines()[-1]}")
        return self._resume(job, before) or Outcome(CLEAR)

    def _resume(self, job: Job, before: dict[str, str]) -> Outcome | None:
        answer = self._stage.run(job.words, timeout=LONGEST)
        if answer["traceback"]:
            return Outcome(TRACEBACK, answer["traceback"])
        if answer["status"] != 0:
            return Outcome(WRONG, f"the next run fails: {answer['printed']}")
        found = differences(self._stage.undisturbed[job.name], tree_without_ids(self._stage.place))
        if found:
            return Outcome(WRONG, f"the next run does not end as an undisturbed one: {found}")
        now = tree(self._stage.place)
        lost = [path for path in MINE[job.start] if now.get(path) != before[path]]
        return Outcome(LOST, ", ".join(lost)) if lost else None

    # --- with a block device

    def _cut_device(self, case: Case) -> Outcome:
        """Copy the block device in the middle of a bake, and mount the copy."""
        if self._device is None:
            self._device = Device(self.folder)
        device, copy = self._device, self.folder / "cut.img"
        if not device.make():
            return Outcome(CLEAR, "this system mounts no block device")
        try:
            seconds = self._bake_on(device, None)
            self._bake_on(device, (case.data["share"] * seconds, copy))
        finally:
            device.unmount()
        if not device.mount(copy):
            return Outcome(WRONG, "the copy of the block device cannot be mounted")
        try:
            answer = self._worker.call("worker:run_command", argv=["bake", BLEND], cwd=str(device.place))
            if answer["traceback"] or answer["status"] != 0:
                return Outcome(TRACEBACK if answer["traceback"] else WRONG, answer["traceback"] or answer["printed"])
            self._worker.call("scenes:describe_bake", folder=str(device.place / FOLDER))
            found = differences(self._expected_on_device(device), tree_without_ids(device.place / FOLDER))
            return Outcome(WRONG, f"not as an undisturbed bake: {found}") if found else Outcome(CLEAR)
        except Failed as error:
            return Outcome(WRONG, f"what is there cannot be read: {str(error).strip().splitlines()[-1]}")
        finally:
            device.unmount()

    def _expected_on_device(self, device: Device) -> dict[str, str]:
        """Return the files of an undisturbed bake there."""
        return json.loads((self.folder / "device.json").read_text())

    def _bake_on(self, device: Device, cut: tuple[float, Path] | None) -> float:
        """Bake on the device in a process of its own; copy the device after some seconds. Return how long it took."""
        expected, blend = self.folder / "device.json", self.folder / "device.blend"
        if cut is None and expected.exists():
            return float(self._expected["seconds"])
        if not blend.exists():
            self._worker.call("scenes:make_scene", path=str(blend), frames=40)
        shutil.copyfile(blend, device.place / BLEND)
        subprocess.run(["sync", "-f", str(device.place)], check=False)
        code = f"from {PACKAGE}.power_cut import bake_slowly; bake_slowly({str(device.place)!r})"
        process = subprocess.Popen(
            [sys.executable, "-P", "-c", code], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, cwd=self.folder
        )
        assert process.stdout is not None
        process.stdout.readline()  # it begins
        began = time.monotonic()
        if cut is not None:
            time.sleep(cut[0])
            process.send_signal(signal.SIGSTOP)
            cut[1].unlink(missing_ok=True)
            shutil.copyfile(device.image, cut[1])
            process.kill()
            process.wait()
            return 0.0
        process.wait()
        self._expected["seconds"] = str(time.monotonic() - began)
        expected.write_text(json.dumps(tree_without_ids(device.place / FOLDER)))
        shutil.rmtree(device.place / FOLDER)
        return float(self._expected["seconds"])


def bake_slowly(folder: str) -> None:
    """Bake with a checkpoint after each frame, and say when it begins. Run in a process of its own."""
    from palpate import commands

    from .worker import checkpoints_always

    checkpoints_always()
    from palpate.addon.session import first_use
    from palpate.core.io import bake_switch

    first_use.load_solver()
    os.chdir(folder)
    print("begins", flush=True)
    status = commands.main(["bake", BLEND])
    bake_switch.wait_for_removals()
    sys.stdout.flush()
    os._exit(status)


AREA = PowerCut
