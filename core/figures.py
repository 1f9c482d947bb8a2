# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of a recording: tactile images over time, force curves, and the labels on a rendered picture.

matplotlib is imported on use, and only its Agg canvas, so that nothing here needs a window or touches another figure.
Forces are in newtons and lengths in millimetres, and no text is smaller than 8 pt at the size of the written figure.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .canvas import FONT, GREY, INK, NORMAL_COLOUR, SHEAR_COLOUR, new_figure, save_figure
from .layout import GridLayout
from .recording import Recording, SensorRecording
from .scenario import SensorParameters
from .texels import Texels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SMALLEST_ARROW = 0.08
"""Share of the strongest shear below which no arrow is drawn."""

ARROW = "simple,head_length=5,head_width=5,tail_width=1.5"


def net_shear(sensor: SensorRecording, texels: Texels) -> np.ndarray:
    """Return the sum of all texels' shear forces, in the frame of the sensor's body.

    Parameters
    ----------
    sensor : SensorRecording
        F frames of n texels.
    texels : Texels
        The n texels.

    Returns
    -------
    (F, 3) float, N
    """
    return sensor.shear[:, :, 0] @ texels.tangent + sensor.shear[:, :, 1] @ texels.bitangent


def mobilised(sensor: SensorRecording, texels: Texels, mus: float) -> np.ndarray:
    """Return how much of the static friction is used: ``|Σ shear| / (mus · Σ normal)``, zero while nothing touches.

    Returns
    -------
    (F,) float
    """
    limit = mus * sensor.normal_force.sum(axis=1)
    shear = np.linalg.norm(net_shear(sensor, texels), axis=1)
    return np.divide(shear, limit, out=np.zeros_like(shear), where=limit > 0)


def peak_force(recording: Recording) -> float:
    """Return the largest normal force of any texel at any frame, N; one newton when nothing ever touched."""
    peak = max((float(sensor.normal_force.max(initial=0.0)) for sensor in recording.sensors.values()), default=0.0)
    return peak if peak > 0 else 1.0


def peak_shear(recording: Recording) -> float:
    """Return the largest shear force of any texel at any frame, N; zero when nothing ever slid."""
    return max((float(np.linalg.norm(s.shear, axis=2).max(initial=0.0)) for s in recording.sensors.values()), default=0.0)


def tidy_limit(value: float) -> float:
    """Return the next number of the form 1, 1.5, 2, 2.5, 3, 4, 5, 6 or 8 × 10ⁿ at or above `value`, for the end of a scale."""
    power = 10.0 ** np.floor(np.log10(value))
    for step in (1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10):
        if value <= step * power * (1 + 1e-9):
            return float(step * power)
    raise AssertionError("every decade ends at ten")


def scale_limit(recording: Recording) -> float:
    """Return the end of a colour scale for a recording, N: a round number with some room above the largest force."""
    return tidy_limit(1.05 * peak_force(recording))


def choose_frames(recording: Recording, count: int) -> np.ndarray:
    """Return up to `count` frame numbers, evenly spread over the time in which the forces change (or over all of it).

    Returns
    -------
    (c,) int, increasing
    """
    peak = peak_force(recording)
    changes = np.zeros(len(recording.frames), dtype=bool)
    for sensor in recording.sensors.values():
        forces = np.concatenate([sensor.normal_force[:, :, None], sensor.shear], axis=2)
        step = np.abs(np.diff(forces, axis=0)).max(axis=(1, 2), initial=0.0) > 1e-3 * peak
        changes[1:] |= step
        changes[:-1] |= step
    indices = np.flatnonzero(changes) if changes.any() else np.arange(len(recording.frames))
    first, span = indices[0], indices[-1] - indices[0] + 1
    count = min(count, span)
    return recording.frames[first + ((np.arange(count) + 0.5) * span / count).astype(int)]


