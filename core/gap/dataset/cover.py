# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors that are not a grid of texels: transducers at given places under a cover, and strips.

The surface that is touched is computed densely, and each reading is a weighted sum over its points.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import FileError
from ...geometry.texels import Texels
from ...geometry.texture_maps import UVLayout
from ...io.input_files import is_number
from ...io.schema import known_words
from ...io.sensor_toml import checked_lengths
from ...skins.magnetic_skin import pressure_below_point_load

COVER_WORDS = {"sensors", "strips", "cover"}
"""Words of a [sensor] that describe such a sensor."""
MOST_POINTS, USUAL_POINTS = 8000, 4000
"""Most points of a surface, and most of them if the rig gives no pitch: contact is computed at each of them in each sample."""
MOST_SENSORS = 4096
POINTS_PER_DEPTH, POINTS_PER_STRIP = 4.0, 4.0
"""Points per depth, and across the narrowest strip, if the rig gives no pitch; benchmarks/RESULTS.md has the errors."""
NEGLIGIBLE = 1e-4
"""Share of a transducer's largest weight up to which a weight is zero: what is far away does not load it."""
SUBDIVISIONS = 4
"""Points along each side of a surface point's cell at which it is tested whether a strip covers it."""


@dataclass(frozen=True)
class Cover:
    """The surface over a sensor's texels.

    Attributes
    ----------
    surface : Texels
        Its m points.
    weights : (n, m) float
        Force on each of n texels per force that a whole texel would have at each point.
    share : (m,) float
        Share of a texel's area that each point stands for.
    """

    surface: Texels
    weights: np.ndarray
    share: np.ndarray


def read_cover(sensor: Mapping[str, Any], path: Path) -> tuple[Texels, Cover]:
    """Return texels at given places, or strips, and the cover over them, from the [sensor] of a rig.

    Raises
    ------
    FileError
        A word is not valid, a transducer or a strip is outside the cover, or the surface has too many points.
    """
    words = sensor.get("cover")
    where = f"cover of '{path.name}'"
    if not isinstance(words, dict) or "size" not in words:
        raise FileError(f"[sensor] of '{path.name}' needs cover = {{ size = [x, y], … }}, in metres, beside sensors or strips.")
    known_words(words, {"size", "depth", "pitch"}, where)
    size = np.array(checked_lengths(words["size"], 2, f"size of {where}"))
    depth = checked_lengths(words["depth"], 1, f"depth of {where}")[0] if "depth" in words else 0.0
    if ("sensors" in sensor) == ("strips" in sensor):
        raise FileError(f"[sensor] of '{path.name}' needs either sensors = [[x, y], …] or strips = […], and not both.")
    if "sensors" in sensor:
        if not depth:
            raise FileError(f"{where} has no depth: write how far below the surface the sensors are, in metres.")
        places = _places(sensor["sensors"], f"sensors of '{path.name}'", 1, size)
        surface = _surface(size, words, depth / POINTS_PER_DEPTH, where)
        area = float(np.prod(size)) / len(places)
        weights = _load_at_depth(places, surface, depth)
        return flat_texels(places, np.full(len(places), area)), Cover(surface, weights, surface.area / area)
    strips = _strips(sensor["strips"], f"strips of '{path.name}'", size)
    surface = _surface(size, words, min(map(_width, strips)) / POINTS_PER_STRIP, where)
    cell = size / [len(np.unique(values)) for values in surface.position[:, :2].T]
    covered = np.array([_covered(strip, surface, cell) for strip in strips]) * surface.area
    areas = covered.sum(axis=1)
    (missed,) = np.nonzero(areas <= 0.0)
    if len(missed):
        raise FileError(f"Strip {missed[0]} of '{path.name}' lies between the points of the {where}: give it a smaller pitch.")
    centres = covered @ surface.position[:, :2] / areas[:, None]
    if depth:
        covered = covered @ _load_at_depth(surface.position[:, :2], surface, depth)
    return flat_texels(centres, areas), Cover(surface, covered / areas.mean(), surface.area / areas.mean())


def _places(value: Any, where: str, least: int, size: np.ndarray) -> np.ndarray:
    """Places (n, 2) on the cover."""
    pairs = isinstance(value, list) and least <= len(value) <= MOST_SENSORS
    if not pairs or not all(isinstance(one, list) and len(one) == 2 and all(map(is_number, one)) for one in value):
        raise FileError(
            f"{where} are {value!r:.60}: write at least {least} and at most {MOST_SENSORS} places [x, y], in metres."
        )
    places = np.array(value, float)
    (outside,) = np.nonzero((np.abs(places) > 0.5 * size + 1e-9).any(axis=1))
    if len(outside):
        x, y = places[outside[0]]
        raise FileError(f"{where}: [{x:g}, {y:g}] is not on the cover, which is centred on the origin; give places in metres.")
    return places


