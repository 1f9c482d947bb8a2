# SPDX-License-Identifier: GPL-3.0-or-later
"""What a dataset says of each frame: names, shapes and units, and the numbers themselves, taken from a run's recordings.

A sensor whose texels form a grid gives pictures, row 0 at the bottom and column 0 at the left as in its tactile images. Any
other gives lists in the order of its texels, whose places are in ``meta/texels.parquet``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from ..core.errors import FileError
from ..core.geometry.layout.grid_layout import GridLayout
from ..core.geometry.texels import Texels
from ..core.io.bake_folder import MANIFEST_NAME, RECORDING_NAME, folder_names, read_manifest
from ..core.io.bake_reader import Bake, checked_parameters
from ..core.io.input_files import read_bytes
from ..core.io.npz import DAMAGED
from ..core.io.recording_npz import load_recording
from ..core.io.sensor_npz import SENSOR_NAME, load_sensor, unpack_sensor
from ..core.model.digest import digest_of
from ..core.model.recording import Recording, SensorRecording
from ..core.model.scenario import Scenario
from ..core.model.sensor_parameters import Painted, SensorParameters
from ..core.model.shared_results import SharedResults
from ..core.response import metrics
from ..core.study.run_record import RunRecord, values_read
from ..core.study.study_file import Study

POSE_AXES = ("x", "y", "z", "qw", "qx", "qy", "qz")
CHANNELS = ("normal_force", "shear_x", "shear_y")
AXES = ("x", "y", "z")
VARIED = "varied."


@dataclass(frozen=True)
class Feature:
    """One column of the dataset.

    Attributes
    ----------
    name : str
    dtype : str
        As numpy names it, or "string".
    shape : tuple of int
        Of one frame; (1,) for a single number.
    names : tuple of str
        Of the numbers along the only axis, or of the axes where there are several.
    unit : str
        "1" for what has none, "" where nothing has a unit (names, indices).
    about : str
        What it is, in a sentence.
    channels : tuple of str
        Of the last axis where there are several.
    """

    name: str
    dtype: str
    shape: tuple[int, ...]
    names: tuple[str, ...]
    unit: str
    about: str
    channels: tuple[str, ...] = ()

    @property
    def is_constant(self) -> bool:
        """True for what is the same in all frames of a run."""
        return self.name.startswith(VARIED)


TIMESTAMP = Feature("timestamp", "float32", (1,), (), "s", "Time since the first frame.")
"""A column that LeRobot expects in every dataset."""


@dataclass(frozen=True)
class FrameStyle:
    """How texels stand in a dataset.

    Attributes
    ----------
    points : bool
        As a list in any case, and not as a picture where they form a grid.
    dtype : str
        Of forces and readings: "float32" or "float16".
    """

    points: bool = False
    dtype: str = "float32"

    @classmethod
    def of(cls, study: Study) -> FrameStyle:
        """Return what a study asks for."""
        return cls(study.points, "float16" if study.half_precision else "float32")


PLAIN_STYLE = FrameStyle()
HALF_ERROR = "Rounded to 16 bits: a relative error of 2^-11 at most, and 3e-8 absolute below 6.1e-5."
"""Of IEEE 754's binary16: 11 digits of the mantissa, and steps of 2^-24 below 2^-14."""


@dataclass(frozen=True)
class SensorRun:
    """One sensor in one run; without a manifest its parameters are not known."""

    texels: Texels
    painted: Painted
    recording: Recording
    arrays: SensorRecording
    parameters: SensorParameters | None
    unit: str


@dataclass(frozen=True)
class Layout:
    """What the frames of all runs in one dataset have in common.

    Attributes
    ----------
    features : tuple of Feature
    fps : float
    texels : dict of str to Texels
        By sensor.
    digest : str
        Equal for the same features, the same texels and the same rate.
    """

    features: tuple[Feature, ...]
    fps: float
    texels: dict[str, Texels]
    digest: str

    @cached_property
    def frame_features(self) -> tuple[Feature, ...]:
        """Time and features that change from frame to frame, in their order."""
        return (TIMESTAMP, *(item for item in self.features if not item.is_constant))


@dataclass(frozen=True)
class RunFrames:
    """The frames of a run as columns.

    Attributes
    ----------
    layout : Layout
    columns : dict of str to (F, …) ndarray
        By the names of the layout's `frame_features`.
    """

    layout: Layout
    columns: dict[str, np.ndarray]

    @property
    def rows(self) -> int:
        """Number of frames."""
        return len(self.columns[TIMESTAMP.name])


def read_frames(run: RunRecord, shared: SharedResults | None = None, style: FrameStyle = PLAIN_STYLE) -> RunFrames:
    """Read the recordings of a run.

    Parameters
    ----------
    run : RunRecord
    shared : SharedResults, optional
        Of the runs that are read one after the other.
    style : FrameStyle

    Raises
    ------
    FileError
        A file of it is missing or damaged, or holds a number that 32 bits cannot.
    """
    shared = shared or SharedResults()
    # The names of their folders are unique and have no slash, which LeRobot does not allow in names.
    sensors = {own: _read_sensor(run.folder / own, shared) for own in folder_names(run.sensors).values()}
    if not sensors:
        raise FileError(f"The run '{run.folder}' has no sensor: delete the folder and run the sweep again.")
    too_large = f"the run '{run.folder}' is too large: delete the run and sweep again."
    return _frames(shared, sensors, run.values, too_large, style)


