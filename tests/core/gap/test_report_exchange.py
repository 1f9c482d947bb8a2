# SPDX-License-Identifier: GPL-3.0-or-later
"""A report takes the place of the earlier one as a whole, whenever it is stopped."""

import json
import shutil
from contextlib import suppress
from types import SimpleNamespace

import numpy as np
import pytest
from file_faults import KILL, Injector, Stopped

from palpate.core.errors import FileError
from palpate.core.gap.report import summary
from palpate.core.io import disk_space
from palpate.core.io.file_list import LIST_NAME
from palpate.core.io.file_writing import atomic_write
from palpate.core.jobs.job_runner import run_job

TRIAL = SimpleNamespace(time=np.zeros(1000))
PICTURES = {"old": ["gap", "map"], "new": ["gap", "loops"]}


def write_text(path, text):
    with atomic_write(path) as temporary:
        temporary.write_text(text)


@pytest.fixture
def report(monkeypatch):
    """Return a function that writes a report of plain text; an age stands for the diagnosis."""

    def draw(result, _errors, folder):
        for name in PICTURES[result.age]:
            for kind in summary.FILE_TYPES:
                write_text(folder / f"{name}.{kind}", result.age)
        return PICTURES[result.age]
        yield  # as the real one is a job

    monkeypatch.setattr(summary, "draw", draw)
    monkeypatch.setattr(summary, "amended_sensor", lambda result: result)
    monkeypatch.setattr(summary, "write_sensor", lambda path, result: write_text(path, result.age))
    monkeypatch.setattr(summary, "summary", lambda result, _errors, _experiment: result.age)

    def plan_after(result):
        """The old diagnosis leaves a pair open."""
        trajectory = SimpleNamespace(age=result.age)
        return SimpleNamespace(design=SimpleNamespace(trajectory=trajectory)) if result.age == "old" else None
        yield

    monkeypatch.setattr(summary, "plan_after", plan_after)
    monkeypatch.setattr(summary, "write_trajectory", lambda trajectory, path: write_text(path, trajectory.age))
    monkeypatch.setattr(summary, "headline", lambda *_: "")
    monkeypatch.setattr(summary, "html_report", lambda result, *_: result.age)

    def write(folder, age, trials=(TRIAL,)):
        rig = SimpleNamespace(trials=trials, texels=())
        run_job(summary.write_report(SimpleNamespace(age=age, rig=rig), folder, object()))

    return write


def ages(folder):
    return {path.name: path.read_text().strip('"\n') for path in folder.iterdir() if path.is_file() and path.name[0] != "."}


@pytest.mark.slow("writes a report once for each of its steps")
@pytest.mark.parametrize("kind", [KILL, "EIO"])
def test_stopped_at_every_step(report, tmp_path, kind):
    start = tmp_path / "start"
    start.mkdir()
    report(start, "old")
    (start / "notes.txt").write_text("mine")
    count = tmp_path / "count"
    shutil.copytree(start, count)
    with Injector(count) as injector:
        report(count, "new")
    new = ages(count)
    assert {"sensor.toml", "report.html", "gap.json", "loops.png"} < set(new) and "map.png" not in new
    assert "next_experiment.csv" in ages(start) and "next_experiment.csv" not in new
    stages = set()
    for number in range(1, len(injector.calls) + 1):
        copy = tmp_path / "copy"
        shutil.copytree(start, copy)
        with Injector(copy, number, kind), suppress(Stopped, FileError):
            report(copy, "new")
        found = set(ages(copy).values()) - {"mine"}
        assert len(found) <= 1, f"old and new files beside each other after {injector.calls[number - 1]}"
        if json.loads((copy / LIST_NAME).read_text())["exports"]["gap"]["complete"]:
            assert ages(copy) in (ages(start), new)
        stages |= found
        with Injector(copy):  # which spares the disk
            report(copy, "new")
        assert ages(copy) == new and new["notes.txt"] == "mine"
        assert [path.name for path in copy.glob(".*")] == [LIST_NAME]
        shutil.rmtree(copy)
    assert stages == {"old", "new"}


def test_a_full_disk_is_found_before_the_pictures_are_drawn(report, tmp_path, monkeypatch):
    report(tmp_path, "old")
    before = ages(tmp_path)
    free = summary.LEAST_BYTES + summary.SAMPLE_BYTES * 1e6
    monkeypatch.setattr(disk_space.shutil, "disk_usage", lambda _: SimpleNamespace(free=free))
    report(tmp_path, "old", trials=1000 * (TRIAL,))
    with pytest.raises(FileError, match="The report needs up to 50 MB"):
        report(tmp_path, "new", trials=1001 * (TRIAL,))
    assert ages(tmp_path) == before
