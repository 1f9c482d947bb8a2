# SPDX-License-Identifier: GPL-3.0-or-later
"""A finger as a rounded tube along a smooth spine. Lengths are millimetres."""

from __future__ import annotations

import math

import numpy as np

from .scene_builder import finger_faces

SIDES, STEP = 28, 2.0  # texels around a finger; mm between rings of texels


class Tube:
    """A tube along a curve through joints, with a round tip.

    Parameters
    ----------
    spine : (m, 4) float, mm
        Points and radii from the root to the centre of the tip's round end.
    inwards : (3,) float
        Direction that the tip's inner side faces.
    """

    def __init__(self, spine: np.ndarray, inwards):
        self.points, self.radii, self.along = _smooth(spine)
        self.frames = _frames(self.points, np.asarray(inwards, float))

    def mesh(self, pad_length: float, length: float) -> tuple[np.ndarray, list, np.ndarray]:
        """Return vertices, faces, and the vertices of the tip's inner side.

        Parameters
        ----------
        pad_length : float, mm
            Of the tip that counts as inner side.
        length : float, mm
            Of the tube up to the tip's centre; what is nearer to the root is left out.
        """
        kept = self.along >= self.along[-1] - length
        points, radii, along = self.points[kept], self.radii[kept], self.along[kept]
        frames = self.frames[-len(points) :]
        # Past the spine's end the radius falls like a circle's, so the tip is round.
        tip, heading = radii[-1], frames[-1][0]
        cap = np.arange(1, 6) / 6 * math.pi / 2
        centres = np.vstack([points, points[-1] + tip * np.sin(cap)[:, None] * heading])
        sizes = np.concatenate([radii, tip * np.cos(cap)])
        turns = [*frames, *[frames[-1]] * len(cap)]
        angle = np.arange(SIDES) * 2 * math.pi / SIDES
        rings = [
            centre + size * (np.cos(angle)[:, None] * inner + np.sin(angle)[:, None] * np.cross(ahead, inner))
            for centre, size, (ahead, inner) in zip(centres, sizes, turns, strict=True)
        ]
        vertices = np.vstack([*rings, centres[-1] + heading * (tip - tip * math.sin(cap[-1]))])
        feels = np.flatnonzero(np.concatenate([along, np.full(len(cap) - 2, along[-1])]) > along[-1] - pad_length)
        near = np.flatnonzero(np.cos(angle) > math.cos(math.radians(80)))
        return vertices, finger_faces(len(rings), SIDES), (feels[:, None] * SIDES + near).ravel()

    def bones(self, cut: float) -> np.ndarray:
        """Return points and radii from the root up to a length in mm before the tip's centre, (n, 4)."""
        return np.column_stack([self.points, self.radii])[self.along <= self.along[-1] - cut]

    def section(self, place: float) -> tuple[np.ndarray, float, np.ndarray, np.ndarray]:
        """Return centre, radius, heading and inner direction at a length in mm past the tip's centre, before it if negative."""
        heading, inner = self.frames[-1]
        if place >= 0.0:
            return self.points[-1] + place * heading, float(self.radii[-1]), heading, inner
        wanted = self.along[-1] + place
        number = int(np.searchsorted(self.along, wanted))
        centre = np.array([np.interp(wanted, self.along, column) for column in self.points.T])
        return centre, float(np.interp(wanted, self.along, self.radii)), *self.frames[number]


def _smooth(spine: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points, radii and arc lengths every `STEP` mm along a curve through the joints."""
    from scipy.interpolate import CubicSpline

    chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(spine[:, :3], axis=0), axis=1))])
    curve = CubicSpline(chord, spine)
    fine = curve(np.linspace(0.0, chord[-1], 400))
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(fine[:, :3], axis=0), axis=1))])
    wanted = np.linspace(0.0, length[-1], round(length[-1] / STEP) + 1)
    found = np.stack([np.interp(wanted, length, fine[:, i]) for i in range(4)], axis=1)
    return found[:, :3], found[:, 3], wanted


def _frames(points: np.ndarray, inwards: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return tangent and inner direction at each point; the latter is transported from the tip to the root without twist."""
    ahead = np.gradient(points, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    frames, inner = [], inwards
    for heading in ahead[::-1]:
        inner = inner - (inner @ heading) * heading
        inner = inner / np.linalg.norm(inner)
        frames.append((heading, inner))
    return frames[::-1]
