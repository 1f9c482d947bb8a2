# SPDX-License-Identifier: GPL-3.0-or-later
"""The surface of a gel as a camera behind it sees it, lit by a red, a green and a blue lamp from three sides.

The surface is the baked penetration, smooth between texels (:func:`.grid_layout.smooth_depth`). It is shaded directly, without
a renderer: light of lamp i is ``brightness · albedo · max(0, n · lᵢ) / sin(angle)``, n being the unit normal of the surface
towards the camera and lᵢ the unit vector to the lamp. Light that is blocked by other parts of the surface, reflected between
them or refracted is left out, and the camera has no perspective. So this is a picture of penalty depths and not a calibrated
model of a camera and its lamps.
"""

from __future__ import annotations

import math

import numpy as np

from .. import response
from ..errors import ParameterError, SensorError
from ..geometry.grid_layout import GridLayout, smooth_depth
from ..geometry.texels import Texels
from ..model.recording import SensorFrame
from . import color_maps
from .figure_style import MARKERS_ALONG, GelStyle
from .tactile_image import SensorView

LAMP_AZIMUTHS = (90.0, 210.0, 330.0)
"""Directions of the red, the green and the blue lamp in the image, degrees from its right side towards its upper side."""
BRIGHTNESS = 0.35
"""Linear light of each colour where nothing touches: a light grey, chosen by eye."""
MARKER_ALBEDO = 0.12
"""Share of the light that a printed marker reflects, beside that of the gel; chosen by eye."""
MARKER_RADIUS = 0.15
"""Of a marker over the distance between markers; chosen by eye."""
MOST_MARKERS = 20_000
"""More would take long to draw, and be smaller than pixels of most images."""


def require_grid(texels: Texels, name: str) -> None:
    """Raise :class:`SensorError` if the texels of sensor `name` form no rows and columns."""
    if not isinstance(texels.layout, GridLayout):
        raise SensorError(
            f"The texels of sensor '{name}' form no rows and columns, of which the gel's image is made: choose a sensor whose "
            "region is a grid, or lay texels in rows on it."
        )


def image_size(texels: Texels, size: tuple[int, int]) -> tuple[int, int]:
    """Return width and height of a gel's image, pixels: the largest of square pixels that fits into `size`."""
    across, up = _lengths(texels)
    scale = min(size[0] / across, size[1] / up)
    return max(1, round(across * scale)), max(1, round(up * scale))


def lamp_directions(angle: float) -> np.ndarray:
    """Return the unit vectors to the red, the green and the blue lamp: right, up, and towards the camera.

    Parameters
    ----------
    angle : float, degrees
        Between the lamps' light and the surface.

    Returns
    -------
    (3, 3) float, a row for each lamp
    """
    turn, up = np.radians(LAMP_AZIMUTHS), math.radians(angle)
    return np.column_stack([math.cos(up) * np.cos(turn), math.cos(up) * np.sin(turn), np.full(3, math.sin(up))])


def gel_pixels(sensor: SensorFrame, texels: Texels, name: str, sigma0: float, style: GelStyle | None = None) -> np.ndarray:
    """Return a gel as a camera behind it sees it: texel columns run from right to left, rows upwards.

    Parameters
    ----------
    sensor : SensorFrame
    texels : Texels
        In rows and columns. The gel is flattened; its first and last rows and columns are the borders of the image.
    name : str
        Of the sensor, for messages.
    sigma0 : float, N/m
        Tangential stiffness of a texel, by which shear moves markers (:func:`marker_shifts`).
    style : GelStyle, optional

    Returns
    -------
    (height, width, 3) uint8, sRGB, the upper row first

    Raises
    ------
    SensorError
        The texels form no rows and columns, or a depth or a shear of the frame is no number.
    ParameterError
        There would be more than :data:`MOST_MARKERS` markers.
    """
    style = style or GelStyle()
    require_grid(texels, name)
    if not (np.isfinite(sensor.depth).all() and np.isfinite(sensor.shear).all()):
        raise SensorError(f"The bake of sensor '{name}' has depths or shear that are not numbers: bake again.")
    light = _shaded(sensor, texels, style)
    if style.markers:
        light *= _marker_albedo(sensor, texels, name, sigma0, style)[:, :, None]
    return np.round(255.0 * color_maps.srgb(np.minimum(light, 1.0))).astype(np.uint8)


