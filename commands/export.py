# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate export``: a bake in the formats of other programs."""

from __future__ import annotations

import argparse
import importlib.util

from ..api.recordings import Recording
from ..core.errors import PalpateError
from ..core.export.exporter import Exporter
from ..core.export.format_table import FORMATS
from ..core.figures.figure_style import FigureStyle
from ..core.io.bake_reader import Bake, read_bake
from . import blender, checks, console, figure_options

LEROBOT = "lerobot"
"""Name of :data:`.sweep.lerobot.EXPORTER`: a study's dataset of one run. Blender's extension has no studies."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    formats = [*FORMATS, LEROBOT]
    parser.epilog = "Colours and their scale apply to the format png, the quantity also to the images of mcap."
    parser.add_argument("bake", metavar="BAKE", help="a bake folder, the folder of one sensor in it, or a baked .blend")
    parser.add_argument(
        "--format", metavar="KIND", choices=formats, default="csv", help=f"{', '.join(formats)} (default: %(default)s)"
    )
    parser.add_argument("--out", metavar="DIR", default="palpate-export", help="folder to write to (default: %(default)s)")
    parser.add_argument("--sensor", metavar="NAME", action="append", help="only this sensor; may be given again")
    figure_options.add_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    bake = find_bake(arguments.bake)
    if arguments.sensor:
        bake = bake.select(arguments.sensor)
    checks.folder_is_no_bake(arguments.out, bake)
    style: FigureStyle = figure_options.figure_style_from(arguments)
    with console.Interrupt.raised_at_once(), console.shown_progress("export", "sensor") as show:
        written = Recording(bake).export(_exporter(arguments.format), arguments.out, style, show)
    for path in written:
        print(path)
    return 0


def _exporter(name: str) -> str | Exporter:
    """Return the options of :func:`export` for a format."""
    if name != LEROBOT:
        return name
    if importlib.util.find_spec(f"{__package__.rpartition('.')[0]}.sweep") is None:  # as in the extension's zip
        raise PalpateError(
            "Blender's extension writes no datasets: run 'pip install .[sweep]' in a checkout of Palpate, with its own Python."
        )
    from ..sweep import lerobot

    return lerobot.EXPORTER


def find_bake(where: str) -> Bake:
    """Read a bake from its folder, or the bake that a .blend shows.

    Raises
    ------
    PalpateError
        There is no bake.
    """
    if not where.endswith(".blend"):
        return read_bake(where)
    with console.blender_output_hidden():
        scene = blender.open_scene(where, blender.IGNORE)  # the bake is what counts, not the motion
        from ..addon.render import figure_export

        return figure_export.read_scene_bake(scene)
