# SPDX-License-Identifier: GPL-3.0-or-later
"""All figures of a baked scene, in one go: what the operator and ``palpate render`` do.

Nothing is computed: the scene plays its bake, and figures are drawn from the bake's files.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from ...core.errors import ParameterError, SceneError
from ...core.figures.figure_style import FigureStyle
from ...core.figures.side_by_side import side_by_side
from ...core.figures.tactile_strip import tactile_strip
from ...core.figures.texel_numbers import MOST, texel_numbers
from ...core.figures.time_curves import time_curves
from ...core.io.bake_folder import folder_names
from ...core.io.bake_reader import Bake, frame_index, read_sensors
from ...core.io.export import export
from ...core.io.file_writing import writable_folder
from ...core.jobs.job_runner import drive
from ..bake import scene_writer
from ..display import bake_display
from ..session.jobs import Progress
from . import render, render_setup, video, workbench_colors

KINDS = ("scene", "strip", "curves", "numbers", "video")
"""What can be made."""
FORMATS = ("png", "pdf", "svg")


@dataclass(frozen=True)
class Wish:
    """What is to be made.

    Attributes
    ----------
    kinds : tuple of str
        Of :data:`KINDS`.
    look : FigureStyle
    frames : tuple of int
        For scene and numbers; none: the one with the largest force. Two or more are also the strip's columns.
    sensors : tuple of str
        None: all.
    formats : tuple of str
        Of figures that are no renders.
    exports : tuple of str
        Kinds of :func:`..formats.export.export`; each gets a folder of its own.
    engine, view, transparent
        See :func:`.render_setup.photographed`.
    own_camera : bool
        The scene's camera stays where it is.
    size : (2,) int, pixels
        Of renders.
    samples : int or None
        Per pixel; None: the scene's.
    """

    kinds: tuple[str, ...] = ("scene", "strip", "curves", "numbers")
    look: FigureStyle = field(default_factory=FigureStyle)
    frames: tuple[int, ...] = ()
    sensors: tuple[str, ...] = ()
    formats: tuple[str, ...] = ("png", "pdf")
    exports: tuple[str, ...] = ()
    engine: str | None = None
    view: tuple[float, float] | None = None
    transparent: bool = False
    own_camera: bool = False
    size: tuple[int, int] = (1280, 960)
    samples: int | None = None

    def __post_init__(self) -> None:
        for what, chosen, known in (("figure", self.kinds, KINDS), ("format", self.formats, FORMATS)):
            for word in chosen:
                if word not in known:
                    raise ParameterError(f"There is no {what} '{word}': choose from {', '.join(known)}.")


def bake_of(scene) -> Bake:
    """Read the bake that a scene plays.

    Raises
    ------
    PalpateError
        It plays none, or its files are gone.
    """
    places = scene_writer.bake_folders(scene)
    if not places:
        raise SceneError(
            f"'{scene.name}' is not baked: bake it first ('palpate bake' with --save, or Physics › Palpate › Bake)."
        )
    return read_sensors(list(places.values()))


def make(scene, folder, wish: Wish) -> Generator[Progress, None, list[Path]]:
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
    bake = bake_of(scene)
    if wish.sensors:
        bake = bake.select(wish.sensors)
    place = writable_folder(folder, create=True)
    frames = wish.frames or (_busiest(bake),)
    for number in frames:
        frame_index(bake.recording, number)
    steps = _Steps(wish, frames, len(bake.recording.frames))
    written: list[Path] = []
    if "scene" in wish.kinds:
        yield from _scene(scene, place, wish, bake, frames, steps, written)
    if {"strip", "curves", "numbers"} & set(wish.kinds):
        yield steps.next("Drawing figures", frames[0])
        written += draw(bake, place, wish, frames)
    for kind in wish.exports:
        yield steps.next(f"Writing {kind.upper()}", frames[0])
        written += drive(export(bake, kind, place / f"data {kind}", wish.look))
    if "video" in wish.kinds:
        yield from _video(scene, place, wish, bake, steps, written)
    return written


def draw(bake: Bake, place: Path, wish: Wish, frames: Sequence[int]) -> list[Path]:
    """Draw strip, curves and numbers, as far as they are wanted."""
    written = []
    for ending in wish.formats:
        parts = (bake.recording, bake.texels)
        if "strip" in wish.kinds:
            columns = wish.frames if len(wish.frames) > 1 else None
            tactile_strip(place / f"strip.{ending}", *parts, columns, wish.look)
            written.append(place / f"strip.{ending}")
        if "curves" in wish.kinds:
            time_curves(place / f"curves.{ending}", *parts, bake.parameters, style=wish.look)
            written.append(place / f"curves.{ending}")
        if "numbers" in wish.kinds:
            for name, stem in folder_names(bake.texels).items():
                if len(bake.texels[name]) > MOST and not wish.sensors:
                    continue  # nobody could read them; asked for by name, it says so
                for number in frames:
                    path = place / f"numbers {stem} {number:04d}.{ending}"
                    texel_numbers(path, *parts, name, number, wish.look)
                    written.append(path)
    return written


def _scene(scene, place, wish, bake, frames, steps, written):
    with _photographed(scene, wish, bake, frames, wish.size) as show:
        for number in frames:
            yield steps.next("Rendering", number)
            show(number)
            plain = place / f"scene {number:04d}.png"
            written.append(render.render_frame(scene, plain, number, samples=wish.samples, size=wish.size))
            beside = place / f"scene and touch {number:04d}.png"
            side_by_side(plain, beside, bake.recording, bake.texels, number, wish.look, wish.size[1])
            written.append(beside)


def _video(scene, place, wish, bake, steps, written):
    numbers = [int(number) for number in bake.recording.frames]
    height = 2 * (min(wish.size[1], 720) // 2)
    size = (2 * round(0.5 * height * wish.size[0] / wish.size[1]), height)
    with tempfile.TemporaryDirectory(prefix="palpate-video-") as scratch:
        pictures = []
        with _photographed(scene, wish, bake, numbers, size) as show:
            for number in numbers:
                yield steps.next("Rendering the video", number)
                show(number)
                picture = Path(scratch) / f"{number - numbers[0]:06d}.png"
                render.render_frame(scene, picture, number, samples=wish.samples, size=size)
                side_by_side(picture, picture, bake.recording, bake.texels, number, wish.look, height)
                pictures.append(picture)
        yield steps.next("Encoding the video", numbers[-1])
        written.append(video.encode(pictures, place / "video.mp4", bake.manifests[next(iter(bake.texels))].fps))


@contextmanager
def _photographed(scene, wish: Wish, bake: Bake, frames, size) -> Iterator[Callable[[int], None]]:
    """Prepare a scene for its pictures; yields what has to be called before each of them with its frame."""
    with (
        render_setup.photographed(
            scene,
            frames,
            engine=wish.engine,
            view=wish.view,
            transparent=wish.transparent,
            frame=not wish.own_camera,
            size=size,
        ),
        ExitStack() as more,
    ):
        show = _nothing
        if scene.render.engine == "BLENDER_WORKBENCH":
            show = more.enter_context(workbench_colors.painted(scene_writer.bake_folders(scene), bake, wish.look))
        yield show


def _nothing(_number: int) -> None:
    """Cycles and EEVEE draw the heat maps' materials."""


def _busiest(bake: Bake) -> int:
    total = sum(felt.normal_force.sum(axis=1) for felt in bake.recording.sensors.values())
    return int(bake.recording.frames[total.argmax()])


class _Steps:
    """Counts what is done."""

    def __init__(self, wish: Wish, frames, whole: int):
        self.done = 0
        self.total = len(frames) * ("scene" in wish.kinds) + 1 + len(wish.exports) + (whole + 1) * ("video" in wish.kinds)

    def next(self, stage: str, frame: int) -> Progress:
        self.done = min(self.done + 1, self.total)
        return Progress(stage, frame, self.done, self.total)


def look_of(scene, **others) -> FigureStyle:
    """Return the look that agrees with what the scene shows."""
    return bake_display.look_of(scene, **others)
