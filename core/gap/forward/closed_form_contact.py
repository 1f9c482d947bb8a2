# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact of texels with a sphere and with a box in closed form (paper, Eq. 4: intersection of a segment with a surface).

A segment leads from behind each texel along its normal to the texel. Where it enters the indenter, the texel is pressed.
"""

from __future__ import annotations

import numpy as np

from ...compiled.kernels import kernel
from ...geometry.rotations import rotation_matrices
from ...geometry.shapes import box_entry, is_in_box, is_in_sphere, sphere_entry

Contact = tuple[np.ndarray, np.ndarray, np.ndarray, int]


def sphere_contact(center: np.ndarray, radius: float, position: np.ndarray, outward: np.ndarray, reach: float) -> Contact:
    """Return the contact of texels with a sphere.

    Parameters
    ----------
    center : (T, 3) float, metres
    radius : float, metres
    position, outward : (n, 3) float
        Texels and their unit normals.
    reach : float, metres
        Length of the segment behind each texel: the maximum penetration.

    Returns
    -------
    depth : (T, n) float, metres
    normal : (T, n, 3) float
        The indenter's outward normal where the segment enters it; minus the texel's normal without contact.
    point : (T, n, 3) float, metres
        Where the segment enters the indenter; the texel without contact.
    overpressed : int
        Most texels at once whose segment begins inside the indenter.
    """
    depth, normal, point = _untouched(len(center), position, outward)
    most = meet_sphere(
        np.ascontiguousarray(center), float(radius), *_plain(position, outward), float(reach), depth, normal, point
    )
    return depth, normal, point, int(most)


def box_contact(
    center: np.ndarray, quaternion: np.ndarray, edges: np.ndarray, position: np.ndarray, outward: np.ndarray, reach: float
) -> Contact:
    """Return the contact of texels with a box: intersection of a segment with three pairs of planes.

    Parameters
    ----------
    center : (T, 3) float, metres
    quaternion : (T, 4) float
        Orientation of the box, (w, x, y, z).
    edges : (3,) float, metres
        Full sizes of the box.
    position, outward, reach
        As in :func:`sphere_contact`, like the returns.
    """
    depth, normal, point = _untouched(len(center), position, outward)
    frame = np.ascontiguousarray(rotation_matrices(quaternion))  # box → sensor
    texels, center, half = _plain(position, outward), np.ascontiguousarray(center, dtype=float), 0.5 * np.asarray(edges, float)
    return depth, normal, point, int(meet_box(center, frame, half, *texels, float(reach), depth, normal, point))


def _untouched(samples: int, position: np.ndarray, outward: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Depth, normal and point without contact."""
    shape = (samples, *position.shape)
    return np.zeros(shape[:2]), np.broadcast_to(-outward, shape).copy(), np.broadcast_to(position, shape).copy()


def _plain(position: np.ndarray, outward: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Contiguous arrays, so that the kernels are compiled only once."""
    return np.ascontiguousarray(position, dtype=float), np.ascontiguousarray(outward, dtype=float)


@kernel
def write_contact(i, j, left, entered, position, outward, contact):  # type: ignore[no-untyped-def]
    """Write where the segment of texel `j` enters the indenter in sample `i`, with so much of its length left.

    `entered` is the indenter's outward normal there, `contact` are depth, normal and point.
    """
    depth, normal, point = contact
    along = 0.0
    for axis in range(3):
        along += entered[axis] * outward[j, axis]
        normal[i, j, axis] = entered[axis]
        point[i, j, axis] = position[j, axis] - left * outward[j, axis]
    depth[i, j] = left * abs(along)


@kernel
def meet_sphere(center, radius, position, outward, reach, depth, normal, point):  # type: ignore[no-untyped-def]
    """Write the contacts with a sphere into `depth`, `normal` and `point`; return the most texels overpressed at once."""
    most = 0
    for i in range(center.shape[0]):
        deep = 0
        for j in range(position.shape[0]):
            nx, ny, nz = outward[j, 0], outward[j, 1], outward[j, 2]
            ox = position[j, 0] - reach * nx - center[i, 0]
            oy = position[j, 1] - reach * ny - center[i, 1]
            oz = position[j, 2] - reach * nz - center[i, 2]
            if is_in_sphere((ox, oy, oz), radius):
                deep += 1
            s = sphere_entry((ox, oy, oz), (nx, ny, nz), radius)
            if s < 0.0 or s >= reach:
                continue
            ax, ay, az = (ox + s * nx) / radius, (oy + s * ny) / radius, (oz + s * nz) / radius
            write_contact(i, j, reach - s, (ax, ay, az), position, outward, (depth, normal, point))
        most = max(most, deep)
    return most


@kernel
def meet_box(center, frame, half, position, outward, reach, depth, normal, point):  # type: ignore[no-untyped-def]
    """Write the contacts with a box of these half edges into `depth`, `normal` and `point`; return as :func:`meet_sphere`."""
    most, farthest = 0, np.sqrt(half[0] ** 2 + half[1] ** 2 + half[2] ** 2) + reach
    for i in range(center.shape[0]):
        deep = 0
        for j in range(position.shape[0]):
            nx, ny, nz = outward[j, 0], outward[j, 1], outward[j, 2]
            ox = position[j, 0] - reach * nx - center[i, 0]
            oy = position[j, 1] - reach * ny - center[i, 1]
            oz = position[j, 2] - reach * nz - center[i, 2]
            if ox * ox + oy * oy + oz * oz > farthest * farthest:
                continue
            # Into the box's frame, whose axes are columns.
            base = (
                ox * frame[i, 0, 0] + oy * frame[i, 1, 0] + oz * frame[i, 2, 0],
                ox * frame[i, 0, 1] + oy * frame[i, 1, 1] + oz * frame[i, 2, 1],
                ox * frame[i, 0, 2] + oy * frame[i, 1, 2] + oz * frame[i, 2, 2],
            )
            way = (
                nx * frame[i, 0, 0] + ny * frame[i, 1, 0] + nz * frame[i, 2, 0],
                nx * frame[i, 0, 1] + ny * frame[i, 1, 1] + nz * frame[i, 2, 1],
                nx * frame[i, 0, 2] + ny * frame[i, 1, 2] + nz * frame[i, 2, 2],
            )
            if is_in_box(base, (half[0], half[1], half[2])):
                deep += 1
            enters, face = box_entry(base, way, (half[0], half[1], half[2]))
            if not 0.0 <= enters < reach:
                continue
            sign = -1.0 if way[face] > 0.0 else 1.0
            ax, ay, az = sign * frame[i, 0, face], sign * frame[i, 1, face], sign * frame[i, 2, face]
            write_contact(i, j, reach - enters, (ax, ay, az), position, outward, (depth, normal, point))
        most = max(most, deep)
    return most
