# SPDX-License-Identifier: GPL-3.0-or-later
"""Options of the commands that draw figures: colours, their scale, and the sizes of figures and renders."""

from __future__ import annotations

import argparse
from typing import Any

from ..core.figures import color_maps, figure_style
from ..core.figures.figure_style import WIDTHS, FigureStyle
from ..core.figures.quantities import QUANTITIES

STYLE_OPTIONS = ("colour_map", "quantity", "limit", "lowest", "width", "dpi")
GEL_OPTIONS = ("light_angle", "markers", "marker_pitch")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    names = [name.lower() for name in color_maps.STOPS]
    parser.add_argument("--colour-map", metavar="NAME", choices=names, help=f"{', '.join(names)} (default: the scene's)")
    parser.add_argument(
        "--quantity",
        choices=QUANTITIES,
        help=f"quantity that the colours show: {', '.join(QUANTITIES)} (default: the scene's)",
    )
    parser.add_argument(
        "--limit", metavar="VALUE", type=float, help="end of the colour scale, in its unit (default: a round number)"
    )
    parser.add_argument(
        "--lowest", metavar="VALUE", type=float, help="with --limit: value at which the colours begin (default: 0)"
    )
    parser.add_argument("--width", choices=WIDTHS, help="width of figures, as columns of a journal (default: double)")
    parser.add_argument("--dpi", metavar="N", type=int, help="resolution of PNG figures (default: 300)")


def add_size_argument(parser: argparse.ArgumentParser, width: int, height: int, what: str) -> None:
    """Add --size, of what it says."""
    parser.add_argument(
        "--size",
        metavar=("W", "H"),
        nargs=2,
        type=pixels,
        default=(width, height),
        help=f"size of {what} (default: {width} {height})",
    )


def add_gel_arguments(parser: argparse.ArgumentParser) -> None:
    low, high = figure_style.LIGHT_ANGLES
    parser.add_argument(
        "--light-angle",
        metavar="DEGREES",
        type=float,
        help=f"gel: angle between the gel and the light of its three lamps, {low:g} to {high:g} degrees "
        f"(default: {figure_style.GelStyle.light_angle:g})",
    )
    parser.add_argument("--no-markers", dest="markers", action="store_false", help="gel: print no markers on it")
    parser.add_argument(
        "--marker-pitch",
        metavar="METRES",
        type=float,
        help=f"gel: distance between markers (default: a round one, about {figure_style.MARKERS_ALONG} along the gel)",
    )


def gel_options_from(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the options of :func:`add_gel_arguments` that were given."""
    return {key: value for key in GEL_OPTIONS if (value := getattr(arguments, key)) is not None}


def pixels(text: str) -> int:
    """Return the number in an option that counts pixels or samples."""
    value = int(text)
    if not 0 < value <= 16384:
        raise argparse.ArgumentTypeError(f"{value} is not between 1 and 16384")
    return value


def figure_style_from(arguments: argparse.Namespace, **others: Any) -> FigureStyle:
    """Return the figure style of the options; `others` replaces the defaults where no option is given.

    Ends of a scale are of one quantity: those of another one are not used.
    """
    given = {key: value for key in STYLE_OPTIONS if (value := getattr(arguments, key)) is not None}
    if "colour_map" in given:
        given["colour_map"] = given["colour_map"].upper()
    if given.get("quantity", others.get("quantity")) != others.get("quantity"):
        others |= {"limit": None, "lowest": None}
    return FigureStyle(**{**others, **given})