def tactile_strip(
    path: str | Path,
    recording: Recording,
    texels: Mapping[str, Texels],
    frames: Sequence[int] | np.ndarray | None = None,
    *,
    colour_map: str = "inferno",
    limit: float | None = None,
    dpi: int = 200,
) -> None:
    """Draw the tactile images of all sensors over time: normal force in colour, shear as arrows.

    Parameters
    ----------
    path : str or Path
        PNG, PDF or SVG, by its ending.
    recording : Recording
    texels : mapping of str to Texels
        By sensor name; one row of images each, in this order.
    frames : sequence of int, optional
        Frame numbers, one column each. Default: six, spread over the time in which the forces change.
    colour_map : str
        A matplotlib colour map; take a perceptually uniform one.
    limit : float, N, optional
        Upper end of the colour scale. Default: a round number above the largest force.
    """
    chosen = choose_frames(recording, 6) if frames is None else np.asarray(frames)
    index = np.searchsorted(recording.frames, chosen)
    top = scale_limit(recording) if limit is None else limit
    views = [_View.of(texels[name]) for name in texels]
    strongest = peak_shear(recording)
    columns = len(chosen)

    # Sizes in inches: the figure is as high as its rows need, so that images keep their shape and text its size.
    left, right, above, gap = 0.95, 0.9, 0.28, 0.36
    cell = max(0.72, (7.2 - left - right) / columns)
    width = left + right + columns * cell
    heights = [min(max(cell * 0.86 * view.height / view.width, 0.5), 2.4) for view in views]
    below = 0.42
    height = above + sum(heights) + gap * (len(views) - 1) + below
    figure = new_figure(width, height)
    y = height - above
    image = None
    for row, (name, view) in enumerate(zip(texels, views, strict=True)):
        y -= heights[row]
        sensor = recording.sensors[name]
        for column, i in enumerate(index):
            x = left + column * cell + 0.03
            axes = figure.add_axes((x / width, y / height, (cell - 0.06) / width, heights[row] / height))
            image = view.draw(axes, sensor.normal_force[i], sensor.shear[i], strongest, top, colour_map)
            if row == 0:
                axes.set_title(f"{recording.times[i]:.2f} s", fontsize=FONT, color=INK, pad=4)
            if column == 0:
                axes.set_anchor("W")
                middle = (y + heights[row] / 2) / height
                figure.text(
                    0.1 / width,
                    middle + 0.1 / height,
                    _wrapped(name),
                    fontsize=FONT + 0.5,
                    color=INK,
                    weight="bold",
                    va="bottom",
                    ha="left",
                )
                figure.text(
                    0.1 / width,
                    middle + 0.06 / height,
                    view.caption,
                    fontsize=8,
                    color=GREY,
                    va="top",
                    ha="left",
                    linespacing=1.3,
                )
            axes.set_anchor("C")
        shown = strongest if np.linalg.norm(sensor.shear[index], axis=2).max(initial=0.0) > SMALLEST_ARROW * strongest else 0.0
        inches = min((cell - 0.06) / view.width, heights[row] / view.height)
        _keys(figure, (left + 0.5 * (cell - inches * view.width), y - 0.2), view, shown, inches)
        y -= gap
    assert image is not None
    bar = figure.add_axes(((width - right + 0.1) / width, 0.2, 0.11 / width, 0.6))
    _colour_bar(figure, image, bar, top)
    save_figure(figure, path, dpi)


