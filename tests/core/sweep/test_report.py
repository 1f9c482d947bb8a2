# SPDX-License-Identifier: GPL-3.0-or-later
"""The report names what metrics depend on, and is one file that needs no other."""

from __future__ import annotations

import base64
import re

import numpy as np
import pytest
from sample_bake import grid_texels, recording_of, round_texels
from sweep_runs import new_study, unit_sensor, write_failure, write_run

from palpate.core.errors import FileError
from palpate.sweep.dependencies import Dependency, dependencies
from palpate.sweep.report import StudyColumns, _metric_row, _strongest_sentence, write_report
from palpate.sweep.report_figures import draw_small_multiples


def study_of(tmp_path, runs=40):
    """A study whose only metric that varies follows the load, which is 1 to 2."""
    study = new_study(tmp_path / "study", "a <b>bold</b> name")
    texels = grid_texels()
    for index in range(runs):
        recording = recording_of(texels)
        recording.sensors["pad"].net_force = recording.sensors["pad"].net_force + [0.0, 0.0, -1.0 - index / runs]
        values = {"load": 1.0 + index / runs, "other": float(np.random.default_rng(index).random()), "shape": "ball"}
        write_run(study, index, [unit_sensor("pad", texels)], recording, values)
    return study


def test_the_page_says_what_depends_on_what(tmp_path):
    study = study_of(tmp_path)
    write_failure(study, 100, "The mesh <cube> has no faces.")
    write_report(study)
    page = (study / "report.html").read_text(encoding="utf-8")
    assert "The strongest dependency is that of largest_force on load." in page
    assert "40 runs finished, 1 failed." in page
    assert "The mesh &lt;cube&gt; has no faces." in page and "<b>bold" not in page
    assert not re.search(r'(src|href)="(?!data:)', page), "nothing outside the page"
    pictures = [base64.b64decode(data) for data in re.findall(r"base64,([^\"]+)", page)]
    assert len(pictures) == 2 and all(picture.startswith(b"\x89PNG") for picture in pictures)
    before = page
    write_report(study)
    assert (study / "report.html").read_text(encoding="utf-8") == before
    assert not list(study.glob(".palpate*"))


def test_failures_that_differ_in_numbers_are_one_row(tmp_path):
    study = study_of(tmp_path)
    for index, number in enumerate((0.21, 1e-5, 0.20, 3)):
        write_failure(study, 100 + index, f"mud of 'Pad 2' is larger than mus ({number:g}).")
    write_failure(study, 200, "mud of 'Pad' is larger than mus (0.2).")
    write_report(study)
    page = (study / "report.html").read_text(encoding="utf-8")
    rows = re.findall(r"<td>(mud of [^<]*)</td><td[^>]*>(\d+)</td>", page)
    assert sorted((row[0].count("Pad 2"), row[1]) for row in rows) == [(0, "1"), (1, "4")]


def test_where_a_press_was_is_not_the_headline():
    """Its place follows the numbers that chose it, and says nothing of the sensor."""
    place, force = (Dependency("press.place", "press.y", 0.98, 0.9, 0.0, 9), Dependency("Pad.k", "force", 0.6, 0.5, 0.0, 9))
    columns = StudyColumns({}, {}, 1.0)
    assert _strongest_sentence([place, force], columns, 9) == "The strongest dependency is that of force on Pad.k."
    assert _strongest_sentence([place], columns, 9) == "The strongest dependency is that of press.y on press.place."


def test_a_study_of_failures_alone_has_a_report(tmp_path):
    study = new_study(tmp_path / "study")
    write_failure(study, 1, "Nothing touches the sensor.")
    write_report(study)
    assert "No run finished, 1 failed." in (study / "report.html").read_text(encoding="utf-8")


def test_texels_without_rows_are_drawn(tmp_path):
    study = new_study(tmp_path / "study")
    write_run(study, 0, [unit_sensor("pad", round_texels())], recording_of(round_texels()), {"mass": 1.0})
    write_report(study)
    assert "base64," in (study / "report.html").read_text(encoding="utf-8")


