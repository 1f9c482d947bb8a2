# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate demo``: builds, bakes and renders the demo scene, and prints the forces on its two finger pads."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core import response
from ..core.figures.figure_canvas import save_figure
from ..core.figures.figure_style import FigureStyle
from ..core.figures.picture_labels import label_picture
from ..core.figures.tactile_strip import strip_figure
from ..core.figures.time_curves import force_curves
from ..core.io.file_writing import writable_folder
from ..core.io.hidden_folder import remove_own_files
from . import blender, console, figure_options
from .bake import bake_with_progress, report

if TYPE_CHECKING:
    from ..addon.bake.bake import BakeResult
    from ..core.model.recording import Recording
    from ..core.model.sensor import Sensor


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--out", metavar="DIR", default="palpate-demo", help="folder for all files (default: %(default)s)")
    figure_options.add_size_argument(parser, 1280, 720, "the picture, pixels")
    parser.add_argument(
        "--samples",
        metavar="N",
        type=figure_options.pixels,
        default=8,
        help="samples per pixel of the picture (default: %(default)s)",
    )
    parser.add_argument("--no-render", action="store_true", help="do not render the picture; everything else takes seconds")


def run(arguments: argparse.Namespace) -> int:
    began = time.monotonic()
    folder = writable_folder(arguments.out, create=True)
    with console.blender_output_hidden():
        scene, baked = _build_and_bake(folder / "demo.blend", arguments.size)
    files = _draw(scene, baked, folder, arguments)
    print(report(baked))
    print()
    print(_report_on_contacts(baked))
    print()
    files["scene"] = folder / "demo.blend"
    files |= {f"bake of {name}": place for name, place in baked.folders.items()}
    for what, path in files.items():
        if path.exists():
            print(f"{what + ':':<18} {path}")
    print(f"{'took:':<18} {time.monotonic() - began:.0f} s")
    return 0


def _build_and_bake(blend: Path, size: tuple[int, int]) -> tuple[Any, BakeResult]:
    """Build the demo scene, bake it and save it; return the scene and the result of the bake."""
    bpy = blender.start_blender()
    from ..sample_blends import demo

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    demo.build(bpy.context.scene)
    demo.frame_picture(bpy.context.scene, size)
    blender.save_blend(blend, backup=False)  # before the bake, because the bake folder is relative to the file
    scene = blender.open_scene(blend)
    baked = bake_with_progress(scene)
    scene.frame_set(demo.PICTURE_FRAME)
    blender.save_blend(blend, backup=False)
    return scene, baked


def _draw(scene: Any, baked: BakeResult, folder: Path, arguments: argparse.Namespace) -> dict[str, Path]:
    """Draw tactile strip and forces, and render the picture; return the files by what they show."""
    from ..sample_blends import demo

    sensors = {sensor.name: sensor for sensor in baked.scenario.read_out}
    texels = {name: sensor.texels for name, sensor in sensors.items()}
    parameters = {name: sensor.parameters for name, sensor in sensors.items()}
    style = FigureStyle(scene.palpate.color_map, limit=demo.RANGE, dpi=200)
    files = {"picture": folder / "scene.png", "tactile images": folder / "tactile-strip.png", "forces": folder / "forces.png"}
    save_figure(strip_figure(baked.recording, texels, demo.STRIP_FRAMES, style), files["tactile images"], style.dpi)
    force_curves(files["forces"], baked.recording, texels, parameters, {demo.PAD_B: _weight(baked)}, style)
    if not arguments.no_render:
        _render_picture(scene, files["picture"], arguments)
        labels = _labels(scene, baked.recording, sensors, demo)
        label_picture(
            files["picture"], files["picture"], baked.recording, texels, demo.PICTURE_FRAME, labels=labels, style=style
        )
    return files


def _weight(baked: BakeResult) -> float:
    """Return the weight of the cube, N."""
    from ..sample_blends import demo

    return demo.CUBE_MASS * float(np.linalg.norm(baked.scenario.gravity))


