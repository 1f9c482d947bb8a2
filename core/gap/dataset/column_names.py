# SPDX-License-Identifier: GPL-3.0-or-later
"""Columns of a logger: its own names and units, which a rig translates into those of Palpate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import FileError
from ...io.csv_table import UNITS
from ...io.input_files import checked_name, is_number
from ...io.schema import known_words

QUANTITIES = {
    "time": "s",
    **dict.fromkeys(("x", "y", "z", "depth", "slide_x", "slide_y"), "m"),
    **dict.fromkeys(("force", "force_x", "force_y", "force_z"), "N"),
    "temperature": "°C",
    **dict.fromkeys(("qw", "qx", "qy", "qz", "texel"), ""),
}
"""Columns that a rig can name, and the SI unit of each; `texel` stands for all texels."""
ZEROS = {"K": -273.15, "°F": -32.0 / 1.8, "degF": -32.0 / 1.8}
"""°C at which other scales of temperature are zero, where they have another zero."""
INVERSE = "1/x"
"""Unit of a column whose inverse is wanted: the resistance of a piezoresistive sensor goes with one over the force."""
NUMBER = "{}"
"""What stands for the number of a texel in the name of its column."""
LARGEST_FACTOR = 1e12


@dataclass(frozen=True)
class ColumnRule:
    """Where the values of a column come from.

    Attributes
    ----------
    source : str
        Name of the column in the file; of texels with ``{}`` in place of the number.
    factor : float
    inverse : bool
        True if one over the values is wanted, before the factor.
    first : int
        Number of the first texel.
    shift : float
        Added after the factor: zero of the kelvin scale and the like, in the SI unit.
    """

    source: str
    factor: float = 1.0
    inverse: bool = False
    first: int = 0
    shift: float = 0.0


def read_column_rules(table: Mapping[str, Any], path: Path) -> dict[str, ColumnRule]:
    """Return the rules of the [columns] of a rig by the names of Palpate's columns.

    Raises
    ------
    FileError
        A word, a name, a unit or a factor is not valid.
    """
    known_words(table, QUANTITIES, f"[columns] of '{path.name}'")
    rules = {}
    for column, words in table.items():
        where = f"{column} in [columns] of '{path.name}'"
        words = {"name": words} if isinstance(words, str) else words
        if not isinstance(words, dict):
            raise FileError(f'{where} is {words!r:.60}: write the name of the column, or {{ name = "Fz", unit = "mN" }}.')
        known_words(words, {"name", "unit", "factor", "first"} if column == "texel" else {"name", "unit", "factor"}, where)
        source = checked_name(words.get("name", "texel_{}" if column == "texel" else column), where)
        if column == "texel" and source.count(NUMBER) != 1:
            raise FileError(f'The name of {where} is "{source}": write {{}} where the texel\'s number stands, as in "R{{}}".')
        first = words.get("first", 0)
        if not isinstance(first, int) or isinstance(first, bool) or not 0 <= first <= 1_000_000:
            raise FileError(f"first of {where} is {first!r:.60}: write the number of the first texel, 0 or 1.")
        scale = _scale(words, QUANTITIES[column], where)
        shift = ZEROS.get(words.get("unit", ""), 0.0) if QUANTITIES[column] == "°C" else 0.0
        rules[column] = ColumnRule(source, *scale, first, shift)
    return rules


def _scale(words: Mapping[str, Any], quantity: str, where: str) -> tuple[float, bool]:
    """Factor of a column, and whether its inverse is wanted."""
    factor, unit = words.get("factor", 1.0), words.get("unit", quantity)
    if not is_number(factor) or not 1.0 / LARGEST_FACTOR <= abs(factor) <= LARGEST_FACTOR:
        raise FileError(f"factor of {where} is {factor!r:.60}: write a number other than zero.")
    if quantity == "":
        if unit not in ("", INVERSE):
            raise FileError(
                f'unit of {where} is {unit!r:.60}: write "{INVERSE}" for one over the values; the unit of the readings stands '
                "in [sensor]."
            )
        return float(factor), unit == INVERSE
    if not isinstance(unit, str) or unit not in UNITS[quantity]:
        raise FileError(f"unit of {where} is {unit!r:.60}: write one of {', '.join(UNITS[quantity])}.")
    return float(factor) * UNITS[quantity][unit], False


def translated(
    names: Sequence[str], values: np.ndarray, rules: Mapping[str, ColumnRule], texels: int, file: Path
) -> dict[str, np.ndarray]:
    """Return the columns of a file by the names and in the units of Palpate; columns without a rule are as they are.

    Parameters
    ----------
    names : sequence of str
        Of the file's columns.
    values : (T, c) float
    rules : mapping of str to ColumnRule
    texels : int
        Number of texels of the sensor.
    file : Path
        For messages.

    Raises
    ------
    FileError
        A column is not there, is there twice, or has a value whose inverse is infinite.
    """
    columns = {name: values[:, i] for i, name in enumerate(names)}
    wanted: dict[str, ColumnRule] = {}
    for column, rule in rules.items():
        if column != "texel":
            wanted[column] = rule
        elif any(rule.source.replace(NUMBER, str(rule.first + i)) in columns for i in range(texels)):
            for i in range(texels):
                source = rule.source.replace(NUMBER, str(rule.first + i))
                wanted[f"texel_{i}"] = ColumnRule(source, rule.factor, rule.inverse)
    found = {}
    for column, rule in wanted.items():
        if rule.source not in columns:
            if column in ("force_x", "force_y", "force_z", "slide_x", "slide_y", "temperature"):
                continue  # not every recording has them
            raise FileError(f"'{file.name}' has no column '{rule.source}', which [columns] names for {column}.")
        if column != rule.source and column in columns and column not in {other.source for other in wanted.values()}:
            raise FileError(f"'{file.name}' has '{rule.source}' and '{column}' for {column}: remove one of them.")
        found[column] = rule.factor * _inverted(columns[rule.source], rule, file) + rule.shift
    taken = {rule.source for rule in wanted.values()}
    return {name: column for name, column in columns.items() if name not in taken} | found


def _inverted(values: np.ndarray, rule: ColumnRule, file: Path) -> np.ndarray:
    """The values, or one over them."""
    if not rule.inverse:
        return values
    (zero,) = np.nonzero(np.abs(values) < 1e-30)
    if len(zero):
        raise FileError(
            f"Line {zero[0] + 2} of '{file.name}' has zero for {rule.source}, which has no inverse: leave the cell empty."
        )
    inverse: np.ndarray = 1.0 / values
    return inverse
