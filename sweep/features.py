# SPDX-License-Identifier: GPL-3.0-or-later
"""Features of each frame in a dataset: names, shapes and units, and the numbers themselves, taken from a run's recording.

A sensor whose texels form a grid gives pictures, row 0 at the bottom and column 0 at the left as in its tactile images. Any
other gives lists in the order of its texels, whose places are in ``meta/texels.parquet``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import msgspec
import numpy as np

from ..core import response
from ..core.errors import FileError, PalpateError
from ..core.geometry.grid_layout import GridLayout
from ..core.geometry.texels import Texels
from ..core.io.bake_folder import folder_names
from ..core.io.file_writing import atomic_write
from ..core.io.recording_npz import Sensors, load_sensor, save_sensor
from ..core.model.recording import Recording, SensorRecording, digest_of
from ..core.model.sensor_parameters import Painted, SensorParameters
from ..core.model.shared_results import SharedResults

POSE_AXES = ("x", "y", "z", "qw", "qx", "qy", "qz")
CHANNELS = ("normal_force", "shear_x", "shear_y")
AXES = ("x", "y", "z")
FEATURES_NAME = "features.json"


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


TIMESTAMP = Feature("timestamp", "float32", (1,), (), "s", "Time since the first frame.")
"""A column that LeRobot expects in every dataset."""


HALF_ERROR = "Rounded to 16 bits: a relative error of 2^-11 at most, and 3e-8 absolute below 6.1e-5."
"""Of IEEE 754's binary16: 11 digits of the mantissa, and steps of 2^-24 below 2^-14."""


