# SPDX-License-Identifier: GPL-3.0-or-later
"""Columns of a logger: its own names and units, which a rig, or answers about logs, translate into those of Palpate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from ...errors import FileError
from ...io.csv_table import UNITS
from ...io.input_files import checked_name
from ...io.schema import Number, Positive, known_words, read_words, wanted

POSE, TURN, SLIDE = ("x", "y", "z"), ("qw", "qx", "qy", "qz"), ("slide_x", "slide_y")
FORCE = ("force_x", "force_y", "force_z")
QUANTITIES = {
    "time": "s",
    **dict.fromkeys((*POSE, "depth", *SLIDE), "m"),
    **dict.fromkeys(("force", *FORCE), "N"),
    "temperature": "°C",
    **dict.fromkeys((*TURN, "texel"), ""),
}
"""Columns that a rig can name, and the SI unit of each; `texel` stands for all texels."""
GRAVITY = 9.80665
"""m/s²: a gram on a scale is a force."""
LOG_UNITS: dict[str, dict[str, float]] = {
    "m": {**UNITS["m"], "nm": 1e-9, "in": 0.0254, "inch": 0.0254},
    "s": {**UNITS["s"], "sec": 1.0, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0},
    "N": {
        **UNITS["N"],
        **{"uN": 1e-6, "g": 1e-3 * GRAVITY, "gf": 1e-3 * GRAVITY, "kg": GRAVITY, "kgf": GRAVITY, "lbf": 4.4482216152605},
    },
    "°C": UNITS["°C"],
}
"""SI unit → units that a log may be in, and the SI value of one of them."""
PRESSURES = {**UNITS["Pa"], "hPa": 1e2, "mbar": 1e2, "bar": 1e5, "psi": 6894.757293168}
"""Pressures: a force follows with the area on which they act."""
READING_UNITS = LOG_UNITS["N"]
"""Units of readings that become newtons. Readings in any other unit keep it."""
ZEROS = {"K": -273.15, "°F": -32.0 / 1.8, "degF": -32.0 / 1.8}
"""°C at which other scales of temperature are zero, where they have another zero."""
INVERSE = "1/x"
"""Unit of a column whose inverse is wanted: the resistance of a piezoresistive sensor goes with one over the force."""
NUMBER = "{}"
"""Placeholder for the number of a texel in the name of its column."""
LARGEST_FACTOR = 1e12
SMALLEST_INVERTED = 1e-30
"""Numbers below it have no inverse."""
_WORDS = ("name", "unit", "factor", "zero", "missing")
_OWN_WORDS = {"time": ("rate",), "force": ("area",), "texel": ("names", "first", "count")}
_WORDS_OF_LOGS = ("rate", "names", "count")


@dataclass(frozen=True)
class Column:
    """Where a quantity comes from: (number − zero) · factor in the unit, for ``1/x`` factor / (number − zero).

    Attributes
    ----------
    names : tuple of str
        The columns: one, or those of all texels in order.
    unit : str
        Empty for texels whose unit is the sensor's own.
    factor, zero : float
    area : float, m²
        On which a pressure acts that becomes a force; 0 if it is none.
    rate : float, Hz
        Of a clock without a column; 0 if it has one.
    missing : float or None
        What the file has where a value is missing.
    constant : float or None
        In SI units, instead of a column.
    """

    names: tuple[str, ...]
    unit: str = ""
    factor: Number = 1.0
    zero: Number = 0.0
    area: Positive = 0.0
    rate: Positive = 0.0
    missing: Number | None = None
    constant: Number | None = None

    def in_si(self, quantity: str, values: np.ndarray) -> np.ndarray:
        """Return the values of a column in the unit of a quantity; NaN where one is missing or has no inverse."""
        unit = QUANTITIES[quantity]
        size = PRESSURES[self.unit] * self.area if self.area else LOG_UNITS.get(unit, READING_UNITS).get(self.unit, 1.0)
        found = values if self.missing is None else np.where(values == self.missing, np.nan, values)
        found = found - self.zero
        if self.unit == INVERSE:
            with np.errstate(divide="ignore"):
                found = np.where(np.abs(found) < SMALLEST_INVERTED, np.nan, 1.0 / found)
        shift = ZEROS.get(self.unit, 0.0) if unit == "°C" else 0.0
        return np.asarray(found * (size * self.factor) + shift)


@dataclass
class _Source:
    name: str | Annotated[tuple[str, ...], wanted("write a name, or a list of them", min_length=1)]
    names: Annotated[tuple[str, ...], wanted('write a list of names, as ["R1", "R2"]', names=True, min_length=1)] = ()
    first: Annotated[int, wanted("write the number of the first texel, 0 or 1", ge=0, le=65536)] = 0
    count: Annotated[int, wanted("write a whole number above zero", ge=1, le=65536)] = 1


def read_column(quantity: str, words: Any, where: str, texels: int | None = None) -> Column:
    """Return the name and the settings of a column from its words in a file: a name alone, or a table.

    `where` names the column in messages. A rig has a number of `texels`, and clocks and names of texels need no words of their
    own (:data:`_WORDS_OF_LOGS`).

    Raises
    ------
    FileError
        A word, a name, a unit or a factor is not valid.
    """
    words = {"name": words} if isinstance(words, str) else words
    if not isinstance(words, dict):
        raise FileError(f'{where} is {words!r:.60}: write the name of the column, or {{ name = "Fz", unit = "mN" }}.')
    known = [*_WORDS, *_OWN_WORDS.get(quantity, ())]
    known_words(words, known if texels is None else [word for word in known if word not in _WORDS_OF_LOGS], where)
    unit, units = words.get("unit", QUANTITIES[quantity]), LOG_UNITS.get(QUANTITIES[quantity], {})
    given = {word: words[word] for word in words if word not in ("name", "names", "first", "count")}
    found = read_words(given, Column, where, besides=("unit",), names=(), unit=unit)
    if not 1.0 / LARGEST_FACTOR <= abs(found.factor) <= LARGEST_FACTOR:
        raise FileError(f"factor of {where} is {found.factor:g}: write a number other than zero.")
    is_pressure = isinstance(unit, str) and unit in PRESSURES
    if not isinstance(unit, str) or (units and unit not in units and not (found.area and is_pressure)):
        hint = " (a pressure needs area = …, in m²)" if is_pressure else ""
        choice = f"one of {', '.join(units)}{hint}" if units else "its name"
        raise FileError(f"unit of {where} is {unit!r:.60}: write {choice}.")
    if found.rate:
        return found
    source = read_words({"name": "texel_{}" if quantity == "texel" else quantity, **words}, _Source, where, besides=words)
    if quantity == "texel" and isinstance(source.name, tuple):
        raise FileError(f"name of {where} is {list(source.name)!r:.60}: write one name, or names = [...].")
    names = source.names or (source.name if isinstance(source.name, tuple) else (source.name,))
    for one in names:
        checked_name(one, where)
    if quantity == "texel" and not source.names:
        names = numbered(names[0], source.first, texels or source.count)
    return replace(found, names=names)


def numbered(pattern: str, first: int, count: int) -> tuple[str, ...]:
    """Return the names of texels: those of a pattern with ``{}``, or the one that it is."""
    return tuple(pattern.replace(NUMBER, str(first + i)) for i in range(count)) if NUMBER in pattern else (pattern,)


def read_column_rules(table: Mapping[str, Any], path: Path, texels: int) -> dict[str, Column]:
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
        rules[column] = read_column(column, words, where, texels)
        if column == "texel" and rules[column].unit not in ("", INVERSE):
            raise FileError(
                f'unit of {where} is {rules[column].unit!r:.60}: write "{INVERSE}" for one over the values; the unit of the '
                "readings stands in [sensor]."
            )
        if column == "texel" and len(rules[column].names) != texels:
            name = rules[column].names[0]
            raise FileError(f'The name of {where} is "{name}": write {{}} where the texel\'s number stands, as in "R{{}}".')
    return rules


def translated(names: Sequence[str], values: np.ndarray, rules: Mapping[str, Column], file: Path) -> dict[str, np.ndarray]:
    """Return the columns of a file by the names and in the units of Palpate; columns without a rule are as they are.

    Parameters
    ----------
    names : sequence of str
        Of the file's columns.
    values : (T, c) float
    rules : mapping of str to Column
    file : Path
        For messages.

    Raises
    ------
    FileError
        A column is not there, is there twice, or has a value whose inverse is infinite.
    """
    columns = dict(zip(names, values.T, strict=True))
    sources = {}
    for quantity, rule in rules.items():
        if quantity != "texel":
            sources[quantity] = quantity, rule.names[0]
        elif any(name in columns for name in rule.names):
            sources |= {f"texel_{i}": (quantity, name) for i, name in enumerate(rule.names)}
    taken = {source for _, source in sources.values()}
    found = {}
    for column, (quantity, source) in sources.items():
        if source not in columns:
            if column in (*FORCE, *SLIDE, "temperature"):
                continue  # not every recording has them
            raise FileError(f"'{file.name}' has no column '{source}', which [columns] names for {column}.")
        if column != source and column in columns and column not in taken:
            raise FileError(f"'{file.name}' has '{source}' and '{column}' for {column}: remove one of them.")
        found[column] = rules[quantity].in_si(quantity, columns[source])
        is_missing = np.isnan(columns[source]) | (columns[source] == rules[quantity].missing)
        (lost,) = np.nonzero(np.isnan(found[column]) & ~is_missing)
        if len(lost):
            raise FileError(
                f"Line {lost[0] + 2} of '{file.name}' has zero for {source}, which has no inverse: leave the cell empty."
            )
    return {name: column for name, column in columns.items() if name not in taken} | found
