# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings as .npz: numpy reads them without Palpate, bit for bit, and equal recordings are equal files.

Members: ``header.npy`` (JSON text), ``frames``, ``times``, ``poses``, ``velocities`` and, for sensor number i of the
header's list, ``sensor_<i>/normal_force`` and so on with the names of :class:`.recording.SensorRecording`. A sensor with
several channels also has ``sensor_<i>/channels/values`` and ``…/clipped``, whose unit, names and places are in the header.

A file that also has the sensors has ``sensor_<i>/texels/…`` as in :mod:`.recording_npz`, and
``sensor_<i>/parameters`` (JSON text). A program that reads recordings reads these files, too.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileError, PalpateError, ParameterError, os_error_reason
from ..geometry.grid_layout import GridLayout
from ..geometry.texels import Texels
from ..geometry.texture_maps import UVLayout
from ..model.recording import (
    CLIPPED,
    SENSOR_FIELDS,
    VALUES,
    Recording,
    SensorArrays,
    SensorRecording,
    VectorReadings,
    row_blocks,
)
from ..model.sensor_parameters import Painted, SensorParameters, stated_parameters
from .file_writing import atomic_write
from .input_files import open_regular


def write_arrays(path: str | os.PathLike, arrays: Mapping[str, np.ndarray]) -> None:
    """Write arrays as .npz, whole or not at all; equal arrays give equal bytes.

    Parameters
    ----------
    path : path
    arrays : mapping of str to ndarray

    Raises
    ------
    FileError
        The file cannot be written.
    """
    if any(array.dtype.hasobject for array in arrays.values()):
        raise ValueError("objects are not written: reading them would run code")
    with atomic_write(path) as temporary, open(temporary, "wb") as file:
        np.savez_compressed(file, **{name: array.copy("C") if array.flags.fnc else array for name, array in arrays.items()})


@contextmanager
def open_arrays(path: str | os.PathLike, what: str, advice: str) -> Iterator[Any]:
    """Give the arrays of an .npz file by name, and say in one sentence what is wrong with it.

    Parameters
    ----------
    path : path
    what : str
        What the file should be, as in "recording".
    advice : str
        What to do if it is missing or damaged.

    Raises
    ------
    FileError
        There is no such file, it cannot be read, or the body of the ``with`` statement meets damage.
    """
    if not Path(path).exists():
        raise FileError(f"'{path}' does not exist: {advice}, or choose another file.")
    try:
        with open_regular(path) as file, np.load(file, allow_pickle=False) as members:
            yield members
    except OSError as error:
        raise FileError(f"'{path}' could not be read ({os_error_reason(error)}): choose another file.") from error
    except PalpateError:
        raise
    except Exception as error:  # a reader meets anything in a damaged archive
        raise FileError(f"'{path}' is damaged or no {what} ({error}): {advice}.") from error


SENSOR_FORMAT = "palpate-sensor/1"
SENSOR_NAME = "sensor.npz"

_ARRAYS = tuple(item.name for item in fields(Texels) if item.name != "layout")
_LAYOUTS: dict[str, type[GridLayout] | type[UVLayout]] = {"grid": GridLayout, "uv": UVLayout}


def save_sensor(path: str | os.PathLike, texels: Texels, painted: Painted | None = None) -> None:
    """Write texels, their layout and what is painted on them as .npz, whole or not at all.

    Raises
    ------
    FileError
        The file cannot be written.
    """
    write_arrays(path, sensor_arrays(texels, painted))


def sensor_arrays(texels: Texels, painted: Painted | None = None) -> dict[str, np.ndarray]:
    """Return the members of the file by name."""
    kind = next(name for name, cls in _LAYOUTS.items() if isinstance(texels.layout, cls))
    arrays = {"format": np.array(SENSOR_FORMAT), "layout": np.array(kind)}
    arrays |= {name: np.asarray(getattr(texels, name)) for name in _ARRAYS}
    arrays |= {f"layout/{item.name}": np.asarray(getattr(texels.layout, item.name)) for item in fields(texels.layout)}
    stated = {f"painted/{item.name}": getattr(painted, item.name, None) for item in fields(Painted)}
    return arrays | {name: np.asarray(values) for name, values in stated.items() if values is not None}


