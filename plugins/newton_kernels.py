# SPDX-License-Identifier: GPL-3.0-or-later
"""Warp kernels between a state of Newton and a Palpate sensor: poses there, wrenches back."""

from typing import Any

import warp as wp


@wp.func
def _frame(shape: int, shape_body: wp.array(dtype=int), shape_transform: wp.array(dtype=wp.transform),
           body_q: wp.array(dtype=wp.transform)):  # fmt: skip
    """Where a shape is in the world."""
    body = shape_body[shape]
    if body >= 0:
        return wp.transform_multiply(body_q[body], shape_transform[shape])
    return shape_transform[shape]


@wp.kernel(enable_backward=False)
def write_poses(
    shapes: wp.array2d(dtype=int),
    shape_body: wp.array(dtype=int),
    shape_transform: wp.array(dtype=wp.transform),
    body_q: wp.array(dtype=wp.transform),
    poses: wp.array3d(dtype=Any),
):
    """Write where the sensor and its targets are, the quaternion as (w, x, y, z)."""
    row, column = wp.tid()
    frame = _frame(shapes[row, column], shape_body, shape_transform, body_q)
    p, q = wp.transform_get_translation(frame), wp.transform_get_rotation(frame)
    for i in range(3):
        poses[row, column, i] = poses.dtype(p[i])
        poses[row, column, 4 + i] = poses.dtype(q[i])
    poses[row, column, 3] = poses.dtype(q[3])


@wp.kernel(enable_backward=False)
def add_wrenches(
    shapes: wp.array2d(dtype=int),
    shape_body: wp.array(dtype=int),
    body_com: wp.array(dtype=wp.vec3),
    body_q: wp.array(dtype=wp.transform),
    poses: wp.array3d(dtype=Any),
    wrench: wp.array3d(dtype=Any),
    body_f: wp.array(dtype=wp.spatial_vector),
):
    """Add the wrench on each target to its body, about the body's centre of mass, and the opposite to the sensor's."""
    row, column = wp.tid()
    w = wrench[row, column]
    force = wp.vec3(float(w[0]), float(w[1]), float(w[2]))
    torque = wp.vec3(float(w[3]), float(w[4]), float(w[5]))
    p = poses[row, 1 + column]
    origin = wp.vec3(float(p[0]), float(p[1]), float(p[2]))
    for side in range(2):
        sign = 1.0 if side == 0 else -1.0
        body = shape_body[shapes[row, (1 + column) * (1 - side)]]
        if body >= 0:
            arm = origin - wp.transform_point(body_q[body], body_com[body])
            wp.atomic_add(body_f, body, wp.spatial_vector(sign * force, sign * (torque + wp.cross(arm, force))))
