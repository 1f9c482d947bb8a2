# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies pressed into an elastic (Winkler) foundation: sums over texels against integrals in closed form.

A texel of pitch h stands for h² of a foundation of stiffness k / h². What it feels is Eq. 4 and 8: depth perpendicular to the
surface, ``d = s cos θ``, and ``k d`` along the surface's normal. A sum over a square grid is then a midpoint rule, whose error,
averaged over places of the grid, falls with a power of h that only the edge of the contact decides (the integrand's Fourier
transform at 1 / h; in two dimensions a curved edge scatters half a power more than a straight one along the grid):

=====================  ==============================  ================  ===============
edge of the contact    bodies                          order of force    order of area
=====================  ==============================  ================  ===============
straight, rises by 0   lying cylinder, tilted flat     2                 1
curved, rises by 0     sphere                          2.5               1.5
curved, jumps          flat cylinder                   1.5               1.5
=====================  ==============================  ================  ===============
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import trimesh
from solver_scenes import about, box, pad, pressed, shape

from palpate.core.geometry.mesh import TriangleMesh, checked_mesh
from palpate.core.model.sensor import Sensor
from palpate.core.model.sensor_parameters import SensorParameters
from palpate.core.solver.simulation import run

RADIUS, DEPTH, LENGTH = 0.02, 5e-4, 0.012
"""Of the bodies; how deep they are pressed; side of the pad. Metres."""
ANGLE = np.radians(5.0)
"""Slope of the tilted flat."""
TEXELS = (8, 16, 32, 64)
"""Along the pad's side."""
PLACES = 64
"""Random offsets between body and grid over which errors are averaged."""


def sheet(points: np.ndarray) -> TriangleMesh:
    """An open surface through a (rows, columns, 3) grid of points; seen from above the grid's normal points down."""
    rows, columns = points.shape[:2]
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    quads = np.stack([corner, corner + columns, corner + columns + 1, corner + 1], axis=1)
    return checked_mesh(points.reshape(-1, 3), np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]), "sheet")[0]


def cap(radius: float, width: float, rings: int = 300, spokes: int = 900) -> TriangleMesh:
    """The lowest part of a sphere whose centre is the origin, of facets far finer than any texel."""
    angle, turn = np.linspace(0, np.arcsin(width / radius), rings), np.linspace(0, 2 * np.pi, spokes + 1)
    angle[0] = 1e-9  # the pole's triangles would be degenerate; this hole is a picometre wide
    a, t = np.meshgrid(angle, turn, indexing="ij")
    points = radius * np.stack([np.sin(a) * np.cos(t), np.sin(a) * np.sin(t), -np.cos(a)], axis=-1)
    points[:, -1] = points[:, 0]
    return sheet(points[:, ::-1])


def trough(radius: float, width: float, length: float, facets: int = 4000) -> TriangleMesh:
    """The lowest part of a cylinder that lies along y, its axis through the origin."""
    angle = np.linspace(-np.arcsin(width / radius), np.arcsin(width / radius), facets)
    y, a = np.meshgrid([-length / 2, length / 2], angle, indexing="ij")
    return sheet(np.stack([radius * np.sin(a), y, -radius * np.cos(a)], axis=-1))


def punch(radius: float, height: float, sections: int = 1024) -> TriangleMesh:
    """A cylinder that stands on end around the origin; the polygon's area is the circle's."""
    angle = 2 * np.pi / sections
    return shape(trimesh.creation.cylinder(radius * np.sqrt(angle / np.sin(angle)), height, sections=sections))


def _arc(depth: np.ndarray, power: int) -> np.ndarray:
    """∫ s cosᵖθ dx over the section of a cylinder pressed in by `depth`: x = R sin θ, s = R cos θ - (R - depth)."""
    a = np.arccos(1 - depth / RADIUS)
    moments = {  # ∫ cosᵖθ dθ from -a to a
        2: a + np.sin(2 * a) / 2,
        3: 2 * (np.sin(a) - np.sin(a) ** 3 / 3),
        4: 3 * a / 4 + np.sin(2 * a) / 2 + np.sin(4 * a) / 16,
    }
    return RADIUS**2 * moments[power + 2] - RADIUS * (RADIUS - depth) * moments[power + 1]


def _bowl(depth: np.ndarray, power: int) -> np.ndarray:
    """∫ s cosᵖθ dA over a spherical cap: u = R cos θ from R - depth to R, dA = 2π u du."""
    low, n = RADIUS - depth, power + 2
    whole = (RADIUS ** (n + 1) - low ** (n + 1)) / (n + 1) - low * (RADIUS**n - low**n) / n
    return 2 * np.pi / RADIUS**power * whole


