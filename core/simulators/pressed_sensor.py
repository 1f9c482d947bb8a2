# SPDX-License-Identifier: GPL-3.0-or-later
"""A sensor inside the loop of another simulator: poses in, forces of texels out, and the wrench that goes back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..errors import ParameterError
from ..geometry.mesh import TriangleMesh
from ..geometry.rotations import rotation_matrices
from ..model.body import Body
from ..model.motion import Motion
from ..model.recording import SensorFrame
from ..model.scenario import Scenario
from ..model.target import Target
from ..solver.simulation import Simulation
from .sensor_on_mesh import SensorOnMesh

Pose = tuple[ArrayLike, ArrayLike]
"""Position (3,) in metres and quaternion (4,), (w, x, y, z), of a frame in the world."""
LAST_FRAME = 2**31 - 1
"""A run ends here: after three days of steps of 0.1 ms."""


@dataclass(frozen=True)
class Contact:
    """What a sensor measures at one step, and the reaction.

    Attributes
    ----------
    texels : SensorFrame
        Force, shear, depth, slip and reading of each texel, on the sensor, in the frame of the sensor.
    force_on_target, torque_on_target : (3,) float, N and N·m
        In the world; the torque is about the origin of the target's frame. On the sensor's body acts the opposite.
    """

    texels: SensorFrame
    force_on_target: np.ndarray
    torque_on_target: np.ndarray


class PressedSensor:
    """A sensor and one thing that presses on it, both moved by another program.

    Parameters
    ----------
    item : SensorOnMesh
        As :func:`.read_probe_list` or :func:`.sensors_on_meshes` returns it.
    target : TriangleMesh
        In the frame of what presses, metres.
    dt : float, seconds
        Step of the other program.
    sensor_pose, target_pose : Pose
        At the start.

    Raises
    ------
    PalpateError
        The sensor, the mesh or the step makes no run.

    Notes
    -----
    The forces at the end of a step follow from where both are then and how they came there. The other program integrates them
    explicitly, so its step has to be below m / c and 2 √(m / K), for a mass m on all texels it covers together, of stiffness K
    and damping c.
    """

    def __init__(self, item: SensorOnMesh, target: TriangleMesh, dt: float, sensor_pose: Pose, target_pose: Pose):
        if not (np.isfinite(dt) and dt > 0):
            raise ParameterError(f"The step is {dt:g} s: give a number above zero.")
        starts = [Motion.at_rest(*map(np.asarray, pose)) for pose in (sensor_pose, target_pose)]
        self._name = item.name
        self._simulation = Simulation(
            Scenario(
                bodies=(Body("sensor", starts[0]), Body("target", starts[1])),
                sensors=(item.sensor,),
                targets=(Target("target", 1, target),),
                frame_start=0,
                frame_end=LAST_FRAME,
                fps=1.0 / dt,
                dt=dt,
            )
        )

    def step(self, sensor_pose: Pose, target_pose: Pose) -> Contact:
        """Go on by one step, to these poses, and return the forces there.

        Raises
        ------
        ParameterError
            A pose is not finite, or a quaternion is zero.
        """
        poses = {0: _checked(sensor_pose, "sensor"), 1: _checked(target_pose, "target")}
        self._simulation.extend(poses)
        texels = self._simulation.advance().sensors[self._name]
        (origin, turn), (place, _) = poses[0], poses[1]
        rotation = rotation_matrices(turn[None])[0]
        force, torque = rotation @ texels.net_force, rotation @ texels.net_torque
        return Contact(texels, -force, -(torque + np.cross(origin - place, force)))


def _checked(pose: Pose, whose: str) -> tuple[np.ndarray, np.ndarray]:
    position, quaternion = (np.array(part, float) for part in pose)
    length = np.linalg.norm(quaternion)
    if position.shape != (3,) or quaternion.shape != (4,) or not np.isfinite(position).all() or not 0 < length < np.inf:
        raise ParameterError(f"The pose of the {whose} is no position and quaternion of finite numbers: check its simulation.")
    return position, quaternion / length
