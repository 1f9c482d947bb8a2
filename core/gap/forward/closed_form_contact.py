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


def shape_contact(
    center: np.ndarray, quaternion: np.ndarray, size: np.ndarray, position: np.ndarray, outward: np.ndarray, reach: float
) -> Contact:
    """Return the contact of texels with a sphere or a box.

    Parameters
    ----------
    center : (T, 3) float, metres
    quaternion : (T, 4) float
        Orientation of the shape, (w, x, y, z).
    size : (1,) or (3,) float, metres
        Radius of a sphere, or half of the edges of a box.
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
    shape = (len(center), *position.shape)
    contact = np.zeros(shape[:2]), np.broadcast_to(-outward, shape).copy(), np.broadcast_to(position, shape).copy()
    # Contiguous arrays, so that the kernel is compiled only once.
    arrays = (center, rotation_matrices(quaternion), size, position, outward)
    return *contact, int(meet(*(np.ascontiguousarray(one, dtype=float) for one in arrays), float(reach), contact))


@kernel
def meet(center, frame, size, position, outward, reach, contact):  # type: ignore[no-untyped-def]
    """Write where the segments of texels enter a shape; return the most texels whose segment begins inside it at once.

    Parameters
    ----------
    center : (T, 3) float, metres
    frame : (T, 3, 3) float
        Axes of the shape as columns.
    size : (1,) or (3,) float, metres
        Radius of a sphere, or half of the edges of a box.
    position, outward, reach
        As in :func:`shape_contact`.
    contact : tuple of (T, n), (T, n, 3) and (T, n, 3) float
        Depth, normal and point; written to.
    """
    depth, normal, point = contact
    is_ball, most, farthest = len(size) == 1, 0, size[0] + reach
    if not is_ball:
        farthest = np.sqrt(size[0] * size[0] + size[1] * size[1] + size[2] * size[2]) + reach
    for i in range(center.shape[0]):
        deep = 0
        for j in range(position.shape[0]):
            nx, ny, nz = outward[j, 0], outward[j, 1], outward[j, 2]
            ox = position[j, 0] - reach * nx - center[i, 0]
            oy = position[j, 1] - reach * ny - center[i, 1]
            oz = position[j, 2] - reach * nz - center[i, 2]
            if ox * ox + oy * oy + oz * oz > farthest * farthest:
                continue
            base, way, face = (ox, oy, oz), (nx, ny, nz), 0
            if is_ball:
                deep += is_in_sphere(base, size[0])
                enters = sphere_entry(base, way, size[0])
            else:  # into the box's frame, whose axes are columns
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
                deep += is_in_box(base, (size[0], size[1], size[2]))
                enters, face = box_entry(base, way, (size[0], size[1], size[2]))
            if not 0.0 <= enters < reach:
                continue
            if is_ball:
                ax, ay, az = (ox + enters * nx) / size[0], (oy + enters * ny) / size[0], (oz + enters * nz) / size[0]
            else:
                sign = -1.0 if way[face] > 0.0 else 1.0
                ax, ay, az = sign * frame[i, 0, face], sign * frame[i, 1, face], sign * frame[i, 2, face]
            left = reach - enters
            depth[i, j] = left * abs(ax * nx + ay * ny + az * nz)
            normal[i, j, 0], normal[i, j, 1], normal[i, j, 2] = ax, ay, az
            for axis in range(3):
                point[i, j, axis] = position[j, axis] - left * outward[j, axis]
        most = max(most, deep)
    return most
