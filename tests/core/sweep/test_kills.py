# SPDX-License-Identifier: GPL-3.0-or-later
"""A study whose driver, scheduler and workers are killed at random ends with the table of an undisturbed one."""

import os
import random
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path

import pytest
from command_runs import LONGEST, assert_succeeds, command
from small_study import begun, rows_of, tree, write_study

from palpate.core.study.study_file import counted_runs
from palpate.sweep.parts import Parts
from palpate.sweep.worker import compute_batch

pytest.importorskip("distributed")
pytest.importorskip("pyarrow")
psutil = pytest.importorskip("psutil")

KILLS, SEED, LATEST = 20, 41, 3.0
"""Kills, and the seconds before each at most; half of them wait for the next part, the others mostly hit a start."""
RUNS = 3000
"""A batch is an eighth of what is to be computed, and a kill follows each part at once: 20 kills come before the end."""
FATAL = """
import os, time
from pathlib import Path
def run(values, folder):
    with open(Path(__file__).with_name("calls"), "a") as file:
        file.write(f"{values['number']:.0f} ")
    time.sleep(0.1)
    if values["number"] == 25:
        os._exit(9)
    return {"double": 2.0 * values["number"]}
"""
HUNGRY = FATAL.replace("os._exit(9)", "kept = []\n        while True:\n            kept.append(bytearray(1 << 22))")
JOB = 'format = "palpate-sweep/1"\njob = "job.py"\ndesign = "grid"\n{more}[vary]\nnumber = {{ choice = [{numbers}] }}\n'


def processes_of(process: subprocess.Popen) -> list:
    """The process and all that it has started, the last ones first."""
    with suppress(psutil.Error):
        own = psutil.Process(process.pid)
        return [*reversed(own.children(recursive=True)), own]
    return []


def lose(process: subprocess.Popen) -> None:
    """Kill a process and all that it has started, as if its machine was gone, and wait until they have ended."""
    for one in processes_of(process):
        with suppress(psutil.Error):
            one.kill()
    process.wait()