def marker_places(texels: Texels, name: str, pitch: float | None) -> tuple[np.ndarray, float]:
    """Return where markers are printed on the flattened gel, from its first row and column, and their distance.

    Returns
    -------
    places : (m, 2) float, metres
        Along the columns (x) and the rows (y). They stand in rows and columns, in the middle of the gel.
    pitch : float, metres
    """
    sides = np.array(_lengths(texels))
    pitch = pitch or response.rounded_limit(float(sides.max()) / MARKERS_ALONG)
    counts = np.maximum(np.floor(sides / pitch), 1.0)
    if counts.prod() > MOST_MARKERS:
        raise ParameterError(
            f"A marker pitch of {pitch:g} m prints {counts.prod():.3g} markers on the gel of sensor '{name}': choose a larger "
            f"one, for at most {MOST_MARKERS:,} markers."
        )
    x, y = (0.5 * (side - (count - 1) * pitch) + pitch * np.arange(count) for side, count in zip(sides, counts, strict=True))
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2), pitch


def marker_shifts(sensor: SensorFrame, texels: Texels, sigma0: float, places: np.ndarray) -> np.ndarray:
    """Return by how much shear carries markers along: shear of a texel over the stiffness of its bristles, ``u = f / σ₀``.

    Between texels the shear is linear.

    Parameters
    ----------
    sensor : SensorFrame
    sigma0 : float, N/m
    places : (m, 2) float, metres
        As of :func:`marker_places`.

    Returns
    -------
    (m, 2) float, metres, along the columns and the rows
    """
    from scipy.ndimage import map_coordinates

    at = (places / _pitches(texels)).T[::-1]
    shift = texels.layout.image(sensor.shear / sigma0)
    return np.column_stack([map_coordinates(shift[:, :, axis], at, order=1, mode="nearest") for axis in (0, 1)])


def _pitches(texels: Texels) -> np.ndarray:
    """(2,) float, metres: distances of columns and of rows."""
    view = SensorView.of(texels)
    return 1e-3 * np.array([view.width / texels.layout.shape[1], view.height / texels.layout.shape[0]])


def _lengths(texels: Texels) -> tuple[float, float]:
    """Return the distances from the first to the last column and row, metres."""
    rows, columns = texels.layout.shape
    across, up = _pitches(texels) * (columns - 1, rows - 1)
    return float(across), float(up)


def _shaded(sensor: SensorFrame, texels: Texels, style: GelStyle) -> np.ndarray:
    """(height, width, 3) float: the linear light of the three lamps from an unprinted gel."""
    width, height = image_size(texels, style.size)
    rows, columns = texels.layout.shape
    # with a pixel beyond each border, so that every slope is between neighbours
    row = (rows - 1) * (1.0 - (np.arange(-1, height + 1) + 0.5) / height)
    column = (columns - 1) * (1.0 - (np.arange(-1, width + 1) + 0.5) / width)
    slopes = np.gradient(smooth_depth(texels.layout.image(sensor.depth), row, column), row, column)
    row_slope, column_slope = (slope[1:-1, 1:-1] for slope in slopes)
    pitch_x, pitch_y = _pitches(texels)
    # Where the gel is pressed it comes nearer to the camera. To the right of the image are the lower columns.
    normal = np.stack([column_slope / pitch_x, -row_slope / pitch_y, np.ones_like(row_slope)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    strength = BRIGHTNESS / math.sin(math.radians(style.light_angle))
    return strength * np.maximum(normal @ lamp_directions(style.light_angle).T, 0.0)


def _marker_albedo(sensor: SensorFrame, texels: Texels, name: str, sigma0: float, style: GelStyle) -> np.ndarray:
    """(height, width) float: the share of light that the printed gel reflects; the rims of markers are smooth."""
    width, height = image_size(texels, style.size)
    places, pitch = marker_places(texels, name, style.marker_pitch)
    moved = places + marker_shifts(sensor, texels, sigma0, places)
    across, up = _lengths(texels)
    scale = np.array([width / across, height / up])
    centres = np.column_stack([across - moved[:, 0], up - moved[:, 1]]) * scale - 0.5
    radius = MARKER_RADIUS * pitch * float(scale.mean())
    reach = math.ceil(radius + 1.0)
    covered = np.zeros((height, width))
    seen = ((centres > -reach) & (centres < np.array([width, height]) + reach)).all(axis=1)
    for x, y in centres[seen]:
        left, top = max(int(x) - reach, 0), max(int(y) - reach, 0)
        part = covered[top : int(y) + reach + 2, left : int(x) + reach + 2]
        distance = np.hypot(left + np.arange(part.shape[1]) - x, (top + np.arange(part.shape[0]) - y)[:, None])
        np.maximum(part, np.clip(radius + 0.5 - distance, 0.0, 1.0), out=part)
    return 1.0 - (1.0 - MARKER_ALBEDO) * covered
