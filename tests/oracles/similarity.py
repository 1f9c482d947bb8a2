# SPDX-License-Identifier: GPL-3.0-or-later
"""The same scenario in other units of length, mass and time: every dimensionless result must be equal."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from palpate.core.model.body import Motion
from palpate.core.model.recording import Recording
from palpate.core.model.scenario import Scenario
from palpate.core.model.sensor_parameters import HUNT_CROSSLEY, SensorParameters


def rescaled(scenario: Scenario, length: float, mass: float = 1.0, time: float = 1.0) -> Scenario:
    """Return a scenario whose lengths, masses and times are multiplied by factors; its step must be given.

    Drives, deformation and effects are not rescaled: the scenario must have none.
    """
    bodies = [
        replace(
            body,
            motion=Motion(body.motion.times * time, body.motion.positions * length, body.motion.quaternions),
            mass=body.mass * mass,
            center_of_mass=body.center_of_mass * length,
            inertia=body.inertia * mass * length**2,
            velocity=body.velocity * length / time,
            angular_velocity=body.angular_velocity / time,
        )
        for body in scenario.bodies
    ]
    sensors = [
        replace(
            sensor,
            texels=replace(sensor.texels, position=sensor.texels.position * length, area=sensor.texels.area * length**2),
            parameters=_parameters(sensor.parameters, length, mass, time),
        )
        for sensor in scenario.sensors
    ]
    targets = [replace(t, mesh=replace(t.mesh, vertices=t.mesh.vertices * length)) for t in scenario.targets]
    if scenario.dt is None:
        raise ValueError("the advised step has bounds in seconds: give a step")
    return replace(
        scenario,
        bodies=tuple(bodies),
        sensors=tuple(sensors),
        targets=tuple(targets),
        gravity=scenario.gravity * length / time**2,
        fps=scenario.fps / time,
        dt=scenario.dt * time,
    )


def _parameters(p: SensorParameters, length: float, mass: float, time: float) -> SensorParameters:
    stiffness, damping, power = mass / time**2, mass / time, p.exponent if p.normal_law == HUNT_CROSSLEY else 1.0
    return replace(
        p,
        k=p.k * stiffness * length ** (1.0 - power),
        cn=p.cn * damping,
        ct=p.ct * damping,
        sigma0=p.sigma0 * stiffness,
        sigma1=p.sigma1 * damping,
        x0=p.x0 * length / time,
        max_penetration=p.max_penetration * length,
        dissipation=p.dissipation * time / length,
    )


def difference(expected: Recording, found: Recording, length: float, mass: float = 1.0, time: float = 1.0) -> float:
    """Return the largest difference of forces and depths, as a share of the largest force and the largest depth."""
    force, worst = mass * length / time**2, 0.0
    for name, sensor in expected.sensors.items():
        for key, unit, size in (
            ("normal_force", force, sensor.normal_force),
            ("shear", force, sensor.normal_force),
            ("depth", length, sensor.depth),
        ):
            error = np.abs(getattr(found.sensors[name], key) / unit - getattr(sensor, key)).max()
            worst = max(worst, float(error / np.abs(size).max()))
    return worst
