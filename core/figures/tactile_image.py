# SPDX-License-Identifier: GPL-3.0-or-later
"""One tactile image on an axes: colours, arrows of shear, scale bar; and the colour bar that belongs to it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..geometry.grid_layout import GridLayout
from ..geometry.mesh import unique_edges
from ..geometry.texels import Texels
from . import color_maps
from .figure_style import FONT, INK, SMALL
from .quantities import Scale, three_digits

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SMALLEST_ARROW = 0.08
"""Share of the strongest shear below which no arrow is drawn."""
LONGEST_ARROW = 0.95
"""Of an arrow over the distance between two: neighbours that point the same way do not touch."""
MOST_ARROWS = 18
"""Along the longer side: where texels are denser, an arrow is the mean of several."""
LEAST_ARROWS, ARROW_ROOM = 5, 0.09
"""The fewest of them, and the inches that one needs to be seen."""
OUTLINE = "#9aa3ad"
"""Colour of the rim of a surface and of the frame of an image."""
ARROW = "simple,head_length=4,head_width=5,tail_width=1.5"
MOST_VECTORS = 5000
"""Triangles of a surface beyond which its colours are pixels in a PDF or SVG, which would else be slow to show."""
_BARS = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500)


@dataclass(frozen=True)
class SensorView:
    """How one sensor's texels are drawn: a grid as an image, any other surface in parts, one for each texel.

    Attributes
    ----------
    window : (4,) float
        Left, right, bottom and top of what is shown, in millimetres.
    points : (n, 2) float
        Where the texels lie.
    seen : (n,) bool
        Which of them are not on the far side.
    triangles : (m, 3) int or None
        Of a surface, as numbers of texels; None for a grid.
    corners : (m, 3, 2) float or None
        Where the corners of the triangles are drawn: on the flattened surface, or, where that is an atlas of single triangles
        or a map without true lengths, as the most loaded side is seen from outside.
    axes : (2, 3) float or None
        Of a view from outside, in the frame of the sensor's body; elsewhere the texels' own axes are the image's.
    most : int
        Arrows along the longer side.
    """

    texels: Texels
    window: tuple[float, float, float, float]
    points: np.ndarray
    seen: np.ndarray
    triangles: np.ndarray | None = None
    corners: np.ndarray | None = None
    axes: np.ndarray | None = None
    most: int = MOST_ARROWS

    @classmethod
    def of(cls, texels: Texels, load: np.ndarray | None = None) -> SensorView:
        """Return the view of a sensor; a flattened surface has true lengths where it lies across the view.

        `load`, (n,) float, weights the texels: a surface that cannot be flattened is seen from its most loaded side.
        """
        layout = texels.layout
        rows, columns = layout.shape
        if isinstance(layout, GridLayout):
            pitch_x, pitch_y = _pitch(texels, layout.row, layout.column), _pitch(texels, layout.column, layout.row)
            points = np.stack([(layout.column + 0.5) * pitch_x, (layout.row + 0.5) * pitch_y], axis=1)
            return cls(texels, (0.0, columns * pitch_x, 0.0, rows * pitch_y), points, np.ones(len(texels), bool))
        if layout.cell or layout.map_name:
            return cls._from_outside(texels, load)
        scale = np.array([columns, rows]) * _millimetres_per_pixel(texels)
        corners, points = layout.corner_uv * scale, np.asarray(layout.uv()) * scale
        return cls(texels, _window(corners), points, np.ones(len(texels), bool), layout.triangles, corners)

    @classmethod
    def _from_outside(cls, texels: Texels, load: np.ndarray | None) -> SensorView:
        layout = texels.layout
        weight = texels.area if load is None or not load.any() else load
        out = weight @ texels.normal
        length = float(np.linalg.norm(out))
        out = out / length if length > 1e-3 * weight.sum() else np.array([0.0, 0.0, 1.0])
        up = np.eye(3)[1 if abs(out[1]) < 0.9 else 2]
        right = np.cross(up, out)
        right /= np.linalg.norm(right)
        axes = np.stack([right, np.cross(out, right)])
        points = 1e3 * texels.position @ axes.T
        a, b, c = np.moveaxis(points[layout.triangles], 1, 0)
        turn = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
        triangles = layout.triangles[turn > 0]
        seen = np.zeros(len(texels), bool)
        seen[triangles] = True
        corners = points[triangles]
        return cls(texels, _window(corners), points, seen, triangles, corners, axes)

    @property
    def width(self) -> float:
        """Millimetres."""
        return self.window[1] - self.window[0]

    @property
    def height(self) -> float:
        """Millimetres."""
        return self.window[3] - self.window[2]

    @property
    def bar(self) -> float:
        """Length of the scale bar, mm; zero where the sensor is too small for any."""
        return max((step for step in _BARS if step <= 0.7 * self.width), default=0.0)

    @property
    def caption(self) -> str:
        """Kind of sensor."""
        layout = self.texels.layout
        if isinstance(layout, GridLayout):
            return f"{layout.rows} × {layout.columns} texels\n{three_digits(self.width / layout.columns)} mm pitch"
        how = "flattened" if self.axes is None else f"{self.seen.sum()} in view"
        return f"{len(self.texels)} texels,\n{how}"

    def at_size(self, inches: float) -> SensorView:
        """Return the view with as many arrows as can be told apart where a millimetre is so many `inches`."""
        longer = inches * max(self.width, self.height)
        return replace(self, most=int(np.clip(longer / ARROW_ROOM, LEAST_ARROWS, MOST_ARROWS)))

    @property
    def _texels_apart(self) -> float:
        """Distance of neighbouring texels, mm; the side of a square of the mean area where they form no grid."""
        layout = self.texels.layout
        if isinstance(layout, GridLayout):
            return min(self.width / layout.columns, self.height / layout.rows)
        return float(np.sqrt(self.width * self.height / max(self.seen.sum(), 1)))

    @property
    def _cell(self) -> float:
        """Side of the squares, mm, of which each gets an arrow; zero where each texel does."""
        cell = max(self.width, self.height) / self.most
        return cell if cell > self._texels_apart * (1 + 1e-9) else 0.0

    @property
    def arrow(self) -> float:
        """Length of the longest arrow, mm: no longer than arrows are apart."""
        return LONGEST_ARROW * max(self._cell, self._texels_apart)

    def draw(
        self,
        axes: Axes,
        values: np.ndarray,
        shear: np.ndarray,
        strongest: float,
        scale: Scale,
        edge: str = OUTLINE,
    ) -> Any:
        """Draw one tactile image; the arrow of the `strongest` shear is as long as texels, or arrows, are apart."""
        layout = self.texels.layout
        colours: dict[str, Any] = {
            "cmap": color_maps.matplotlib_colormap(scale.colour_map),
            "clim": (scale.low, scale.high),
        }
        image: Any
        if self.corners is not None and self.triangles is not None:
            image = _draw_surface(axes, self.triangles, self.corners, values, colours)
        else:
            picture: Any = np.ma.masked_array(layout.image(values), ~layout.mask())
            image = axes.imshow(picture, origin="lower", extent=self.window, interpolation="nearest", **colours)
        self._arrows(axes, shear, strongest)
        if isinstance(layout, GridLayout) and max(layout.shape) <= 64:
            rows, columns = layout.shape
            lines: dict[str, Any] = {"color": "white", "lw": 0.4, "alpha": 0.22, "zorder": 2}
            axes.vlines(np.arange(1, columns) * self.width / columns, 0.0, self.height, **lines)
            axes.hlines(np.arange(1, rows) * self.height / rows, 0.0, self.width, **lines)
        axes.set(xlim=self.window[:2], ylim=self.window[2:], xticks=[], yticks=[])
        axes.spines[:].set(color=edge, linewidth=0.6)
        return image

    def _arrows(self, axes: Axes, shear: np.ndarray, strongest: float) -> None:
        if self.axes is not None:
            force = shear[:, :1] * self.texels.tangent + shear[:, 1:] * self.texels.bitangent
            shear = force @ self.axes.T
        middle, mean = self._thinned(shear)
        size = np.linalg.norm(mean, axis=1)
        shown = size > SMALLEST_ARROW * strongest if strongest > 0 else np.zeros(len(size), dtype=bool)
        if not shown.any():
            return
        length = mean[shown] * (self.arrow / strongest)
        axes.quiver(
            middle[shown, 0],
            middle[shown, 1],
            length[:, 0],
            length[:, 1],
            angles="xy",
            scale_units="xy",
            scale=1.0,
            pivot="middle",
            color="white",
            edgecolor="black",
            linewidth=0.35,
            width=self.arrow * 0.12,
            units="xy",
            headwidth=3.6,
            headlength=3.8,
            headaxislength=3.4,
            minlength=0.1,
            zorder=3,
            clip_on=False,
        )

    def _thinned(self, shear: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return where arrows stand and the mean shear of the texels around them; every texel where there are few."""
        points, shear = self.points[self.seen], shear[self.seen]
        if not self._cell:
            return points, shear
        places = np.floor((points - [self.window[0], self.window[2]]) / self._cell).astype(int)
        _, which, count = np.unique(places, axis=0, return_inverse=True, return_counts=True)
        which = which.ravel()
        middle, mean = (np.column_stack([np.bincount(which, table[:, i]) / count for i in (0, 1)]) for table in (points, shear))
        return middle, mean


