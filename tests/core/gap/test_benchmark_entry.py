# SPDX-License-Identifier: GPL-3.0-or-later
"""The hidden-effects benchmark as others use it: cases as rigs, answers as files, one table; and the methods that learn."""

import csv
import json
import re
import sys

import numpy as np
import pytest

from palpate.benchmarks import __main__ as benchmarks
from palpate.benchmarks import _entry, _learned, _rows, _simulated
from palpate.benchmarks._hidden import cases, conditions
from palpate.core.gap.dataset.rig import read_rig

METHOD = """
from __future__ import annotations
from dataclasses import dataclass
from beside import NAMES


@dataclass
class Said:
    names: list[str]


def says_creep(rig):
    return (Said(NAMES).names, 0.8) if rig.parent.name != "000" else ((), None)


def says_hum(rig):
    return ["hum"], 0.5
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Eight cases, one of each row."""
    folder = tmp_path_factory.mktemp("benchmark") / "cases"
    assert benchmarks.main(["gap", "--write", str(folder), "--cases", "4", "--first", "20"]) == 0
    return folder


def entry(cases_there, said):
    """Answers as a file has them."""
    return {
        case: _entry.Answer(tuple(names), probability) for case, (names, probability) in zip(cases_there, said, strict=True)
    }


@pytest.mark.slow("draws the cases that all tests of this file share")
def test_every_row_is_written_and_no_rig_tells_which(folder):
    hidden = _entry.read_hidden(folder)
    assert sorted(one.kind for one in hidden.values()) == sorted(_rows.MIX)
    assert [one.kind for one in hidden.values()] != [kind for kind, _ in _rows.plan_of(4, 20)]
    for case, one in hidden.items():
        rig = folder / "rigs" / case / "rig.toml"
        text = rig.read_text(encoding="utf-8")
        assert f'name = "{case}"' in text and str(one.number) not in text.splitlines()[1]
        assert one.names == cases.answer_of(one.kind, one.number)
    rig = read_rig(folder / "rigs" / "003" / "rig.toml")
    np.testing.assert_allclose(
        rig.trials[1].reading, cases.draw(hidden["003"].kind, hidden["003"].number).readings[1], rtol=1e-5, atol=1e-6
    )


@pytest.mark.long("draws a case of each of the eight kinds")
def test_an_answer_follows_from_kind_and_number_alone():
    for kind in _rows.MIX:
        assert cases.answer_of(kind, 7) == cases.draw(kind, 7).answer


def test_the_page_has_the_checksums_of_the_public_part(repository):
    page = (repository / "docs" / "gap-results.md").read_text(encoding="utf-8")
    for count in (78, sum(_rows.MIX.values())):
        assert f"| {count} | `{_entry.checksum_of(_entry.hidden_text(count, 0))}` |" in page
    assert set(re.findall(r"^\| `(\w+)` \| \d+ \|", page, re.MULTILINE)) == {*_rows.MIX, *conditions.CONDITIONS}


def test_a_changed_file_of_what_is_hidden_is_refused(folder, tmp_path):
    for name in (_entry.HIDDEN, _entry.CHECKSUM):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    assert _entry.read_hidden(tmp_path) == _entry.read_hidden(folder)
    text = (tmp_path / _entry.HIDDEN).read_text(encoding="utf-8")
    (tmp_path / _entry.HIDDEN).write_text(text.replace("own", "none"), encoding="utf-8")
    with pytest.raises(SystemExit, match="has changed since it was written"):
        _entry.read_hidden(tmp_path)
    with pytest.raises(SystemExit, match=r"has no hidden\.csv"):
        _entry.read_hidden(tmp_path / "elsewhere")
    with pytest.raises(SystemExit, match="not empty"):
        _entry.write_cases(tmp_path, 4, 20)


