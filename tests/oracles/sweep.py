# SPDX-License-Identifier: GPL-3.0-or-later
"""Random scenes from one end of the parameter space to the other: bodies thrown onto a pad must never gain energy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from solver_scenes import GRAVITY, box, free_body, pad, shape

from palpate.core.geometry.rotations import rotation_matrices
from palpate.core.model.body import Body, Motion
from palpate.core.model.scenario import Scenario, Target
from palpate.core.model.sensor import Sensor
from palpate.core.model.sensor_parameters import SensorParameters
from palpate.core.solver.simulation import Simulation


def logarithmic(rng, low, high):
    """A number between `low` and `high`, every decade as likely as the next."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def random_turn(rng, largest=np.pi):
    """A unit quaternion: a turn by at most `largest` about a random axis."""
    axis, half = rng.normal(size=3), 0.5 * rng.uniform(0, largest)
    return np.concatenate([[np.cos(half)], np.sin(half) * axis / np.linalg.norm(axis)])


def random_solid(rng, size):
    """A solid of about the given size with few enough faces to be quick."""
    made = {
        "box": lambda: box(*(size * rng.uniform(0.4, 1.0, 3))),
        "sphere": lambda: shape(trimesh.creation.icosphere(2, size / 2)),
        "cylinder": lambda: shape(trimesh.creation.cylinder(size / 3, size, sections=24)),
        "cone": lambda: shape(trimesh.creation.cone(size / 2, size, sections=24)),
        "plate": lambda: box(size, size, 0.1 * size),
    }
    name = str(rng.choice(list(made)))
    return name, made[name]()


def random_case(seed: int) -> tuple[Scenario, float, str]:
    """One parameter set: k 1…1e6 N/m, mass 1 g…100 kg, step 10 µs…10 ms; any shape, slope, throw and spin.

    Returns
    -------
    scenario : Scenario
        One step per frame, so that nothing between is missed.
    gap : float, metres
        Between the pad and the lowest point of the body, along the pad's normal.
    words : str
        The set in one line.
    """
    rng = np.random.default_rng([2026, seed])
    k, mass, dt = logarithmic(rng, 1.0, 1e6), logarithmic(rng, 1e-3, 100.0), logarithmic(rng, 1e-5, 1e-2)
    cn = 0.0 if rng.random() < 0.1 else k * logarithmic(rng, 1e-3, 1e-1)
    sigma0 = k * logarithmic(rng, 1e-2, 10.0)
    mus = rng.uniform(0.0, 1.2)
    parameters = SensorParameters(
        k=k, cn=cn, ct=rng.uniform(0, 1) * 0.01 * cn, sigma0=sigma0, sigma1=sigma0 * logarithmic(rng, 1e-4, 1e-1),
        x0=logarithmic(rng, 1e-3, 1.0), mus=mus, mud=rng.uniform(0.2, 1.0) * mus,
    )  # fmt: skip
    name, mesh = random_solid(rng, rng.uniform(0.01, 0.06))
    texels = pad() if rng.random() < 0.5 else pad(12, 12, 0.004)
    slope, turn = random_turn(rng, np.radians(40)), random_turn(rng)
    gap = float(rng.choice([0.0, 1e-5, 1e-3])) * rng.random()
    lowest = (mesh.vertices @ rotation_matrices(turn).T)[:, 2].min()
    sideways = rng.normal(size=2) * 0.005
    speed = rng.normal(size=3) * logarithmic(rng, 1e-3, 1.0)
    speed[2] = -abs(speed[2])
    scenario = Scenario(
        bodies=(
            Body("pad", Motion.at_rest()),
            free_body(
                "thing", mesh, mass, (*sideways, gap - lowest), turn,
                velocity=speed, angular_velocity=rng.normal(size=3) * logarithmic(rng, 1e-2, 10.0),
            ),
        ),
        sensors=(Sensor("pad", 0, texels, parameters),),
        targets=(Target("thing", 1, mesh),),
        frame_end=10**6,
        fps=1.0 / dt,
        gravity=rotation_matrices(slope) @ [0, 0, -GRAVITY],
        dt=dt,
    )  # fmt: skip
    words = f"set {seed}: {name}, k {k:.3g}, cn {cn:.3g}, sigma0 {sigma0:.3g}, mass {mass:.3g} kg, dt {dt:.3g} s"
    return scenario, gap, words


ROUNDING = 1e-12
"""Rounding of a run's sums as a share of their largest term: hundreds of steps, each with a linear system of its own."""