def force_curves(
    path: str | Path,
    recording: Recording,
    texels: Mapping[str, Texels],
    parameters: Mapping[str, SensorParameters],
    required: Mapping[str, float] | None = None,
    *,
    dpi: int = 200,
) -> None:
    """Draw each sensor's summed normal force and shear over time, with the friction limits ``mus · N`` and ``mud · N``.

    Parameters
    ----------
    required : mapping of str to float, N, optional
        The normal force that a sensor ought to show at the end (a weight at rest), drawn as a dashed line.
    """
    names = list(texels)
    figure = new_figure(7.2, 0.75 + 1.75 * len(names))
    grid = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for axes, name in zip(grid, names, strict=True):
        sensor, mu = recording.sensors[name], parameters[name]
        normal = sensor.normal_force.sum(axis=1)
        shear = np.linalg.norm(net_shear(sensor, texels[name]), axis=1)
        axes.plot(recording.times, normal, color=NORMAL_COLOUR, lw=1.8, label="normal, sum of texels")
        if required and name in required:
            axes.axhline(required[name], color=INK, lw=0.9, ls=(0, (4, 3)), label=f"required: {required[name]:.4f} N")
            axes.annotate(
                f"{normal[-1]:.4f} N",
                (recording.times[-1], normal[-1]),
                (-4, -6),
                textcoords="offset points",
                ha="right",
                va="top",
                fontsize=8,
                color=NORMAL_COLOUR,
            )
        else:
            axes.fill_between(
                recording.times,
                mu.mud * normal,
                mu.mus * normal,
                color=SHEAR_COLOUR,
                alpha=0.18,
                lw=0,
                label=r"friction limit, $\mu_d$ N to $\mu_s$ N",
            )
            axes.plot(recording.times, shear, color=SHEAR_COLOUR, lw=1.8, label="shear, net")
        axes.set_title(name, loc="left", fontsize=FONT + 0.5, color=INK, weight="bold")
        axes.set_ylabel("force (N)")
        axes.set_ylim(bottom=0)
        axes.margins(x=0)
        axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False, handlelength=1.6, borderaxespad=0)
        axes.grid(True, color="#e4e7eb", lw=0.7)
        axes.set_axisbelow(True)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    grid[-1].set_xlabel("time (s)")
    figure.subplots_adjust(
        left=0.08, right=0.72, top=1 - 0.3 / figure.get_figheight(), bottom=0.5 / figure.get_figheight(), hspace=0.45
    )
    figure.align_ylabels(list(grid))
    save_figure(figure, path, dpi)


@dataclass(frozen=True)
class Label:
    """Words on a picture with a thin line to what they are about.

    Attributes
    ----------
    text : str
        Its first line is set bold.
    at : (2,) float
        Where the words stand, as shares of the picture's width and height from its lower left corner.
    to : (2,) float or None
        Where the line ends, likewise.
    """

    text: str
    at: tuple[float, float]
    to: tuple[float, float] | None = None


def label_picture(
    source: str | Path,
    path: str | Path,
    recording: Recording,
    texels: Mapping[str, Texels],
    frame: int,
    *,
    colour_map: str = "inferno",
    limit: float | None = None,
    labels: Sequence[Label] = (),
    dpi: int = 160,
) -> None:
    """Put a colour bar in newtons, the tactile images of `frame`, and labels on a rendered picture.

    Parameters
    ----------
    source, path : str or Path
        The rendered PNG and the PNG to write; they may be the same file. The size in pixels stays as it is.
    """
    from matplotlib.image import imread

    picture = imread(source)
    pixels_y, pixels_x = picture.shape[:2]
    # Text keeps its share of the picture, and its 8 pt when the picture is shown at eight inches of width.
    dpi = round(dpi * pixels_x / 1280)
    width, height = pixels_x / dpi, pixels_y / dpi
    figure = new_figure(width, height)
    background = figure.add_axes((0, 0, 1, 1))
    background.imshow(picture, aspect="auto", interpolation="none")
    background.set_axis_off()

    (found,) = np.nonzero(recording.frames == frame)
    if len(found) == 0:
        raise KeyError(frame)
    i = int(found[0])
    top = scale_limit(recording) if limit is None else limit
    views = [_View.of(texels[name]) for name in texels]
    image = None
    # A column at the right edge: one tactile image per sensor over each other, the colour bar beside them.
    column, bar_room, title = 0.74, 0.72, 0.24
    x = width - column - bar_room - 0.12
    room = height - 0.3
    each = min(1.75, room / max(len(views), 1) - title)
    y = height - 0.5 * (height - len(views) * (each + title))
    y_top = y - title
    for name, view in zip(texels, views, strict=True):
        y -= title
        figure.text(
            (x + column / 2) / width, (y + 0.05) / height, name, fontsize=FONT, color="white", weight="bold", ha="center"
        )
        y -= each
        axes = figure.add_axes((x / width, y / height, column / width, each / height))
        sensor = recording.sensors[name]
        image = view.draw(
            axes, sensor.normal_force[i], sensor.shear[i], peak_shear(recording), top, colour_map, edge="#ffffff80"
        )
    if image is not None:
        bar = figure.add_axes(((width - bar_room) / width, y / height, 0.12 / width, (y_top - y) / height))
        _colour_bar(figure, image, bar, top, ink="white")
    for label in labels:
        _draw_label(figure, label, width, height)
    save_figure(figure, path, dpi)