def test_a_method_from_a_file_answers_is_resumed_and_scored(folder, tmp_path, capsys, monkeypatch):
    (tmp_path / "mine.py").write_text(METHOD, encoding="utf-8")
    (tmp_path / "beside.py").write_text('NAMES = ["creep"]\n', encoding="utf-8")
    (tmp_path / "words.txt").write_text("no code\n", encoding="utf-8")
    monkeypatch.setattr(sys, "path", [*sys.path])
    out = tmp_path / "mine.csv"
    arguments = ["gap", "--answer", f"{tmp_path / 'mine.py'}:says_creep", "--of", str(folder), "--out", str(out)]
    assert benchmarks.main(arguments) == 0
    rows = out.read_text(encoding="utf-8").splitlines()
    assert rows[:3] == ["case,said,probability", "000,nothing,", "001,creep,0.8000"] and len(rows) == 9
    out.write_text("\n".join(rows[:4]) + "\n", encoding="utf-8")  # stopped there
    assert benchmarks.main(arguments) == 0 and out.read_text(encoding="utf-8").splitlines() == rows
    capsys.readouterr()
    assert benchmarks.main(["gap", "--score", str(out), "--of", str(folder)]) == 0
    printed = capsys.readouterr().out
    assert "| hidden | cases | mine |" in printed and "Right / wrong of 8 cases" in printed
    with pytest.raises(SystemExit, match="'hum' is no effect"):
        benchmarks.main([*arguments[:1], "--answer", f"{tmp_path / 'mine.py'}:says_hum", *arguments[3:5], "--out", "new.csv"])
    with pytest.raises(SystemExit, match="no function 'absent'"):
        _entry.method_named(f"{tmp_path / 'mine.py'}:absent")
    with pytest.raises(SystemExit, match="is no Python file"):
        _entry.method_named(f"{tmp_path / 'words.txt'}:says")
    with pytest.raises(SystemExit, match="no method 'divination'"):
        _entry.method_named("divination")


def test_what_counts_as_right_in_each_row():
    hidden = {
        "000": _entry.Hidden("own", 1, ["creep"]), "001": _entry.Hidden("none", 1, []),
        "002": _entry.Hidden("two", 1, ["creep", "lag"]), "003": _entry.Hidden("three", 1, ["creep", "lag", "wear"]),
        "004": _entry.Hidden("outside", 1, ["hum"]), "005": _entry.Hidden("poor", 1, ["lag"]),
    }  # fmt: skip
    good = [(["creep"], 0.95), (["nothing"], 1.0), (["creep", "lag"], 0.9), (["lag", "wear"], 0.6), (["unknown"], None)]
    good.append((["unknown"], None))
    bad = [(["lag"], 0.95), (["drift"], 0.5), (["creep"], 0.9), (["lag"], None), (["noise"], 0.9), (["creep"], 0.9)]
    answers = {"good": entry(hidden, good), "bad": entry(hidden, bad), "silent": {}}
    text = _entry.table(hidden, answers)
    rows = {line.split(" | ")[0].strip("| "): line.split(" | ")[2:] for line in text.splitlines() if line.startswith("|")}
    one, nothing, two, three, outside, poor = (
        [cell.strip(" |") for cell in rows[_rows.ROWS[kind][0]]] for kind in ("own", "none", "two", "three", "outside", "poor")
    )
    assert one == ["1 / 0", "0 / 1", "0 / 0"] and nothing == ["1 / 0", "0 / 1", "0 / 0"]
    assert two == ["1 / 0", "0 / 0", "0 / 0"] and three == ["1 / 0", "0 / 0", "0 / 0"]
    assert outside == ["1 / 0", "0 / 1", "1 / 0"] and poor == ["0 / 0", "0 / 1", "0 / 0"]
    assert "silent has not answered 6 of them, which counts as unknown" in text
    sure = next(line for line in text.splitlines() if "or more" in line)
    assert "2 of 2" in sure and "1 of 4" in sure
    brier = next(line for line in text.splitlines() if "Brier" in line)
    expected = [np.mean([0.05**2, 0.1**2, 0.4**2]), np.mean([0.95**2, 0.5**2, 0.1**2, 0.9**2, 0.9**2])]
    assert all(f"{value:.2f}" in brier for value in expected)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("000,creep,2", "line 2: the probability is '2'"),
        ("000,creep,nan", "line 2: the probability is 'nan'"),
        ("000,unknown+creep,", "line 2: 'unknown' is no effect"),
        ("900,creep,", "line 2: there is no case '900'"),
        ("000,creep,\n000,lag,", "line 3: case 000 is answered twice"),
    ],
)
def test_mistakes_in_answers_are_told_with_their_line(tmp_path, rows, message):
    path = tmp_path / "mine.csv"
    path.write_text(f"case,said,probability\n{rows}\n", encoding="utf-8")
    with pytest.raises(SystemExit, match=message):
        _entry.read_answers(path, ["000", "001"])


