# SPDX-License-Identifier: GPL-3.0-or-later
"""PNG: every tactile image as a picture in colours, with the colour scale beside it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from ...figures import color_maps
from ...figures.figure_canvas import save_pixels
from ...figures.figure_style import FigureStyle
from ...io.bake_folder import folder_names
from ...io.bake_reader import Bake
from ...io.file_writing import writable_folder, write_text
from ...io.tactile_exr import channel_layout
from ...jobs import Job
from ...model.recording import row_blocks
from ..exporter import Exporter, sensor_progress

_LEAST_PIXELS = 256
"""Pixels along the longer side: smaller images are magnified by a whole number, pixel by pixel."""


def write_png(bake: Bake, folder: Path, style: FigureStyle) -> Job[list[Path]]:
    """Write one picture per frame and ``scale.json`` into a folder per sensor; all sensors share one colour scale."""
    recording = bake.recording
    written: list[Path] = []
    shown = style.scale(recording, bake.texels)
    for name, stem in folder_names(bake.texels).items():
        yield sensor_progress(bake, name)
        own_folder = writable_folder(folder / stem, create=True)
        texels = bake.texels[name]
        layout, recorded = texels.layout, recording.sensors[name]
        mask = layout.mask()
        for i, frame in enumerate(recording.frames):
            own = shown.values(recorded.at(i), texels)
            color = shown.colors(layout.image(own).ravel()).reshape(*layout.shape, 3)
            path = own_folder / f"tactile_{frame:04d}.png"
            _save(path, np.dstack([color, mask]), layout.shape)
            written.append(path)
        written += _write_channels(bake, name, own_folder)
        _write_scale(own_folder / "scale.json", " ".join(shown.label), (shown.low, shown.high), shown.colour_map)
        written.append(own_folder / "scale.json")
    return written


def _save(path: Path, pixels: np.ndarray, shape: tuple[int, ...]) -> None:
    """Write a picture (height, width, 4) of colours from 0 to 1, its lowest row first, magnified as images of a shape are."""
    magnified = max(1, -(-_LEAST_PIXELS // max(shape)))
    pixels = np.repeat(np.repeat(pixels[::-1], magnified, axis=0), magnified, axis=1)
    save_pixels((pixels * 255 + 0.5).astype(np.uint8), path)


def _write_scale(path: Path, quantity: str, ends: tuple[float, float], colour_map: str) -> None:
    """Write the colour scale of pictures as JSON."""
    scale = {"quantity": quantity, "first_colour": ends[0], "last_colour": ends[1], "colour_map": colour_map}
    write_text(path, json.dumps(scale, indent=2) + "\n")


def _write_channels(bake: Bake, name: str, folder: Path) -> list[Path]:
    """Write pictures of how the channels of a sensor have changed since the first frame, side by side, in signed colours."""
    recording = bake.recording
    channels = recording.sensors[name].channels
    if channels is None:
        return []
    layout = channel_layout(bake.texels[name], channels)
    mask, rest = layout.mask(), channels.values[0]
    top = max((float(np.abs(channels.values[rows] - rest).max()) for rows in row_blocks(channels.values)), default=0.0) or 1.0
    written = []
    for values, frame in zip(channels.values, recording.frames, strict=True):
        images = np.moveaxis(layout.image((values - rest) / top), 2, 0)
        color = color_maps.colors(color_maps.SIGNED, 0.5 + 0.5 * images.ravel()).reshape(*images.shape, 3)
        tiles = np.concatenate([color, np.broadcast_to(mask[None, ..., None], (*images.shape, 1))], axis=3)
        written.append(folder / f"channels_{frame:04d}.png")
        _save(written[-1], np.concatenate(list(tiles), axis=1), layout.shape)
    quantity = f"change of {', '.join(channels.names)} since frame {recording.frames[0]} ({channels.unit}), left to right"
    _write_scale(folder / "channels_scale.json", quantity, (-top, top), "blue, white, red")
    return [*written, folder / "channels_scale.json"]


EXPORTER = Exporter("png", write_png)