def _strips(value: Any, where: str, size: np.ndarray) -> list[np.ndarray]:
    """Polygons, each (p, 2); a rectangle may be given by two opposite corners."""
    if not isinstance(value, list) or not 1 <= len(value) <= MOST_SENSORS:
        raise FileError(f"{where} are {value!r:.60}: write a list of them, each as [[x, y], [x, y]] or with all its corners.")
    strips = []
    for number, one in enumerate(value):
        corners = _places(one, f"Corners of strip {number} of the {where}", 2, size)
        if len(corners) == 2:
            (x0, y0), (x1, y1) = corners
            corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
        if _area(corners) <= 1e-9 * float(np.prod(size)):
            raise FileError(f"Strip {number} of the {where} has no area: give two opposite corners, or all corners in order.")
        strips.append(corners)
    return strips


def _area(corners: np.ndarray) -> float:
    """Area of a polygon (shoelace formula)."""
    x, y = corners.T
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def _width(corners: np.ndarray) -> float:
    """Twice the area over the perimeter: the width of a long strip."""
    return 2.0 * _area(corners) / float(np.linalg.norm(corners - np.roll(corners, -1, axis=0), axis=1).sum())


def _surface(size: np.ndarray, words: Mapping[str, Any], otherwise: float, where: str) -> Texels:
    """Points in z = 0 at the centres of equal cells, centred on the origin; `otherwise` is their pitch if `words` give none."""
    pitch = max(otherwise, float(np.sqrt(np.prod(size) / USUAL_POINTS)))
    if "pitch" in words:
        (pitch,) = checked_lengths(words["pitch"], 1, f"pitch of {where}")
    counts = np.maximum(np.ceil(size / pitch - 1e-9), 1.0)
    if counts.prod() > MOST_POINTS:
        raise FileError(f"{where} has {counts.prod():.3g} points: at most {MOST_POINTS} are computed; give a larger pitch.")
    columns, rows = (int(count) for count in counts)
    step = size / counts
    row, column = np.divmod(np.arange(rows * columns), columns)
    places = np.stack([column + 0.5, row + 0.5], axis=1) * step - 0.5 * size
    return flat_texels(places, np.full(len(places), float(np.prod(step))))


def flat_texels(places: np.ndarray, area: np.ndarray) -> Texels:
    """Return texels in z = 0, normals +z, that form no grid, given their places (n, 2) and areas (n,)."""
    n = len(places)
    return Texels(
        vertex=np.arange(n),
        position=np.column_stack([places, np.zeros(n)]),
        normal=np.tile([0.0, 0.0, 1.0], (n, 1)),
        tangent=np.tile([1.0, 0.0, 0.0], (n, 1)),
        area=area,
        layout=UVLayout(np.zeros((0, 3), int), np.zeros((0, 3, 2)), 1, 1),
    )


def _load_at_depth(places: np.ndarray, surface: Texels, depth: float) -> np.ndarray:
    """Share of the force at each surface point that loads a unit of area below a place, times that point's area, (p, m).

    The normal stress under a point load integrates to one, so that under an even pressure each place has this pressure.
    Negligible shares are zero.
    """
    squares = ((places[:, None, :] - surface.position[None, :, :2]) ** 2).sum(axis=2)
    weights = pressure_below_point_load(depth, squares) * surface.area
    return np.where(weights > NEGLIGIBLE * weights.max(axis=1, keepdims=True), weights, 0.0)


def _covered(corners: np.ndarray, surface: Texels, cell: np.ndarray) -> np.ndarray:
    """Share of each cell, `cell` (2,) wide, that a polygon covers, (m,): even-odd rule at a grid of points of the cell."""
    offsets = (np.arange(SUBDIVISIONS) + 0.5) / SUBDIVISIONS - 0.5
    px = surface.position[:, 0] + (offsets * cell[0])[:, None, None]
    py = surface.position[:, 1] + (offsets * cell[1])[:, None]
    inside = np.zeros((SUBDIVISIONS, SUBDIVISIONS, len(surface)), bool)
    for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if ay != by:
            inside ^= ((ay > py) != (by > py)) & (px < (bx - ax) * (py - ay) / (by - ay) + ax)
    return np.asarray(inside.mean(axis=(0, 1)))