def test_answers_as_json_are_those_of_csv(tmp_path):
    (tmp_path / "a.csv").write_text("case,said,probability\n000,creep + lag,0.7\n001,nothing,\n", encoding="utf-8")
    table = {"000": {"said": ["creep", "lag"], "probability": 0.7}, "001": []}
    (tmp_path / "a.json").write_text(json.dumps(table), encoding="utf-8")
    known = ["000", "001"]
    assert _entry.read_answers(tmp_path / "a.csv", known) == _entry.read_answers(tmp_path / "a.json", known)


def test_groups_without_options_take_none(capsys):
    with pytest.raises(SystemExit):
        benchmarks.main(["bake", "--write", "x"])
    assert "unrecognized arguments" in capsys.readouterr().err


# --- the methods that learn


def test_features_of_a_file_are_those_of_the_case(tmp_path):
    """Files have seven digits: that moves no feature by more than a twentieth."""
    case = cases.draw("simulated", 5)
    trials = list(zip(case.times, case.paths, case.readings, case.forces, strict=True))
    here = _simulated.features(case.probe, trials)
    there = _simulated.features(*_simulated.read(cases.write(case, tmp_path)))
    assert np.isfinite(here).all() and here.shape == there.shape
    np.testing.assert_allclose(there, here, atol=0.05)


def test_simulations_are_kept_gone_on_with_and_apart_from_all_tested_cases(tmp_path, monkeypatch):
    monkeypatch.setenv("PALPATE_GAP_PROCESSES", "1")
    made = []

    def simulated(number):
        made.append(number)
        return {"number": number, "features": [float(number), 1.0], "answer": ["creep"] if number % 2 else []}

    class Pool:
        def __init__(self, *_):
            pass

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        map = staticmethod(map)

    monkeypatch.setattr(_simulated, "_simulated", simulated)
    monkeypatch.setattr(_simulated, "ProcessPoolExecutor", Pool)
    values, holds = _simulated.simulations(3, 100, tmp_path)
    more, _ = _simulated.simulations(5, 100, tmp_path)
    assert made == [100, 101, 102, 103, 104] and np.array_equal(more[:3], values)
    assert [_simulated.LABELS[row.argmax()] for row in holds] == ["nothing", "creep", "nothing"] and (
        holds.sum(axis=1) == 1
    ).all()
    assert "simulated" not in _rows.MIX  # a kind of its own: no number of it is tested


def separable(count=240, seed=3):
    """Features of which each effect moves one of its own, with noise: what any method that learns must learn."""
    rng = np.random.default_rng(seed)
    holds = np.zeros((count, len(_simulated.LABELS)), bool)
    for row in holds:
        row[rng.choice(6, size=rng.integers(0, 3), replace=False)] = True
        row[-1] = not row.any()
    return holds[:, :-1] * 3.0 + 0.2 * rng.normal(size=(count, len(_simulated.LABELS) - 1)), holds