def load_sensor(path: str | os.PathLike) -> tuple[Texels, Painted]:
    """Read what :func:`save_sensor` wrote.

    Raises
    ------
    FileError
        There is no such file, or it is damaged or something else.
    """
    with open_arrays(path, "sensor", "bake again with this version") as members:
        return sensor_in(members)


def sensor_in(members: Mapping[str, np.ndarray]) -> tuple[Texels, Painted]:
    """Return the sensor whose members an archive gives by name; raises anything where these are damaged."""
    if str(members["format"]) != SENSOR_FORMAT:
        raise ValueError(f"its format is not '{SENSOR_FORMAT}'")
    cls = _LAYOUTS[str(members["layout"])]
    stored = {item.name: f"layout/{item.name}" for item in fields(cls)}
    layout: Any = cls(**{name: _plain(members[key]) for name, key in stored.items() if key in members})
    texels = Texels(**{name: members[name] for name in _ARRAYS}, layout=layout)
    found = {item.name: f"painted/{item.name}" for item in fields(Painted)}
    return texels, Painted(**{name: np.asarray(members[key], float) for name, key in found.items() if key in members})


def _plain(value: np.ndarray) -> Any:
    return value if value.ndim else value.item()


RECORDING_FORMAT = "palpate-recording/2"


Sensors = dict[str, tuple[Texels, Painted, SensorParameters]]
"""Texels, what is painted on them, and parameters of each sensor by its name."""


def save_recording(path: str | os.PathLike, recording: Recording, sensors: Sensors | None = None) -> None:
    """Write a recording as .npz, with its sensors if they are given, whole or not at all; the same data give the same bytes.

    Raises
    ------
    FileError
        The file cannot be written.
    ValueError
        A number is not finite or an array has another number of frames (a fault of the program, not of the user).
    """
    arrays = {name: np.asarray(getattr(recording, name)) for name in ("frames", "times", "poses", "velocities")}
    arrays |= sensor_members(recording.sensors.values())
    for name, array in arrays.items():
        if len(array) != len(recording.frames):
            raise ValueError(f"'{name}' has {len(array)} frames, the recording {len(recording.frames)}")
        if array.dtype.kind == "f" and not all(np.isfinite(array[rows]).all() for rows in row_blocks(array)):
            raise ValueError(f"'{name}' of the recording has values that are not finite")
        if array.dtype.kind not in "fiubU":
            raise ValueError(f"'{name}' of the recording has type {array.dtype}")
    for i, name in enumerate(recording.sensors):
        if sensors and name in sensors:
            texels, painted, parameters = sensors[name]
            arrays |= {f"sensor_{i}/texels/{key}": values for key, values in sensor_arrays(texels, painted).items()}
            arrays[f"sensor_{i}/parameters"] = np.array(json.dumps(asdict(parameters)))
    write_arrays(path, {"header": np.array(json.dumps(_header(recording), allow_nan=False)), **arrays})


def sensor_members(sensors: Iterable[SensorArrays]) -> dict[str, np.ndarray]:
    """Return the arrays of sensors, at one frame or of a recording, under the names that they have in its file."""
    members: dict[str, np.ndarray] = {}
    for i, sensor in enumerate(sensors):
        members |= {f"sensor_{i}/{name}": np.asarray(getattr(sensor, name)) for name in SENSOR_FIELDS}
        if sensor.channels is not None:
            members[f"sensor_{i}/{VALUES}"] = np.asarray(sensor.channels.values)
            members[f"sensor_{i}/{CLIPPED}"] = np.asarray(sensor.channels.clipped)
    return members


def load_recording(path: str | os.PathLike) -> Recording:
    """Read a recording that :func:`save_recording` wrote.

    Raises
    ------
    FileError
        There is no such file, or it is damaged or something else.
    """
    with open_arrays(path, "recording", "bake again") as members:
        return _recording(path, members)


