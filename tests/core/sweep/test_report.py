# SPDX-License-Identifier: GPL-3.0-or-later
"""The report names what metrics depend on, and is one file that needs no other."""

from __future__ import annotations

import base64
import re

import numpy as np
import pytest
from sample_bake import round_texels
from sweep_runs import failed, made_up, new_study, published

from palpate.core.study.study_file import read_study
from palpate.sweep.dependencies import Dependency, dependencies
from palpate.sweep.report import _strongest_sentence, write_report

pytest.importorskip("pyarrow")


def report_of(folder, results):
    """The page of a study of these runs."""
    study = published(folder, results)
    write_report(study, read_study(study / "study.toml"))
    return (study / "report.html").read_text(encoding="utf-8")


def loads(runs=40, **more):
    """Runs whose only metric follows the load, which is 1 to 2."""
    for index in range(runs):
        load = 1.0 + index / runs
        values = {"load": load, "other": float(np.random.default_rng(index).random()), "shape": "ball"}
        yield made_up(index, {**values, **{name: value(index) for name, value in more.items()}}, load=load)


@pytest.mark.slow("draws two pages")
def test_the_page_says_what_depends_on_what(tmp_path):
    study = new_study(tmp_path / "study")
    file = study / "study.toml"
    file.write_text(file.read_text().replace("presses", "a <b>bold</b> name"))
    runs = [*loads(), failed(100, "The mesh <cube> has no faces.")]
    page = report_of(study, runs)
    assert "The strongest dependency is that of load on load." in page
    assert "40 runs finished, 1 failed." in page
    assert "The mesh &lt;cube&gt; has no faces." in page and "<b>bold" not in page
    assert not re.search(r'(src|href)="(?!data:)', page), "nothing outside the page"
    pictures = [base64.b64decode(data) for data in re.findall(r"base64,([^\"]+)", page)]
    assert len(pictures) == 2 and all(picture.startswith(b"\x89PNG") for picture in pictures)
    assert report_of(study, []) == page
    assert not list(study.glob(".palpate*"))


def test_failures_that_differ_in_numbers_are_one_row(tmp_path):
    lost = [failed(100 + i, f"mud of 'Pad 2' is larger than mus ({x:g}).") for i, x in enumerate((0.21, 1e-5, 0.20, 3))]
    page = report_of(new_study(tmp_path / "study"), [*loads(4), *lost, failed(200, "mud of 'Pad' is larger than mus (0.2).")])
    rows = re.findall(r"<td>(mud of [^<]*)</td><td[^>]*>(\d+)</td>", page)
    assert sorted((row[0].count("Pad 2"), row[1]) for row in rows) == [(0, "1"), (1, "4")]


def test_what_failing_depends_on_is_said(tmp_path):
    runs = [one for one in loads(60) if one.run.values["load"] < 1.5]
    lost = [failed(one.run.index, "Too much load.", one.run.values) for one in loads(60) if one.run.values["load"] >= 1.5]
    page = report_of(new_study(tmp_path / "study"), [*runs, *lost])
    assert "What failing depends on:</p>" in page and "<td>load</td>" in page.partition("What failing depends on")[2]


def test_where_a_press_was_is_not_the_headline():
    """Its place follows the numbers that chose it, and says nothing of the sensor."""
    place, force = Dependency("press.place", "press.y", 0.98, 0.9, 9), Dependency("Pad.k", "force", 0.6, 0.5, 9)
    assert _strongest_sentence([place, force]) == "The strongest dependency is that of force on Pad.k."
    assert _strongest_sentence([place]) == "The strongest dependency is that of press.y on press.place."


def test_texels_without_rows_are_drawn(tmp_path):
    assert "base64," in report_of(new_study(tmp_path / "study"), [made_up(0, {"mass": 1.0}, {"cap": round_texels()})])


def test_dependencies_are_found_and_chance_is_not():
    """Rising, rising and falling, and by name; of 200 pairs without a dependency none may be taken for one too often."""
    random = np.random.default_rng(1)
    x, other = random.random(300), random.random(300)
    names = [("ball", "cube", "cone")[i % 3] for i in range(300)]
    kind = np.array([len(name) + (name == "cone") * 2.0 for name in names])
    noise = 0.1 * random.standard_normal(300)
    metrics = {"rising": x + noise, "humped": (x - 0.5) ** 2 + 0.1 * noise, "named": kind + noise}
    found = {(one.parameter, one.metric): one for one in dependencies({"x": x, "other": other, "name": names}, metrics)}
    assert found["x", "rising"].rank_correlation > 0.9
    assert abs(found["x", "humped"].rank_correlation) < 0.2 and found["x", "humped"].strength > 0.7
    assert found["name", "named"].rank_correlation is None and found["name", "named"].strength > 0.7
    assert set(found) == {("x", "rising"), ("x", "humped"), ("name", "named")}
    false = [
        one
        for seed in range(20)
        for one in dependencies(
            {f"p{i}": np.random.default_rng([seed, i]).random(100) for i in range(10)},
            {"m": np.random.default_rng([seed, 99]).random(100)},
        )
    ]
    assert len(false) <= 2  # of 200, at one in a thousand: more than two come with a probability of 0.001


def test_missing_values_count_as_missing():
    x = [float(i) if i % 2 else None for i in range(40)]
    y = np.where(np.arange(40) < 30, np.arange(40.0), np.nan)
    (one,) = dependencies({"x": x}, {"y": y})
    assert one.runs == 15 and one.rank_correlation == pytest.approx(1.0)
    assert dependencies({"x": x[:10]}, {"y": y[:10]}) == [], "five runs say nothing"


def test_a_choice_that_names_each_run_is_neither_drawn_nor_judged(tmp_path):
    runs = [made_up(index, {"case": f"case {index}"}, load=1.0 + index / 40) for index in range(40)]
    page = report_of(new_study(tmp_path / "study"), runs)
    assert "Metrics over each parameter" not in page and "Drawn are 0 of 1 parameter" in page
    assert "No dependency of a metric on a parameter was detected" in page and "Strongest dependencies" not in page


@pytest.mark.parametrize(("names", "runs"), [(4, 40), (20, 200), (50, 500)])
def test_names_as_rare_as_are_judged_seldom_seem_to_matter(names, runs):
    """Of 400 pairs without a dependency, at one in a thousand: more than four come with a probability of 0.0001."""
    values = {"name": [f"name {number % names}" for number in range(runs)]}
    false = 0
    for seed in range(400):
        false += len(dependencies(values, {"m": np.random.default_rng([seed, names]).random(runs)}))
    assert false <= 4
    metric = np.array([float(name.split()[1]) for name in values["name"]])
    assert dependencies(values, {"m": metric})
    assert not dependencies({"name": values["name"][:-1]}, {"m": metric[:-1]}), "one run fewer is too few"
