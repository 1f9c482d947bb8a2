# SPDX-License-Identifier: GPL-3.0-or-later
"""Conservation and invariance: momenta, energy, and scenes that are turned, moved or carried along."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import trimesh
from scipy.integrate import solve_ivp
from solver_scenes import about, box, cube_on_pad, free_body, pad, shape

from oracles.sweep import moving, stored
from palpate.core.geometry.rotations import quaternion_product, rotation_matrices
from palpate.core.model.body import Motion
from palpate.core.model.scenario import Scenario, Target
from palpate.core.model.sensor import Sensor
from palpate.core.model.sensor_parameters import SensorParameters
from palpate.core.solver.simulation import Simulation, run

STIFF = {"sigma0": 1e3, "sigma1": 10.0, "x0": 0.01}


# ---- free collisions ----
def collision(seed: int, dt: float = 1e-4) -> Scenario:
    """A pad on a free block meets a free solid in free space, askew and spinning; nothing else acts."""
    rng = np.random.default_rng([17, seed])
    block, texels = box(0.05, 0.05, 0.02), pad(10, 10, 0.005)
    texels = replace(texels, position=texels.position + [0, 0, 0.01])
    solid = (
        box(0.04, 0.03, 0.05),
        shape(trimesh.creation.icosphere(2, 0.02)),
        shape(trimesh.creation.cylinder(0.015, 0.05, sections=24)),
    )[seed % 3]
    turn = about(rng.normal(size=3), rng.uniform(0, 180))
    low = (solid.vertices @ rotation_matrices(turn).T)[:, 2].min()
    aside, spin = rng.uniform(-0.01, 0.01, 2), rng.normal(size=(2, 3)) * 2.0
    parameters = SensorParameters(k=rng.uniform(100, 2000), cn=rng.uniform(0, 10), **STIFF)
    return Scenario(
        bodies=(
            free_body("block", block, 0.7, (0, 0, 0), velocity=rng.normal(size=3) * 0.1, angular_velocity=spin[0]),
            free_body(
                "solid", solid, rng.uniform(0.05, 2.0), (*aside, 0.0102 - low), turn,
                velocity=np.array([*rng.normal(size=2) * 0.2, -0.4]), angular_velocity=spin[1],
            ),
        ),
        sensors=(Sensor("pad", 0, texels, parameters),),
        targets=(Target("solid", 1, solid),),
        gravity=np.zeros(3),
        frame_end=60,
        fps=1000.0,
        dt=dt,
    )  # fmt: skip


def momenta(scenario: Scenario, poses, velocities, point) -> tuple[np.ndarray, np.ndarray]:
    """Linear momentum of all bodies together, and angular momentum about a point."""
    linear, angular = np.zeros(3), np.zeros(3)
    for body, pose, twist in zip(scenario.bodies, poses, velocities, strict=True):
        rotation = rotation_matrices(pose[3:])
        center = pose[:3] + rotation @ body.center_of_mass
        linear += body.mass * twist[:3]
        angular += body.mass * np.cross(center - point, twist[:3]) + rotation @ body.inertia @ rotation.T @ twist[3:]
    return linear, angular


def collide(seed: int, dt: float = 1e-4) -> tuple[float, float, float]:
    """Let two free bodies collide.

    Returns
    -------
    linear, angular : float
        Largest change of the momenta, as shares of what the contact exchanged.
    growth : float
        Largest energy (motion, springs and bristles) above the start's, as a share of it.
    """
    scenario = collision(seed, dt)
    simulation, rows = Simulation(scenario), []
    for i in range(60):
        frame = simulation.advance() if i else simulation.observe()
        single = replace(scenario, bodies=scenario.bodies[:1])
        total = momenta(scenario, frame.poses, frame.velocities, np.array([1.0, -2.0, 0.5]))
        alone = momenta(single, frame.poses[:1], frame.velocities[:1], np.array([1.0, -2.0, 0.5]))
        rows.append((*total, *alone, moving(scenario, frame) + stored(simulation, frame)))
    linear, angular, own, own_spin, energy = (np.array(values) for values in zip(*rows, strict=True))
    exchanged, turned = np.abs(own - own[0]).max(), np.abs(own_spin - own_spin[0]).max()
    return (
        float(np.abs(linear - linear[0]).max() / exchanged),
        float(np.abs(angular - angular[0]).max() / turned),
        float((energy.max() - energy[0]) / energy[0]),
    )


# ---- free flight ----
MOMENTS, SPIN = np.diag([1e-4, 2e-4, 3e-4]), np.array([0.1, 20.0, 0.1])
"""Of a body that turns about its middle axis and so tumbles over again and again."""


def tumbling_flight(dt: float, seconds: float) -> tuple[float, float, float]:
    """Let an uneven body fly freely.

    Returns
    -------
    growth : float
        Largest kinetic energy above the start's, as a share of it.
    momentum : float
        Largest change of its angular momentum, as a share of it.
    error : float, rad/s
        Distance of its spin at the end, body axes, from Euler's equations as scipy's DOP853 solves them.
    """
    scenario = collision(0, dt)
    body = replace(
        scenario.bodies[1], motion=Motion.at_rest((1, 0, 0)), inertia=MOMENTS, angular_velocity=SPIN, velocity=np.zeros(3)
    )
    frames = round(100.0 * seconds) + 1
    recording = run(replace(scenario, bodies=(scenario.bodies[0], body), frame_end=frames, fps=100.0))
    rotations = rotation_matrices(recording.poses[:, 1, 3:])
    spins = np.einsum("fij,fi->fj", rotations, recording.velocities[:, 1, 3:])
    energy = 0.5 * np.einsum("fi,ij,fj->f", spins, MOMENTS, spins)
    momentum = np.einsum("fij,jk,fk->fi", rotations, MOMENTS, spins)
    exact = solve_ivp(
        lambda _, w: -np.cross(w, MOMENTS @ w) / np.diag(MOMENTS), (0, seconds), SPIN, method="DOP853", rtol=1e-12, atol=1e-12
    )
    change = np.linalg.norm(momentum - momentum[0], axis=1).max() / np.linalg.norm(momentum[0])
    return float(energy.max() / energy[0] - 1.0), float(change), float(np.abs(spins[-1] - exact.y[:, -1]).max())


# ---- invariance ----
def differences(one: Scenario, other: Scenario, skip: int = 0) -> float:
    """Largest difference of two scenes' readings in the sensors' frames, as a share of the largest reading of its kind."""
    first, second = run(one), run(other)
    worst = 0.0
    for name, a in first.sensors.items():
        b = second.sensors[name]
        for key in ("normal_force", "shear", "depth", "net_force", "net_torque"):
            x, y = getattr(a, key)[skip:], getattr(b, key)[skip:]
            worst = max(worst, float(np.abs(x - y).max() / np.abs(x).max()))
    return worst


def tumbling(frames: int = 24) -> Scenario:
    """A cube that is thrown askew onto a pad, slides, topples and comes to rest."""
    scenario = cube_on_pad(
        0.3, texels=pad(12, 12, 0.006), frames=frames, dt=1e-3, gap=2e-3, size=0.03, k=400.0, cn=4.0, **STIFF
    )
    turn = about((1, 2, 0.3), 12.0)
    cube = replace(
        scenario.bodies[1], motion=Motion.at_rest((0.002, 0, 0.022), turn), velocity=np.array([0.2, 0.1, 0.0]),
        angular_velocity=np.array([0.5, -1.0, 2.0]),
    )  # fmt: skip
    return replace(scenario, bodies=(scenario.bodies[0], cube))


def turned_and_moved(scenario: Scenario, turn: np.ndarray, shift: np.ndarray) -> Scenario:
    """The same scene elsewhere in the world and askew, gravity included."""
    rotation = rotation_matrices(turn)

    def place(body):
        m = body.motion
        motion = Motion(m.times, m.positions @ rotation.T + shift, quaternion_product(turn, m.quaternions))
        return replace(
            body, motion=motion, velocity=rotation @ body.velocity, angular_velocity=rotation @ body.angular_velocity
        )

    bodies = tuple(place(body) for body in scenario.bodies)
    return replace(scenario, bodies=bodies, gravity=rotation @ scenario.gravity)


def carried(scenario: Scenario, velocity: np.ndarray, acceleration: np.ndarray) -> Scenario:
    """The same scene on a carrier that moves and accelerates, with the gravity that makes up for it.

    The carrier's path is given at every step. A free body's velocity at a step's end belongs to the step behind it, that of the
    carrier to the middle of the step before: half a step's gain is taken off at the start, so that both begin alike.
    """
    dt = Simulation(scenario).dt
    times = np.arange(round((scenario.frame_end - 1) / scenario.fps / dt) + 2) * dt
    path = np.outer(times, velocity) + 0.5 * np.outer(times**2, acceleration)
    bodies = []
    for body in scenario.bodies:
        m = body.motion
        if body.free:
            bodies.append(replace(body, velocity=body.velocity + velocity - 0.5 * dt * acceleration))
        else:
            motion = Motion(times, m.positions[0] + path, np.repeat(m.quaternions[:1], len(times), axis=0))
            bodies.append(replace(body, motion=motion))
    return replace(scenario, bodies=tuple(bodies), gravity=scenario.gravity + acceleration)


def round_and_round(turns: float = 3.0, frames: int = 24) -> float:
    """Spin pad and probe together, bristles bent, some times about an axis that passes neither; largest change of shear."""
    steps = 40 * frames
    times = np.linspace(0, frames / 24.0, steps + 1)
    drag = np.zeros((steps + 1, 3))
    drag[:, 0], drag[:, 2] = np.minimum(times * 24.0 / 3.0, 1.0) * 2e-3, 0.009
    after = np.maximum(times - 4 / 24.0, 0.0)
    angle = 360.0 * turns * (after / after[-1]) ** 2
    spins = np.array([about((0.3, -0.5, 0.8), a) for a in angle])
    rotations, arm = rotation_matrices(spins), np.array([0.2, 0.1, -0.3])
    plate, texels = box(0.08, 0.08, 0.02), pad(6, 6)
    base = cube_on_pad(1.0, texels=texels, sigma0=100.0, sigma1=0.0, ct=0.0, k=100.0, cn=0.0)
    motions = [Motion(times, np.einsum("fij,fj->fi", rotations, arm + way), spins) for way in (0.0 * drag, drag)]
    bodies = (replace(base.bodies[0], motion=motions[0]), replace(base.bodies[1], free=False, motion=motions[1]))
    scenario = replace(
        base, bodies=bodies, targets=(Target("cube", 1, plate),), frame_end=frames + 1, dt=1.01 * times[1], gravity=np.zeros(3)
    )
    shear = run(scenario).sensors["pad"].shear
    return float(np.abs(shear[5:] - shear[4]).max() / np.abs(shear[4]).max())
