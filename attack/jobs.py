# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands that the attack disturbs, the folders they start from, and what must hold of their results."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from .trees import put_back, tree
from .worker import PATIENCE, Failed, Worker

BAKES, SAVED, EXPORTS, MEASURED = "bakes", "saved", "exports", "measured"
"""Names of the folders that jobs start from."""
FORMATS = ("csv", "npz", "hdf5", "png")
MINE = {
    BAKES: ("notes.txt", "palpate/Pad/notes.txt", "palpate/Pad.partial/thesis.txt", "palpate/project/thesis.txt"),
    EXPORTS: tuple(f"{kind}/notes.txt" for kind in FORMATS) + ("csv/Pad/notes.txt", "png/Pad/notes.txt"),
    MEASURED: ("report/notes.txt",),
}
MINE[SAVED] = MINE[BAKES]
"""Files of the user's in each of them."""
BLEND, FOLDER = "scene.blend", "palpate-bake"
EXPORT_LIST = ".palpate-export.json"


@dataclass(frozen=True)
class Job:
    """A command.

    Attributes
    ----------
    name : str
    start : str
        The folder it starts from.
    words : tuple of str
        The command, run in that folder.
    share : float
        Part of all faults that goes to this job.
    output : str
        Folder or file that it writes, for what is checked by bytes; empty for a bake.
    bakes, saves : bool
        True if it writes a bake, and if it writes a .blend.
    """

    name: str
    start: str
    words: tuple[str, ...]
    share: float
    output: str = ""
    bakes: bool = False
    saves: str = ""


JOBS = (
    Job("bake", BAKES, ("bake", BLEND), 0.26, bakes=True),
    Job("bake --save", SAVED, ("bake", BLEND, "--save"), 0.24, bakes=True, saves=BLEND),
    Job("bake --save-as", BAKES, ("bake", BLEND, "--save-as", "shown.blend"), 0.06, bakes=True, saves="shown.blend"),
    *(Job(f"export {kind}", EXPORTS, ("export", FOLDER, "--format", kind, "--out", kind), 0.08, kind) for kind in FORMATS),
    Job("gap", MEASURED, ("gap", "rig.toml", "--out", "report"), 0.02, "report"),
    Job(
        "render",
        EXPORTS,
        ("render", BLEND, "--only", "curves", "--only", "numbers", "--format", "png", "--out", "figures"),
        0.04,
        "figures",
    ),
    Job("openrave export", BAKES, ("openrave", "export", BLEND, "--out", "robot.xml"), 0.02, "robot.xml"),
    Job("openrave import", BAKES, ("openrave", "import", "given.xml", BLEND, "--from", "T"), 0.04, saves=BLEND),
)


@dataclass
class Stage:
    """Start folders, and what each job makes of them undisturbed.

    Parameters
    ----------
    folder : Path
    worker : Worker
    """

    folder: Path
    worker: Worker
    undisturbed: dict[str, dict[str, str]] = field(default_factory=dict)
    described: dict[str, tuple[str, str]] = field(default_factory=dict)
    """What .blend and bake show before a job and after it, by the job's name and the word "blend" or "bake"."""
    _made: set[str] = field(default_factory=set)

    @property
    def place(self) -> Path:
        """Return the folder in which every job runs."""
        return self.folder / "place"

    def run(self, words: tuple[str, ...] | list[str], fault: dict | None = None, timeout: float = PATIENCE) -> dict:
        """Run a command in the place."""
        return self.worker.call("worker:run_command", timeout, argv=list(words), cwd=str(self.place), fault=fault)

    def start(self, job: Job) -> None:
        """Put the folder from which a job starts in place."""
        kept = self.folder / job.start
        if job.start not in self._made:
            self._make(job.start)
            self._made.add(job.start)
        put_back(kept, self.place)

    def expect(self, job: Job) -> None:
        """Find out what the job makes when nothing disturbs it."""
        if job.name in self.undisturbed:
            return
        self.start(job)
        before = self._describe(job)
        answer = self.run(job.words)
        if answer["status"] != 0:
            raise Failed(f"{job.name} fails undisturbed: {answer}")
        after = self._describe(job)
        self.described |= {f"{job.name} {what}": (before[what], after[what]) for what in before}
        self.undisturbed[job.name] = tree_without_ids(self.place)

    def bake_now(self) -> str:
        """Return the digest of the present bake, whose files are all checked; raises Failed if it cannot be read."""
        return self.worker.call("scenes:describe_bake", folder=str(self.place / FOLDER))

    def blend_now(self, name: str) -> str:
        """Return what a .blend shows; empty if there is none; raises Failed if it cannot be opened."""
        path = self.place / name
        return self.worker.call("scenes:describe_blend", path=str(path)) if path.exists() else ""

    def _describe(self, job: Job) -> dict[str, str]:
        found = {}
        if job.bakes:
            found["bake"] = self.bake_now()
        if job.saves:
            found["blend"] = self.blend_now(job.saves)
        return found

    def _make(self, name: str) -> None:
        empty = self.folder / "empty"
        empty.mkdir(exist_ok=True)
        put_back(empty, self.place)
        self.worker.call("worker:checkpoints_always")
        makers: dict[str, Callable[[], None]] = {
            BAKES: partial(self._make_bakes, ()),
            SAVED: partial(self._make_bakes, ("--save",)),
            EXPORTS: self._make_exports,
            MEASURED: self._make_measured,
        }
        makers[name]()
        for mine in MINE[name]:
            path = self.place / mine
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(f"mine: {mine}")
        put_back(self.place, self.folder / name)

    def _done(self, *words: str) -> None:
        answer = self.run(words)
        if answer["status"] != 0:
            raise Failed(f"{words}: {answer}")

    def _make_bakes(self, options: tuple[str, ...]) -> None:
        """An old bake of eight frames, and a scene that has been changed since."""
        blend = str(self.place / BLEND)
        self.worker.call("scenes:make_scene", path=blend, frames=8)
        self._done("openrave", "export", BLEND, "--sensor", "Pad", "--out", "given.xml")
        given = self.place / "given.xml"
        given.write_text(given.read_text().replace('name="Pad"', 'name="T"'))
        self._done("bake", BLEND, *options)
        self.worker.call("scenes:change_scene", path=blend, frames=6, k=90.0)

    def _make_exports(self) -> None:
        """A bake that is shown, and exports of a longer one before it."""
        self._make_bakes(("--save",))
        for kind in FORMATS:
            self._done("export", FOLDER, "--format", kind, "--out", kind)
        self._done("render", BLEND, "--only", "curves", "--format", "png", "--out", "figures")
        self._done("bake", BLEND, "--save")

    def _make_measured(self) -> None:
        self.worker.call("scenes:make_rig", folder=str(self.place))
        (self.place / "report").mkdir()


def tree_without_ids(folder: Path) -> dict[str, str]:
    """Return the tree of a folder without what differs from run to run, random ids, and memory addresses in .blend files.

    Backups of a .blend are left out: a command that is run twice makes one more of them.
    """
    found = {key: digest for key, digest in tree(folder).items() if not key.endswith((".blend1", ".blend2"))}
    for key in found:
        if key.endswith("palpate-folder.json"):
            found[key] = "marker"
        elif key.endswith(".blend"):
            found[key] = "blend"
    return found


def is_marked_unfinished(folder: Path, kind: str) -> bool:
    """Return True if the list of exports in a folder says that the one of a format is not complete."""
    try:
        listed = json.loads((folder / EXPORT_LIST).read_text(encoding="utf-8"))
        return not listed["exports"][kind]["complete"]
    except (OSError, ValueError, KeyError):
        return True
