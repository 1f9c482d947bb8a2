# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers by which single recordings differ from the sensor: what a [[trial]] says of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...errors import FileError
from ...io.toml_file import checked_name, is_number
from .trial import Trial

FREE = "free"
"""What a rig writes for a number that is fitted."""
SHARED_HEIGHT = "all"
"""Name of the contact height that all recordings share."""
LARGEST_HEIGHT = 1.0
"""Largest contact height, in metres: a larger one was given in millimetres."""
LARGEST_NUMBER = 1e6
"""Largest factor of a recording, whose inverse is the smallest, and largest zero."""


def own_numbers(entry: dict[str, Any], where: str) -> dict[str, str | float]:
    """Factor and zero of a trial: numbers, or names of free numbers, which the recordings of one specimen share."""
    specimen = entry.get("specimen", "")
    if "specimen" in entry:
        specimen = checked_name(specimen, f"specimen of {where}")
    numbers: dict[str, str | float] = {"factor": 1.0, "zero": 0.0}
    for word in tuple(numbers):
        value = entry.get(word, numbers[word])
        if value == FREE:
            numbers[word] = specimen or Path(str(entry.get("file"))).stem
        elif is_number(value) and abs(value) <= LARGEST_NUMBER and (word == "zero" or value >= 1.0 / LARGEST_NUMBER):
            numbers[word] = float(value)
        else:
            wanted = "a number" if word == "zero" else "a number above zero"
            raise FileError(f'{word} of {where} is {value!r:.60}: write "free" or {wanted}.')
    if specimen and FREE not in [entry.get(word) for word in (*numbers, "force_zero", "contact_height")]:
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


def contact_height_of(words: Mapping[str, Any], where: str, name: str) -> str | float:
    """Contact height of a table, [sensor] or a [[trial]]: a length in metres, or `name` if it is free."""
    value = words.get("contact_height", 0.0)
    if value == FREE:
        return name
    if is_number(value) and abs(value) <= LARGEST_HEIGHT:
        return float(value)
    raise FileError(f'contact_height of {where} is {value!r:.60}: write "free", or a number in metres.')


def with_contact_heights(
    trials: Sequence[Trial], entries: Sequence[dict[str, Any]], sensor: Mapping[str, Any], path: Path
) -> list[Trial]:
    """Return trials with their contact heights, those of the [sensor] where a [[trial]] says nothing.

    Raises
    ------
    FileError
        A height is no length, or it is free and none of the recordings that share it is fitted.
    """
    found = []
    for number, (trial, entry) in enumerate(zip(trials, entries, strict=True), start=1):
        if trial.stimulus == "force":
            found.append(trial)  # what presses is known, wherever contact begins
        elif "contact_height" in entry:
            name = str(entry.get("specimen") or Path(str(entry.get("file"))).stem)
            height = contact_height_of(entry, f"Trial {number} of '{path.name}'", name)
            found.append(replace(trial, contact_height=height))
        else:
            found.append(replace(trial, contact_height=contact_height_of(sensor, f"[sensor] of '{path.name}'", SHARED_HEIGHT)))
    fitted = {trial.contact_height for trial in found if trial.use == "fit"}
    for trial in found:
        if isinstance(trial.contact_height, str) and trial.contact_height not in fitted:
            raise FileError(
                f"The contact_height of '{trial.name}.csv' in '{path.name}' is free, and no recording with the same one has "
                'use = "fit": give it as a number, or fit one recording of its specimen.'
            )
    return found
