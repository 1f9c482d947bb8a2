# SPDX-License-Identifier: GPL-3.0-or-later
"""A finished bake, read from its folder without Blender and checked; figures and exports are made from it.

Every file is what was baked: its SHA-256 is in the manifest or in the list of images. The manifests say which folders are of
the same bake. So whoever draws or exports a bake may rely on it.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from ..errors import FileError, PalpateError
from ..geometry.texels import Texels
from ..model.recording import Recording
from ..model.sensor_parameters import Painted, SensorParameters, stated_parameters
from .bake_folder import MANIFEST_NAME, RECORDING_NAME, Manifest, is_interrupted, read_manifest
from .hidden_folder import PRIVATE_FOLDER
from .recording_npz import SENSOR_NAME, Sensors, load_recording, load_sensor


@dataclass(frozen=True)
class Bake:
    """The recordings and descriptions of some sensors.

    Attributes
    ----------
    recording : Recording
    texels, painted, parameters, folders, manifests : dict
        By sensor name; the last two are empty for a recording that comes from no folder.
    """

    recording: Recording
    texels: dict[str, Texels]
    painted: dict[str, Painted]
    parameters: dict[str, SensorParameters]
    folders: dict[str, Path]
    manifests: dict[str, Manifest]

    @property
    def sensors(self) -> Sensors:
        """Texels, what is painted on them, and parameters of each sensor by its name."""
        return {name: (texels, self.painted[name], self.parameters[name]) for name, texels in self.texels.items()}

    def select(self, names: Sequence[str]) -> Bake:
        """Return the bake of some of the sensors, in the order of `names`.

        Raises
        ------
        FileError
            There is no such sensor.
        """
        for name in names:
            if name not in self.recording.sensors:
                raise FileError(f"There is no sensor '{name}' in this bake: choose from {', '.join(self.recording.sensors)}.")
        sensors = {name: self.recording.sensors[name] for name in names}
        tables = {item.name: getattr(self, item.name) for item in fields(self)[1:]}
        parts = {key: {name: table[name] for name in names if name in table} for key, table in tables.items()}
        return Bake(recording=replace(self.recording, sensors=sensors), **parts)


def read_bake(folder: str | os.PathLike, images: bool = True) -> Bake:
    """Read a bake folder, or the folder of one sensor in it, and check its files; all images are read for that with `images`.

    Raises
    ------
    FileError
        There is no bake, a file of it is damaged, or its sensors do not belong to the same run.
    """
    if not os.fspath(folder) or not os.path.isdir(folder):  # an empty name would be the present folder
        raise FileError(f"The folder '{folder}' does not exist: bake first, or choose another.")
    folder = Path(folder)
    if os.path.lexists(folder / MANIFEST_NAME):
        return read_sensors([folder], images)
    marks = (MANIFEST_NAME, RECORDING_NAME, SENSOR_NAME)  # even a damaged bake is one
    places = [place for place in sorted(folder.iterdir()) if place.name != PRIVATE_FOLDER]
    folders = [place for place in places if any(os.path.lexists(place / name) for name in marks)]
    if not folders and is_interrupted(folder):
        raise FileError(f"A bake in '{folder}' was interrupted while it took the place of the earlier one: bake again.")
    if not folders:
        raise FileError(f"'{folder}' holds no bake: bake first, or choose the folder that Physics › Palpate › Bake names.")
    bake = read_sensors(folders, images)
    expected = dict.fromkeys(name for manifest in bake.manifests.values() for name in manifest.sensors)
    for name in expected:
        if name not in bake.texels:
            quoted = ", ".join(f"'{name}'" for name in expected)
            raise FileError(
                f"The sensor '{name}' is missing from the bake in '{folder}', which had {quoted}: bake again, or "
                "choose the folder of one sensor."
            )
    return bake


def read_sensors(folders: Sequence[Path], images: bool = True) -> Bake:
    """Read the folders of some sensors of one bake.

    Parameters
    ----------
    folders : sequence of Path
    images : bool
        Check the tactile images as well, every one of which is read for that.

    Raises
    ------
    FileError
        As :func:`read_bake`.
    """
    manifests = {folder: read_manifest(folder) for folder in folders}
    first = manifests[folders[0]]
    for folder, manifest in manifests.items():
        if manifest.digest != first.digest or (manifest.bake_id and first.bake_id and manifest.bake_id != first.bake_id):
            raise FileError(
                f"The sensors '{first.sensor}' and '{manifest.sensor}' in '{folder.parent}' are of different bakes: "
                "bake again, or choose the folder of one sensor."
            )
    places: dict[str, Path] = {}
    for folder, manifest in manifests.items():
        if manifest.sensor in places:
            raise FileError(
                f"'{folder}' and '{places[manifest.sensor]}' both hold the sensor '{manifest.sensor}': "
                "move one of them out of the bake folder."
            )
        places[manifest.sensor] = folder
        manifest.check_files(folder, images)
    recordings = {name: load_recording(folder / RECORDING_NAME) for name, folder in places.items()}
    sensors = {name: load_sensor(folder / SENSOR_NAME) for name, folder in places.items()}
    parameters = {name: _parameters(folder, manifests[folder]) for name, folder in places.items()}
    recorded = {name: replace(own.sensors[name], unit=parameters[name].unit) for name, own in recordings.items()}
    return Bake(
        recording=replace(next(iter(recordings.values())), sensors=recorded),
        texels={name: texels for name, (texels, _) in sensors.items()},
        painted={name: painted for name, (_, painted) in sensors.items()},
        parameters=parameters,
        folders=places,
        manifests={name: manifests[folder] for name, folder in places.items()},
    )


def _parameters(folder: Path, manifest: Manifest) -> SensorParameters:
    """Return the parameters that a manifest holds; a parameter that its version did not have keeps its default."""
    try:
        parameters = SensorParameters(**stated_parameters(manifest.parameters, "its parameters"))
        parameters.check(manifest.sensor)
    except PalpateError as error:
        raise FileError(f"'{folder / MANIFEST_NAME}' is damaged ({str(error).rstrip('.')}): bake again.") from error
    return parameters


def frame_index(recording: Recording, frame: int) -> int:
    """Return the index of a frame in a recording.

    Raises
    ------
    FileError
        The frame was not baked.
    """
    (found,) = np.nonzero(recording.frames == frame)
    if len(found) == 0:
        raise FileError(f"Frame {frame} is not in the bake: choose from {recording.frames[0]} to {recording.frames[-1]}.")
    return int(found[0])