def _draw_label(figure: Figure, label: Label, width: float, height: float) -> None:
    first, _, rest = label.text.partition("\n")
    x, y = label.at
    figure.text(x, y, first, fontsize=FONT + 1.5, color="white", weight="bold", va="bottom", ha="left")
    figure.text(x, y - 0.03 / height, rest, fontsize=FONT, color="#e3e8ee", va="top", ha="left", linespacing=1.35)
    if label.to is not None:
        from matplotlib.lines import Line2D

        figure.add_artist(
            Line2D([x, label.to[0]], [label.at[1] + 0.22 / height, label.to[1]], color="white", lw=0.8, alpha=0.8)
        )


@dataclass(frozen=True)
class _View:
    """How one sensor's texels are drawn: an image and where the texels lie on it."""

    texels: Texels
    extent: tuple[float, float, float, float]
    points: np.ndarray
    bar: float
    """Length of the scale bar in the units of `extent`; zero where the layout has no true lengths."""

    @classmethod
    def of(cls, texels: Texels) -> _View:
        layout = texels.layout
        rows, columns = layout.shape
        if isinstance(layout, GridLayout):
            pitch_x, pitch_y = _pitch(texels, layout.row, layout.column), _pitch(texels, layout.column, layout.row)
            points = np.stack([(layout.column + 0.5) * pitch_x, (layout.row + 0.5) * pitch_y], axis=1)
            reach = columns * pitch_x
            steps = [s for s in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500) if s <= 0.7 * reach]
            return cls(texels, (0.0, reach, 0.0, rows * pitch_y), points, steps[-1] if steps else 0.0)
        points = np.asarray(layout.uv()) * [columns, rows]
        return cls(texels, (0.0, float(columns), 0.0, float(rows)), points, 0.0)

    @property
    def width(self) -> float:
        return self.extent[1]

    @property
    def height(self) -> float:
        return self.extent[3]

    @property
    def caption(self) -> str:
        layout = self.texels.layout
        if isinstance(layout, GridLayout):
            return f"{layout.rows} × {layout.columns} texels\n{self.width / layout.columns:.3g} mm pitch"
        return f"{len(self.texels)} texels"

    def draw(
        self,
        axes: Axes,
        normal_force: np.ndarray,
        shear: np.ndarray,
        strongest: float,
        top: float,
        colour_map: str,
        edge: str = "#9aa3ad",
    ) -> Any:
        """Draw one tactile image; the arrow of the `strongest` shear is a little longer than a texel."""
        layout = self.texels.layout
        picture: Any = np.ma.masked_array(layout.image(normal_force), ~layout.mask())
        image = axes.imshow(
            picture, origin="lower", extent=self.extent, cmap=colour_map, vmin=0.0, vmax=top, interpolation="nearest"
        )
        size = np.linalg.norm(shear, axis=1)
        shown = size > SMALLEST_ARROW * strongest if strongest > 0 else np.zeros(len(size), dtype=bool)
        if shown.any():
            length = shear[shown] * (self.arrow / strongest)
            middle = self.points[shown]
            axes.quiver(
                middle[:, 0],
                middle[:, 1],
                length[:, 0],
                length[:, 1],
                angles="xy",
                scale_units="xy",
                scale=1.0,
                pivot="middle",
                color="white",
                edgecolor="black",
                linewidth=0.35,
                width=self.arrow * 0.1,
                units="xy",
                headwidth=3.6,
                headlength=3.8,
                headaxislength=3.4,
                minlength=0.1,
                zorder=3,
                clip_on=False,
            )
        if isinstance(layout, GridLayout):
            rows, columns = layout.shape
            lines: dict[str, Any] = {"color": "white", "lw": 0.4, "alpha": 0.22, "zorder": 2}
            axes.vlines(np.arange(1, columns) * self.width / columns, 0.0, self.height, **lines)
            axes.hlines(np.arange(1, rows) * self.height / rows, 0.0, self.width, **lines)
        axes.set_xlim(self.extent[:2])
        axes.set_ylim(self.extent[2:])
        axes.set_xticks([])
        axes.set_yticks([])
        for spine in axes.spines.values():
            spine.set_color(edge)
            spine.set_linewidth(0.6)
        return image

    @property
    def arrow(self) -> float:
        """Length of the longest arrow, in the units of `extent`."""
        rows, columns = self.texels.layout.shape
        if isinstance(self.texels.layout, GridLayout):
            return 1.2 * self.width / columns
        return 0.12 * max(rows, columns)


