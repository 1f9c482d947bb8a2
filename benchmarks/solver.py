# SPDX-License-Identifier: GPL-3.0-or-later
"""The solver against MuJoCo's `tactile` sensor: same object, same number of texels, in turn in one process.

Static accuracy is that of a cube of 1 kg that has been put on the pad, level and on a slope of 10°: the larger of the relative
errors of the normal and the shear force on the pad, the worst of the last half of two seconds. MuJoCo's is that of its contact
forces, since its tactile sensor reports depths. Our step is the longest of some that is at least as exact as MuJoCo at 1 ms.
"""

from __future__ import annotations

import math
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import trimesh
from solver_scenes import GRAVITY, free_body, grid_mesh

from palpate.core.geometry.mesh import TriangleMesh, checked_mesh
from palpate.core.geometry.texels import texels_from_region
from palpate.core.model.body import Body, Motion
from palpate.core.model.scenario import Scenario, Target
from palpate.core.model.sensor import Sensor
from palpate.core.model.sensor_parameters import SensorParameters
from palpate.core.solver.simulation import Simulation

from . import beside

SIDE = 0.047
"""Longer side of the pad, metres."""
CUBE, BALL = 0.06, 0.02
"""Edge of the cube and radius of the ball, metres."""
GRIDS = {84: (14, 6), 1024: (32, 32), 10000: (100, 100)}
ROUNDS = 7
SLOPE = 10.0
"""Degrees."""
STEPS = (1e-2, 5e-3, 2e-3, 1e-3)
"""Among which ours is chosen, s."""
SECONDS, RATE = 2, 25
"""How long a cube is watched, and how many readings are taken in a second."""


def cube(subdivisions: int) -> trimesh.Trimesh:
    """Return a cube of 12 · 4ⁿ faces."""
    solid = trimesh.creation.box((CUBE, CUBE, CUBE))
    for _ in range(subdivisions):
        solid = solid.subdivide()
    return solid


def pad(rows: int, columns: int) -> TriangleMesh:
    """Return a flat sheet of rows × columns vertices whose longer side is SIDE."""
    return grid_mesh(rows, columns, SIDE / (max(rows, columns) - 1))


def sensor_of(texels: int, k: float | None = None) -> tuple[Sensor, TriangleMesh]:
    """Return a pad as a sensor, and its mesh; stiffness is shared out so that every resolution sinks alike, or given."""
    sheet = pad(*GRIDS[texels])
    shared = 84e3 / texels
    friction = {"sigma0": shared, "sigma1": 0.01 * shared} if k is None else {}
    stiff = shared if k is None else k
    parameters = SensorParameters(k=stiff, cn=0.01 * stiff, **friction)
    return Sensor("pad", 0, texels_from_region(sheet, np.ones(len(sheet.vertices), bool)), parameters), sheet


def gravity(slope: float) -> np.ndarray:
    """Return the gravity that a pad feels which is tilted by `slope` degrees, so that things slide towards -y."""
    return -GRAVITY * np.array([0.0, math.sin(math.radians(slope)), math.cos(math.radians(slope))])


def weighing(
    texels: int, solid: trimesh.Trimesh, dt: float | None = 1e-3, fps: float = 1.0, slope: float = 0.0, gap: float = 0.0
) -> Scenario:
    """1 kg on the pad."""
    mesh, _ = checked_mesh(solid.vertices, solid.faces, "cube")
    return Scenario(
        bodies=(Body("pad", Motion.at_rest()), free_body("cube", mesh, 1.0, (0, 0, CUBE / 2 + gap))),
        sensors=(sensor_of(texels)[0],),
        targets=(Target("cube", 1, mesh),),
        frame_end=10**6,
        fps=fps,
        gravity=gravity(slope),
        dt=dt,
    )


def palpate_step(
    texels: int, solid: trimesh.Trimesh, threads: int = 1, clock: Callable[[], float] = time.thread_time
) -> Callable[[], float]:
    """Return a function that gives the microseconds of one substep in full contact.

    Of one thread's own time, so that whatever else the machine does counts for neither; with several threads by the wall.
    """
    simulation = Simulation(weighing(texels, solid), threads)
    for _ in range(10):
        frame = simulation.advance()
    if not frame.sensors["pad"].contact.all():
        raise RuntimeError("the pad is not fully covered: this would not be the same work")

    def measure() -> float:
        start = clock()
        simulation.advance()
        return (clock() - start) / simulation.substeps * 1e6

    return measure


def memory(texels: int, solid: trimesh.Trimesh) -> int:
    """Return the bytes of all arrays that the inner loop works on, but for the object's own triangles."""
    simulation = Simulation(weighing(texels, solid))
    model, detection, state, workspace = simulation.arrays
    return sum(map(_bytes, (model, detection.neighbours, state, workspace)))