def _render_picture(scene: Any, path: Path, arguments: argparse.Namespace) -> None:
    """Render the scene; Ctrl-C ends the process during the render."""
    from ..addon.render import render
    from ..sample_blends import demo

    # These save time at the same look. See-through steel makes the denoiser's guides, colour and normal of the surfaces, noisy,
    # so that they would have to be denoised first. A light tree chooses among many lamps, but there are three, and all matter.
    scene.cycles.denoising_input_passes, scene.cycles.use_light_tree = "RGB", False
    stopped = "palpate demo: stopped while rendering; the bake and the scene are finished."
    with (
        console.progress_bar("Rendering the picture", 1, unit="picture") as bar,
        console.exit_on_interrupt(stopped, remove_own_files),
        console.blender_output_hidden(),
    ):
        render.render_frame(scene, path, demo.PICTURE_FRAME, samples=arguments.samples, size=arguments.size)
        scene.frame_set(demo.PICTURE_FRAME)
        bar.update()


def _report_on_contacts(baked: BakeResult) -> str:
    """Return the measurements of the pads as text: friction under the ball, and the weight of the cube."""
    from ..sample_blends import demo

    pressed = next(sensor for sensor in baked.scenario.read_out if sensor.name == demo.PAD_A)
    slide = _slide(baked.recording, pressed)
    required, measured = _weight(baked), baked.recording.sensors[demo.PAD_B].normal_force[-1].sum()
    return f"{slide}\n\n{demo.CUBE} at rest on {demo.PAD_B}: required {required:.6f} N, measured {measured:.6f} N"


def _labels(scene: Any, recording: Recording, sensors: dict[str, Sensor], demo: Any) -> list[tuple[str, tuple[float, float]]]:
    """Return labels for the ball and the cube, with the forces on their pads."""
    from ..addon.render import render

    i = int(np.searchsorted(recording.frames, demo.PICTURE_FRAME))
    pressed, at_rest = recording.sensors[demo.PAD_A], recording.sensors[demo.PAD_B]
    normal = pressed.normal_force[i].sum()
    shear = np.linalg.norm(response.net_shear(pressed, sensors[demo.PAD_A].texels)[i])
    weight, carriers = at_rest.normal_force[i].sum(), np.count_nonzero(at_rest.contact[i])
    words = {
        demo.BALL: f"Steel ball, slipping\n{normal:.2f} N normal, {shear:.2f} N shear",
        demo.CUBE: f"Steel cube, 1 kg, at rest\n{weight:.4f} N on {carriers} texels",
    }
    labels = [("\nArrows: the force with\nwhich a pad pushes back", (0.315, 0.14))]
    for name, text in words.items():
        box = np.array([render.image_position(scene, point) for point in render.bounding_box_corners([scene.objects[name]])])
        labels.append((text, (float(box[:, 0].min()), float(box[:, 1].max()) + 0.035)))
    return labels


def _slide(recording: Recording, sensor: Sensor) -> str:
    """Return how friction builds up under the ball until it slips, as a table."""
    readings, mu = recording.sensors[sensor.name], sensor.parameters
    normal = readings.normal_force.sum(axis=1)
    shear = np.linalg.norm(response.net_shear(readings, sensor.texels), axis=1)
    share = response.mobilised_friction(readings, sensor.texels, mu.mus)
    slipping = response.slipping(readings, mu)
    rows = [("frame", "time", "normal", "shear", "shear / µs·normal", "texels slipping")]
    touching = np.flatnonzero(normal > 0)
    for i in touching[:: max(1, len(touching) // 10)]:
        rows.append(
            (
                str(recording.frames[i]),
                f"{recording.times[i]:.2f} s",
                f"{normal[i]:.4f} N",
                f"{shear[i]:.4f} N",
                f"{share[i]:.2f}",
                f"{np.count_nonzero(slipping[i])} of {np.count_nonzero(readings.contact[i])}",
            )
        )
    return f"{sensor.name} under the ball:\n" + console.text_table(rows, ">>>>>>")