@pytest.mark.slow("learns from simulations")
@pytest.mark.parametrize("method", ["classifier", "nearest_simulated"])
def test_methods_learn_what_can_be_learnt(monkeypatch, method):
    """Nine of ten cases that were not learnt from are named exactly, and a case of no known effect by chance alone."""
    if method == "classifier":
        pytest.importorskip("sklearn", reason="scikit-learn is in palpate[bench]: the classifier is not tested without it")
    values, holds = separable()
    monkeypatch.setattr(_learned, "simulations", lambda: (values, holds))
    monkeypatch.setattr(_learned, "read", lambda rig: (rig,))
    monkeypatch.setattr(_learned, "features", lambda one: one)
    for cached in (_learned._forest, _learned._crowd):
        cached.cache_clear()
    try:
        fresh, truth = separable(30, seed=4)
        right = 0
        for one, row in zip(fresh, truth, strict=True):
            names, probability = getattr(_learned, method)(one)
            assert 0.0 <= probability <= 1.0
            right += list(names) == [label for label, there in zip(_simulated.LABELS[:-1], row, strict=False) if there]
        assert right >= 27
    finally:
        for cached in (_learned._forest, _learned._crowd):
            cached.cache_clear()


def test_what_is_said_of_shares():
    shares = np.zeros(len(_simulated.LABELS))
    shares[[0, 2, -1]] = 0.8, 0.6, 0.1
    names, probability = _learned._said(shares, 0.5)
    assert names == (_simulated.LABELS[0], _simulated.LABELS[2]) and probability == pytest.approx(0.48)
    shares[:] = 0.1
    assert _learned._said(shares, 0.5) == (_learned.UNKNOWN, pytest.approx(0.9))
    shares[-1] = 0.7
    assert _learned._said(shares, 0.5) == ((), pytest.approx(0.7))


def test_all_methods_are_compared_and_one_that_raises_has_failed(monkeypatch, folder, tmp_path):
    def careful(rig):
        return _learned.UNKNOWN, None

    def fails(rig):
        raise RuntimeError("no")

    monkeypatch.setattr(_entry, "METHODS", {"careful": careful, "fails": fails})
    monkeypatch.setattr(_rows, "HOUSE", tmp_path)
    monkeypatch.setattr(_rows, "fingerprint", lambda: "same")
    kept = tmp_path / "build" / "gap" / "compare-20-4-same"
    kept.parent.mkdir(parents=True)
    kept.symlink_to(folder)
    text = _entry.compare(4, 20, ["careful", "fails"])
    with (kept / "answers" / "fails.csv").open(encoding="utf-8", newline="") as file:
        assert {row["said"] for row in csv.DictReader(file)} == {"failed"}
    assert f"| {_rows.ROWS['outside'][0]} | 1 | 1 / 0 | 0 / 0 |" in text and " / 1 |" not in text


def test_runs_of_the_study_are_answers(folder, tmp_path, capsys):
    hidden = _entry.read_hidden(folder)
    for i, one in enumerate(hidden.values()):
        run = tmp_path / "hidden" / "runs" / str(i)
        run.mkdir(parents=True)
        names = one.names if one.kind == "own" else []
        said = [[name, "form", 0.9] for name in names] + [["offset", "common", 0.25]]
        verdict = "no gap" if one.kind == "none" else "explained"
        case = {"kind": one.kind, "number": one.number, "sure": names, "said": said, "verdict": verdict}
        (run / _rows.CASE_NAME).write_text(json.dumps(case) + "\n", encoding="utf-8")
    answers = _entry.answers_of_study(tmp_path / "hidden", hidden)
    by_kind = {one.kind: answers[case] for case, one in hidden.items()}
    assert by_kind["own"].said == tuple(next(one.names for one in hidden.values() if one.kind == "own"))
    assert by_kind["own"].probability == 0.9
    assert by_kind["none"].said == ("nothing",) and by_kind["two"].said == by_kind["outside"].said == ("unknown",)
    assert benchmarks.main(["gap", "--score", str(tmp_path / "hidden"), "--of", str(folder)]) == 0
    assert f"| {_rows.ROWS['own'][0]} | 1 | 1 / 0 |" in capsys.readouterr().out
    with pytest.raises(SystemExit, match="no folder of the study"):
        _entry.answers_of_study(tmp_path, hidden)


def test_the_base_model_that_other_methods_begin_with_names_nothing(folder):
    base = _entry._base(next((folder / "rigs").glob("*/rig.toml")))
    assert base.findings == [] and base.base.model.effects == () and base.base.sse.sum() > 0.0
