# SPDX-License-Identifier: GPL-3.0-or-later
"""A study of presses that take milliseconds, and what must hold of its folder, for attacks on ``palpate sweep``."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import trimesh

from palpate.core.geometry.mesh import TriangleMesh
from palpate.core.io.folder_lock import FolderLock
from palpate.core.io.scenario_npz import save_scenario
from palpate.core.model.body import Body
from palpate.core.model.motion import Motion
from palpate.core.model.scenario import Scenario
from palpate.core.model.sensor import Sensor
from palpate.core.model.sensor_parameters import SensorParameters
from palpate.core.model.target import Target
from palpate.core.study.run_files import RUNS, done_runs, failed_runs, make_folders, run_batch
from palpate.core.study.run_shards import SUFFIX, ShardIndex, digests_in
from palpate.sweep.child import DONE, UNWRITABLE, Scenes, answer_to
from palpate.sweep.dataset import publish
from palpate.sweep.finished_runs import StoredRuns
from palpate.sweep.study_folder import begin_study

from .sample_bake import grid_texels
from .trees import tree

STUDY = """format = "palpate-sweep/1"
name = "small presses"
scene = "pad.npz"
design = "random"
samples = {runs}
seed = {seed}
fps = 100
[vary]
"Pad.mus" = {{ uniform = [0.3, 1.0] }}
{more}
[press]
depth = {{ uniform = [0.2e-3, 2e-3] }}
speed = 0.1
hold = {hold}
"""
FAILING = '"Pad.mud" = { choice = [0.2, 0.25, 2.0] }'
"""Every third value of the friction is above that at rest, which no sensor has: the run fails."""


def scenario() -> Scenario:
    """A ball over a pad of 5 × 3 texels."""
    solid = trimesh.creation.icosphere(1, 0.006)
    ball = TriangleMesh(np.array(solid.vertices), np.array(solid.faces))
    bodies = (Body("Pad", Motion.at_rest()), Body("Ball", Motion.at_rest((0.0, 0.0, 0.02))))
    sensor = Sensor("Pad", 0, grid_texels(), SensorParameters())
    return Scenario(bodies, (sensor,), (Target("Ball", 1, ball),), 1, 3, 50.0, name="pad")


def write_study(folder: Path, runs: int, seed: int = 1, fails: bool = False, more: str = "", hold: float = 0.0) -> Path:
    """Write scene and study into a folder that is made, and return the study's file; presses are held for `hold` seconds."""
    folder.mkdir(parents=True, exist_ok=True)
    save_scenario(folder / "pad.npz", scenario())
    file = folder / "study.toml"
    file.write_text(STUDY.format(runs=runs, seed=seed, more=FAILING if fails else more, hold=hold), encoding="utf-8")
    return file


def sweep_here(file: Path, folder: Path, most: int | None = None) -> None:
    """Do in this process what the command does with many, or only so many runs of it; the report, a second each, is left out.

    Raises
    ------
    PalpateError
        As the command says it.
    """
    from palpate.core.errors import FileError
    from palpate.core.io.file_writing import writable_folder

    lock = FolderLock(writable_folder(folder, create=True), "sweep")
    try:
        opened = begin_study(file, folder, lambda blend, target: None)
        make_folders(folder)
        over = done_runs(folder) | failed_runs(folder)
        scenes = Scenes(folder)
        with run_batch(folder) as batch:
            answers = []
            for run in [run for run in opened.runs if run.digest not in over][:most]:
                answers.append(answer_to(scenes, run, batch.place))
                if answers[-1]["status"] == UNWRITABLE:
                    break
                if answers[-1]["status"] == DONE:
                    batch.add(run.digest)
        if answers and answers[-1]["status"] == UNWRITABLE:
            raise FileError(answers[-1]["sentence"])
        publish(folder, opened.runs)
    finally:
        lock.release()


def run_hashes(folder: Path) -> dict[str, str]:
    """Return a hash of each run in the shards of a study, wherever it stands there; the seconds that it took are left out."""
    shards = ShardIndex(folder / RUNS)
    found = {}
    runs = StoredRuns(folder)
    for digest in digests_in(folder / RUNS):
        record, frames = runs.record(digest), shards.read(digest)
        about = asdict(record) | {"folder": "", "seconds": 0.0}
        words, at = json.dumps(about, sort_keys=True).encode(), 8 + int.from_bytes(frames[:4], "little")
        layout = shards.common(json.loads(frames[8:at])["layout"])
        found[digest] = hashlib.sha256(b"".join((words, frames[at:], layout))).hexdigest()
    return found


def results(folder: Path) -> dict[str, str]:
    """Return what must be equal after any interruption: all files by their hashes, without times and without the report.

    Which runs stand in which shard depends on who computed them, so each run counts by itself. What is hidden is left out,
    except what a finished command should have removed.
    """
    found = {f"{RUNS}/{digest}": run for digest, run in run_hashes(folder).items()}
    for name, digest in tree(folder).items():
        if name in ("timings.csv", "report.html") or name.startswith(".palpate/") or name == ".palpate":
            continue
        is_whole = not any(part.startswith(".") for part in name.split("/"))  # a kill leaves halves in hidden folders
        if is_whole and name.startswith(f"{RUNS}/") and name.endswith(SUFFIX):
            continue
        if is_whole and name.startswith(f"{RUNS}/") and name.endswith("run.json"):
            words = json.loads((folder / name).read_bytes())
            words.pop("seconds")
            digest = hashlib.sha256(json.dumps(words, sort_keys=True).encode()).hexdigest()
        found[name] = digest
    return found