def _bytes(part: object) -> int:
    """Return the bytes of an array, or of all arrays in a tuple."""
    return part.nbytes if isinstance(part, np.ndarray) else sum(map(_bytes, part)) if isinstance(part, tuple) else 0


def mujoco_pad(texels: int, body: str, asset: str = "", option: str = "", more: str = "", tactile: bool = True):
    """Return MuJoCo's model of the pad at its usual step of 1 ms, with its tactile sensor, below a body; both are MJCF."""
    import mujoco

    rows, columns = GRIDS[texels]
    pitch = SIDE / (max(rows, columns) - 1)
    half_x, half_y = (columns - 1) * pitch / 2, (rows - 1) * pitch / 2
    sensor = '<sensor><tactile geom="pad" mesh="pad"/></sensor>' if tactile else ""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.001" {option}/>
        <asset><mesh name="pad" builtin="plate" params="{columns} {rows}" scale="{half_x} {half_y} 0.001"/>{asset}</asset>
        <worldbody><body><geom name="pad" type="mesh" mesh="pad" quat="0 1 0 0" contype="0" conaffinity="0"/>
        <geom type="box" size="{half_x} {half_y} 0.005" pos="0 0 -0.005"/></body>{body}</worldbody>{more}{sensor}</mujoco>"""
    )
    if tactile and model.nsensordata != 3 * texels:
        raise RuntimeError(f"MuJoCo has {model.nsensordata // 3} texels instead of {texels}")
    return model


def mujoco_model(texels: int, solid: trimesh.Trimesh, slope: float = 0.0, gap: float = 0.0):
    """Return MuJoCo's model of the same."""
    body = f"""<body pos="0 0 {CUBE / 2 + gap}"><freejoint/><geom type="mesh" mesh="cube" mass="1"/>
        <geom type="sdf" mesh="cube" contype="0" conaffinity="0" mass="0"/></body>"""
    pull = " ".join(map(str, gravity(slope)))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cube.obj"
        solid.export(path)
        return mujoco_pad(texels, body, f'<mesh name="cube" file="{path}"/>', f'gravity="{pull}"')


def mujoco_step(texels: int, solid: trimesh.Trimesh) -> Callable[[], float]:
    """Return the same as :func:`palpate_step` for MuJoCo."""
    import mujoco

    model = mujoco_model(texels, solid)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 1000)

    def measure() -> float:
        start = time.thread_time()
        mujoco.mj_step(model, data, 300)
        return (time.thread_time() - start) / 300 * 1e6

    return measure