def solved_frames(
    scenario: Scenario,
    recording: Recording,
    numbers: RunRecord,
    shared: SharedResults,
    style: FrameStyle = PLAIN_STYLE,
) -> RunFrames:
    """Return the frames of a run as it was solved.

    Raises
    ------
    PalpateError
        A number of it is too large for the bits that it gets.
    """
    names = folder_names(recording.sensors)
    sensors = {
        names[own.name]: SensorRun(
            own.texels, own.painted, recording, recording.sensors[own.name], own.parameters, own.parameters.unit
        )
        for own in scenario.sensors
        if own.readout
    }
    advice = "leave half_precision out" if style.dtype == "float16" else "vary less widely"
    return _frames(shared, sensors, values_read(numbers.values), f"run {numbers.index} is too large: {advice}.", style)


def bake_frames(bake: Bake) -> RunFrames:
    """Return the frames of a bake, as of a run of which nothing was varied.

    Raises
    ------
    FileError
        A number of it is too large for 32 bits.
    """
    names = folder_names(bake.texels)
    sensors = {
        names[name]: SensorRun(
            texels,
            bake.painted[name],
            bake.recording,
            bake.recording.sensors[name],
            bake.parameters[name],
            bake.parameters[name].unit,
        )
        for name, texels in bake.texels.items()
    }
    return _frames(SharedResults(), sensors, {}, "the bake is too large: export it as HDF5 or NPZ.", PLAIN_STYLE)


def _frames(
    shared: SharedResults, sensors: dict[str, SensorRun], varied: Mapping[str, Any], too_large: str, style: FrameStyle
) -> RunFrames:
    """Return the frames of some sensors of one run; `too_large` ends the sentence about a number that its bits cannot hold."""
    first = next(iter(sensors.values())).recording
    features: list[Feature] = []
    columns = {TIMESTAMP.name: (first.times - first.times[0]).astype(TIMESTAMP.dtype)}
    with np.errstate(over="ignore"):  # what is too large is looked for where all is narrow
        for feature, values in _all_features(first, sensors, style):
            features.append(feature)
            columns[feature.name] = _narrowed(too_large, feature, values)
    features += [_varied_feature(name, value) for name, value in varied.items()]
    fps = _frame_rate(first.times)
    texels = {name: sensor.texels for name, sensor in sensors.items()}
    digest = _layout_digest(tuple(features), fps, tuple(texels), tuple(shared.of(digest_of, own) for own in texels.values()))
    return RunFrames(Layout(tuple(features), fps, texels, digest), columns)


@lru_cache(maxsize=64)
def _layout_digest(features: tuple[Feature, ...], fps: float, names: tuple[str, ...], texels: tuple[str, ...]) -> str:
    return digest_of((features, fps, names, texels))


def _read_sensor(folder: Path, shared: SharedResults) -> SensorRun:
    recording = load_recording(folder / RECORDING_NAME)
    texels, painted = _read_texels(folder / SENSOR_NAME, shared)
    if len(recording.sensors) != 1 or len(recording.frames) == 0:
        raise FileError(f"'{folder / RECORDING_NAME}' is not a recording of one sensor: delete the run and sweep again.")
    (arrays,) = recording.sensors.values()
    if arrays.normal_force.shape[1] != len(texels):
        raise FileError(f"'{folder}' holds a recording and a sensor of different runs: delete the run and sweep again.")
    parameters, unit = None, ""
    if (folder / MANIFEST_NAME).is_file():
        manifest = read_manifest(folder)
        parameters, unit = checked_parameters(folder, manifest), manifest.unit
    return SensorRun(texels, painted, recording, arrays, parameters, unit)


def _read_texels(path: Path, shared: SharedResults) -> tuple[Texels, Painted]:
    """Return what ``sensor.npz`` says; runs whose files are equal get the same objects."""
    try:
        return shared.of(unpack_sensor, read_bytes(path))
    except (OSError, *DAMAGED):
        return load_sensor(path)  # it says what is wrong


def _frame_rate(times: np.ndarray) -> float:
    """Return frames per second, to nine digits, so that rounding of the times makes no other rate; 1 for a single frame."""
    span = float(times[-1] - times[0])
    return float(f"{(len(times) - 1) / span:.9g}") if len(times) > 1 and span > 0 else 1.0


def _narrowed(too_large: str, feature: Feature, values: np.ndarray) -> np.ndarray:
    """Return the values in the type that the dataset stores."""
    narrow = np.ascontiguousarray(values, dtype=feature.dtype)
    if feature.dtype != "bool" and narrow.size and not math.isfinite(float(narrow.max()) - float(narrow.min())):
        bits = feature.dtype.removeprefix("float")
        raise FileError(f"A number of '{feature.name}' has no place in {bits} bits, {too_large}")
    return narrow