def _window(corners: np.ndarray) -> tuple[float, float, float, float]:
    """Return left, right, bottom and top of (m, 3, 2) corners, with a rim of 1 % of the longer side."""
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    rim = 0.01 * float((high - low).max())
    return float(low[0]) - rim, float(high[0]) + rim, float(low[1]) - rim, float(high[1]) + rim


def _draw_surface(axes: Axes, triangles: np.ndarray, corners: np.ndarray, values: np.ndarray, colours: dict[str, Any]) -> Any:
    """Give each texel the third of every triangle that is nearest to its corner, and draw the outline of the surface.

    A gradient from texel to texel would look finer than the sensor is.
    """
    from matplotlib.collections import LineCollection, PolyCollection

    middle = corners.mean(axis=1, keepdims=True).repeat(3, axis=1)
    after, before = 0.5 * (corners + np.roll(corners, -1, axis=1)), 0.5 * (corners + np.roll(corners, 1, axis=1))
    parts = np.stack([corners, after, middle, before], axis=2).reshape(-1, 4, 2)
    whole = len(triangles) > MOST_VECTORS
    # A part without an edge leaves a hair of the page between itself and its neighbours.
    surface = PolyCollection(
        parts, array=values[triangles].ravel(), edgecolors="face", linewidths=0.2, rasterized=whole, **colours
    )
    axes.add_collection(surface)
    rim = LineCollection(list(_outline(triangles, corners)), colors=OUTLINE, linewidths=0.5, zorder=1.5)
    axes.add_collection(rim)
    axes.set_aspect("equal")
    return surface


