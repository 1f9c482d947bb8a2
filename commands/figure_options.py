# SPDX-License-Identifier: GPL-3.0-or-later
"""Options of the commands that draw figures: colours, their scale, and the sizes of figures and renders."""

from __future__ import annotations

import argparse
from typing import Any

from ..core.figures import color_maps
from ..core.figures.figure_style import WIDTHS, FigureStyle

STYLE_OPTIONS = ("colour_map", "quantity", "limit", "width", "dpi")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    names = [name.lower() for name in color_maps.STOPS]
    parser.add_argument("--colour-map", metavar="NAME", choices=names, help=f"{', '.join(names)} (default: the scene's)")
    parser.add_argument(
        "--quantity",
        choices=("force", "pressure"),
        help="what the colours show: force per texel (N) or pressure (kPa) (default: the scene's)",
    )
    parser.add_argument(
        "--limit", metavar="VALUE", type=float, help="end of the colour scale, N or kPa (default: a round number)"
    )
    parser.add_argument("--width", choices=WIDTHS, help="width of figures, as columns of a journal (default: double)")
    parser.add_argument("--dpi", metavar="N", type=int, help="resolution of PNG figures (default: 300)")


def pixels(text: str) -> int:
    """Return the number in an option that counts pixels or samples."""
    value = int(text)
    if not 0 < value <= 16384:
        raise argparse.ArgumentTypeError(f"{value} is not between 1 and 16384")
    return value


def figure_style_from(arguments: argparse.Namespace, **others: Any) -> FigureStyle:
    """Return the figure style of the options; `others` replaces the defaults where no option is given."""
    given = {key: value for key in STYLE_OPTIONS if (value := getattr(arguments, key)) is not None}
    if "colour_map" in given:
        given["colour_map"] = given["colour_map"].upper()
    return FigureStyle(**{**others, **given})
