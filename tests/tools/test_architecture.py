# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of the architecture shows the imports of the source, and the counts see what they are to see."""

import ast

import architecture_counts
import architecture_picture
import pytest
from import_graph import ORDER


@pytest.fixture(scope="module")
def rooms(imports):
    """Rooms and imports of the source as it is."""
    return architecture_picture.rooms_and_imports(imports)


def test_the_picture_shows_the_imports_of_the_source(rooms):
    """Otherwise run `python tools/architecture.py`."""
    assert architecture_picture.drawn_data() == rooms.as_json()


def test_every_room_of_the_picture_has_a_caption_and_every_step_a_room():
    rooms = {f"{package}.{room}" for package in ("core", "addon") for room in ORDER[package]}
    assert rooms | set(architecture_picture.DRIVERS) == set(architecture_picture.CAPTIONS)
    assert {room for step in architecture_picture.SIMULATION.values() for room in step} <= rooms
    assert set(architecture_picture.IDENTIFICATION.values()) <= set(ORDER["core.gap"])


def test_imports_that_others_imply_are_left_out():
    graph = {"a": {"b", "c"}, "b": {"c"}, "c": set()}
    assert architecture_picture.reduced(graph) == {"a": {"b"}, "b": {"c"}, "c": set()}


def test_a_picture_is_written_with_its_data(tmp_path, rooms):
    architecture_picture.draw(rooms, tmp_path / "picture.svg")
    assert architecture_picture.drawn_data(tmp_path / "picture.svg") == rooms.as_json()


@pytest.mark.parametrize(
    ("recognised", "formula"),
    [
        (architecture_counts.is_normal_law, "k * d * (1 + 1.5 * p.dissipation * rate)"),
        (architecture_counts.is_normal_law, "3 / 2 * dissipation"),
        (architecture_counts.is_friction_step, "keep * z + gain * v"),
        (architecture_counts.is_friction_step, "keep[i] * zx + gains[i] * (vx - out * nx)"),
    ],
)
def test_formulas_are_recognised(recognised, formula):
    assert any(recognised(node) for node in ast.walk(ast.parse(formula)))


@pytest.mark.parametrize("formula", ["1.5 * x", "dissipation * rate", "keep * z", "a * z + b * v"])
def test_other_formulas_are_not(formula):
    nodes = list(ast.walk(ast.parse(formula)))
    assert not any(architecture_counts.is_normal_law(node) or architecture_counts.is_friction_step(node) for node in nodes)


def test_a_table_of_parameters_is_seen():
    table = 'UNITS = {"k": "N/m", "cn": "N s/m", "mus": "1", "mud": "1", "x0": "m/s"}\nNAMES = ("k", "cn")'
    assert list(architecture_counts.parameter_tables(ast.parse(table))) == [1]


@pytest.mark.slow("reads and counts the whole source")
def test_core_and_addon_hold_packages_only():
    counts = architecture_counts.count()
    assert counts.files_beside_packages == {"core": [], "addon": []}
    assert not counts.circles
    assert max(counts.layers.values()) <= 8
