# SPDX-License-Identifier: GPL-3.0-or-later
"""Warp kernels between data of MuJoCo Warp and a Palpate sensor: poses there, wrenches back."""

from typing import Any

import warp as wp


@wp.func
def _write_pose(position: wp.vec3, quaternion: wp.quat, pose: wp.array(dtype=Any)):
    """Write a position and a quaternion in MuJoCo's order, (w, x, y, z), which is also ours."""
    for i in range(3):
        pose[i] = pose.dtype(position[i])
    for i in range(4):
        pose[3 + i] = pose.dtype(quaternion[i])


@wp.kernel(enable_backward=False)
def write_poses(
    body: int,
    geoms: wp.array(dtype=int),
    xpos: wp.array2d(dtype=wp.vec3),
    xquat: wp.array2d(dtype=wp.quat),
    geom_xpos: wp.array2d(dtype=wp.vec3),
    geom_xmat: wp.array2d(dtype=wp.mat33),
    poses: wp.array3d(dtype=Any),
):
    """Write where the sensor and its targets are."""
    world, column = wp.tid()
    if column == 0:
        _write_pose(xpos[world, body], xquat[world, body], poses[world, 0])
        return
    geom = geoms[column - 1]
    matrix = wp.quat_from_matrix(geom_xmat[world, geom])
    _write_pose(geom_xpos[world, geom], wp.quat(matrix[3], matrix[0], matrix[1], matrix[2]), poses[world, column])


@wp.kernel(enable_backward=False)
def write_wrenches(
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
        force, torque = wp.vec3(float(w[0]), float(w[1]), float(w[2])), wp.vec3(float(w[3]), float(w[4]), float(w[5]))
        origin = wp.vec3(float(p[0]), float(p[1]), float(p[2]))
        on_target = torque + wp.cross(origin - xipos[world, target], force)
        on_sensor = torque + wp.cross(origin - xipos[world, body], force)
        xfrc_applied[world, target] = xfrc_applied[world, target] + wp.spatial_vector(force, on_target)
        xfrc_applied[world, body] = xfrc_applied[world, body] - wp.spatial_vector(force, on_sensor)
