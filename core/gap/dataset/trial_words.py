# SPDX-License-Identifier: GPL-3.0-or-later
"""What a [[trial]] of a rig says, the numbers by which single recordings differ from the sensor among it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec

from ...errors import FileError
from ...io.schema import Name, Switch, wanted
from .trial import Trial

FREE = "free"
"""What a rig writes for a number that is fitted."""
SHARED_HEIGHT = "all"
"""Name of the contact height that all recordings share."""
LARGEST_HEIGHT = 1.0
"""Largest contact height, in metres: a larger one was given in millimetres."""
LARGEST_NUMBER = 1e6
"""Largest factor of a recording, whose inverse is the smallest, and largest zero."""

_Free = Literal["free"]
_Height = Annotated[float, wanted('write "free", or a number in metres', ge=-LARGEST_HEIGHT, le=LARGEST_HEIGHT)]
_Factor = Annotated[float, wanted('write "free" or a number above zero', ge=1.0 / LARGEST_NUMBER, le=LARGEST_NUMBER)]
_Zero = Annotated[float, wanted('write "free" or a number', ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]
_Newtons = Annotated[float, msgspec.Meta(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]
_Force = Annotated[tuple[_Newtons, ...], wanted('write "free", or three numbers in newtons', min_length=3, max_length=3)]


@dataclass(frozen=True)
class TrialWords:
    """The words of a [[trial]]; :class:`.Trial` says what they mean."""

    file: Any = None
    use: Literal["fit", "check"] = "fit"
    name: Any = None
    session: Name = ""
    started: Any = None
    tared: Switch = False
    specimen: Name = ""
    factor: _Free | _Factor = 1.0
    zero: _Free | _Zero = 0.0
    force_zero: _Free | _Force = (0.0, 0.0, 0.0)
    contact_height: _Free | _Height | None = None
    probe: Any = None
    repeats: Name = ""
    readings: Annotated[Mapping[str, Any], wanted('write { file = "readings.csv", late = 0.0 }')] | None = None

    def own_numbers(self, where: str) -> dict[str, Any]:
        """Return the own numbers of the trial; in the place of free ones the name that the recordings of a specimen share.

        Raises
        ------
        FileError
            It has a specimen and no free number.
        """
        numbers = {word: getattr(self, word) for word in ("factor", "zero", "force_zero", "contact_height")}
        if self.specimen and FREE not in numbers.values():
            raise FileError(f'{where} has a specimen and no free number: write factor = "free" or zero = "free".')
        name = self.specimen or Path(str(self.file)).stem
        return {word: name if value == FREE else value for word, value in numbers.items()}


@dataclass(frozen=True)
class SensorHeight:
    """The contact height of all recordings, from the rig's [sensor]."""

    contact_height: _Free | _Height = 0.0


def check_free_heights(trials: Sequence[Trial], path: Path) -> None:
    """Raise FileError for a contact height that is free, if none of the recordings that share it is fitted."""
    fitted = {trial.contact_height for trial in trials if trial.use == "fit"}
    for trial in trials:
        if isinstance(trial.contact_height, str) and trial.contact_height not in fitted:
            raise FileError(
                f"The contact_height of '{trial.name}.csv' in '{path.name}' is free, and no recording with the same one has "
                'use = "fit": give it as a number, or fit one recording of its specimen.'
            )