@dataclass(frozen=True)
class Energies:
    """What a run had at each step, joules, and a scale.

    `mechanical` is motion and height, `total` has what contacts can give back as well: what springs and bristles hold, but no
    more than was put into them. `unpaid` is by how much the depths that texels report stand for more than that.
    """

    total: np.ndarray
    mechanical: np.ndarray
    unpaid: np.ndarray
    scale: float

    @property
    def growth(self) -> float:
        """Largest total energy above that of the start, but for rounding, as a share of all that there was to be lost."""
        return max(0.0, float((self.total.max() - self.total[0] - self._rounding) / self.scale))

    @property
    def mechanical_growth(self) -> float:
        """The same for motion and height alone."""
        return max(0.0, float((self.mechanical.max() - self.total[0] - self._rounding) / self.scale))

    @property
    def _rounding(self) -> float:
        """Rounding of the sums, joules: what a body weighs may be thousands of times its scale.

        In set 498 the terms are 30,000 times the scale. Ten copies of it that are turned as a whole, whose sums are rounded
        otherwise, grow by -1e-19 to 2e-16 J, of 1.3e-3 J, and with half the step it does not grow at all.
        """
        return ROUNDING * float(max(np.abs(self.total).max(), np.abs(self.mechanical).max(), np.abs(self.unpaid).max()))

    @property
    def overshoot(self) -> float:
        """Largest energy that reported depths stand for above what was put in, as a share of the scale."""
        return float(self.unpaid.max() / self.scale)


def stored(simulation: Simulation, frame) -> float:
    """Energy in the springs and bristles of all contacts, joules."""
    total, state, pairs = 0.0, simulation._state, simulation._model.pairs
    for index, sensor in enumerate(simulation.scenario.sensors):
        p = sensor.parameters
        if sensor.readout:
            total += 0.5 * p.k * (frame.sensors[sensor.name].depth ** 2).sum()
        for pair in np.flatnonzero(pairs.sensor == index):
            own = slice(pairs.first_slot[pair], pairs.first_slot[pair] + len(sensor.texels))
            total += 0.5 * p.sigma0 * (state.bristle[own] ** 2).sum()
    return total


def moving(scenario: Scenario, frame) -> float:
    """Kinetic energy and height of all free bodies, joules."""
    total = 0.0
    for body, pose, twist in zip(scenario.bodies, frame.poses, frame.velocities, strict=True):
        if body.free:
            rotation = rotation_matrices(pose[3:])
            spin = rotation.T @ twist[3:]
            height = (pose[:3] + rotation @ body.center_of_mass) @ scenario.gravity
            total += 0.5 * body.mass * twist[:3] @ twist[:3] + 0.5 * spin @ body.inertia @ spin - body.mass * height
    return total


def lag(simulation: Simulation) -> float:
    """Energy that free bodies have lost by falling with the velocity of each step's end, joules: ½ m dt g·(v - v₀)."""
    scenario, total = simulation.scenario, 0.0
    for body, velocity in zip(scenario.bodies, simulation._state.velocity, strict=True):
        if body.free:
            total += 0.5 * body.mass * simulation.dt * scenario.gravity @ (velocity[:3] - body.velocity)
    return float(total)


def energies(scenario: Scenario, steps: int, scale: float) -> Energies:
    """Run some steps and add up the energy after each."""
    simulation = Simulation(scenario)
    mechanical, held, paid = [], [], []
    for step in range(steps + 1):
        frame = simulation.advance() if step else simulation.observe()
        mechanical.append(moving(scenario, frame))
        held.append(stored(simulation, frame))
        paid.append(float(simulation._state.stored_energy.sum()) + lag(simulation) if step else held[0])
    motion, springs = np.array(mechanical), np.array(held)
    back = np.minimum(springs, paid)
    return Energies(motion + back, motion, springs - back, scale)


def thrown(seed: int, steps: int = 300) -> tuple[Energies, str]:
    """Energies of a random case. The scale is the energy of its throw, its fall to the pad and its sinking into it."""
    scenario, gap, words = random_case(seed)
    body, p = scenario.bodies[1], scenario.sensors[0].parameters
    rotation = rotation_matrices(body.motion.quaternions[0])
    spin = rotation.T @ body.angular_velocity
    kinetic = 0.5 * body.mass * body.velocity @ body.velocity + 0.5 * spin @ body.inertia @ spin
    sinking = min(body.mass * GRAVITY / p.k / len(scenario.sensors[0].texels), p.max_penetration)
    return energies(scenario, steps, kinetic + body.mass * GRAVITY * (gap + sinking)), words