def _pitch(texels: Texels, across: np.ndarray, along: np.ndarray) -> float:
    """Median distance, in mm, of texels that are neighbours in `along` and equal in `across`; 1 where there are none."""
    order = np.lexsort((along, across))
    a, b = order[:-1], order[1:]
    neighbours = (across[a] == across[b]) & (along[b] - along[a] == 1)
    if not neighbours.any():
        return 1.0
    gaps = np.linalg.norm(texels.position[b[neighbours]] - texels.position[a[neighbours]], axis=1)
    return float(np.median(gaps)) * 1e3


def _keys(figure: Figure, at: tuple[float, float], view: _View, strongest: float, inches: float) -> None:
    """Below a row of images, at (x, y) inches: how long some millimetres and some newtons of shear are drawn.

    `inches` is the size of one unit of the view's extent; without a `strongest` shear there is no arrow.
    """
    from matplotlib.lines import Line2D
    from matplotlib.patches import FancyArrowPatch

    width, height = figure.get_size_inches()
    x, y = at
    words: dict[str, Any] = {"fontsize": 8, "color": INK, "va": "center_baseline"}
    if view.bar > 0:
        stop = x + view.bar * inches
        figure.add_artist(Line2D([x / width, stop / width], [y / height] * 2, color=INK, lw=2.0, solid_capstyle="butt"))
        figure.text((stop + 0.07) / width, y / height, f"{view.bar:g} mm", **words)
        x = stop + 0.85
    if strongest > 0:
        value = float(f"{strongest:.1g}")
        stop = x + value / strongest * view.arrow * inches
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
        figure.text((stop + 0.07) / width, y / height, f"{_newtons(value)} shear", **words)


def _newtons(value: float) -> str:
    return f"{value * 1e3:g} mN" if value < 0.1 else f"{value:g} N"


def _wrapped(name: str) -> str:
    import textwrap

    return "\n".join(textwrap.wrap(name, 12)) or name


def _colour_bar(figure: Figure, image: Any, axes: Axes, top: float, ink: str = INK) -> None:
    from matplotlib.ticker import MaxNLocator

    bar = figure.colorbar(image, cax=axes)
    bar.locator = MaxNLocator(5, steps=[1, 2, 2.5, 5, 10])
    bar.update_ticks()
    bar.ax.tick_params(labelsize=FONT, colors=ink, length=2.5, width=0.6)
    bar.ax.yaxis.set_major_formatter(lambda value, _: f"{value:.3g}")
    tall = axes.get_position().height * figure.get_figheight() > 1.9  # inches; else the words need two lines
    bar.set_label("normal force per texel (N)" if tall else "normal force\nper texel (N)", fontsize=FONT, color=ink)
    bar.outline.set_edgecolor(ink)
    bar.outline.set_linewidth(0.5)