def error_of(forces: np.ndarray, slope: float) -> float:
    """Return the worst relative error of the (n, 3) forces on the pad in the last half of them."""
    late, true = forces[len(forces) // 2 :], gravity(slope)
    errors = [np.abs(late[:, i] / true[i] - 1.0).max() for i in (1, 2) if true[i] != 0.0]
    return float(max(errors))


def palpate_weighing(texels: int, solid: trimesh.Trimesh, slope: float, dt: float) -> tuple[float, float]:
    """Return the seconds of computing per simulated second of a cube that comes to rest, and the error of its forces."""
    simulation = Simulation(weighing(texels, solid, dt, RATE, slope, gap=1e-4))
    start = time.perf_counter()
    forces = [simulation.advance().sensors["pad"].net_force for _ in range(SECONDS * RATE)]
    return (time.perf_counter() - start) / SECONDS, error_of(np.array(forces), slope)


def mujoco_weighing(texels: int, solid: trimesh.Trimesh, slope: float) -> tuple[float, float]:
    """Return the same for MuJoCo."""
    import mujoco

    model = mujoco_model(texels, solid, slope, gap=1e-4)
    data, wrench, forces = mujoco.MjData(model), np.zeros(6), []
    start = time.perf_counter()
    for _ in range(SECONDS * RATE):
        mujoco.mj_step(model, data, round(1 / (RATE * model.opt.timestep)))
        total = np.zeros(3)
        for i in range(data.ncon):
            mujoco.mj_contactForce(model, data, i, wrench)
            total += data.contact[i].frame.reshape(3, 3).T @ wrench[:3]
        forces.append(-total)  # on the pad, whose geometry comes first
    return (time.perf_counter() - start) / SECONDS, error_of(np.array(forces), slope)


def equal_accuracy(texels: int, solid: trimesh.Trimesh) -> Iterator[dict]:
    """Time per simulated second, level and sloping, at a static accuracy that is at least MuJoCo's."""
    import mujoco

    theirs = max(mujoco_weighing(texels, solid, slope)[1] for slope in (0.0, SLOPE))
    for dt in STEPS:
        ours = max(palpate_weighing(texels, solid, slope, dt)[1] for slope in (0.0, SLOPE))
        if ours <= theirs:
            break
    peer = f"mujoco-{mujoco.__version__} tactile"
    yield {"name": f"solver.static_error.{texels}", "value": ours, "unit": "1", "peer": peer, "peer_value": theirs}
    taken = in_turn(
        *(lambda slope=slope: palpate_weighing(texels, solid, slope, dt)[0] * 1e3 for slope in (0.0, SLOPE)),
        *(lambda slope=slope: mujoco_weighing(texels, solid, slope)[0] * 1e3 for slope in (0.0, SLOPE)),
        rounds=3,
    )
    own, other = (taken[0] + taken[1]) / 2, (taken[2] + taken[3]) / 2
    yield beside(f"solver.second.{texels}.at_{dt * 1e3:g}_ms", own, "ms", f"{peer} at 1 ms", other, 1.0)


def ball(parts: int) -> TriangleMesh:
    """Return a ball of 12 · parts² faces: a cube whose sides are divided alike, blown up."""
    a, b = np.meshgrid(*[np.tan(np.linspace(-np.pi / 4, np.pi / 4, parts + 1))] * 2, indexing="ij")
    side = np.stack([a, b, np.ones_like(a)], axis=-1).reshape(-1, 3)
    sides = [np.roll(sign * side * [1, sign, 1], axis, axis=1) for axis in range(3) for sign in (1.0, -1.0)]
    corner = (np.arange(parts)[:, None] * (parts + 1) + np.arange(parts)).ravel()
    quads = np.stack([corner, corner + parts + 1, corner + parts + 2, corner + 1], axis=1)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    solid = trimesh.Trimesh(np.concatenate(sides), np.concatenate([faces + i * len(side) for i in range(6)]), process=True)
    points = BALL * solid.vertices / np.linalg.norm(solid.vertices, axis=1)[:, None]
    return checked_mesh(points, solid.faces, "ball")[0]


def rolling_step(parts: int) -> Callable[[], float]:
    """Return a function that gives the microseconds of one substep while a :func:`ball` rolls over the pad."""
    mesh = ball(parts)
    times = np.linspace(0.0, 2.0, 51)
    angle = 0.5 * np.sin(2 * np.pi * 0.5 * times)  # rolls to and fro by half a radian
    path = np.stack([np.zeros_like(times), -BALL * angle, np.full_like(times, BALL - 1.5e-3)], axis=1)
    turns = np.stack([np.cos(angle / 2), np.sin(angle / 2), 0 * angle, 0 * angle], axis=1)
    scenario = Scenario(
        bodies=(Body("pad", Motion.at_rest()), Body("ball", Motion(times, path, turns))),
        sensors=(sensor_of(1024, 84.0)[0],),
        targets=(Target("ball", 1, mesh),),
        frame_end=10**6,
        fps=5.0,
        dt=1e-3,
    )

    def measure() -> float:
        simulation = Simulation(scenario)
        simulation.advance()
        start = time.thread_time()
        for _ in range(5):
            simulation.advance()
        return (time.thread_time() - start) / (5 * simulation.substeps) * 1e6

    return measure


def in_turn(*measures: Callable[[], float], rounds: int = ROUNDS) -> list[float]:
    """Median of several rounds in which each is measured once."""
    taken = [[measure() for measure in measures] for _ in range(rounds)]
    return [statistics.median(values) for values in zip(*taken, strict=True)]


def run() -> Iterator[dict]:
    """Time per step by number of texels and by number of faces, and per second at equal accuracy."""
    import mujoco

    solid = cube(4)
    for texels in GRIDS:
        ours, theirs = in_turn(palpate_step(texels, solid), mujoco_step(texels, solid))
        yield beside(f"solver.step.cube.{texels}", ours, "us", f"mujoco-{mujoco.__version__} tactile", theirs, 0.6)
    wall = time.perf_counter
    two, one = in_turn(palpate_step(10000, solid, 2, wall), palpate_step(10000, solid, 1, wall), rounds=5)
    yield beside("solver.step.cube.10000.two_threads", two, "us", "palpate with one thread", one)
    for texels in GRIDS:
        yield {"name": f"solver.memory.{texels}", "value": memory(texels, solid) / texels, "unit": "bytes per texel"}
    few, many = in_turn(palpate_step(84, cube(4)), palpate_step(84, cube(8)))
    yield beside("solver.step.faces.786k", many, "us", "palpate with 3k faces", few, 1.5)
    few, many, more = in_turn(rolling_step(20), rolling_step(204), rolling_step(331), rounds=3)
    for name, value in (("499k", many), ("1315k", more)):
        yield beside(f"solver.step.faces.rolling.{name}", value, "us", "palpate with 5k faces", few, 1.5)
    for texels in GRIDS:
        yield from equal_accuracy(texels, solid)
