# SPDX-License-Identifier: GPL-3.0-or-later
"""The hidden-effects benchmark: its generator and scores, and how others use it: cases as rigs, answers as files, one table."""

import ast
import re
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from palpate.benchmarks import __main__ as benchmarks
from palpate.benchmarks import _entry, _rows, gap
from palpate.benchmarks._hidden import cases, other, own, third, world
from palpate.core.effects.engine.registry import effect, library, names_where
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.forward.predictor import Model, Predictor


def test_the_generator_shares_nothing_with_the_package():
    allowed = {"__future__", "collections", "dataclasses", "pathlib", "zlib", "numpy", "scipy"}
    for path in Path(cases.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                assert {name.name.split(".")[0] for name in node.names} <= allowed, path
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 1 or (node.level == 0 and node.module.split(".")[0] in allowed), path


def test_every_effect_is_hidden_in_some_case():
    """The three families of formulas hide the same effects: all that need nothing but readings and forces.

    What needs more, as a clock or a column, is hidden by test_warm_up.py and test_temperature.py. A new effect is hidden once
    somebody who did not write its file has written other formulas of it.
    """
    hidden = set(other.MAKERS)
    assert hidden == set(own.OWN) == set(third.THIRD) and len(hidden) >= 20
    assert hidden <= set(names_where(lambda kind: not kind.needs))
    assert not set(other.OUTSIDE) & set(library())


def test_a_rig_is_read_and_does_not_tell_its_answer(tmp_path):
    case = cases.draw("own", 12)
    path = cases.write(case, tmp_path)
    rig = read_rig(path)
    assert [trial.use for trial in rig.trials] == ["fit"] * 4 + ["check"] * 2 and not rig.warnings
    for trial, reading in zip(rig.trials, case.readings, strict=True):
        np.testing.assert_allclose(trial.reading, reading, rtol=1e-6, atol=1e-6 * np.abs(reading).max())
    assert not any(word in path.read_text(encoding="utf-8") for word in (*case.answer, case.hidden[0].form))


def test_outcomes():
    say = gap.outcome
    assert say(["creep"], ["creep"], "explained", False) == "right"
    assert say(["creep"], ["lag"], "explained", False) == "wrong"
    assert say(["creep"], ["creep", "lag"], "explained", False) == "wrong"
    assert say(["creep"], [], "explained", True) == "ambiguous"
    assert say(["creep"], [], "unexplained", False) == "unexplained"
    assert say([], [], "no gap", False) == "no gap"
    assert say([], ["drift"], "explained", False) == "wrong"
    assert say(["creep", "lag"], ["lag"], "explained", False) == "part"
    assert say(["creep", "lag", "drift"], ["lag"], "explained", False) == "part"
    assert say(["creep", "lag", "drift"], ["lag", "drift"], "explained", True) == "right"
    assert say(["creep", "lag", "drift"], ["lag", "drift", "wear"], "explained", False) == "wrong"


def test_net_force_under_a_sliding_ball_is_that_of_the_other_code(tmp_path):
    """The other code takes several steps from sample to sample; where the two differ is a quarter of the force's noise."""
    case = cases.draw("none", 2)
    rig = read_rig(cases.write(case, tmp_path))
    names = ("k", "cn", "mus", "mud", "x0", "sigma0", "sigma1", "ct", "gain", "zero")
    true = Model(replace(rig.parameters, **{name: getattr(case.pad, name) for name in names}))
    for trial, (reading, force), measured in zip(rig.trials, case.clean, case.forces, strict=True):
        found = Predictor(trial, rig).predict(true)
        assert np.sqrt(np.mean((found.force - force) ** 2)) < 0.25 * np.std(measured - force)
        assert np.abs(found.reading - reading).max() < 0.01 * np.ptp(reading)


def test_a_cover_leaves_the_net_force_as_it_is():
    """A cover spreads what texels carry, and neither the touch of its outer face nor the friction there."""
    number = next(number for number in range(99) if cases.answer_of("other", number) == ["load-spreading"])
    case = cases.draw("other", number)
    touched = world.touch(case.probe, case.pad, case.times[3], case.paths[3])
    spread, plain = (world.respond(touched, case.pad, hidden) for hidden in (case.hidden, ()))
    np.testing.assert_array_equal(world.net_force(spread), world.net_force(plain))
    assert np.abs(spread.reading - plain.reading).max() > 0.01 * np.ptp(plain.reading)


@pytest.mark.parametrize("family", [own.OWN, other.MAKERS, third.THIRD], ids=["own", "other", "third"])
def test_no_hidden_effect_generates_energy(family):
    """The work of the probe on the pad is not negative, within the error of the trapezoidal rule."""
    time = np.arange(900) / 50.0
    depth = 3e-3 * np.maximum(np.sin(2.0 * np.pi * time / 6.0), -0.1) * (0.5 + time / 50.0)
    pad = world.Pad(60.0, 0.0, 0.5, 0.4, 0.01, 30.0, 0.3, 0.01, 1.0, 0.0, "N")
    probe = world.Probe(None, (0.04, 0.07, 0.02))
    path = np.stack([np.zeros_like(time), np.zeros_like(time), probe.lowest - depth], axis=1)
    touched = world.touch(probe, pad, time, path)
    made = [maker(np.random.default_rng(seed), 0.6) for maker in family.values() for seed in range(3)]  # some draw a form
    for hidden in {(one.name, one.form): one for one in made if one.elastic or one.force}.values():
        force = world.respond(touched, pad, (hidden,), slides=False).force.mean(axis=1)
        work = float(0.5 * (force[1:] + force[:-1]) @ np.diff(depth))
        assert work > -1e-3 * 0.5 * pad.k * depth.max() ** 2, hidden.name


def test_a_wrongly_mounted_sensor_is_that_of_the_other_code(tmp_path):
    """The generator moves the ball into the sensor's frame, the library moves the texels: the six numbers mean the same."""
    values = {"x": 2e-3, "y": -1.5e-3, "z": 0.6e-3, "about_x": 0.04, "about_y": -0.03, "about_z": 0.1}
    frame = Rotation.from_euler("xyz", [values["about_x"], values["about_y"], values["about_z"]])
    case = next(case for case in map(partial(cases.draw, "none"), range(9)) if case.probe.radius is not None)
    readings = []
    for time, path in zip(case.times, case.paths, strict=True):
        middle = frame.inv().apply(path - [values["x"], values["y"], values["z"]])
        readings.append(world.respond(world.touch(case.probe, case.pad, time, middle), case.pad, slides=False).reading)
    rig = read_rig(cases.write(replace(case, readings=readings), tmp_path))
    plain = Model(rig.parameters)
    model = plain.with_effect(effect("misalignment", "rigid", **values))
    for trial, reading in zip(rig.trials, readings, strict=True):
        predictor = Predictor(trial, rig)
        agree, moved = (np.corrcoef(predictor.predict(one).reading.ravel(), reading.ravel())[0, 1] for one in (model, plain))
        assert agree > 0.995 > moved


# --- methods of others


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
    drawn, rig = cases.draw(hidden["003"].kind, hidden["003"].number), read_rig(folder / "rigs" / "003" / "rig.toml")
    assert hidden["003"].names == drawn.answer
    np.testing.assert_allclose(rig.trials[1].reading, drawn.readings[1], rtol=1e-5, atol=1e-6)


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
    """Right and wrong answers of one method to one case of each kind; another method has not answered."""
    hidden = {
        "000": _entry.Hidden("own", 1, ["creep"]),
        "001": _entry.Hidden("none", 1, []),
        "002": _entry.Hidden("three", 1, ["creep", "lag", "wear"]),
        "003": _entry.Hidden("outside", 1, ["hum"]),
    }
    good = entry(hidden, [(["creep"], 0.95), (["nothing"], 1.0), (["lag", "wear"], 0.6), (["unknown"], None)])
    bad = entry(hidden, [(["lag"], 0.95), (["drift"], 0.5), (["lag"], None), (["noise"], 0.9)])
    text = _entry.table(hidden, {"good": good, "bad": bad, "silent": {}})
    rows = {line.split(" | ")[0].strip("| "): line.split(" | ")[2:] for line in text.splitlines() if line.startswith("|")}
    own, none, three, outside = (
        [cell.strip(" |") for cell in rows[_rows.ROWS[kind][0]]] for kind in ("own", "none", "three", "outside")
    )
    assert own == none == ["1 / 0", "0 / 1", "0 / 0"] and three == ["1 / 0", "0 / 0", "0 / 0"]
    assert outside == ["1 / 0", "0 / 1", "1 / 0"]
    assert "silent has not answered 4 of them, which counts as unknown" in text
    sure = next(line for line in text.splitlines() if "or more" in line)
    assert "1 of 1" in sure and "0 of 2" in sure
    brier = next(line for line in text.splitlines() if "Brier" in line)
    expected = [np.mean([0.05**2, 0.4**2]), np.mean([0.95**2, 0.5**2, 0.9**2])]
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
