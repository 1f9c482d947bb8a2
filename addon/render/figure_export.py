# SPDX-License-Identifier: GPL-3.0-or-later
"""All figures of a baked scene: what the operator Make Figures and ``palpate render`` do.

No forces are computed: pictures are renders of the scene, and figures are drawn from the files of its bake.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...core import response
from ...core.errors import SceneError
from ...core.export.exporter import export
from ...core.figures.figure_canvas import save_figure
from ...core.figures.side_by_side import side_by_side
from ...core.figures.tactile_strip import strip_figure
from ...core.figures.texel_numbers import texel_numbers, why_unreadable
from ...core.figures.time_curves import curves_figure
from ...core.io.bake_folder import folder_names
from ...core.io.bake_reader import Bake, frame_index, read_sensors
from ...core.io.file_writing import writable_folder
from ...core.io.hidden_folder import FileList, temporary_folder
from ...core.jobs import Job, Progress, part_of_job
from ..display import bake_identity, baked_scene
from . import gel_figures, loaded_texels, render, render_setup, see_through, video, workbench_colors
from .figure_request import FigureRequest

SIGHTS = 12
"""Frames of a video, at most, whose loaded texels the camera is turned to."""
MAX_VIDEO_HEIGHT = 720
DRAWN = {"strip", "curves", "numbers"}
"""Kinds of figures that need no render."""


def read_scene_bake(scene) -> Bake:
    """Read the bake that a scene shows.

    Raises
    ------
    PalpateError
        The scene shows no bake, its folder holds another one, or a file of the bake is missing or damaged.
    """
    places = baked_scene.bake_folders(scene)
    if not places:
        raise SceneError(
            f"'{scene.name}' is not baked: bake it first ('palpate bake' with --save, or Physics › Palpate › Bake)."
        )
    bake_identity.require_own_bake(scene)
    return read_sensors(list(places.values()))


def make_figures(scene, folder, request: FigureRequest, warn: Callable[[str], object] = lambda text: None) -> Job[list[Path]]:
    """Make the figures of a baked scene.

    All figures are written before the first of them is put in its place. Earlier ones of the same kinds stay if they were made
    from the same bake and have other names; those of another bake are removed (:mod:`....core.io.hidden_folder`).

    Parameters
    ----------
    folder : path
        It is created if it is missing, with the folders above it.
    warn : callable, optional
        Called with a sentence on each figure that is left out.

    Returns
    -------
    list of Path
        The files that were written.

    Raises
    ------
    PalpateError
        The scene or one of the frames is not baked, or a file cannot be written.
    """
    bake = read_scene_bake(scene)
    if request.sensors:
        bake = bake.select(request.sensors)
    usual = response.peak_frame if request.at_peak else response.settled_frame
    frames = request.frames or (usual(bake.recording),)
    for number in frames:
        frame_index(bake.recording, number)
    if "gel" in request.kinds:
        gel_figures.gel_sensors(bake, request)  # raises before anything is made
    folder = writable_folder(folder, create=True)
    for reason in map(why_unreadable, bake.texels, bake.texels.values()):
        if reason and "numbers" in request.kinds and not request.sensors:
            warn(reason)
    files = FileList(folder)
    steps = _StepCounter(request, frames, bake)
    with files.new_files("figures") as new:
        written: dict[str, list[Path]] = {}
        if "scene" in request.kinds:
            written["scene"] = yield from _render_pictures(scene, new, request, bake, frames, steps)
        if DRAWN & set(request.kinds):
            written |= yield from draw_figures(bake, new, request, frames, steps)
        if "video" in request.kinds:
            written["video"] = yield from _make_video(scene, new, request, bake, steps)
        if "gel" in request.kinds:
            written["gel"] = yield from gel_figures.draw_gels(bake, new, request, steps.next)
        manifest = next(iter(bake.manifests.values()))
        kinds = {f"figures {kind}": paths for kind, paths in written.items()}
        made = files.replace(new, kinds, manifest.bake_id or manifest.digest)
    for kind in request.exports:
        steps.done += 1
        made += yield from part_of_job(export(bake, kind, folder / f"data_{kind}", request.style), steps.within)
    return made


def draw_figures(
    bake: Bake, folder: Path, request: FigureRequest, frames: Sequence[int], steps: _StepCounter
) -> Job[dict[str, list[Path]]]:
    """Draw strip, curves and numbers, as far as the request names them; return the files of each kind."""
    written: dict[str, list[Path]] = {kind: [] for kind in request.kinds if kind in DRAWN}
    for ending in request.formats:
        parts = (bake.recording, bake.texels)
        if "strip" in request.kinds:
            columns = request.frames if len(request.frames) > 1 else None
            yield steps.next("Drawing the strip", frames[0])
            save_figure(strip_figure(*parts, columns, request.style), folder / f"strip.{ending}", request.style.dpi)
            written["strip"].append(folder / f"strip.{ending}")
        if "curves" in request.kinds:
            yield steps.next("Drawing curves", frames[0])
            curves = curves_figure(*parts, bake.parameters, style=request.style)
            save_figure(curves, folder / f"curves.{ending}", request.style.dpi)
            written["curves"].append(folder / f"curves.{ending}")
        if "numbers" in request.kinds:
            for name, stem in folder_names(bake.texels, "_").items():
                if why_unreadable(name, bake.texels[name]) and not request.sensors:
                    continue  # with a warning; a sensor that the request names raises an error instead
                for number in frames:
                    path = folder / f"numbers_{stem}_{number:04d}.{ending}"
                    yield steps.next("Drawing numbers", number)
                    texel_numbers(path, *parts, name, number, request.style)
                    written["numbers"].append(path)
    return written


def _render_pictures(scene, folder, request, bake, frames, steps) -> Job[list[Path]]:
    """Render the frames, each alone and with the tactile images; return the files."""
    written = []
    with _prepared_scene(scene, request, bake, frames, request.size) as show_frame:
        slow = scene.render.engine == "CYCLES" and not render.can_denoise()
        stage = f"Rendering ({render.SAMPLES_WITHOUT_DENOISER} × samples: no denoiser here)" if slow else "Rendering"
        for number in frames:
            yield steps.next(stage, number)
            show_frame(number)
            plain = folder / f"scene_{number:04d}.png"
            written.append(_render(scene, plain, number, request, bake, request.size))
            beside = folder / f"scene_and_touch_{number:04d}.png"
            side_by_side(plain, beside, bake.recording, bake.texels, number, request.style, request.size[1])
            written.append(beside)
    return written


def _render(scene, path, number: int, request: FigureRequest, bake: Bake, size: tuple[int, int]) -> Path:
    """Render one frame, with targets see-through where they cover loaded texels if that is wanted."""
    if not request.see_through:
        return render.render_frame(scene, path, number, samples=request.samples, size=size)
    loaded = loaded_texels.loaded_texels(scene, bake, number)
    return see_through.render_picture(scene, path, number, loaded, samples=request.samples, size=size)


def _make_video(scene, folder, request, bake, steps) -> Job[list[Path]]:
    """Render all frames with the tactile images beside them, and encode them; return the file."""
    numbers = [int(number) for number in bake.recording.frames]
    height = 2 * (min(request.size[1], MAX_VIDEO_HEIGHT) // 2)
    size = 2 * round(0.5 * height * request.size[0] / request.size[1]), height  # a video's sides are even
    with temporary_folder(folder, "video") as temporary:
        pictures = []
        with _prepared_scene(scene, request, bake, numbers, size) as show_frame:
            for number in numbers:
                yield steps.next("Rendering the video", number)
                show_frame(number)
                picture = temporary / f"{number - numbers[0]:06d}.png"
                _render(scene, picture, number, request, bake, size)
                side_by_side(picture, picture, bake.recording, bake.texels, number, request.style, size[1])
                pictures.append(picture)
        yield steps.next("Encoding the video", numbers[-1])
        return [video.encode_video(pictures, folder / "video.mp4", bake.manifests[next(iter(bake.texels))].fps)]


@contextmanager
def _prepared_scene(scene, request: FigureRequest, bake: Bake, frames, size) -> Iterator[Callable[[int], None]]:
    """Prepare a scene for its pictures; yield the function to call with the frame before each of them."""
    some = [int(frames[place]) for place in np.linspace(0, len(frames) - 1, min(len(frames), SIGHTS)).round().astype(int)]
    loaded = {number: loaded_texels.loaded_texels(scene, bake, number) for number in some}
    with render_setup.render_setup(scene, frames, replace(request, size=size), loaded), ExitStack() as stack:

        def show_frame(_number: int) -> None:
            """Do nothing: Cycles and EEVEE draw the materials of the heat maps."""

        if scene.render.engine == "BLENDER_WORKBENCH":
            folders = baked_scene.bake_folders(scene)
            show_frame = stack.enter_context(workbench_colors.workbench_colors(folders, bake, request.style))
        yield show_frame


class _StepCounter:
    """Counts the steps of a request for its progress."""

    def __init__(self, request: FigureRequest, frames: Sequence[int], bake: Bake):
        self.done = 0
        pictures = len(frames) if "scene" in request.kinds else 0
        video_steps = len(bake.recording.frames) + 1 if "video" in request.kinds else 0
        gel_steps = len(gel_figures.gel_frames(bake, request)) if "gel" in request.kinds else 0
        drawings = {"strip": 1, "curves": 1, "numbers": len(frames) * len(bake.texels)}
        drawn = len(request.formats) * sum(drawings[kind] for kind in DRAWN & set(request.kinds))
        self.total = max(1, pictures + drawn + len(request.exports) + video_steps + gel_steps)

    def next(self, stage: str, frame: int) -> Progress:
        self.done = min(self.done + 1, self.total)
        return Progress(stage, self.done, self.total, frame)

    def within(self, part: Progress) -> Progress:
        """Return how far a job that is the present step has come."""
        return Progress(part.stage, round(1000 * (self.done - 1 + part.share)), 1000 * self.total, part.frame)
