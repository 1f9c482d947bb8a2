# SPDX-License-Identifier: GPL-3.0-or-later
"""All figures of a baked scene, in one go: what the operator and ``palpate render`` do.

Nothing is computed: the scene plays its bake, and figures are drawn from the bake's files.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from ...core.errors import SceneError
from ...core.export.registry import export
from ...core.figures.side_by_side import side_by_side
from ...core.figures.tactile_strip import tactile_strip
from ...core.figures.texel_numbers import MOST, texel_numbers
from ...core.figures.time_curves import time_curves
from ...core.io.bake_folder import folder_names
from ...core.io.bake_reader import Bake, frame_index, read_sensors
from ...core.io.file_writing import writable_folder
from ...core.jobs.job_runner import run_job
from ...core.jobs.progress import Progress
from ..display import baked_scene
from . import render, render_setup, video, workbench_colors
from .figure_request import FigureRequest


def read_scene_bake(scene) -> Bake:
    """Read the bake that a scene plays.

    Raises
    ------
    PalpateError
        It plays none, or its files are gone.
    """
    places = baked_scene.bake_folders(scene)
    if not places:
        raise SceneError(
            f"'{scene.name}' is not baked: bake it first ('palpate bake' with --save, or Physics › Palpate › Bake)."
        )
    return read_sensors(list(places.values()))


def make_figures(scene, folder, request: FigureRequest) -> Generator[Progress, None, list[Path]]:
    """Make the figures of a baked scene.

    Parameters
    ----------
    folder : path
        Made when only it is missing.

    Returns
    -------
    list of Path

    Raises
    ------
    PalpateError
        The scene is not baked, a frame was not, or a file cannot be written.
    """
    bake = read_scene_bake(scene)
    if request.sensors:
        bake = bake.select(request.sensors)
    place = writable_folder(folder, create=True)
    frames = request.frames or (_frame_of_largest_force(bake),)
    for number in frames:
        frame_index(bake.recording, number)
    steps = _StepCounter(request, frames, len(bake.recording.frames))
    written: list[Path] = []
    if "scene" in request.kinds:
        yield from _scene(scene, place, request, bake, frames, steps, written)
    if {"strip", "curves", "numbers"} & set(request.kinds):
        yield steps.next("Drawing figures", frames[0])
        written += draw_figures(bake, place, request, frames)
    for kind in request.exports:
        yield steps.next(f"Writing {kind.upper()}", frames[0])
        written += run_job(export(bake, kind, place / f"data {kind}", request.style))
    if "video" in request.kinds:
        yield from _video(scene, place, request, bake, steps, written)
    return written


def draw_figures(bake: Bake, place: Path, request: FigureRequest, frames: Sequence[int]) -> list[Path]:
    """Draw strip, curves and numbers, as far as they are wanted."""
    written = []
    for ending in request.formats:
        parts = (bake.recording, bake.texels)
        if "strip" in request.kinds:
            columns = request.frames if len(request.frames) > 1 else None
            tactile_strip(place / f"strip.{ending}", *parts, columns, request.style)
            written.append(place / f"strip.{ending}")
        if "curves" in request.kinds:
            time_curves(place / f"curves.{ending}", *parts, bake.parameters, style=request.style)
            written.append(place / f"curves.{ending}")
        if "numbers" in request.kinds:
            for name, stem in folder_names(bake.texels).items():
                if len(bake.texels[name]) > MOST and not request.sensors:
                    continue  # nobody could read them; asked for by name, it says so
                for number in frames:
                    path = place / f"numbers {stem} {number:04d}.{ending}"
                    texel_numbers(path, *parts, name, number, request.style)
                    written.append(path)
    return written


def _scene(scene, place, request, bake, frames, steps, written):
    with _prepared_scene(scene, request, bake, frames, request.size) as show:
        for number in frames:
            yield steps.next("Rendering", number)
            show(number)
            plain = place / f"scene {number:04d}.png"
            written.append(render.render_frame(scene, plain, number, samples=request.samples, size=request.size))
            beside = place / f"scene and touch {number:04d}.png"
            side_by_side(plain, beside, bake.recording, bake.texels, number, request.style, request.size[1])
            written.append(beside)


def _video(scene, place, request, bake, steps, written):
    numbers = [int(number) for number in bake.recording.frames]
    height = 2 * (min(request.size[1], 720) // 2)
    size = (2 * round(0.5 * height * request.size[0] / request.size[1]), height)
    with tempfile.TemporaryDirectory(prefix="palpate-video-") as scratch:
        pictures = []
        with _prepared_scene(scene, request, bake, numbers, size) as show:
            for number in numbers:
                yield steps.next("Rendering the video", number)
                show(number)
                picture = Path(scratch) / f"{number - numbers[0]:06d}.png"
                render.render_frame(scene, picture, number, samples=request.samples, size=size)
                side_by_side(picture, picture, bake.recording, bake.texels, number, request.style, height)
                pictures.append(picture)
        yield steps.next("Encoding the video", numbers[-1])
        written.append(video.encode_video(pictures, place / "video.mp4", bake.manifests[next(iter(bake.texels))].fps))


@contextmanager
def _prepared_scene(scene, request: FigureRequest, bake: Bake, frames, size) -> Iterator[Callable[[int], None]]:
    """Prepare a scene for its pictures; yields what has to be called before each of them with its frame."""
    with (
        render_setup.render_setup(
            scene,
            frames,
            engine=request.engine,
            view=request.view,
            transparent=request.transparent,
            frame=not request.own_camera,
            size=size,
        ),
        ExitStack() as more,
    ):
        show = _draw_nothing
        if scene.render.engine == "BLENDER_WORKBENCH":
            show = more.enter_context(workbench_colors.workbench_colors(baked_scene.bake_folders(scene), bake, request.style))
        yield show


def _draw_nothing(_number: int) -> None:
    """Cycles and EEVEE draw the heat maps' materials."""


def _frame_of_largest_force(bake: Bake) -> int:
    total = sum(readings.normal_force.sum(axis=1) for readings in bake.recording.sensors.values())
    return int(bake.recording.frames[total.argmax()])


class _StepCounter:
    """Counts what is done."""

    def __init__(self, request: FigureRequest, frames, whole: int):
        self.done = 0
        self.total = (
            len(frames) * ("scene" in request.kinds) + 1 + len(request.exports) + (whole + 1) * ("video" in request.kinds)
        )

    def next(self, stage: str, frame: int) -> Progress:
        self.done = min(self.done + 1, self.total)
        return Progress(stage, self.done, self.total, frame)