@contextmanager
def started(*words: str) -> Iterator[subprocess.Popen]:
    """A process that is killed with all that it has started when the body ends."""
    process = subprocess.Popen(
        [sys.executable, "-m", *words], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    try:
        yield process
    finally:
        lose(process)
        process.communicate()


def until(condition: Callable[[], bool], what: str) -> None:
    end = time.monotonic() + LONGEST
    while not condition():
        assert time.monotonic() < end, f"{what} takes longer than {LONGEST:.0f} s"
        time.sleep(0.02)


def wait(seconds: float, condition: Callable[[], bool]) -> None:
    """Wait for some time, at most until the condition holds."""
    end = time.monotonic() + seconds
    while time.monotonic() < end and not condition():
        time.sleep(0.02)


def has_moved(out: Path, before: tuple[int, int], driver: subprocess.Popen) -> bool:
    return counted_runs(out) != before or driver.poll() is not None


def free_port() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return str(probe.getsockname()[1])


def undisturbed(folder: Path, runs: int) -> tuple[list[dict], dict[str, str]]:
    """Return the rows of a study that is computed in this process, and hashes of its dataset."""
    from palpate.sweep.dataset import publish

    opened = begun(write_study(folder, runs, fails=True, hold=0.5))
    compute_batch(range(runs), str(opened.folder))
    publish(opened.folder, opened.study)
    return rows_of(opened.folder), tree(opened.folder / "dataset")


@pytest.mark.long("kills a study twenty times and computes it again")
def test_a_study_killed_twenty_times_has_the_table_of_an_undisturbed_one(tmp_path):
    """Of a scheduler and two workers that were started by hand, and the command, one is killed at a random moment."""
    study, out, dice, killed = (
        write_study(tmp_path / "own", RUNS, fails=True, hold=0.5),
        tmp_path / "out",
        random.Random(SEED),
        [],
    )
    with ExitStack() as files:
        alive: dict[str, subprocess.Popen] = {}

        def start(name: str, *words: str) -> None:
            if name not in alive or alive[name].poll() is not None:
                alive[name] = files.enter_context(started(*words))

        while len(killed) < KILLS and sum(counted_runs(out)) < RUNS:
            if "scheduler" not in alive or alive["scheduler"].poll() is not None:
                for name in alive:  # its workers wait for one at the same address
                    lose(alive[name])
                port = free_port()
                start("scheduler", "dask", "scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard")
            address = f"tcp://127.0.0.1:{port}"
            for name in ("worker 1", "worker 2"):
                more = ("--nworkers", "1", "--nthreads", "1", "--no-dashboard", "--local-directory", str(tmp_path / name))
                start(name, "dask", "worker", address, *more)
            start("driver", "palpate.commands", "sweep", str(study), "--out", str(out), "--scheduler", address)
            moved = partial(has_moved, out, counted_runs(out), alive["driver"])
            if dice.random() < 0.5:
                until(moved, "the next part")
            else:
                wait(dice.uniform(0.0, LATEST), moved)
            name = dice.choice([name for name in sorted(alive) if alive[name].poll() is None])
            lose(alive[name])
            killed.append((name, sum(counted_runs(out))))
    assert_succeeds("sweep", study, "--out", out, "--workers", 2)
    print(f"kills, and how many runs were over: {killed}; runs in {len(Parts(out).files)} parts")
    assert len(killed) == KILLS, f"the study was over after {len(killed)} kills: give it more runs"
    assert (rows_of(out), tree(out / "dataset")) == undisturbed(tmp_path / "expected", RUNS)


@pytest.mark.long("stops a study and computes it again")
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_a_stopped_study_goes_on_where_it_was(tmp_path):
    """A terminal's Ctrl-C reaches the whole group; what is done is not computed again."""
    study, out = write_study(tmp_path / "own", RUNS, fails=True, hold=0.5), tmp_path / "out"
    words = "sweep", study, "--out", out, "--workers", 2
    process = subprocess.Popen(command(*words), stderr=subprocess.PIPE, text=True, start_new_session=True)
    until(lambda: sum(counted_runs(out)) >= 10 or process.poll() is not None, "the first part")
    os.killpg(process.pid, signal.SIGINT)
    stderr = process.communicate(timeout=LONGEST)[1]
    assert process.returncode == 130, stderr
    assert stderr.splitlines()[-1] == "palpate sweep: stopped; the same command continues.", stderr
    assert "Traceback" not in stderr
    before = {path: path.read_bytes() for path in Parts(out).files}
    assert_succeeds(*words)
    assert before and all(path.read_bytes() == content for path, content in before.items())
    assert sum(counted_runs(out)) == RUNS, "a run was computed twice"
    assert rows_of(out) == undisturbed(tmp_path / "expected", RUNS)[0]


@pytest.mark.long("a run that ends its worker three times")
@pytest.mark.parametrize(("job", "more"), [(FATAL, ""), (HUNGRY, "run_memory = 600\n")])
def test_a_run_that_ends_its_worker_fails_alone(tmp_path, job, more):
    (tmp_path / "job.py").write_text(job, encoding="utf-8")
    study = tmp_path / "study.toml"
    study.write_text(JOB.format(more=more, numbers=", ".join(map(str, range(30)))), encoding="utf-8")
    said = assert_succeeds("sweep", study, "--out", tmp_path / "out", "--workers", 2, "--allow-scripts")
    assert "30 runs: 29 done, 1 failed, 0 left" in said
    (row,) = [row for row in rows_of(tmp_path / "out") if row["status"] == "failed"]
    advice = "raise run_memory, 600 MB" if more else "it may need more memory"
    assert row["message"] == f"Run 25 ended its worker each time that it was computed: {advice}, or vary less widely."
    calls = Counter((tmp_path / "out" / "scenes" / "calls").read_text().split())
    assert calls["25"] <= 3
    # Once each but for the batch of four that was lost, and perhaps one whose result was not yet taken.
    assert sum(count == 1 for count in calls.values()) >= 22