@dataclass(frozen=True)
class Layout:
    """Features that the frames of many runs share.

    Attributes
    ----------
    features : tuple of Feature
        Time, and what changes from frame to frame.
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

    def save(self, folder: Path) -> None:
        """Write it into a folder of its own in `folder`, unless it is there; raise FileError if that is not possible."""
        own = folder / self.digest
        if (own / FEATURES_NAME).exists():
            return
        own.mkdir(parents=True, exist_ok=True)
        for name, texels in self.texels.items():
            save_sensor(own / f"{name}.npz", texels)
        content = _LayoutFile(self.features, self.fps, list(self.texels))
        with atomic_write(own / FEATURES_NAME) as fresh:  # last: it says that all is there
            fresh.write_bytes(msgspec.json.encode(content))

    @classmethod
    def load(cls, folder: Path, digest: str) -> Layout:
        """Return the layout that :meth:`save` wrote; raise FileError where it is missing or damaged."""
        path = folder / digest / FEATURES_NAME
        try:
            found = msgspec.json.decode(path.read_bytes(), type=_LayoutFile)
        except (OSError, msgspec.MsgspecError) as error:
            raise FileError(f"'{path}' is missing or damaged ({error}): give another folder with --out.") from error
        texels = {name: load_sensor(folder / digest / f"{name}.npz")[0] for name in found.sensors}
        return cls(found.features, found.fps, texels, digest)


@dataclass(frozen=True)
class _LayoutFile:
    features: tuple[Feature, ...]
    fps: float
    sensors: list[str]


def frames_of(
    recording: Recording,
    sensors: Sensors,
    shared: SharedResults | None = None,
    points: bool = False,
    half_precision: bool = False,
) -> tuple[Layout, dict[str, np.ndarray]]:
    """Return the layout of the frames of a run, and (F, …) columns by the names of its features.

    Parameters
    ----------
    recording : Recording
    sensors : mapping of str to (Texels, Painted, SensorParameters)
        Of the recording.
    shared : SharedResults, optional
        Of the runs of this process.
    points : bool
        True for texels as a list in any case, and not as a picture where they form a grid.
    half_precision : bool
        True for forces and readings of texels in 16 bits.

    Raises
    ------
    PalpateError
        A number is too large for its bits.
    """
    names = folder_names(sensors)  # unique and without a slash, which LeRobot does not allow in names
    features, columns = [TIMESTAMP], {TIMESTAMP.name: (recording.times - recording.times[0]).astype(TIMESTAMP.dtype)}
    with np.errstate(over="ignore"):  # what is too large is looked for where all is narrow
        for feature, values in _all_features(recording, sensors, names, points, half_precision):
            features.append(feature)
            columns[feature.name] = _narrowed(feature, values)
    fps, texels = _frame_rate(recording.times), {names[name]: own for name, (own, _, _) in sensors.items()}
    shared = shared or SharedResults()
    digests = tuple(shared.of(digest_of, own) for own in texels.values())
    digest = _layout_digest(tuple(features), fps, tuple(texels), digests)
    return Layout(tuple(features), fps, texels, digest), columns


@lru_cache(maxsize=64)
def _layout_digest(features: tuple[Feature, ...], fps: float, names: tuple[str, ...], texels: tuple[str, ...]) -> str:
    return digest_of((features, fps, names, texels))[:24]


def _frame_rate(times: np.ndarray) -> float:
    """Return frames per second, to nine digits, so that rounding of the times makes no other rate; 1 for a single frame."""
    span = float(times[-1] - times[0])
    return float(f"{(len(times) - 1) / span:.9g}") if len(times) > 1 and span > 0 else 1.0


def _narrowed(feature: Feature, values: np.ndarray) -> np.ndarray:
    """Return the values in the type that the dataset stores."""
    narrow = np.ascontiguousarray(values, dtype=feature.dtype)
    if feature.dtype != "bool" and narrow.size and not math.isfinite(float(narrow.max()) - float(narrow.min())):
        bits = feature.dtype.removeprefix("float")
        advice = "leave half_precision out" if bits == "16" else "make what is simulated smaller"
        raise PalpateError(f"A number of '{feature.name}' is too large for {bits} bits: {advice}.")
    return narrow


def _all_features(
    recording: Recording, sensors: Sensors, names: Mapping[str, str], points: bool, half_precision: bool
) -> Iterator[tuple[Feature, np.ndarray]]:
    frame = "in the frame of the sensor's body"
    for sensor, own in sensors.items():
        name, arrays = names[sensor], recording.sensors[sensor]
        yield from _texel_features(name, arrays, *own, points, "float16" if half_precision else "float32")
        about = f"Net torque on the sensor about the origin of its body, {frame}."
        middle = f"Force-weighted mean of the contact points, {frame}; zero without contact."
        yield _vector(net_force_name(name), "N", f"Net force on the sensor, {frame}."), arrays.net_force
        yield _vector(f"observation.net_torque.{name}", "N m", about), arrays.net_torque
        yield _vector(f"contact.centre_of_pressure.{name}", "m", middle), arrays.centre_of_pressure
    count = len(recording.body_names)  # poses of all bodies as one list, which is how LeRobot keeps the state of a robot
    axes = tuple(f"{body}.{axis}" for body in recording.body_names for axis in POSE_AXES)
    about = "Poses of the bodies in the world: position, m, and quaternion."
    yield Feature("observation.state", "float32", (7 * count,), axes, "m, 1", about), recording.poses.reshape(-1, 7 * count)


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


def varied_feature(name: str, dtype: str) -> Feature:
    """Return the column of what was varied; LeRobot allows no slash."""
    about = "Varied properties; the same in all frames of a run."
    return Feature(name.replace("/", "_"), dtype, (1,), (), "", about)


def _texel_features(
    name: str,
    arrays: SensorRecording,
    texels: Texels,
    painted: Painted,
    parameters: SensorParameters,
    points: bool,
    dtype: str,
) -> Iterator[tuple[Feature, np.ndarray]]:
    """Yield what is recorded of each texel: forces and readings of a type, and the truth about contact."""
    layout = None if points or not isinstance(texels.layout, GridLayout) else texels.layout
    shape: tuple[int, ...] = (len(texels),) if layout is None else layout.shape
    names = ("row", "column") if len(shape) == 2 else ("texel",)

    def placed(kind: str, *channels: np.ndarray) -> np.ndarray:
        """Return numbers of the texels, (F, n) each, where the dataset has them: one number, or a list of them, per place."""
        picture = np.zeros((len(channels[0]), math.prod(shape), len(channels)), kind)
        places = slice(None) if layout is None else _places(layout)
        for number, values in enumerate(channels):
            picture[:, places, number] = values
        return picture.reshape(-1, *shape, *(len(channels),) * (len(channels) > 1))

    error = f" {HALF_ERROR}" if dtype == "float16" else ""
    about = f"Forces on the texels: along the normal, and shear along the texel's x and y axes.{error}"
    image = Feature(tactile_name(name), dtype, (*shape, 3), (*names, "channel"), "N", about, CHANNELS)
    yield image, placed(dtype, arrays.normal_force, arrays.shear[:, :, 0], arrays.shear[:, :, 1])
    about = f"Readings of the texels, in the sensor's unit.{error}"
    readings = placed(dtype, arrays.reading)
    yield Feature(f"observation.reading.{name}", dtype, shape, names, parameters.unit, about), readings
    touch = placed("bool", arrays.contact)
    yield Feature(f"contact.touch.{name}", "bool", shape, names, "1", "Which texels touch something."), touch
    slips = placed("bool", response.slipping(arrays, parameters, painted))
    about = "Which texels touch, move, and are at the limit of friction."
    yield Feature(f"contact.slip.{name}", "bool", shape, names, "1", about), slips


def _places(layout: GridLayout) -> slice | np.ndarray:
    """Return where the texels are among the pixels, row by row; a slice, which is faster, where all are in their order."""
    places = layout.row * layout.columns + layout.column
    return slice(None) if np.array_equal(places, np.arange(layout.rows * layout.columns)) else places


def _vector(name: str, unit: str, about: str) -> Feature:
    return Feature(name, "float32", (3,), AXES, unit, about)
