# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m palpate.sweep.child FOLDER [SCRIPTS]``: computes runs of a study, one for each line of standard input.

A line is a run as JSON, with the folder of the batch that it is written into; the answer is a line of JSON on standard output.
The process ends when its input does, at once: whoever started it is gone then, and an unfinished run is computed again.
"""

from __future__ import annotations

import json
import os
import queue
import sys
import threading
import time
import traceback
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, TextIO

from ..core.errors import FileError, PalpateError
from ..core.model.recording import Recording
from ..core.model.scenario import Scenario
from ..core.model.shared_results import SharedResults
from ..core.study.metrics import metrics_of
from ..core.study.presses import Press
from ..core.study.run_files import STUDY_NAME, write_failure, write_packed_run, write_run
from ..core.study.run_placement import place_run
from ..core.study.run_record import RunRecord
from ..core.study.scene_property import is_scene_property, scene_values
from ..core.study.study_file import SCENE, Plan, Run, Study, at_rate, read_study
from ..core.study.variation import PRESS, varied_scenario
from .encoded_run import encode_run, layout_name, pack_layout, pack_run
from .features import FrameStyle, Layout, solved_frames
from .program import Program, frozen_program, require_allowed
from .scene_evaluation import REFUSE, SceneReader
from .study_scenes import frozen_meshes, plan_of

DONE, FAILED, UNWRITABLE = "done", "failed", "unwritable"
"""What became of a run; the last one: its files could not be written, so no run can be."""


class Scenes:
    """The scenes of a study, each read when a run first needs it.

    Attributes
    ----------
    folder : Path
        Of the study.
    study : Study
    shared : SharedResults
        What the runs of this process have in common.
    """

    def __init__(self, folder: Path, scripts: str = REFUSE):
        self.folder = folder
        self.study: Study = read_study(folder / STUDY_NAME)
        self._reader = SceneReader(folder, scripts)
        self._meshes = frozen_meshes(self.study, folder)
        require_allowed(self.study, scripts)
        self._plans: dict[str, Plan] = {}
        self._programs: dict[str, Program] = {}
        self._layouts: dict[str, Layout] = {}
        self.shared = SharedResults()

    def plan(self, scene: str) -> Plan:
        """Return what the study means on a scene."""
        if scene not in self._plans:
            self._plans[scene] = plan_of(self.study, self.folder, scene, self._meshes)
        return self._plans[scene]

    def program(self, name: str) -> Program:
        """Return the program of a study that has no scene."""
        if name not in self._programs:
            self._programs[name] = frozen_program(self.study, self.folder, name)
        return self._programs[name]

    def layout(self, found: Layout) -> Layout:
        """Return the first layout that is equal, so that what follows from it is computed once."""
        return self._layouts.setdefault(found.digest, found)

    def scenario(self, scene: str, values: Mapping[str, Any]) -> Scenario:
        """Return the scenario of a scene with the values of a run; it is read again where they have properties of the scene."""
        plan, read_with = self.plan(scene), scene_values(values)
        assert plan.scenario is not None  # but for a program
        scenario = at_rate(self._reader.read(scene, read_with), self.study.fps) if read_with else plan.scenario
        rest = {name: value for name, value in values.items() if not is_scene_property(name)}
        return varied_scenario(scenario, rest, plan.press, plan.meshes, self.shared)


def compute_run(scenes: Scenes, run: Run, place: Path) -> None:
    """Compute a run and write it into the folder of a batch (:class:`.RunBatch`).

    Raises
    ------
    PalpateError
        Its values make no run.
    """
    from ..core.solver.simulation import Simulation

    began = time.perf_counter()
    plan = scenes.plan(run.scene)
    values = {**plan.fixed, **{name: value for name, value in run.values.items() if name != SCENE}}
    if scenes.study.is_job:
        found = scenes.program(run.scene)
        place_run(place, run, lambda own: found.run(values, own), time.perf_counter)
        return
    scenario = scenes.scenario(run.scene, values)
    # Only the files of a recording say the digest of their scenario.
    recording = Simulation(scenario, threads=1, shared=scenes.shared).advance_all(with_digest=scenes.study.has_folders)
    made: Press | None = plan.press
    if made is not None:
        start = f"{PRESS}."
        own: dict[str, Any] = {name[len(start) :]: value for name, value in values.items() if name.startswith(start)}
        made = replace(made, **own)
    metrics = metrics_of(scenario, recording, made)
    seconds = time.perf_counter() - began
    if scenes.study.has_folders:
        write_run(place, run, scenario, recording, metrics, seconds, scenes.study.images, scenes.shared)
        return
    numbers = RunRecord(place, run.digest, run.index, dict(run.values), metrics, seconds, tuple(recording.sensors))
    pack_frames(scenes, place, run, scenario, recording, numbers)


def pack_frames(scenes: Scenes, place: Path, run: Run, scenario: Scenario, recording: Recording, numbers: RunRecord) -> None:
    """Encode the frames of a run and write them with its numbers into the folder of a batch, for a shard.

    Raises
    ------
    FileError
        The file cannot be written, or a number is too large for 32 bits.
    """
    frames = encode_run(solved_frames(scenario, recording, numbers, scenes.shared, FrameStyle.of(scenes.study)))
    common = scenes.shared.of(pack_layout, scenes.layout(frames.layout))
    content = pack_run(replace(numbers, frames=frames.rows), frames)
    write_packed_run(place, run, content, layout_name(frames.layout), common)


def answer_to(scenes: Scenes, run: Run, place: Path) -> dict[str, Any]:
    """Compute a run and return what became of it; a failure is written to the folder of failures."""
    began = time.perf_counter()
    answer: dict[str, Any] = {"digest": run.digest, "status": DONE}
    try:
        try:
            compute_run(scenes, run, place)
        except FileError:
            raise
        except PalpateError as error:
            answer |= {"status": FAILED, "sentence": str(error)}
            write_failure(scenes.folder, run.digest, str(error))
        except MemoryError:
            answer |= {"status": FAILED, "sentence": "There is not enough memory for this run: use fewer workers."}
            write_failure(scenes.folder, run.digest, answer["sentence"])
        except Exception as error:
            answer |= {"status": FAILED, "sentence": f"A fault of the program: {type(error).__name__}: {error}"}
            write_failure(scenes.folder, run.digest, answer["sentence"], traceback.format_exc())
    except FileError as error:
        answer |= {"status": UNWRITABLE, "sentence": str(error)}
    return answer | {"seconds": time.perf_counter() - began}


def run_from(words: Mapping[str, Any]) -> Run:
    """Return the run that a line of JSON says."""
    return Run(int(words["index"]), str(words["scene"]), dict(words["values"]), str(words["digest"]))


def _lines() -> queue.Queue[str]:
    """Return a queue of the lines of standard input; the process ends with them."""
    lines: queue.Queue[str] = queue.Queue()

    def read() -> None:
        for line in sys.stdin:
            lines.put(line)
        os._exit(0)

    threading.Thread(target=read, name="palpate sweep input", daemon=True).start()
    return lines


def _own_output() -> TextIO:
    """Return standard output for the answers, and send what anything else prints there to standard error."""
    output = os.fdopen(os.dup(1), "w", encoding="utf-8", buffering=1)
    os.dup2(2, 1)
    return output


def _end_first_without_memory() -> None:
    """Let Linux end this process, and not its worker or the scheduler, where the machine's memory is used up."""
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text("500", encoding="ascii")


def main() -> None:
    """Answer lines until there are no more."""
    output = _own_output()
    _end_first_without_memory()
    try:
        scenes = Scenes(Path(sys.argv[1]), *sys.argv[2:3])
    except PalpateError as error:
        print(json.dumps({"status": UNWRITABLE, "sentence": str(error)}), file=output, flush=True)
        return
    lines = _lines()
    from ..core.solver import precompile

    if not scenes.study.is_job:
        precompile.compile_solver()  # loads what was compiled, so that the first run is as fast as the others
    print(json.dumps({"status": "ready"}), file=output, flush=True)
    while True:
        words = json.loads(lines.get())
        answer = answer_to(scenes, run_from(words), Path(words["place"]))
        print(json.dumps(answer), file=output, flush=True)


if __name__ == "__main__":
    main()
