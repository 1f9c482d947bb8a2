# SPDX-License-Identifier: GPL-3.0-or-later
"""Studies whose runs a Python file computes, and the hidden-effect benchmark as one of them."""

import json
from pathlib import Path

import pytest
from command_runs import assert_succeeds
from small_study import begun

from palpate.commands import main
from palpate.core.errors import PalpateError
from palpate.core.study.study_file import study_of
from palpate.sweep.parts import Parts
from palpate.sweep.scripts import ALLOW
from palpate.sweep.study_folder import resume_study
from palpate.sweep.worker import RunComputer, compute_batch

pytest.importorskip("distributed")
parquet = pytest.importorskip("pyarrow.parquet")

STUDY = """format = "palpate-sweep/1"
name = "counts"
job = "count.py"
design = "grid"
[vary]
number = { choice = [1, 2, 3] }
word = { choice = ["ab", "abc"] }
twice = { same = "number", factor = 2 }
loud = true
"""
JOB = """
import json
from palpate.commands import main
from palpate.core.errors import PalpateError

def fingerprint():
    return "as it was"

def run(values, folder):
    if values["number"] == 3 and values["word"] == "ab":
        raise PalpateError("Three is too many.")
    (folder / "more").mkdir()
    (folder / "more" / "values.json").write_text(json.dumps(values))
    return {"product": values["number"] * len(values["word"]), "nothing": None}
"""


def write(folder: Path, text: str = STUDY, job: str = JOB) -> Path:
    (folder / "count.py").write_text(job, encoding="utf-8")
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return folder / "study.toml"


@pytest.mark.slow("the one study of a job from the command line in this tier")
def test_a_job_computes_its_runs(tmp_path, capsys):
    said = assert_succeeds("sweep", write(tmp_path), "--out", tmp_path / "out", "--allow-scripts", "--workers", 1)
    assert "6 runs: 5 done, 1 failed, 0 left" in said and "Three is too many." in said
    table = parquet.read_table(tmp_path / "out" / "runs.parquet").to_pylist()
    done = [row for row in table if row["status"] == "finished"]
    assert [row["metric.product"] for row in done] == [2.0, 3.0, 4.0, 6.0, 9.0]
    for row in done:
        assert row["varied.twice"] == 2 * row["varied.number"]
        written = json.loads((tmp_path / "out" / "runs" / row["digest"] / "more" / "values.json").read_text())
        assert written == {
            "loud": True,
            "number": row["varied.number"],
            "word": row["varied.word"],
            "twice": row["varied.twice"],
        }
    assert "metric.nothing" not in table[0]
    assert not (tmp_path / "out" / "dataset").exists()
    assert (tmp_path / "out" / "report.html").is_file()
    assert main(["sweep", str(tmp_path / "out")]) == 0  # nothing is left to run, so no Python is
    assert main(["sweep", str(tmp_path / "out"), "--retry-failed"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "--allow-scripts" in line


def test_a_job_needs_permission_and_nothing_of_it_is_run_before(tmp_path, capsys):
    file = write(tmp_path, job=f"open({str(tmp_path / 'mine')!r}, 'w')\n" + JOB)
    assert main(["sweep", str(file), "--out", str(tmp_path / "out")]) == 1
    assert capsys.readouterr().err == (
        "palpate sweep: The study runs the Python of 'count.py': add --allow-scripts if you trust the file.\n"
    )
    assert not (tmp_path / "out").exists()
    assert not (tmp_path / "mine").exists()
    folder = begun(write(tmp_path)).folder
    with pytest.raises(PalpateError, match="--allow-scripts"):
        RunComputer(resume_study(folder))


@pytest.mark.parametrize(
    ("returned", "sentence"),
    [
        ("{'product': float('nan')}", "Metric 'product' of run 0 is nan: give finite numbers, or None."),
        ("{'product': 'many'}", "Metric 'product' of run 0 is 'many': give finite numbers, or None."),
        ("[1]", "The job gave [1] for run 0: let its run() return metrics by name."),
        ("1 / 0", "A fault of the program: ZeroDivisionError: division by zero"),
        ("open(folder / 'missing')", "A fault of the program: RuntimeError: FileNotFoundError: "),
    ],
)
def test_what_a_job_does_wrong_is_a_failed_run(tmp_path, returned, sentence):
    opened = begun(write(tmp_path, job=f"def run(values, folder):\n    return {returned}\n"))
    found = compute_batch(range(len(opened.runs)), str(opened.folder), ALLOW)
    assert (found.done, found.failed) == (0, 6)
    assert found.failures[0][1].startswith(sentence)
    assert not len(Parts(opened.folder).done)
    assert not list((opened.folder / "runs").iterdir())


def test_a_job_that_takes_longer_than_its_limit_has_failed(tmp_path):
    opened = begun(write(tmp_path, job=JOB))
    found = compute_batch([0], str(opened.folder), ALLOW, limit=1e-9)
    assert found.failures == [(0, "Run 0 took longer than its limit of 1e-09 s: raise run_limit.")]


def test_a_job_that_is_none_begins_nothing(tmp_path):
    for job, word in (("raise ValueError('no')", "ValueError: no"), ("run = 3", "has no function run"), ("def", "SyntaxError")):
        with pytest.raises(PalpateError, match=word):
            begun(write(tmp_path, job=job))
        assert not any((tmp_path / "out").iterdir())


def test_a_changed_job_is_refused(tmp_path):
    file = write(tmp_path)
    opened = begun(file)
    assert list(resume_study(opened.folder).runs) == list(begun(file).runs) == list(opened.runs)
    write(tmp_path, job=JOB.replace("Three", "3"))
    with pytest.raises(PalpateError, match=r"count.py' has changed since the study"):
        begun(file)
    (opened.folder / "scenes" / "count.py").write_text(JOB.replace("Three", "3"), encoding="utf-8")
    with pytest.raises(PalpateError, match="is not the one that the study began with"):
        resume_study(opened.folder)


def test_what_a_job_calls_may_not_change_either(tmp_path):
    (tmp_path / "state").write_text("1")
    job = JOB.replace('"as it was"', f"open({str(tmp_path / 'state')!r}).read()")
    opened = begun(write(tmp_path, job=job))
    assert compute_batch([0], str(opened.folder), ALLOW).done == 1
    (tmp_path / "state").write_text("2")
    with pytest.raises(PalpateError, match="What the job 'count.py' computes with is not what the study in "):
        RunComputer(opened).result(1)  # no other run can be computed, so the study stops


def test_words_of_scenes_mean_nothing_to_a_job():
    table = {"format": "palpate-sweep/1", "job": "count.py", "design": "random", "samples": 1}
    assert study_of(table, "s").is_job
    for word, value in (("fps", 10), ("images", True), ("press", {})):
        with pytest.raises(PalpateError, match=f"{word} of 's' has no meaning for a job"):
            study_of({**table, word: value}, "s")
    with pytest.raises(PalpateError, match="one of them"):
        study_of({**table, "scene": "a.blend"}, "s")
