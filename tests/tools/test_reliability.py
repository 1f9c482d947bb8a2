# SPDX-License-Identifier: GPL-3.0-or-later
"""How often names are right at some confidence is counted rightly."""

import json

import pytest
import reliability

ROWS = [
    {"kind": "own", "answer": ["creep"], "said": [["creep", "power", 0.99]], "ambiguous": []},
    {"kind": "other", "answer": ["lag"], "said": [["lag", "delay", 0.96], ["wear", "work", 0.45]], "ambiguous": []},
    {
        "kind": "poor",
        "answer": ["wear"],
        "said": [["creep", "power", 0.45]],
        "ambiguous": [["creep", "wear"], ["lag", "drift"]],
    },
]


def test_names_are_counted_bin_by_bin_and_groups_by_what_they_contain():
    found = {(one.low, one.right, one.count) for one in reliability.binned(*reliability.named(ROWS))}
    assert found == {(0.4, 0, 2), (0.95, 1, 1), (0.98, 1, 1)}
    assert reliability.group_coverage(ROWS) == (1, 2)
    ends = reliability.Bin(0.8, 0.9, 0.85, 8, 10).interval
    assert ends == pytest.approx((0.4902, 0.9433), abs=1e-4)  # Brown, Cai and DasGupta, Statistical Science 16 (2001)


def test_results_become_a_table_and_a_picture(tmp_path, capsys):
    path, picture = tmp_path / "results.jsonl", tmp_path / "reliability.png"
    path.write_text("".join(json.dumps(row) + "\n" for row in ROWS), encoding="utf-8")
    reliability.main([str(path), "--picture", str(picture)])
    said = capsys.readouterr().out
    assert "| 0.40 – 0.50 | 0.450 | 0 of 2 | 0% (0% – 66%) |" in said and "Of 2 ambiguous groups 1 contain" in said
    assert picture.read_bytes().startswith(b"\x89PNG")