def _outline(triangles: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return the edges that belong to one triangle only, (e, 2, 2)."""
    ends = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2, 2)
    _, which, count = unique_edges(triangles)
    return ends[count[which.ravel()] == 1]


def _pitch(texels: Texels, across: np.ndarray, along: np.ndarray) -> float:
    """Median distance, in mm, of texels that are neighbours in `along` and equal in `across`; 1 where there are none."""
    order = np.lexsort((along, across))
    a, b = order[:-1], order[1:]
    neighbours = (across[a] == across[b]) & (along[b] - along[a] == 1)
    if not neighbours.any():
        return 1.0
    gaps = np.linalg.norm(texels.position[b[neighbours]] - texels.position[a[neighbours]], axis=1)
    return float(np.median(gaps)) * 1e3


def _millimetres_per_pixel(texels: Texels) -> float:
    """Scale of a flattened surface where it is least foreshortened: the edges that are longest on the map for their length."""
    layout = texels.layout
    assert not isinstance(layout, GridLayout)
    rows, columns = layout.shape
    corner = layout.corner_uv * [columns, rows]
    true = texels.position[layout.triangles]
    pixels = np.linalg.norm(corner - np.roll(corner, -1, axis=1), axis=2).ravel()
    metres = np.linalg.norm(true - np.roll(true, -1, axis=1), axis=2).ravel()
    whole = (pixels > 1e-9) & (metres > 0)
    if not whole.any():
        return 1.0
    return float(np.quantile(metres[whole] / pixels[whole], 0.05)) * 1e3


SCALE_KEY_LINE = 0.17
"""Inches from the scale bar to the arrow where that stands below."""
_LETTER = 0.066
"""Inches that a letter of the small text takes, on average."""


def shear_of_arrow(shear: np.ndarray, strongest: float) -> float:
    """Return the shear (N) that the arrow below images with some shear (…, n, 2) stands for; zero without any arrow on them."""
    return strongest if np.linalg.norm(shear, axis=-1).max(initial=0.0) > SMALLEST_ARROW * strongest else 0.0


def _arrow_scale(view: SensorView, strongest: float, inches: float) -> tuple[str, float]:
    """Words for the arrow below the images, and its length in inches."""
    value = float(f"{strongest:.1g}")
    return f"{value:g} N shear", value / strongest * view.arrow * inches


def scale_key_widths(view: SensorView, strongest: float, inches: float) -> tuple[float, float]:
    """Return the room, in inches, that :func:`draw_scale_key` needs on one line and on two."""
    bar = view.bar * inches + 0.07 + _LETTER * len(f"{view.bar:g} mm") if view.bar > 0 else 0.0
    if strongest <= 0:
        return bar, bar
    words, length = _arrow_scale(view, strongest, inches)
    arrow = 0.2 + length + 0.07 + _LETTER * len(words)
    return bar + arrow, max(bar, arrow - 0.2)


def draw_scale_key(
    figure: Figure,
    at: tuple[float, float],
    view: SensorView,
    strongest: float,
    inches: float,
    room: float | None = None,
) -> None:
    """Draw a scale bar for lengths and an arrow for shear below a row of images, at (x, y) inches.

    `inches` is the size of a millimetre. There is no arrow without a `strongest` shear. If both need more than `room` inches,
    the arrow is below the bar.
    """
    from matplotlib.lines import Line2D
    from matplotlib.patches import FancyArrowPatch

    width, height = figure.get_size_inches()
    x, y = at
    words: dict[str, Any] = {"fontsize": SMALL, "color": INK, "va": "center_baseline"}
    if view.bar > 0:
        stop = x + view.bar * inches
        figure.add_artist(Line2D([x / width, stop / width], [y / height] * 2, color=INK, lw=2.0, solid_capstyle="butt"))
        figure.text((stop + 0.07) / width, y / height, f"{view.bar:g} mm", **words)
        x = stop + 0.07 + _LETTER * len(f"{view.bar:g} mm") + 0.2
    if room is not None and view.bar > 0 and scale_key_widths(view, strongest, inches)[0] > room:
        x, y = at[0], y - SCALE_KEY_LINE
    if strongest > 0:
        label, length = _arrow_scale(view, strongest, inches)
        stop = x + length
        figure.add_artist(
            FancyArrowPatch(
                (x / width, y / height),
                (stop / width, y / height),
                arrowstyle=ARROW,
                mutation_scale=1,
                color=INK,
                lw=0,
                shrinkA=0,
                shrinkB=0,
                transform=figure.transFigure,
            )
        )
        figure.text((stop + 0.07) / width, y / height, label, **words)


def draw_colour_bar(figure: Figure, image: Any, axes: Axes, scale: Scale, ink: str = INK) -> None:
    """Fill `axes` with the colour bar of an image; it is horizontal where the axes are wider than high."""
    from matplotlib.ticker import MaxNLocator

    place, (width, height) = axes.get_position(), figure.get_size_inches()
    lies = place.width * width > place.height * height
    bar = figure.colorbar(image, cax=axes, orientation="horizontal" if lies else "vertical")
    bar.locator = MaxNLocator(5, steps=[1, 2, 2.5, 5, 10])
    bar.update_ticks()
    bar.ax.tick_params(labelsize=FONT, colors=ink, length=2.5, width=0.6)
    long = (place.width * width if lies else place.height * height) > 1.9  # inches; else the words need two lines
    label = (" " if long or lies else "\n").join(scale.label)
    bar.set_label(label, fontsize=FONT, color=ink, labelpad=2.0 if lies else 4.0)
    bar.outline.set(edgecolor=ink, linewidth=0.5)