def _header(recording: Recording) -> dict[str, Any]:
    channels = {name: described(sensor.channels) for name, sensor in recording.sensors.items() if sensor.channels is not None}
    return {
        "format": RECORDING_FORMAT,
        "sensors": list(recording.sensors),
        "bodies": list(recording.body_names),
        "dt": float(recording.dt),
        "digest": recording.digest,
        "warnings": list(recording.warnings),
        "step_reason": recording.step_reason,
        **({"channels": channels} if channels else {}),
    }


def described(channels: VectorReadings) -> dict[str, Any]:
    """Return names, units and ranges of channels as JSON."""
    place = None if channels.place is None else channels.place.tolist()
    return {"unit": channels.unit, "names": list(channels.names), "place": place}


def _channels(members: Any, i: int, about: dict[str, Any] | None) -> VectorReadings | None:
    if about is None:
        return None
    values, clipped = (members[f"sensor_{i}/{key}"] for key in (VALUES, CLIPPED))
    place = None if about["place"] is None else np.array(about["place"], float)
    names = tuple(str(name) for name in about["names"])
    shape = (*values.shape[:1], values.shape[1] if place is None else len(place), len(names))
    if values.shape != shape or clipped.shape != shape or values.dtype.kind != "f" or clipped.dtype.kind != "b":
        raise ValueError(f"its channels have the shapes {values.shape} and {clipped.shape}, not {shape}")
    return VectorReadings(values, clipped, str(about["unit"]), names, place)


def _recording(path: str | os.PathLike, members: Any) -> Recording:
    if "header" not in members:
        raise FileError(f"'{path}' is not a recording of Palpate: choose a recording.npz of a bake.")
    header = json.loads(str(members["header"]))
    if header["format"] != RECORDING_FORMAT:
        raise FileError(
            f"'{path}' has the format {header['format']!r}, not '{RECORDING_FORMAT}': bake again with this version."
        )
    arrays = {name: members[name] for name in ("frames", "times", "poses", "velocities")}
    sensors = {}
    for i, name in enumerate(header["sensors"]):
        own = {key: members[f"sensor_{i}/{key}"] for key in SENSOR_FIELDS}
        sensors[str(name)] = SensorRecording(**own, channels=_channels(members, i, header.get("channels", {}).get(name)))
    count = len(arrays["frames"])
    parts = [*arrays.values(), *(array for sensor in sensors.values() for array in sensor.arrays())]
    if any(len(part) != count for part in parts):
        raise ValueError("its arrays have different numbers of frames")
    return Recording(
        **arrays,
        sensors=sensors,
        body_names=tuple(str(name) for name in header["bodies"]),
        dt=float(header["dt"]),
        digest=str(header["digest"]),
        warnings=tuple(str(warning) for warning in header["warnings"]),
        step_reason=str(header.get("step_reason", "")),
    )


def load_with_sensors(path: str | os.PathLike) -> tuple[Recording, Sensors]:
    """Read what :func:`save_recording` wrote with sensors, or a recording alone, which has none.

    Raises
    ------
    FileError
        There is no such file, or it is damaged or something else.
    """
    sensors: Sensors = {}
    try:
        with open_arrays(path, "recording", "write it again") as members:
            recording = _recording(path, members)
            for i, name in enumerate(recording.sensors):
                if f"sensor_{i}/parameters" not in members:
                    continue
                start = f"sensor_{i}/texels/"
                texels, painted = sensor_in({key.removeprefix(start): members[key] for key in members if key.startswith(start)})
                words = json.loads(str(members[f"sensor_{i}/parameters"]))
                parameters = SensorParameters(**stated_parameters(words, f"'{name}'"))
                parameters.check(name)
                if len(texels) != recording.sensors[name].normal_force.shape[1]:
                    raise ParameterError("its texels and its forces differ in number")
                sensors[name] = texels, painted, parameters
                recording.sensors[name].unit = parameters.unit
    except ParameterError as error:
        raise FileError(f"'{path}' is damaged ({error}): write it again.") from error
    return recording, sensors
