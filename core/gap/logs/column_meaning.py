# SPDX-License-Identifier: GPL-3.0-or-later
"""Meaning of a column, guessed from its name, its unit and the size of its values.

A name tells a quantity; a unit is what the file states, or stands in the name. Where neither tells the unit, the size of the
values does, and the answer is not sure: a person has to confirm it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..dataset.column_names import LOG_UNITS, PRESSURES, QUANTITIES
from .column_behaviour import finite

KNOWN_UNITS = {unit for units in (*LOG_UNITS.values(), PRESSURES) for unit in units}
KNOWN_UNITS |= {"counts", "count", "raw", "LSB", "ADC", "V", "mV", "ohm", "kohm", "Ohm", "kOhm", "Ω", "kΩ", "F", "pF"}
KNOWN_UNITS |= {"deg", "rad", "%"}
TEXEL_WORDS = {
    *("texel", "taxel", "tactel", "cell", "sensor", "tactile", "tac", "tactip", "ch", "channel", "hall"),
    *("pressure", "resistance", "capacitance", "voltage", "adc", "raw", "signal", "reading", "readings", "value", "values"),
    *("r", "c", "s", "p", "v"),
}
"""Words in the names of columns that hold the sensor's response."""
_MOTIONS = {"acceleration", "accel", "acc", "jerk", "gyro", "angular", "twist", "twists"}
_AXIS_WORDS = {
    "velocity": {"velocity", "vel", "v", "speed"} | _MOTIONS,
    "rotation": {"orientation", "rotation", "quaternion", "quat", "q", "rot"},
    "force": {"force", "f", "wrench", "load", "ft"},
    "torque": {"torque", "moment", "t", "m", "tau"},
    "position": {"position", "pos", "pose", "translation", "motion", "p"}
    | {"tcp", "tip", "probe", "indenter", "tool", "ee", "robot"},
}
"""Words beside the letter of an axis; the first kind of which a name has a word counts."""
_JOINED = {"f": "force", "p": "position", "pos": "position", "q": "rotation"}
_JOINED |= {kind: kind for kind in ("force", "position", "slide")}
"""What is written together with the letter of an axis."""
_TIME_WORDS = {"time", "t", "timestamp", "stamp", "sec", "secs", "seconds", "elapsed", "clock", "tim", "tim2", "zeit"}
_SINGLE = {
    "force": {"force", "load", "weight", "mass", "normal_force", "fn", "loadcell", "scale", "futek"},
    "temperature": {"temperature", "temp", "temperatur", "thermistor"},
    "depth": {"depth", "indentation", "penetration", "compression", "deflection"},
}
MUCH_LESS = 0.3
"""Difference of the correlations with the load from which on one family of columns is preferred whatever its name and size."""
SINCE_1970 = 1e9
"""Seconds: larger time stamps are times of day."""
BY_SIZE: dict[str, tuple[tuple[float, str], ...]] = {
    "m": ((0.3, "m"), (math.inf, "mm")),
    "N": ((500.0, "N"), (math.inf, "g")),
    "°C": ((200.0, "°C"), (420.0, "K"), (math.inf, "?")),
}
"""The unit where none is stated, by the reach of the values: rigs for touch move by millimetres to some decimetres, probes
press a skin with 0.1 to 100 N while scales show grams, and nobody presses a sensor at 200 °C or at 70 K. Temperatures that are
larger than both are counts of a converter."""
_BRACKETS = re.compile(r"^(?P<name>.*?)\s*[\[(]\s*(?P<unit>[^\])]+?)\s*[\])]\s*$")
RATE = re.compile(r"/\s*(ms|s|sec|min|h)$")
"""The end of a unit of something that is no reading: speeds, and loads over time."""


@dataclass(frozen=True)
class Meaning:
    """Meaning of a name.

    Attributes
    ----------
    quantity : str
        One of :data:`..dataset.column_names.QUANTITIES`, or empty.
    unit : str
        Empty if the name has none.
    weight : int
        How sure the name is: 3 for a full word, 2 for a letter with an axis, 1 for a single letter.
    """

    quantity: str
    unit: str = ""
    weight: int = 0


def name_and_unit(column: str) -> tuple[str, str]:
    """Return the name of a column without its unit, and the unit: ``Fz (N)``, ``Fz [N]``, ``Fz_N``, ``height mm``."""
    found = _BRACKETS.match(column)
    if found:
        return found["name"], found["unit"]
    stem, mark, last = re.match(r"^(.*?)([_ .]?)([^_ .]*)$", column).groups()  # type: ignore[union-attr]
    is_unit = last in KNOWN_UNITS - {"m", "s", "g", "V", "F", "N", "in", "C", "K"}
    is_letter = mark == "_" and len(stem) > 1 and last in {"m", "s", "g", "N", "V"}
    return (stem, last) if mark and stem and (is_unit or is_letter) else (column, "")


