# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of the gels of a bake: which sensors and frames, and their files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ...core import response
from ...core.errors import SensorError
from ...core.figures.figure_canvas import save_pixels
from ...core.figures.gel_image import gel_pixels, require_grid
from ...core.geometry.grid_layout import GridLayout
from ...core.io.bake_folder import folder_names
from ...core.io.bake_reader import Bake, frame_index
from ...core.jobs import Job, Progress
from .figure_request import FigureRequest


def gel_frames(bake: Bake, request: FigureRequest) -> tuple[int, ...]:
    """Return the frames of which images are wanted: those that are named, that of the peak, or all of the bake."""
    if request.frames:
        return request.frames
    return (response.peak_frame(bake.recording),) if request.at_peak else tuple(int(number) for number in bake.recording.frames)


def gel_sensors(bake: Bake, request: FigureRequest) -> list[str]:
    """Return the names of the sensors of which images can be made, those with rows and columns.

    Raises
    ------
    SensorError
        The request names another sensor, or there is no sensor with rows and columns.
    """
    if request.sensors:
        for name in bake.texels:
            require_grid(bake.texels[name], name)
    names = [name for name, texels in bake.texels.items() if isinstance(texels.layout, GridLayout)]
    if not names:
        raise SensorError(
            "No sensor of the bake has its texels in rows and columns, of which the gel's image is made: choose other figures, "
            "or lay texels in rows on a sensor."
        )
    return names


def draw_gels(bake: Bake, folder: Path, request: FigureRequest, next_step: Callable[[str, int], Progress]) -> Job[list[Path]]:
    """Draw the images, frame after frame, and return their files.

    Parameters
    ----------
    next_step : callable
        Returns the progress for what is done and the frame.
    """
    written = []
    style, stems = request.gel_style(), folder_names(bake.texels, "_")
    names = gel_sensors(bake, request)
    for number in gel_frames(bake, request):
        yield next_step("Drawing the gel", number)
        i = frame_index(bake.recording, number)
        for name in names:
            path = folder / f"gel_{stems[name]}_{number:04d}.png"
            sensor, sigma0 = bake.recording.sensors[name].at(i), bake.parameters[name].sigma0
            save_pixels(gel_pixels(sensor, bake.texels[name], name, sigma0, style), path)
            written.append(path)
    return written
