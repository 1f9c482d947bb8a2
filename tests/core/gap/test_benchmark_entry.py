# SPDX-License-Identifier: GPL-3.0-or-later
"""The hidden-effects benchmark as others use it: cases as rigs, answers as files, one table."""

import re
import sys

import numpy as np
import pytest

from palpate.benchmarks import __main__ as benchmarks
from palpate.benchmarks import _entry, _rows
from palpate.benchmarks._hidden import cases
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


@pytest.mark.long("draws a case of each of the eight kinds")
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
    assert set(re.findall(r"^\| `(\w+)` \| \d+ \|", page, re.MULTILINE)) >= set(_rows.MIX)


@pytest.mark.long("draws a case of each of the eight kinds")
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


@pytest.mark.long("draws a case of each of the eight kinds")
def test_a_method_from_a_file_answers_is_resumed_and_scored(folder, tmp_path, capsys, monkeypatch):
    (tmp_path / "mine.py").write_text(METHOD, encoding="utf-8")
    (tmp_path / "beside.py").write_text('NAMES = ["creep"]\n', encoding="utf-8")
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
