# SPDX-License-Identifier: GPL-3.0-or-later
"""The description of a whole run: everything the solver needs and nothing of Blender."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..errors import ParameterError, SceneError
from ..geometry.mesh import TriangleMesh
from .body import Body
from .recording import digest_of
from .sensor import Deformation, Sensor


@dataclass(frozen=True)
class Target:
    """A surface that sensors can be in contact with.

    Attributes
    ----------
    name : str
    body : int
        Index in :attr:`.Scenario.bodies`.
    mesh : TriangleMesh
        In the frame of its body, metres; its shape at the first frame.
    deformation : Deformation or None
        How its vertices move when the target is not rigid.
    sensor : int or None
        Index of the sensor whose surface this is, when the target is the soft surface of another sensor.
    smooth : bool
        True when contact normals are interpolated between the vertices, as for smooth shading; False when they are the normals
        of the triangles.
    """

    name: str
    body: int
    mesh: TriangleMesh
    deformation: Deformation | None = None
    smooth: bool = False
    sensor: int | None = None


@dataclass(frozen=True)
class Scenario:
    """A whole run.

    Attributes
    ----------
    bodies, sensors, targets : tuple
        :class:`.Body`, :class:`.Sensor` and :class:`.Target`. A sensor never touches the targets of its own body.
    frame_start, frame_end : int
        Frames that are recorded, both included; time zero is `frame_start`.
    fps : float
        Frames per second.
    gravity : (3,) float, m/s²
    dt : float or None, seconds
        Longest substep. With None :mod:`.time_step_adviser` chooses it.
    name : str
        Of the scene, for messages.
    interpolation : str
        How motions are interpolated between their samples: ``linear`` or ``smooth`` (:func:`.simulation.poses_at`).
    """

    bodies: tuple[Body, ...]
    sensors: tuple[Sensor, ...]
    targets: tuple[Target, ...]
    frame_start: int = 1
    frame_end: int = 250
    fps: float = 24.0
    gravity: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, -9.81]))
    dt: float | None = None
    name: str = "scene"
    interpolation: str = "linear"

    @property
    def frames(self) -> range:
        """The recorded frames."""
        return range(self.frame_start, self.frame_end + 1)

    @property
    def read_out(self) -> list[Sensor]:
        """Sensors that are read out, without pads."""
        return [sensor for sensor in self.sensors if sensor.readout]

    def check(self) -> None:
        """Raise a :class:`.PalpateError` when the parts do not make a run.

        Effects are checked by :func:`.registry.check_scenario`, which also calls this method.
        """
        if self.frame_end < self.frame_start:
            raise SceneError(
                f"The frame range of '{self.name}' runs backwards ({self.frame_start} to {self.frame_end}): "
                "set the end frame after the start frame."
            )
        if not (np.isfinite(self.fps) and self.fps > 0):
            raise SceneError(f"The frame rate of '{self.name}' is {self.fps:g}: set it above zero.")
        if self.dt is not None and not (np.isfinite(self.dt) and self.dt > 0):
            raise ParameterError(
                f"The time step of '{self.name}' is {self.dt:g} s: give a value above zero, or leave it automatic."
            )
        if not np.isfinite(self.gravity).all():
            raise SceneError(f"The gravity of '{self.name}' is NaN or infinite: set it under Scene › Gravity.")
        if self.interpolation not in ("linear", "smooth"):
            raise ParameterError(f"The interpolation of '{self.name}' is '{self.interpolation}': choose linear or smooth.")
        if not self.sensors:
            raise SceneError(f"'{self.name}' has no sensor: make one with Physics › Palpate › Make Sensor.")
        if not any(sensor.readout for sensor in self.sensors):
            raise SceneError(f"'{self.name}' has pads but no sensor to read: change one pad's role to Sensor.")
        touched = any(target.body != sensor.body for sensor in self.sensors for target in self.targets)
        if not touched:
            raise SceneError(f"Nothing in '{self.name}' can touch a sensor: give at least one other object the role Target.")
        for sensor in self.sensors:
            sensor.parameters.check(sensor.name)
            sensor.painted.check(sensor.name, len(sensor.texels))
            if sensor.deformation is not None:
                sensor.deformation.check(sensor.name, (len(sensor.texels), 9))
        for target in self.targets:
            if not np.isfinite(target.mesh.vertices).all():
                raise SceneError(f"A vertex of '{target.name}' is NaN or infinite: check its mesh and what deforms it.")
            if target.deformation is not None:
                target.deformation.check(target.name, target.mesh.vertices.shape)
        for body in self.bodies:
            if body.moved_by_forces and not (np.isfinite(body.mass) and body.mass > 0):
                kind = "free" if body.free else "driven"
                raise ParameterError(f"The mass of {kind} body '{body.name}' is {body.mass:g} kg: give it a value above zero.")
            self._check_start(body)
            self._check_drive(body)
            path = (body.motion.positions, body.motion.quaternions)
            if not all(np.isfinite(values).all() for values in path):
                raise SceneError(f"The motion of '{body.name}' has a NaN or infinite pose: check its keyframes and drivers.")

    def _check_start(self, body: Body) -> None:
        for what, value in (("velocity", body.velocity), ("angular velocity", body.angular_velocity)):
            if not np.isfinite(value).all():
                raise ParameterError(f"The {what} of '{body.name}' at the start is NaN or infinite: give it three numbers.")
        for what, value in (("centre of mass", body.center_of_mass), ("inertia", body.inertia)):
            if not np.isfinite(value).all():
                raise ParameterError(f"The {what} of '{body.name}' is NaN or infinite: check its mesh and its mass.")
        if body.moved_by_forces and not (np.linalg.eigvalsh(body.inertia) > 0.0).all():
            raise ParameterError(
                f"The inertia of '{body.name}' is zero about some axis: give it a larger mass, or a shape with an extent."
            )

    def _check_drive(self, body: Body) -> None:
        drive = body.drive
        if drive is None:
            return
        if body.free:
            raise ParameterError(f"Body '{body.name}' is free and driven at once: choose one.")
        drive.check(body.name)
        if drive.leader is not None:
            leader = self.bodies[drive.leader].drive if 0 <= drive.leader < len(self.bodies) else None
            if leader is None or leader.leader is not None:
                raise SceneError(
                    f"Driven body '{body.name}' follows a body that has no drive of its own: choose another leader."
                )
        elif drive.control == "force" and not 0 <= drive.sensor < len(self.sensors):
            raise SceneError(f"Driven body '{body.name}' has no sensor for its force control: choose one.")

    def digest(self) -> str:
        """Return a hash of everything that the forces depend on; equal digests give equal recordings, bit for bit."""
        return digest_of(self)
