# SPDX-License-Identifier: GPL-3.0-or-later
"""A sensor, or many, inside the loop of another simulator."""

from __future__ import annotations

from ..core.geometry.mesh import TriangleMesh
from ..core.geometry.shapes import Shape
from ..core.simulators import pressed_sensor, pressed_sensors
from ..core.simulators.environment_parameters import Columns
from ..core.simulators.sensor_on_mesh import SensorOnMesh
from . import arguments
from .arguments import ArgumentError
from .bodies import Body
from .running import prepare_solver
from .sensors import Sensor

Pose = pressed_sensor.Pose


class PressedSensor(pressed_sensor.PressedSensor):
    """A sensor and one thing that presses on it, both moved by another program.

    ``pressed.step(sensor_pose, target_pose)`` goes on by one step and returns forces and readings of the texels, and the force
    and torque that go back to the other program; a pose is a position (3,), m, and a quaternion
    (4,), (w, x, y, z), or one array (7,) of both.

    Parameters
    ----------
    sensor : Sensor
    target : Body
        Its shape counts; the other program moves it. Contacts with a box, sphere, capsule or plane are in closed form.
    dt : float, seconds
        Step of the other program.
    sensor_pose, target_pose : pose, optional
        At the start. Default: it begins at rest at the poses of the first step. A target's pose alone begins with the sensor
        where it is.

    Raises
    ------
    PalpateError
        The sensor, the body or the step makes no run.
    """

    def __init__(
        self,
        sensor: SensorOnMesh,
        target: Body | TriangleMesh | Shape,
        dt: float,
        sensor_pose: Pose | None = None,
        target_pose: Pose | None = None,
    ):
        arguments.sensor_on_mesh(sensor)
        prepare_solver()
        surface = _surface(target)
        step = arguments.number(dt, "dt", above_zero=True)
        if sensor_pose is None and target_pose is not None:
            sensor_pose = sensor.world_pose() if isinstance(sensor, Sensor) else (sensor.position, sensor.quaternion)
        super().__init__(sensor, surface, step, sensor_pose, target_pose)


class PressedSensors(pressed_sensors.PressedSensors):
    """A sensor and one thing that presses on it in many environments, moved by another program.

    ``pressed.step(sensor_poses, target_poses)`` goes on by one step in all environments; poses are (E, 7): position, m, and
    quaternion (w, x, y, z), or a pair of arrays. Each environment gives the bits of a :class:`PressedSensor`.

    Parameters
    ----------
    sensor : Sensor
    target : Body
        Its shape counts; the other program moves it. Contacts with a box, sphere, capsule or plane are in closed form.
    environments : int
    dt : float, seconds
        Step of the other program.
    threads : int, optional
        How many to compute with; by default as many as pay off.
    parameters : mapping of str to (E,) float, optional
        In which the sensors of environments differ, as ``{"k": …, "mus": …, "effect.creep.amount": …}``.

    Raises
    ------
    PalpateError
        The sensor, the body or the step makes no run, or memory does not suffice.
    """

    def __init__(
        self,
        sensor: SensorOnMesh,
        target: Body | TriangleMesh | Shape,
        environments: int,
        dt: float,
        threads: int | None = None,
        parameters: Columns | None = None,
    ):
        arguments.sensor_on_mesh(sensor)
        surface = _surface(target)
        count = arguments.count(environments, "environments")
        prepare_solver()
        super().__init__(sensor, surface, dt, count, threads, parameters)


def _surface(target: Body | TriangleMesh | Shape) -> TriangleMesh | Shape:
    """Return what presses on a sensor: in closed form where there is one."""
    surface = (target.shape or target.mesh) if isinstance(target, Body) else target
    if not isinstance(surface, TriangleMesh | Shape):
        raise ArgumentError(f"target is {arguments.brief(target)}: give a Body.")
    return surface
