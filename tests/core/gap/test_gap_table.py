# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate gap-table``: several rigs in one table, and what it refuses."""

import numpy as np
import pytest

from palpate.benchmarks._recordings import Recording
from palpate.commands import main
from palpate.core.gap.report.gap_table import TableRow, markdown, median_ratio

TIME = np.linspace(0.0, 30.0, 201)


def write_rig(folder, name, curve, uses=("fit", "check")):
    """One texel under a known force of up to 10 N."""
    trials = []
    for number, use in enumerate(uses):
        force = 5.0 * (1.0 - np.cos(2.0 * np.pi * TIME / (5.0 + number)))
        reading = curve(force) + 0.01 * np.random.default_rng(number).normal(size=len(TIME))
        trials.append((str(number), use, {"time": TIME, "force": force, "texel_0": reading}))
    return Recording(name, 'grid = { rows = 1, columns = 1, pitch = 0.01 }\nunit = "V"', trials).write(folder)


def test_a_table_has_ratios_and_their_median_where_a_model_by_hand_is_known():
    rows = [TableRow("a", 0.1, 0.02, 0.01, "`creep` 0.99"), TableRow("b", 0.1, 0.03, None, "no gap")]
    rows.append(TableRow("c|d", 0.2, 0.01, 0.02, "unexplained"))
    assert rows[0].ratio == 2.0 and rows[1].ratio is None and median_ratio(rows) == 1.25
    lines = markdown(rows).splitlines()
    assert (
        lines[2] == "| a | 10.00% | 2.00% | 1.00% | 2.00 | `creep` 0.99 |"
        and lines[3] == "| b | 10.00% | 3.00% |  |  | no gap |"
    )
    assert lines[4].startswith("| c\\|d |") and lines[5] == "| median |  |  |  | 1.25 |  |"
    assert median_ratio(rows[1:2]) is None and "median" not in markdown(rows[1:2])


@pytest.mark.slow("two whole diagnoses of one texel")
def test_two_rigs_stand_in_one_table(tmp_path, capsys):
    plain = write_rig(tmp_path / "a", "straight", lambda f: 0.3 * f)
    bent = write_rig(tmp_path / "b", "bent", lambda f: 0.9 * np.tanh(0.3 * f))
    (tmp_path / "by-hand.csv").write_text("rig,error\nbent,0.011\n")
    out = tmp_path / "table.md"
    assert main(["gap-table", str(plain), str(bent), "--by-hand", str(tmp_path / "by-hand.csv"), "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    lines = out.read_text().splitlines()
    assert len(lines) == 5 and lines[2].startswith("| straight |") and lines[3].startswith("| bent |")
    cells = [cell.strip() for cell in lines[3].strip("|").split("|")]
    base, amended = (float(cell.rstrip("%")) / 100 for cell in cells[1:3])
    assert 0.1 < base < 0.2 and amended < 0.25 * base and "`saturation`" in cells[5]
    assert cells[3] == "1.10%" and float(cells[4]) == pytest.approx(amended / 0.011, abs=0.01)
    assert "straight" in printed and "saturation" in printed


@pytest.mark.parametrize(
    ("by_hand", "said"),
    [
        ("name,error\n", "should begin with the line rig,error"),
        ("rig,error\nother,0.1\n", "Line 2 of 'by-hand.csv' names no rig of the table"),
        ("rig,error\n\nown,none\n", "Line 3 of 'by-hand.csv' has the error 'none'"),
        ("rig,error\nown,nan\n", "has the error 'nan'"),
        ("rig,error\nown,-0.1\n", "write a share of the range above zero"),
    ],
)
def test_errors_by_hand_that_cannot_be_used_are_refused(tmp_path, capsys, by_hand, said):
    rig = write_rig(tmp_path / "a", "own", lambda f: f)
    (tmp_path / "by-hand.csv").write_text(by_hand)
    assert main(["gap-table", str(rig), "--by-hand", str(tmp_path / "by-hand.csv")]) == 1
    assert said in capsys.readouterr().err


def test_rigs_that_a_table_cannot_judge_are_refused(tmp_path, capsys):
    unchecked = write_rig(tmp_path / "a", "own", lambda f: f, uses=("fit",))
    assert main(["gap-table", str(unchecked)]) == 1
    assert "Rig 'own' has no recording with use = \"check\"" in capsys.readouterr().err
    twins = [str(write_rig(tmp_path / name, "twin", lambda f: f)) for name in "bc"]
    assert main(["gap-table", *twins]) == 1
    assert "Two rigs are called 'twin'" in capsys.readouterr().err
    assert main(["gap-table", twins[0], "--out", twins[0]]) == 1
    assert "rig.toml" in capsys.readouterr().err
