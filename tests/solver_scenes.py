# SPDX-License-Identifier: GPL-3.0-or-later
"""Small scenarios that several tests press, tilt and shake."""

from dataclasses import replace

import numpy as np
import trimesh

from palpate.core.geometry.mesh import TriangleMesh, checked_mesh, mass_properties
from palpate.core.geometry.rotations import rotation_matrices
from palpate.core.geometry.texels import Texels, texels_from_region
from palpate.core.model.body import Body, Drive, Motion, Signal
from palpate.core.model.scenario import Scenario, Target
from palpate.core.model.sensor import Sensor
from palpate.core.model.sensor_parameters import SensorParameters

GRAVITY = 9.81
LEVEL = (1.0, 0.0, 0.0, 0.0)


def grid_mesh(rows: int = 14, columns: int = 6, pitch: float | tuple[float, float] = 0.0034) -> TriangleMesh:
    """A flat sheet in z = 0, centred, rows along +y, columns along +x, normals +z; a pitch or one of x and one of y."""
    x_pitch, y_pitch = np.broadcast_to(pitch, 2)
    y, x = np.mgrid[0:rows, 0:columns]
    x, y = x * x_pitch, y * y_pitch
    vertices = np.stack([x - x.mean(), y - y.mean(), np.zeros_like(x)], axis=-1).reshape(-1, 3)
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    quads = np.stack([corner, corner + 1, corner + columns + 1, corner + columns], axis=1)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return checked_mesh(vertices, triangles, "pad", quads)[0]


def pad(rows: int = 14, columns: int = 6, pitch: float | tuple[float, float] = 0.0034) -> Texels:
    """The texels of :func:`grid_mesh`."""
    mesh = grid_mesh(rows, columns, pitch)
    return texels_from_region(mesh, np.ones(len(mesh.vertices), bool), "pad")


def shape(solid: trimesh.Trimesh, name: str = "object") -> TriangleMesh:
    """A trimesh solid as a mesh of ours."""
    return checked_mesh(solid.vertices, solid.faces, name)[0]


def box(*size: float) -> TriangleMesh:
    """A box of the given full sizes around the origin."""
    return shape(trimesh.creation.box(size), "box")


def about(axis, degrees: float) -> np.ndarray:
    """Quaternion of a turn about an axis."""
    half = np.radians(degrees) / 2
    return np.concatenate([[np.cos(half)], np.sin(half) * np.asarray(axis, float) / np.linalg.norm(axis)])


def free_body(name, mesh, mass, position, quaternion=LEVEL, **start) -> Body:
    """A free body whose mass is spread through its mesh."""
    center, inertia, _ = mass_properties(mesh, mass, name)
    return Body(name, Motion.at_rest(position, quaternion), True, mass, center, inertia, **start)


def cube_on_pad(mass=1.0, tilt=0.0, texels=None, size=0.05, frames=48, dt=1e-4, fps=24.0, gap=1e-4, **parameters) -> Scenario:
    """The paper's section 5.1: a cube on a pad (k 1000, cn 10 unless told) that may be tilted about x, so along its rows."""
    texels = pad() if texels is None else texels
    values = {"k": 1000.0, "cn": 10.0, **parameters}
    turn = about((1, 0, 0), tilt)
    mesh = box(size, size, size)
    above = rotation_matrices(turn) @ np.array([0.0, 0.0, size / 2 + gap])
    return Scenario(
        bodies=(Body("pad", Motion.at_rest(quaternion=turn)), free_body("cube", mesh, mass, above, turn)),
        sensors=(Sensor("pad", 0, texels, SensorParameters(**values)),),
        targets=(Target("cube", 1, mesh),),
        frame_end=frames,
        fps=fps,
        gravity=np.array([0.0, 0.0, -GRAVITY]),
        dt=dt,
    )


def pressed(mesh, path, texels=None, times=None, fps=24.0, dt=1e-3, turns=None, **parameters) -> Scenario:
    """A keyframed object that follows `path` (m, 3), one sample per frame, over a pad that stays where it is."""
    path = np.asarray(path, float)
    turns = np.tile(LEVEL, (len(path), 1)) if turns is None else np.asarray(turns, float)
    times = np.arange(len(path)) / fps if times is None else times
    return Scenario(
        bodies=(Body("pad", Motion.at_rest()), Body("probe", Motion(times, path, turns))),
        sensors=(Sensor("pad", 0, pad() if texels is None else texels, SensorParameters(**parameters)),),
        targets=(Target("probe", 1, mesh),),
        frame_end=len(path),
        fps=fps,
        dt=dt,
    )


def smooth_path(*knots: tuple[float, float], fps: float, end: float) -> np.ndarray:
    """Heights, one per frame from 0 to `end` seconds, that go from knot (time, height) to knot with rest at both."""
    times = np.arange(round(end * fps) + 1) / fps
    heights = np.full(len(times), knots[0][1], dtype=float)
    for (t0, h0), (t1, h1) in zip(knots, knots[1:], strict=False):
        share = np.clip((times - t0) / (t1 - t0), 0, 1)
        heights = np.where(times >= t0, h0 + (h1 - h0) * (3 * share**2 - 2 * share**3), heights)
    return heights


def gripper(solid, mass, force, heights, fps=24.0, dt=5e-4, opening=0.06, coupled=True, height=None, **parameters) -> Scenario:
    """Two fingers with 14 × 6 pads, on a carrier that follows `heights`, close along x on an object that stands on a table.

    `force` is the wanted tactile sum of the left finger, newtons: a number, or one for each frame.
    """
    values = {"k": 1000.0, "cn": 10.0, "sigma0": 2e3, "sigma1": 20.0, "mus": 0.6, "mud": 0.5, **parameters}
    tall = float(np.ptp(solid.vertices[:, 2])) if height is None else height
    times = np.arange(len(heights)) / fps
    force = np.broadcast_to(np.asarray(force, float), len(heights))
    finger = Sensor("left", 0, pad(), SensorParameters(**values))
    closing = Drive("force", Signal(times, force), sensor=0, max_speed=0.05, max_force=200.0)
    bodies = []
    for name, side in (("left", -1.0), ("right", 1.0)):
        path = np.stack([np.full(len(times), side * opening / 2), np.zeros(len(times)), heights], axis=1)
        turn = np.tile(about((0, 1, 0), -90.0 * side), (len(times), 1))
        bodies.append(Body(name, Motion(times, path, turn), mass=0.1, drive=closing))
    if coupled:
        bodies[1] = replace(bodies[1], drive=Drive(leader=0))
    else:
        bodies[1] = replace(bodies[1], drive=replace(closing, sensor=1))
    table = Sensor("table", 3, pad(16, 16, 0.004), SensorParameters(**values), readout=False)
    sunk = mass * GRAVITY / values["k"] / 144  # texels of the table under a box of 50 mm
    return Scenario(
        bodies=(*bodies, free_body("object", solid, mass, (0, 0, tall / 2 - sunk)), Body("table", Motion.at_rest())),
        sensors=(finger, replace(finger, name="right", body=1), table),
        targets=(Target("object", 2, solid),),
        frame_end=len(heights),
        fps=fps,
        gravity=np.array([0.0, 0.0, -GRAVITY]),
        dt=dt,
    )
