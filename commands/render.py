# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate render``: pictures of a baked scene, its tactile images, curves and numbers, and a video."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from ..core.figures.figure_canvas import FILE_TYPES as FORMATS
from ..core.io.file_writing import writable_folder
from ..core.io.hidden_folder import remove_own_files
from . import blender, console, figure_options

FIGURES = ("scene", "strip", "curves", "numbers", "video", "gel")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", metavar="SCENE.blend", help="a baked file, or with --bake the file that was baked")
    parser.add_argument(
        "--bake",
        metavar="DIR",
        help="folder that 'palpate bake' has written of this file without --save (default: the bake that the file plays)",
    )
    parser.add_argument("--out", metavar="DIR", default="palpate-figures", help="folder to write to (default: %(default)s)")
    parser.add_argument(
        "--only", metavar="FIGURE", action="append", choices=FIGURES,
        help=f"{', '.join(FIGURES)}; may be given again (default: all but the video and the gel)",
    )  # fmt: skip
    parser.add_argument("--sensor", metavar="NAME", action="append", help="only this sensor; may be given again")
    parser.add_argument(
        "--frame",
        metavar="N",
        type=int,
        action="append",
        help="frame of pictures and numbers, two or more also of the strip; may be given again "
        "(default: that at which the settled forces are largest, of the gel every frame)",
    )
    parser.add_argument("--peak", action="store_true", help="without --frame: the frame with the largest force")
    parser.add_argument(
        "--format",
        metavar="KIND",
        action="append",
        choices=FORMATS,
        help="file format of figures: png, pdf, svg (default: png and pdf)",
    )
    _add_picture_arguments(parser)
    figure_options.add_gel_arguments(parser)
    blender.add_script_arguments(parser)
    figure_options.add_arguments(parser)


def _add_picture_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what concerns renders of the scene."""
    parser.add_argument("--engine", choices=("cycles", "eevee", "workbench"), help="render engine (default: the scene's)")
    figure_options.add_size_argument(parser, 1280, 960, "renders, pixels; images of the gel fit into it")
    parser.add_argument(
        "--samples", metavar="N", type=figure_options.pixels, help="samples per pixel of renders (default: the scene's)"
    )
    parser.add_argument(
        "--view",
        metavar=("AZIMUTH", "ELEVATION"),
        nargs=2,
        type=float,
        help="direction of the camera, degrees (default: towards the loaded texels)",
    )
    parser.add_argument("--own-camera", action="store_true", help="leave the scene's camera where it is")
    parser.add_argument(
        "--own-light", action="store_true", help="keep the scene's lamps, world and backdrop (default: studio light)"
    )
    parser.add_argument(
        "--opaque-targets",
        action="store_true",
        help="let targets hide the texels that they press (default: see-through there)",
    )
    parser.add_argument("--transparent", action="store_true", help="render without background")


def run(arguments: argparse.Namespace) -> int:
    with console.blender_output_hidden():
        scene = blender.open_scene(arguments.scene, arguments.scripts)
        folder = writable_folder(arguments.out, create=True)
        from ..addon.display import bake_display
        from ..addon.render import figure_export
        from ..addon.render.figure_request import FigureRequest

        if arguments.bake is not None:
            _show_bake(scene, arguments.bake)
        given: dict[str, Any] = figure_options.gel_options_from(arguments)
        given |= {"kinds": tuple(arguments.only)} if arguments.only else {}
        given |= {"formats": tuple(arguments.format)} if arguments.format else {}
        style = figure_options.figure_style_from(arguments, **vars(bake_display.figure_style(scene)))
        bake_display.take_style(scene, style)
        request = FigureRequest(
            style=style,
            frames=tuple(arguments.frame or ()),
            sensors=tuple(arguments.sensor or ()),
            engine=arguments.engine,
            view=tuple(arguments.view) if arguments.view else None,
            transparent=arguments.transparent,
            own_camera=arguments.own_camera,
            own_light=arguments.own_light,
            see_through=not arguments.opaque_targets,
            at_peak=arguments.peak,
            size=tuple(arguments.size),
            samples=arguments.samples,
            **given,
        )
        stopped = "palpate render: stopped; earlier figures are unchanged."
        with console.exit_on_interrupt(stopped, remove_own_files):
            notes: list[str] = []
            job = figure_export.make_figures(scene, folder, request, notes.append)
            written = console.run_with_progress_bar("render", job, describe=lambda step: f"{step.stage}, frame {step.frame}")
    for path in written:
        print(path)
    for note in notes:
        print(f"warning: {note}", file=sys.stderr)
    return 0


def _show_bake(scene: Any, folder: str) -> None:
    """Put the bake in a folder into the open scene, which is not saved."""
    from ..addon.bake import bake
    from ..core.io.bake_reader import read_bake

    blender.require_utf8(folder)
    console.run_with_progress_bar("render", bake.show_bake(scene, read_bake(Path(folder).absolute())))
