# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers by which single recordings differ from the sensor: what a [[trial]] says of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ...errors import FileError
from ...io.toml_file import checked_name, is_number

FREE = "free"
"""What a rig writes for a number that is fitted."""
LARGEST_NUMBER = 1e6
"""Largest factor of a recording, whose inverse is the smallest, and largest zero."""


def own_numbers(entry: dict[str, Any], where: str) -> dict[str, str | float]:
    """Factor and zero of a trial: numbers, or names of free numbers, which the recordings of one specimen share."""
    specimen = entry.get("specimen", "")
    if "specimen" in entry:
        specimen = checked_name(specimen, f"specimen of {where}")
    numbers: dict[str, str | float] = {"factor": 1.0, "zero": 0.0}
    for word in numbers:
        value = entry.get(word, numbers[word])
        if value == FREE:
            numbers[word] = specimen or Path(str(entry.get("file"))).stem
        elif is_number(value) and abs(value) <= LARGEST_NUMBER and (word == "zero" or value >= 1.0 / LARGEST_NUMBER):
            numbers[word] = float(value)
        else:
            wanted = "a number" if word == "zero" else "a number above zero"
            raise FileError(f'{word} of {where} is {value!r:.60}: write "free" or {wanted}.')
    if specimen and FREE not in [entry.get(word) for word in (*numbers, "force_zero")]:
        raise FileError(f'{where} has a specimen and no free number: write factor = "free" or zero = "free".')
    return numbers


def force_zero_of(entry: dict[str, Any], where: str) -> str | tuple[float, ...]:
    """What the force sensor shows without load: three numbers, or the name of free ones that a specimen's recordings share."""
    value = entry.get("force_zero", [0.0, 0.0, 0.0])
    if value == FREE:
        return str(entry.get("specimen") or Path(str(entry.get("file"))).stem)
    if isinstance(value, list) and len(value) == 3 and all(is_number(one) and abs(one) <= LARGEST_NUMBER for one in value):
        return tuple(float(one) for one in value)
    raise FileError(f'force_zero of {where} is {value!r:.60}: write "free", or three numbers in newtons.')
