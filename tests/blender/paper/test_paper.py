# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's experiments: the quick ones are run, the scenes of the others are built, and the page says what came out."""

from __future__ import annotations

from functools import partial

import pytest

from palpate.commands import main
from palpate.core.solver.simulation import run
from palpate.paper import experiment_tools, grasping, page
from palpate.paper.chapter import Chapter, Picture, Row, below, compare
from palpate.sample_blends import grasps, gripper, hand, pick_and_place

SECONDS = 16.0
"""Of a hold: six to settle and the ten in which nothing may move; palpate paper holds for sixty."""


def test_the_page_holds_every_row_and_picture(tmp_path):
    (tmp_path / "a.png").write_bytes(b"png")
    (tmp_path / "a.pdf").write_bytes(b"pdf")
    chapter = Chapter("Title & more", "Table <3>", "Text.", [compare("sum", "9.7999 N", 9.8, 9.8000001, 1e-6, "N")])
    chapter.rows += [below("drift", "—", 2.0, 1.0, "m"), Row("seen", "—", "—", "yes", None)]
    chapter.pictures.append(Picture(tmp_path / "a.png", 'A "picture"'))
    path = tmp_path / "index.html"
    page.write_page(path, [chapter], 12.0)
    text = path.read_text(encoding="utf-8")
    assert "1 of 2 rows are within their tolerance" in text
    assert "Title &amp; more" in text and "Table &lt;3&gt;" in text and "9.8000001 N" in text
    assert 'src="a.png"' in text and 'href="a.pdf"' in text
    assert not chapter.kept


def test_a_row_outside_its_tolerance_is_not_kept():
    assert compare("x", "—", 1.0, 1.1, 0.05, "N").kept is False
    assert below("x", "—", float("nan"), 1.0, "m").kept is False


def test_calibration_and_definition_from_the_command_line(tmp_path, capfd):
    assert main(["paper", "--out", str(tmp_path), "--only", "stiffness", "--only", "friction", "--only", "definition"]) == 0
    out = capfd.readouterr().out
    assert "14 of 14 rows within their tolerance" in out
    for name in ("index.html", "fig6-foam.png", "fig6-foam.pdf", "fig7-friction.png", "table2.xml"):
        assert (tmp_path / name).stat().st_size > 0


def test_an_unknown_experiment_is_one_line(tmp_path, refused):
    assert "no experiment 'weather'" in refused("paper", "--out", tmp_path, "--only", "weather")


@pytest.mark.long("an experiment of the paper")
@pytest.mark.parametrize(
    ("build", "name", "finger", "force"),
    [
        (partial(grasps.build, kind="bottle"), grasps.OBJECTS["bottle"].name, gripper.LEFT, grasps.FORCE),
        (hand.build, hand.CYLINDER, hand.INDEX, hand.FORCE),
    ],
    ids=["a bottle in a gripper", "a cylinder between finger and thumb"],
)
def test_it_is_held(build, name, finger, force):
    """Controlled sum within 1e-6 N, and not a micrometre in the last ten seconds."""
    scenario = experiment_tools.scenario_of(experiment_tools.new_scene(build))
    rows = grasping.held_rows(scenario, name, finger, force, SECONDS)
    assert all(row.kept for row in rows), rows


@pytest.mark.long("an experiment of the paper")
def test_a_heavy_box_slips_at_coulombs_limit():
    """Held one per cent below 2 · mus · N, let go one per cent above it; palpate paper finds the limit by bisection."""
    scenario = grasping.slowly(experiment_tools.scenario_of(experiment_tools.new_scene(partial(grasps.build, kind="box"))))
    limit = grasping.coulomb_limit(scenario)
    assert not grasping.slips(scenario, "Box", 0.99 * limit)
    assert grasping.slips(scenario, "Box", 1.01 * limit)


@pytest.mark.long("an experiment of the paper")
def test_pick_and_place_sets_the_cube_down_where_it_was():
    recording = run(experiment_tools.scenario_of(experiment_tools.new_scene(pick_and_place.build)))
    rows = grasping.cycle_rows(recording)
    assert all(row.kept for row in rows), rows