def meaning_of(column: str) -> Meaning:
    """Return the meaning of a column's name."""
    plain, unit = name_and_unit(column)
    if plain.lower() in QUANTITIES and plain.lower() != "texel":
        return Meaning(plain.lower(), unit, 3)
    words = _words(plain)
    if not words:
        return Meaning("")
    kind = next((kind for kind, names in _AXIS_WORDS.items() if names & set(words)), "")
    last = words[-1]
    if joined := re.fullmatch(r"(f|force|p|pos|position|q|t|m|v|a|slide)([xyzw])", last):
        return _of_axis(_JOINED.get(joined[1], ""), joined[2], unit, 3 if joined[1] == "slide" else 2)
    if last in ("x", "y", "z", "w"):
        is_alone = not kind and len(words) == 1
        return _of_axis("position" if is_alone else "" if "torque" in words else kind, last, unit, 1 if is_alone else 3)
    if set(words) & _TIME_WORDS and kind != "velocity":
        return Meaning("time", unit, 3 if words[0] in _TIME_WORDS else 2)
    if unit in PRESSURES and {"pressure", "stress"} & set(words) and not any(word.isdigit() for word in words):
        return Meaning("force", unit, 2)
    for quantity, known in _SINGLE.items():
        if set(words) & known or "_".join(words) in known:
            return Meaning(quantity, unit, 2)
    return Meaning("", unit)


def meaning_in(table: str, column: str, stated: str) -> Meaning:
    """Return the meaning of a column, whose topic or group may say more than its name, in the unit that the file states."""
    found = meaning_of(column)
    longer = meaning_of(f"{table.rpartition('/')[2]} {column}") if table and found.weight <= 1 else found
    best = max(found, longer, key=lambda one: one.weight)
    return replace(best, unit=stated or best.unit)


def _words(text: str) -> list[str]:
    return [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", text)]


def _of_axis(kind: str, axis: str, unit: str, weight: int) -> Meaning:
    before = {"force": "force_", "position": "", "rotation": "q", "slide": "slide_"}
    quantity = before[kind] + axis if kind in before else ""
    return Meaning(quantity, unit, weight) if quantity in QUANTITIES else Meaning("")


@dataclass(frozen=True)
class Family:
    """Columns that differ by their numbers alone.

    Attributes
    ----------
    columns : tuple of str
        In the order of their numbers.
    is_named : bool
        True if the name is a word for readings.
    follows : float
        Median correlation of the columns with what pressed; 0 if nothing is known to press.
    """

    columns: tuple[str, ...]
    is_named: bool
    follows: float = 0.0


def families(columns: Sequence[str], follows: Callable[[str], float]) -> list[Family]:
    """Return the columns that may be texels, the likeliest first: what follows the load, then what is named so, then the most.

    Parameters
    ----------
    columns : sequence of str
    follows : callable
        Correlation of a column with what pressed, 0 to 1.
    """
    groups: dict[str, list[tuple[tuple[int, ...], str]]] = {}
    for column in columns:
        plain, unit = name_and_unit(column)
        numbers = tuple(int(one) for one in re.findall(r"\d+", plain))
        if numbers:
            groups.setdefault(f"{re.sub(r'[0-9]+', '#', plain)} {unit}", []).append((numbers, column))
    found = []
    for key, members in groups.items():
        ranges = [sorted(set(axis)) for axis in zip(*(numbers for numbers, _ in members))]
        is_whole = all(one[-1] - one[0] == len(one) - 1 for one in ranges)
        if not is_whole or len({numbers for numbers, _ in members}) != len(members) != math.prod(map(len, ranges)):
            continue
        words = set(_words(key))
        is_named = bool(words & TEXEL_WORDS) and not words & _MOTIONS
        if len(members) > (1 if is_named else 2):
            own = tuple(column for _, column in sorted(members))
            found.append(Family(own, is_named, float(np.median([follows(one) for one in own]))))
    if not found:
        words_of = {name: {word.lower() for word in re.findall(r"[A-Za-z]+", name)} for name in columns}
        single = tuple(name for name in columns if words_of[name] & TEXEL_WORDS - {"p", "v", "s", "c"})
        return [Family(single, True)] if single else []
    best = max(one.follows for one in found)
    return sorted(found, key=lambda one: (one.follows < best - MUCH_LESS, not one.is_named, -len(one.columns)))


def time_unit(values: np.ndarray, stated: str) -> tuple[str, str, bool]:
    """Return the unit of time stamps, why, and whether it only seems so."""
    if stated in LOG_UNITS["s"]:
        return stated, "the file says so", False
    known = finite(values)
    steps = np.diff(known)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    size = float(np.abs(known).max()) if len(known) else 0.0
    for unit, seconds in (("ns", 1e-9), ("us", 1e-6), ("ms", 1e-3), ("s", 1.0)):
        if SINCE_1970 <= size * seconds < 3.0 * SINCE_1970 and step * seconds < 10.0:
            return unit, "such numbers count from 1970", False
    if 0.0 < step <= 0.5:
        return "s", f"samples are {step:.3g} s apart", False
    return "ms" if step <= 500.0 else "us", f"samples are {step:.4g} apart", True


def unit_of(kind: str, stated: str, size: float) -> tuple[str, str, bool]:
    """Return the unit of a length (``m``), a force (``N``) or a temperature (``°C``), why, and whether it only seems so.

    Parameters
    ----------
    kind : str
    stated : str
        By the file; empty if it states none.
    size : float
        How far the values span, or what a temperature is.
    """
    if stated in LOG_UNITS[kind] or kind == "N" and stated in PRESSURES:
        return stated, "the file says so", False
    if stated:
        return "?", f"it is in {stated}: write {kind} as unit, and how much of it one {stated} is as factor", True
    unit = next((unit for most, unit in BY_SIZE[kind] if abs(size) <= most), "?")  # of nothing known none
    what = "it is about" if kind == "°C" else "it changes by"
    advice = ": write unit, factor and zero, or remove the line" if unit == "?" else ""
    return unit, f"no unit is stated, and {what} {size:.4g}{advice}", True
