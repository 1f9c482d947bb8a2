# SPDX-License-Identifier: GPL-3.0-or-later
"""A report takes the place of the earlier one as a whole, whenever it is stopped."""

import errno
import os
from types import SimpleNamespace

import pytest

from palpate.core.errors import FileError
from palpate.core.gap.report import summary
from palpate.core.io.file_writing import atomic_write
from palpate.core.io.hidden_folder import LIST_NAME
from palpate.core.jobs import run_job

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
    monkeypatch.setattr(summary, "summary", lambda result, _errors, _experiment, _notes: result.age)

    def plan_after(result):
        """The old diagnosis leaves a pair open."""
        trajectory = SimpleNamespace(age=result.age)
        return SimpleNamespace(trajectory=trajectory) if result.age == "old" else None
        yield

    monkeypatch.setattr(summary, "plan_after", plan_after)
    monkeypatch.setattr(summary, "write_trajectory", lambda trajectory, path: write_text(path, trajectory.age))
    monkeypatch.setattr(summary, "headline", lambda *_: "")
    monkeypatch.setattr(summary, "html_report", lambda result, *_: result.age)

    def write(folder, age):
        run_job(summary.write_report(SimpleNamespace(age=age), folder, object()))

    return write


def ages(folder):
    return {path.name: path.read_text().strip('"\n') for path in folder.iterdir() if path.is_file() and path.name[0] != "."}


def test_a_report_takes_the_place_of_the_earlier_one(report, tmp_path):
    report(tmp_path, "old")
    (tmp_path / "notes.txt").write_text("mine")
    assert "next_experiment.csv" in ages(tmp_path) and "map.png" in ages(tmp_path)
    report(tmp_path, "new")
    found = ages(tmp_path)
    assert found.pop("notes.txt") == "mine" and set(found.values()) == {"new"}
    assert {"sensor.toml", "report.html", "gap.json", "loops.png"} < set(found)
    assert "map.png" not in found and "next_experiment.csv" not in found
    assert [path.name for path in tmp_path.glob(".*")] == [LIST_NAME]


def test_a_full_disk_is_one_sentence_and_leaves_the_earlier_report(report, tmp_path, monkeypatch):
    report(tmp_path, "old")
    before = ages(tmp_path)

    def full(path, _result):
        with atomic_write(path):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(summary, "write_sensor", full)
    with pytest.raises(FileError, match="sensor.toml.*no space left on device.*free some space"):
        report(tmp_path, "new")
    assert ages(tmp_path) == before


def test_a_plan_that_fails_takes_no_finished_result_with_it(report, tmp_path, monkeypatch):
    told = []

    def plan_after(_result):
        raise FileError("0.1 N do not rest on the sensor.")
        yield

    monkeypatch.setattr(summary, "plan_after", plan_after)
    monkeypatch.setattr(summary, "summary", lambda result, _errors, experiment, notes: told.append((experiment, notes)))
    report(tmp_path, "old")
    assert told == [(None, ["No further recording was planned: 0.1 N do not rest on the sensor."])]
    assert (tmp_path / "gap.json").exists() and not (tmp_path / "next_experiment.csv").exists()