def _all_features(
    recording: Recording, sensors: dict[str, SensorRun], style: FrameStyle
) -> Iterator[tuple[Feature, np.ndarray]]:
    for name, sensor in sensors.items():
        yield from _texel_features(name, sensor, style)
        yield from _net_features(name, sensor.arrays)
    yield from _pose_features(recording)


def tactile_name(sensor: str) -> str:
    """Return the column of the forces on the texels."""
    return f"observation.tactile.{sensor}"


def net_force_name(sensor: str) -> str:
    """Return the column of the force on a sensor."""
    return f"observation.net_force.{sensor}"


def by_texel(values: np.ndarray, texels: Texels) -> np.ndarray:
    """Return (F, rows, columns, 3) or (F, n, 3) forces in the order of the texels, (F, n, 3)."""
    if values.ndim < 4:
        return values
    assert isinstance(texels.layout, GridLayout)  # which alone gives pictures
    return values[:, texels.layout.row, texels.layout.column]


def varied_name(name: str) -> str:
    """Return the column of what was varied; LeRobot allows no slash."""
    return f"{VARIED}{name.replace('/', '_')}"


def _varied_feature(name: str, value: Any) -> Feature:
    about = "Varied properties; the same in all frames of a run."
    return Feature(varied_name(name), "string" if isinstance(value, str) else "float64", (1,), (), "", about)


def _texel_features(name: str, sensor: SensorRun, style: FrameStyle) -> Iterator[tuple[Feature, np.ndarray]]:
    """Yield what is recorded of each texel: forces, readings, and the truth about contact."""
    texels, arrays = sensor.texels, sensor.arrays
    layout = None if style.points or not isinstance(texels.layout, GridLayout) else texels.layout
    shape: tuple[int, ...] = (len(texels),) if layout is None else layout.shape
    names = ("row", "column") if len(shape) == 2 else ("texel",)

    def placed(dtype: str, *channels: np.ndarray) -> np.ndarray:
        """Return numbers of the texels, (F, n) each, where the dataset has them: one number, or a list of them, per place."""
        picture = np.zeros((len(channels[0]), math.prod(shape), len(channels)), dtype)
        places = slice(None) if layout is None else _places(layout)
        for number, values in enumerate(channels):
            picture[:, places, number] = values
        return picture.reshape(-1, *shape, *(len(channels),) * (len(channels) > 1))

    error = f" {HALF_ERROR}" if style.dtype == "float16" else ""
    about = f"Forces on the texels: along the normal, and shear along the texel's x and y axes.{error}"
    image = Feature(tactile_name(name), style.dtype, (*shape, 3), (*names, "channel"), "N", about, CHANNELS)
    yield image, placed(style.dtype, arrays.normal_force, arrays.shear[:, :, 0], arrays.shear[:, :, 1])
    about = f"Readings of the texels, in the sensor's unit.{error}"
    readings = placed(style.dtype, arrays.reading)
    yield Feature(f"observation.reading.{name}", style.dtype, shape, names, sensor.unit, about), readings
    touch = placed("bool", arrays.contact)
    yield Feature(f"contact.touch.{name}", "bool", shape, names, "1", "Which texels touch something."), touch
    if sensor.parameters is not None:
        slips = placed("bool", metrics.slipping(arrays, sensor.parameters, sensor.painted))
        about = "Which texels touch, move, and are at the limit of friction."
        yield Feature(f"contact.slip.{name}", "bool", shape, names, "1", about), slips


def _places(layout: GridLayout) -> slice | np.ndarray:
    """Return where the texels are among the pixels, row by row; a slice where each pixel is the texel of its number."""
    places = layout.row * layout.columns + layout.column
    return slice(None) if np.array_equal(places, np.arange(layout.rows * layout.columns)) else places


def _net_features(name: str, arrays: SensorRecording) -> Iterator[tuple[Feature, np.ndarray]]:
    frame = "in the frame of the sensor's body"
    yield _vector(net_force_name(name), "N", f"Net force on the sensor, {frame}."), arrays.net_force
    about = f"Net torque on the sensor about the origin of its body, {frame}."
    yield _vector(f"observation.net_torque.{name}", "N m", about), arrays.net_torque
    about = f"Force-weighted mean of the contact points, {frame}; zero without contact."
    yield _vector(f"contact.centre_of_pressure.{name}", "m", about), arrays.centre_of_pressure


def _vector(name: str, unit: str, about: str) -> Feature:
    return Feature(name, "float32", (3,), AXES, unit, about)


def _pose_features(recording: Recording) -> Iterator[tuple[Feature, np.ndarray]]:
    """Yield the poses of all bodies as one list, which is how LeRobot keeps the state of a robot."""
    count = len(recording.body_names)
    names = tuple(f"{body}.{axis}" for body in recording.body_names for axis in POSE_AXES)
    about = "Poses of the bodies in the world: position, m, and quaternion."
    yield Feature("observation.state", "float32", (7 * count,), names, "m, 1", about), recording.poses.reshape(-1, 7 * count)
