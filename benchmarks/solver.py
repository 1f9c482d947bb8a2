# SPDX-License-Identifier: GPL-3.0-or-later
"""The solver against MuJoCo's `tactile` sensor: same object, same number of texels, one thread, in turn in one process."""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import trimesh

from palpate.core.mesh import TriangleMesh, checked_mesh, mass_properties
from palpate.core.scenario import Body, Motion, Scenario, Sensor, SensorParameters, Target
from palpate.core.solve import Simulation
from palpate.core.texels import texels_from_region

SIDE = 0.047
"""Longer side of the pad, metres."""
CUBE = 0.06
GRIDS = {84: (14, 6), 1024: (32, 32), 10000: (100, 100)}
ROUNDS = 7


def cube(subdivisions: int) -> trimesh.Trimesh:
    """Return a cube of 12 · 4ⁿ faces."""
    solid = trimesh.creation.box((CUBE, CUBE, CUBE))
    for _ in range(subdivisions):
        solid = solid.subdivide()
    return solid


def pad(rows: int, columns: int) -> TriangleMesh:
    """Return a flat sheet of rows × columns vertices."""
    pitch = SIDE / (max(rows, columns) - 1)
    y, x = np.mgrid[0:rows, 0:columns] * pitch
    vertices = np.stack([x - x.mean(), y - y.mean(), np.zeros_like(x)], axis=-1).reshape(-1, 3)
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    quads = np.stack([corner, corner + 1, corner + columns + 1, corner + columns], axis=1)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return checked_mesh(vertices, triangles, "pad", quads)[0]


def weighing(texels: int, solid: trimesh.Trimesh, dt: float = 1e-3) -> Scenario:
    """1 kg on the pad; stiffness shared out so that every resolution sinks alike."""
    sheet = pad(*GRIDS[texels])
    mesh, _ = checked_mesh(solid.vertices, solid.faces, "cube")
    center, inertia, _ = mass_properties(mesh, 1.0, "cube")
    parameters = SensorParameters(k=84e3 / texels, cn=840.0 / texels)
    start = Motion.at_rest((0, 0, CUBE / 2))
    return Scenario(
        bodies=(Body("pad", Motion.at_rest()), Body("cube", start, True, 1.0, center, inertia)),
        sensors=(Sensor("pad", 0, texels_from_region(sheet, np.ones(len(sheet.vertices), bool)), parameters),),
        targets=(Target("cube", 1, mesh),),
        frame_end=10**6,
        fps=1.0,
        dt=dt,
    )


def palpate_step(texels: int, solid: trimesh.Trimesh) -> Callable[[], float]:
    """Return a function that gives the microseconds of one substep in full contact."""
    simulation = Simulation(weighing(texels, solid))
    for _ in range(10):
        frame = simulation.advance()
    if not frame.sensors["pad"].contact.all():
        raise RuntimeError("the pad is not fully covered: this would not be the same work")

    def measure() -> float:
        start = time.perf_counter()
        simulation.advance()
        return (time.perf_counter() - start) / simulation.substeps * 1e6

    return measure


def mujoco_step(texels: int, solid: trimesh.Trimesh) -> Callable[[], float]:
    """Return the same for MuJoCo with its tactile sensor at its usual step of 1 ms."""
    import mujoco

    rows, columns = GRIDS[texels]
    pitch = SIDE / (max(rows, columns) - 1)
    half_x, half_y = (columns - 1) * pitch / 2, (rows - 1) * pitch / 2
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cube.obj"
        solid.export(path)
        model = mujoco.MjModel.from_xml_string(
            f"""<mujoco><option timestep="0.001" gravity="0 0 -9.81"/>
            <asset><mesh name="pad" builtin="plate" params="{columns} {rows}" scale="{half_x} {half_y} 0.001"/>
            <mesh name="cube" file="{path}"/></asset>
            <worldbody><body><geom name="pad" type="mesh" mesh="pad" quat="0 1 0 0" contype="0" conaffinity="0"/>
            <geom type="box" size="{half_x} {half_y} 0.005" pos="0 0 -0.005"/></body>
            <body pos="0 0 {CUBE / 2}"><freejoint/><geom type="mesh" mesh="cube" mass="1"/>
            <geom type="sdf" mesh="cube" contype="0" conaffinity="0" mass="0"/></body></worldbody>
            <sensor><tactile geom="pad" mesh="pad"/></sensor></mujoco>"""
        )
    data = mujoco.MjData(model)
    if model.nsensordata != 3 * texels:
        raise RuntimeError(f"MuJoCo has {model.nsensordata // 3} texels instead of {texels}")
    mujoco.mj_step(model, data, 1000)

    def measure() -> float:
        start = time.perf_counter()
        mujoco.mj_step(model, data, 100)
        return (time.perf_counter() - start) / 100 * 1e6

    return measure


def in_turn(*measures: Callable[[], float]) -> list[float]:
    """Median of several rounds in which each is measured once."""
    rounds = [[measure() for measure in measures] for _ in range(ROUNDS)]
    return [statistics.median(values) for values in zip(*rounds, strict=True)]


def run() -> Iterator[dict]:
    """Time per step by number of texels, and by number of faces."""
    import mujoco

    solid = cube(4)
    for texels in GRIDS:
        ours, theirs = in_turn(palpate_step(texels, solid), mujoco_step(texels, solid))
        yield {
            "name": f"solver.step.cube.{texels}", "value": ours, "unit": "us",
            "peer": f"mujoco-{mujoco.__version__} tactile", "peer_value": theirs, "ratio": ours / theirs, "goal": 0.6,
        }  # fmt: skip
    few, many = in_turn(palpate_step(84, cube(4)), palpate_step(84, cube(8)))
    yield {
        "name": "solver.step.faces.786k", "value": many, "unit": "us",
        "peer": "palpate with 3k faces", "peer_value": few, "ratio": many / few, "goal": 1.5,
    }  # fmt: skip