def _chord(depth: np.ndarray) -> np.ndarray:
    """Half the width of a round body at the height of the pad."""
    return np.sqrt(2 * RADIUS * depth - depth**2)


@dataclass(frozen=True)
class Pressing:
    """A body over a foundation of 1 N/m per square metre. What the closed forms say is a function of the depth, metres.

    Attributes
    ----------
    mesh : TriangleMesh
    low : float, metres
        How far its lowest point is below its origin; of the tilted flat, the middle of its lower face.
    turn : (4,) float
    normal : callable → N
        Sum of normal forces.
    upward : callable → N
        Force on the body along the pad's normal.
    area : callable → m²
    """

    mesh: TriangleMesh
    low: float
    turn: np.ndarray
    normal: Callable[[np.ndarray], np.ndarray]
    upward: Callable[[np.ndarray], np.ndarray]
    area: Callable[[np.ndarray], np.ndarray]


def _pressings() -> dict[str, Pressing]:
    level, lean = about((0, 1, 0), 0.0), about((0, 1, 0), np.degrees(ANGLE))
    widest, thick, disc = 1.05 * _chord(1.2 * DEPTH), 0.01, np.pi * 0.003**2

    def wet(depth):  # of the tilted flat, from where its lower face passes through the pad to the pad's edge
        return LENGTH / 2 + depth / np.tan(ANGLE)

    def wedge(depth):
        return LENGTH * np.sin(ANGLE) * wet(depth) ** 2 / 2

    return {
        "sphere": Pressing(
            cap(RADIUS, widest), RADIUS, level,
            lambda d: _bowl(d, 1), lambda d: _bowl(d, 2), lambda d: np.pi * _chord(d) ** 2,
        ),
        "flat cylinder": Pressing(
            punch(0.003, thick), thick / 2, level, lambda d: disc * d, lambda d: disc * d, lambda d: disc + 0 * d
        ),
        "lying cylinder": Pressing(
            trough(RADIUS, widest, 3 * LENGTH), RADIUS, level,
            lambda d: LENGTH * _arc(d, 1), lambda d: LENGTH * _arc(d, 2), lambda d: LENGTH * 2 * _chord(d),
        ),
        "tilted flat": Pressing(
            box(4 * LENGTH, 4 * LENGTH, thick), thick / 2 / np.cos(ANGLE), lean,
            wedge, lambda d: wedge(d) * np.cos(ANGLE), lambda d: LENGTH * wet(d),
        ),
    }  # fmt: skip


PRESSINGS = _pressings()
ORDERS = {"sphere": (2.5, 1.5), "flat cylinder": (1.5, 1.5), "lying cylinder": (2.0, 1.0), "tilted flat": (2.0, 1.0)}
"""Of force and of area; see above."""


@dataclass(frozen=True)
class Errors:
    """Root mean square of the relative errors over the places of the grid, by texels along the side, and their orders."""

    pitch: np.ndarray
    normal: np.ndarray
    upward: np.ndarray
    area: np.ndarray

    def order(self, errors: np.ndarray) -> float:
        """Exponent of the pitch, by least squares over all resolutions."""
        return float(np.polyfit(np.log(self.pitch), np.log(errors), 1)[0])


def convergence(name: str) -> Errors:
    """Press a body at many places and depths into ever finer pads, all of them at once."""
    body, rng = PRESSINGS[name], np.random.default_rng(7)
    depth = DEPTH * rng.uniform(0.8, 1.2, PLACES)
    places = np.column_stack([rng.uniform(-0.5, 0.5, (PLACES, 2)) * LENGTH / TEXELS[0], body.low - depth])
    if name == "tilted flat":
        places[:, :2] = 0.0
        depth -= DEPTH
        places[:, 2] += DEPTH
    scenario = pressed(body.mesh, places, turns=np.tile(body.turn, (PLACES, 1)), dt=1.0)
    smooth = SensorParameters(k=1.0, cn=0.0, mus=0.0, mud=0.0, sigma1=0.0, ct=0.0)
    sensors = tuple(Sensor(f"{n}", 0, pad(n, n, LENGTH / n), smooth) for n in TEXELS)
    recording, rows = run(replace(scenario, sensors=sensors)), []
    for n in TEXELS:
        sensor, cell = recording.sensors[f"{n}"], (LENGTH / n) ** 2
        ratios = (
            cell * sensor.normal_force.sum(axis=1) / body.normal(depth),
            -cell * sensor.net_force[:, 2] / body.upward(depth),
            cell * sensor.contact.sum(axis=1) / body.area(depth),
        )
        rows.append([LENGTH / n, *(np.sqrt(np.mean((ratio - 1.0) ** 2)) for ratio in ratios)])
    return Errors(*np.array(rows).T)
