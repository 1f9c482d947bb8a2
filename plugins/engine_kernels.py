# SPDX-License-Identifier: GPL-3.0-or-later
"""Warp kernels between the data of engines and a Palpate sensor: poses there, wrenches back."""

from typing import Any

import warp as wp


@wp.func
def _write_pose(position: wp.vec3, rotation: wp.quat, pose: wp.array(dtype=Any)):
    """Write a position and a rotation, the quaternion as (w, x, y, z)."""
    for i in range(3):
        pose[i] = pose.dtype(position[i])
        pose[4 + i] = pose.dtype(rotation[i])
    pose[3] = pose.dtype(rotation[3])


@wp.func
def _about(centre: wp.vec3, wrench: wp.array(dtype=Any), pose: wp.array(dtype=Any)) -> wp.spatial_vector:
    """Return a wrench about a point, given that about the origin of a pose."""
    force = wp.vec3(float(wrench[0]), float(wrench[1]), float(wrench[2]))
    torque = wp.vec3(float(wrench[3]), float(wrench[4]), float(wrench[5]))
    origin = wp.vec3(float(pose[0]), float(pose[1]), float(pose[2]))
    return wp.spatial_vector(force, torque + wp.cross(origin - centre, force))


@wp.kernel(enable_backward=False)
def write_mujoco_poses(
    body: int,
    geoms: wp.array(dtype=int),
    xpos: wp.array2d(dtype=wp.vec3),
    xquat: wp.array2d(dtype=wp.quat),
    geom_xpos: wp.array2d(dtype=wp.vec3),
    geom_xmat: wp.array2d(dtype=wp.mat33),
    poses: wp.array3d(dtype=Any),
):
    """Write where a sensor's body and its targets are in MuJoCo Warp, whose quaternions are (w, x, y, z)."""
    world, column = wp.tid()
    if column == 0:
        q = xquat[world, body]
        _write_pose(xpos[world, body], wp.quat(q[1], q[2], q[3], q[0]), poses[world, 0])
        return
    geom = geoms[column - 1]
    _write_pose(geom_xpos[world, geom], wp.quat_from_matrix(geom_xmat[world, geom]), poses[world, column])


@wp.kernel(enable_backward=False)
def write_mujoco_wrenches(
    body: int,
    bodies: wp.array(dtype=int),
    xipos: wp.array2d(dtype=wp.vec3),
    poses: wp.array3d(dtype=Any),
    wrench: wp.array3d(dtype=Any),
    xfrc_applied: wp.array2d(dtype=wp.spatial_vector),
):
    """Write the wrench on each target's body, about its centre of mass, and the opposite on the sensor's."""
    world = wp.tid()
    xfrc_applied[world, body] = wp.spatial_vector()
    for column in range(bodies.shape[0]):
        xfrc_applied[world, bodies[column]] = wp.spatial_vector()
    for column in range(bodies.shape[0]):
        w, p, target = wrench[world, column], poses[world, 1 + column], bodies[column]
        xfrc_applied[world, target] = xfrc_applied[world, target] + _about(xipos[world, target], w, p)
        xfrc_applied[world, body] = xfrc_applied[world, body] - _about(xipos[world, body], w, p)


@wp.func
def _frame(shape: int, shape_body: wp.array(dtype=int), shape_transform: wp.array(dtype=wp.transform),
           body_q: wp.array(dtype=wp.transform)):  # fmt: skip
    """Return where a shape of Newton is in the world."""
    body = shape_body[shape]
    if body >= 0:
        return wp.transform_multiply(body_q[body], shape_transform[shape])
    return shape_transform[shape]


@wp.kernel(enable_backward=False)
def write_newton_poses(
    shapes: wp.array2d(dtype=int),
    shape_body: wp.array(dtype=int),
    shape_transform: wp.array(dtype=wp.transform),
    body_q: wp.array(dtype=wp.transform),
    poses: wp.array3d(dtype=Any),
):
    """Write where a sensor's shape and its targets are in Newton."""
    row, column = wp.tid()
    frame = _frame(shapes[row, column], shape_body, shape_transform, body_q)
    _write_pose(wp.transform_get_translation(frame), wp.transform_get_rotation(frame), poses[row, column])


@wp.kernel(enable_backward=False)
def add_newton_wrenches(
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
    for side in range(2):
        body = shape_body[shapes[row, (1 + column) * (1 - side)]]
        if body >= 0:
            centre = wp.transform_point(body_q[body], body_com[body])
            sign = 1.0 if side == 0 else -1.0
            wp.atomic_add(body_f, body, sign * _about(centre, wrench[row, column], poses[row, 1 + column]))
