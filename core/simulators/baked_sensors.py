# SPDX-License-Identifier: GPL-3.0-or-later
"""The sensors of a .blend from the files of its bake, without Blender."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..effects.engine.registry import check, from_dict
from ..errors import FileError, PalpateError, suggestion
from ..geometry.mesh import TriangleMesh
from ..io.bake_folder import MANIFEST_NAME, UNCHANGED_NOTE, BakeOwner, other_owner
from ..io.bake_reader import Bake, read_bake
from ..io.input_files import read_bytes
from ..model.sensor import Sensor
from .sensor_on_mesh import SensorOnMesh

DEFAULT_FOLDER = "palpate-bake"
"""Beside the .blend: the bake folder of a scene that names no other."""
CLOCK = 2.0
"""Seconds: file systems for memory cards (FAT) store times in steps of this length."""


def baked_sensors(
    blend: str | os.PathLike, names: Sequence[str] | None = None, folder: str | os.PathLike | None = None
) -> list[SensorOnMesh]:
    """Return sensors of a .blend as they were baked, each in the frame of the body that carries it.

    Parameters
    ----------
    blend : path
    names : sequence of str, optional
        Which sensors; by default all of the bake.
    folder : path, optional
        Its bake folder, which only Blender can read from the .blend. Default: ``palpate-bake`` in the folder of the .blend.

    Returns
    -------
    list of SensorOnMesh
        Their mesh consists of the texels and the triangles between them; their pose is that of the body at the first frame.

    Raises
    ------
    FileError
        There is no .blend, no bake, or no sensor of a name; the bake is damaged, incomplete, that of another .blend or of an
        older version; a sensor has several channels; or the .blend has changed since.
    """
    blend = Path(blend)
    if not blend.is_file():
        raise FileError(f"'{blend}' does not exist: give the path of a .blend.")
    place = blend.parent / DEFAULT_FOLDER if folder is None else Path(folder)
    if not place.is_dir():
        raise FileError(
            f"'{blend}' has no bake in '{place}': run 'palpate bake {blend}', or give the bake folder that its scene names."
        )
    found = read_bake(place, images=False)
    known = found.recording.sensors
    for name in names or ():
        if name not in known:
            near = suggestion(name, known)
            raise FileError(f"The bake of '{blend}' has no sensor '{name}'{near}: choose from {', '.join(known)}.")
    chosen = list(known) if names is None else list(dict.fromkeys(names))
    return [_checked_sensor(blend, found, name) for name in chosen]


def _checked_sensor(blend: Path, found: Bake, name: str) -> SensorOnMesh:
    """Return a sensor of a bake, if the bake is of the .blend as it is."""
    folder, manifest = found.folders[name], found.manifests[name]
    other = other_owner(manifest, folder.parent, BakeOwner(blend=blend))
    if other:
        raise FileError(f"'{folder}' is the bake of {other} and not of '{blend}': give the bake folder of this .blend.")
    saved_later = blend.stat().st_mtime > (folder / MANIFEST_NAME).stat().st_mtime + CLOCK
    note = (UNCHANGED_NOTE + manifest.bake_id).encode()  # that the .blend is as it was baked
    if saved_later and not (manifest.bake_id and note in read_bytes(blend)):
        raise FileError(
            f"'{blend}' was saved after its bake in '{folder}' and may have changed: "
            f"run 'palpate bake {blend}' (of a compressed file it cannot be told)."
        )
    if manifest.effects is None or not manifest.body:
        raise FileError(
            f"'{folder / MANIFEST_NAME}' is of an older version and does not name the sensor's effects: "
            f"run 'palpate bake {blend}'."
        )
    if manifest.channels:
        raise FileError(
            f"The sensor '{name}' of '{blend}' has channels, which loops of other programs do not compute: "
            "read its bake, or name other sensors."
        )
    texels, parameters = found.texels[name], found.parameters[name]
    try:
        effects = tuple(from_dict(table, parameters.gain) for table in manifest.effects)
        check(effects, name, len(texels), parameters.gain)
    except PalpateError as error:
        raise FileError(f"'{folder / MANIFEST_NAME}' is damaged ({error}): run 'palpate bake {blend}'.") from error
    mesh = TriangleMesh(texels.position, np.asarray(texels.layout.triangles, np.int64))
    pose = found.recording.poses[0, found.recording.body_names.index(manifest.body)]
    texels = replace(texels, vertex=np.arange(len(texels)))
    sensor = Sensor(name, 0, texels, parameters, painted=found.painted[name], effects=effects)
    return SensorOnMesh(sensor, mesh, None, pose[:3].copy(), pose[3:].copy())
