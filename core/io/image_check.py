# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks of the tactile images of a bake: each frame has its image, and the image shows what the recording says.

An image that the manifest or the list of images vouches for with its SHA-256 is what was baked. Any other, as in older bakes,
is read and compared with the recording.
"""

from __future__ import annotations

from itertools import zip_longest

import numpy as np

from ..errors import FileError
from ..geometry.layout.texture_maps import OverlapError
from ..model.recording import SensorFrame
from .bake_check import SensorFiles
from .bake_folder import IMAGE_LIST_NAME, check_sha256, frame_file
from .sensor_npz import SENSOR_NAME
from .tactile_exr import CHANNELS, exr_channels, read_exr

ROUNDING = 1e-5
"""Share of an image's largest value by which a pixel may differ from the recording, which another order of sums explains."""


def check_images(files: SensorFiles) -> None:
    """Check the tactile images of one sensor, whose other files have been checked.

    Raises
    ------
    FileError
        An image is missing or damaged, or shows something else than the recording; the message names it.
    """
    recording, manifest, name = files.recording, files.manifest, files.manifest.sensor
    if not manifest.has_images:
        return
    if IMAGE_LIST_NAME in manifest.files:
        _check_listed(files)
        return
    for number in recording.frames:
        file = frame_file(int(number))
        if file in manifest.files:
            manifest.check_file(files.folder, file)
        else:
            fault = _fault(files, int(number), recording.at(int(number)).sensors[name])
            if fault:
                raise FileError(f"'{files.folder / file}' does not belong to its bake ({fault}): bake again.")


def _check_listed(files: SensorFiles) -> None:
    """Check the images that the list of the bake names, one for each frame."""
    listed = files.manifest.image_checksums(files.folder)
    for number, found in zip_longest(files.recording.frames, listed):
        if number is None or found is None or found[0] != frame_file(int(number)):
            raise FileError(f"'{files.folder / IMAGE_LIST_NAME}' does not list an image for each frame: bake again.")
        check_sha256(files.folder / found[0], found[1])


def _fault(files: SensorFiles, number: int, frame: SensorFrame) -> str:
    """Return what is wrong with the image of a frame; empty if nothing is."""
    found, about = read_exr(files.folder / frame_file(number))
    manifest = files.manifest
    said = {"sensor": manifest.sensor, "frame": str(number), "digest": manifest.digest, "unit": manifest.unit}
    for key, value in said.items():
        if about.get(key, value) != value:
            return f"its {key} is {about[key]!r:.60} and not {value!r:.60}"
    try:
        expected = exr_channels(files.texels.layout, frame)
    except OverlapError:
        path = files.folder / SENSOR_NAME
        raise FileError(f"'{path}' is damaged (two parts of the region cover one pixel): bake again.") from None
    for channel in CHANNELS:
        if channel not in found:
            return f"it has no channel {channel}"
        if found[channel].shape != manifest.shape:
            return f"it has {' × '.join(map(str, found[channel].shape))} pixels"
        difference = np.abs(found[channel] - expected[channel])
        if channel != "contact" and not (difference <= ROUNDING * np.abs(expected[channel]).max(initial=0.0)).all():
            return f"its channel {channel} differs from the recording"
    return ""
