# SPDX-License-Identifier: GPL-3.0-or-later
"""A recording and the sensors that made it in one .npz: the members of :mod:`.recording_npz`, and a few more.

For sensor number i of the header's list the further members are ``sensor_<i>/texels/…`` as in :mod:`.sensor_npz`, and
``sensor_<i>/parameters`` (JSON text). A program that reads recordings reads these files, too.
"""

from __future__ import annotations

import json
import os
from dataclasses import asdict
from typing import Any

import numpy as np

from ..errors import FileError, PalpateError
from ..geometry.texels import Texels
from ..model.recording import Recording
from ..model.sensor_parameters import Painted, SensorParameters
from .npz import DAMAGED, open_archive, write_arrays
from .recording_npz import load_recording, recording_arrays
from .regular_file import open_regular
from .sensor_npz import sensor_arrays, sensor_in
from .sensor_toml import stated_parameters

Sensors = dict[str, tuple[Texels, Painted, SensorParameters]]
"""What belongs to the recording of each sensor, by its name."""


def save(path: str | os.PathLike, recording: Recording, sensors: Sensors) -> None:
    """Write a recording with its sensors, whole or not at all.

    Raises
    ------
    FileError
        The file cannot be written.
    """
    arrays = recording_arrays(recording)
    for i, name in enumerate(recording.sensors):
        if name in sensors:
            texels, painted, parameters = sensors[name]
            arrays |= {f"sensor_{i}/texels/{key}": values for key, values in sensor_arrays(texels, painted).items()}
            arrays[f"sensor_{i}/parameters"] = np.array(json.dumps(asdict(parameters)))
    write_arrays(path, arrays)


def load(path: str | os.PathLike) -> tuple[Recording, Sensors]:
    """Read what :func:`save` wrote, or a recording alone, which has no sensors.

    Raises
    ------
    FileError
        There is no such file, or it is damaged or something else.
    """
    recording = load_recording(path)
    sensors: Sensors = {}
    try:
        with open_regular(path) as opened, open_archive(opened) as members:
            for i, name in enumerate(recording.sensors):
                if f"sensor_{i}/parameters" not in members.files:
                    continue
                texels, painted = sensor_in(_Part(members, f"sensor_{i}/texels/"))
                parameters = SensorParameters(
                    **stated_parameters(json.loads(str(members[f"sensor_{i}/parameters"])), f"'{name}'")
                )
                parameters.check(name)
                if len(texels) != recording.sensors[name].normal_force.shape[1]:
                    raise ValueError("its texels and its forces differ in number")
                sensors[name] = texels, painted, parameters
    except (*DAMAGED, PalpateError) as error:
        raise FileError(f"'{path}' is damaged ({error}): write it again.") from error
    return recording, sensors


class _Part:
    """The members of an archive whose names begin alike, without that beginning."""

    def __init__(self, members: Any, start: str):
        self._members, self._start = members, start
        self.files = [name.removeprefix(start) for name in members.files if name.startswith(start)]

    def __getitem__(self, name: str) -> np.ndarray:
        found: np.ndarray = self._members[self._start + name]
        return found