def test_a_damaged_run_is_named(tmp_path):
    study = study_of(tmp_path, runs=1)
    path = next((study / "runs").glob("*/run.json"))
    path.write_text('{"format": "palpate-run/1"}', encoding="utf-8")
    with pytest.raises(FileError, match="run.json' is damaged"):
        write_report(study)


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
    assert abs(found["x", "humped"].rank_correlation) < 0.2 and found["x", "humped"].information > 0.7
    assert found["name", "named"].rank_correlation is None and found["name", "named"].strength > 0.7
    assert {pair for pair, one in found.items() if one.strength > 0} == {("x", "rising"), ("x", "humped"), ("name", "named")}
    false = [
        one
        for seed in range(20)
        for one in dependencies(
            {f"p{i}": np.random.default_rng([seed, i]).random(100) for i in range(10)},
            {"m": np.random.default_rng([seed, 99]).random(100)},
        )
        if one.strength > 0
    ]
    assert len(false) <= 2  # of 200, at one in a thousand: more than two come with a probability of 0.001


def test_missing_values_count_as_missing():
    x = [float(i) if i % 2 else None for i in range(40)]
    y = np.where(np.arange(40) < 30, np.arange(40.0), np.nan)
    (one,) = dependencies({"x": x}, {"y": y})
    assert one.runs == 15 and one.rank_correlation == pytest.approx(1.0)
    assert dependencies({"x": x[:10]}, {"y": y[:10]}) == [], "five runs say nothing"


def test_a_choice_that_names_each_run_is_neither_drawn_nor_judged(tmp_path):
    study = new_study(tmp_path / "study", "cases")
    texels = grid_texels()
    for index in range(40):
        recording = recording_of(texels)
        recording.sensors["pad"].net_force = recording.sensors["pad"].net_force + [0.0, 0.0, -1.0 - index / 40]
        write_run(study, index, [unit_sensor("pad", texels)], recording, {"case": f"case {index}"})
    write_report(study)
    page = (study / "report.html").read_text(encoding="utf-8")
    assert "Metrics over each parameter" not in page and "1 choice of more than 12 names" in page
    assert "No dependency of a metric on a parameter was looked for" in page and "Strongest dependencies" not in page


def test_what_was_not_judged_is_not_said_to_matter_little():
    random = np.random.default_rng(3)
    values = {"case": [f"case {number}" for number in range(40)], "load": list(random.random(40))}
    metrics = {"slip": random.random(40)}
    sentence = _strongest_sentence(dependencies(values, metrics), StudyColumns(values, metrics, 0.0), 40)
    assert sentence == "No metric depends on load as far as 40 runs can tell."


@pytest.mark.parametrize(("names", "runs"), [(4, 40), (20, 200), (50, 500)])
def test_names_as_rare_as_are_judged_seldom_seem_to_matter(names, runs):
    """Of 400 pairs without a dependency, at one in a thousand: more than four come with a probability of 0.0001."""
    values = {"name": [f"name {number % names}" for number in range(runs)]}
    false = 0
    for seed in range(400):
        (one,) = dependencies(values, {"m": np.random.default_rng([seed, names]).random(runs)})
        false += one.strength > 0
    assert false <= 4
    fewer = {"name": values["name"][:-1]}
    assert not dependencies(fewer, {"m": np.random.default_rng(0).random(runs - 1)}), "one run fewer is too few"


def test_means_of_metrics_are_given():
    """Of the runs that have a value; the mean of uneven ones is no median."""
    assert _metric_row("slip", np.array([1.0, 1.0, 7.0])) == ["slip", "3", "1", "1", "7", "3"]
    assert _metric_row("slip", np.array([])) == ["slip", "", "", "", "", "0"]


def test_names_that_would_be_cut_to_the_same_stay_whole(tmp_path):
    names = ["left/a-long-shape.stl", "right/a-long-shape.stl"]
    drawn = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("palpate.sweep.report_figures.save_figure", lambda figure, *_: drawn.append(figure))
        draw_small_multiples(tmp_path / "a.png", {"mesh": names * 20}, {"slip": np.arange(40.0)}, set())
    (axes,) = drawn[0].axes
    assert [label.get_text() for label in axes.get_xticklabels()] == names
