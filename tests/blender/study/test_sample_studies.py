# SPDX-License-Identifier: GPL-3.0-or-later
"""The sample studies, each with a few runs instead of hundreds."""

import pytest
from small_study import rows_of
from solver_scenes import GRAVITY

from palpate.sweep.study_folder import open_study
from palpate.sweep.worker import compute_batch


def finished(folder, tmp_path, name: str, order, count: int) -> list[dict]:
    """Compute the first and the last runs of a sample study by an order of their values, and return what they say."""
    file = folder / f"{name}.toml"
    opened = open_study(file, tmp_path / name)
    ordered = sorted(opened.runs, key=lambda run: order(run.values))
    chosen = [run.index for run in (*ordered[:count], *ordered[-count:])]
    assert compute_batch(chosen, str(opened.folder)).done == 2 * count
    rows = {row["run"]: row for row in rows_of(opened.folder)}
    return [
        {kind: named(rows[index], word) for kind, word in (("values", "varied."), ("metrics", "metric."))} for index in chosen
    ]


def named(row: dict, start: str) -> dict:
    return {name.removeprefix(start): value for name, value in row.items() if name.startswith(start)}


@pytest.mark.long("computes runs of a sample study")
def test_presses_are_at_many_places_of_the_fingertip(repository, tmp_path):
    """Deep and shallow ones: each touches, with the force that its depth gives, and slides as far as it was told."""
    runs = finished(repository / "docs" / "sample-study", tmp_path, "presses", lambda values: values["press.depth"], 3)
    places = {tuple(run["metrics"][f"press.{axis}"] for axis in "xyz") for run in runs}
    assert len(places) == len(runs)
    for run in runs:
        values, metrics = run["values"], run["metrics"]
        assert metrics["max_contact_texels"] >= 1.0 and metrics["max_normal_force"] > 0.0
        assert 0.0 < metrics["max_depth"] <= values["press.depth"] * 1.001
        assert metrics["end_normal_force"] == pytest.approx(0.0, abs=1e-9)  # it has gone back
    shallow, deep = (max(run["metrics"]["max_normal_force"] for run in part) for part in (runs[:3], runs[3:]))
    assert deep > 2.0 * shallow


@pytest.mark.long("computes runs of a sample study")
def test_a_grasp_holds_where_friction_can_bear_the_weight(repository, tmp_path):
    """The fingers bear the weight by friction: it slides where their friction is less, and is held where it is more."""

    def reserve_of(values):
        return values["Left finger.mus"] * values["Left finger.k"] / values["Cylinder.mass"]

    runs = finished(repository / "docs" / "sample-study", tmp_path, "grasp", reserve_of, 2)
    seen = set()
    for run in runs:
        values, metrics = run["values"], run["metrics"]
        assert values["Right finger.k"] == values["Left finger.k"]
        assert values["Right finger.mud"] == pytest.approx(0.8 * values["Left finger.mus"])
        grip = sum(metrics[f"{side} finger.max_normal_force"] for side in ("Left", "Right"))
        reserve = values["Left finger.mus"] * grip / (values["Cylinder.mass"] * GRAVITY)
        if reserve > 2.0:  # the lift accelerates, and the grip is not always at its largest
            assert metrics["Cylinder.held"] == 1.0, run
            assert metrics["Cylinder.fall"] < -0.03, run  # it is lifted by 32 mm and creeps a little
            seen.add("held")
        elif reserve < 0.8:
            assert metrics["Cylinder.held"] == 0.0, run
            assert abs(metrics["Cylinder.fall"]) < 0.005, run  # it stays on the soft table
            seen.add("lost")
    assert seen == {"held", "lost"}
