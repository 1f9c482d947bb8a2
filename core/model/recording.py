# SPDX-License-Identifier: GPL-3.0-or-later
"""The results of a run: per frame and texel, per frame and sensor, per frame and body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields

import numpy as np

PER_TEXEL = ("normal_force", "shear", "friction", "depth", "slip", "contact", "reading")
"""Names of the per-texel channels, in the order in which every exporter writes them."""


@dataclass
class SensorFrame:
    """One sensor at one frame. Forces act **on the sensor** and are given in the frame of the sensor's body.

    Attributes
    ----------
    normal_force : (n,) float, N
        Force along the surface normal of the target (paper, Eq. 8). Only the effect adhesion makes it negative.
    shear : (n, 2) float, N
        Components of the whole force along the x and y axes of the texel. On a flat sensor the shear of all texels adds up to
        the tangential part of `net_force`, apart from rounding.
    friction : (n,) float, N
        Magnitude of the friction force (Eq. 13), which is tangential to the target's surface. It never exceeds the limit
        of friction.
    depth : (n,) float, m
        Penetration, perpendicular to the target's surface (Eq. 4).
    slip : (n,) float, m/s
        Relative tangential speed (Eq. 6).
    contact : (n,) bool
    reading : (n,) float, the sensor's unit
    net_force : (3,) float, N
    net_torque : (3,) float, N·m
        About the origin of the sensor's body.
    centre_of_pressure : (3,) float, m
        Force-weighted mean of the contact points; zero while nothing touches.
    """

    normal_force: np.ndarray
    shear: np.ndarray
    friction: np.ndarray
    depth: np.ndarray
    slip: np.ndarray
    contact: np.ndarray
    reading: np.ndarray
    net_force: np.ndarray
    net_torque: np.ndarray
    centre_of_pressure: np.ndarray


@dataclass
class Frame:
    """All sensors and all bodies at one frame.

    Attributes
    ----------
    frame : int
    time : float, seconds since the first frame
    sensors : dict of str to SensorFrame
        By sensor name; pads are not in it.
    poses : (b, 7) float
        Origin (m) and orientation quaternion (w, x, y, z) of each body's frame, in the world.
    velocities : (b, 6) float
        Linear velocity of the centre of mass (m/s) and angular velocity (rad/s), in the world.
    """

    frame: int
    time: float
    sensors: dict[str, SensorFrame]
    poses: np.ndarray
    velocities: np.ndarray


@dataclass
class SensorRecording:
    """The frames of one sensor stacked: every array of :class:`SensorFrame` with a leading axis of length F."""

    normal_force: np.ndarray
    shear: np.ndarray
    friction: np.ndarray
    depth: np.ndarray
    slip: np.ndarray
    contact: np.ndarray
    reading: np.ndarray
    net_force: np.ndarray
    net_torque: np.ndarray
    centre_of_pressure: np.ndarray

    def at(self, i: int) -> SensorFrame:
        """Return the recorded frame with index `i`."""
        return SensorFrame(**{item.name: getattr(self, item.name)[i] for item in fields(self)})


@dataclass
class Recording:
    """A finished run.

    Attributes
    ----------
    frames : (F,) int
    times : (F,) float, seconds
    sensors : dict of str to SensorRecording
    body_names : tuple of str
    poses : (F, b, 7) float
    velocities : (F, b, 6) float
    dt : float, seconds
        The substep that was used.
    step_reason : str
        Why this substep was used, in words for the user.
    digest : str
        :meth:`.Scenario.digest` of the scenario that was solved.
    warnings : tuple of str
        What the user should know (a texel bottomed out, a mesh was repaired), one sentence each.
    """

    frames: np.ndarray
    times: np.ndarray
    sensors: dict[str, SensorRecording]
    body_names: tuple[str, ...]
    poses: np.ndarray
    velocities: np.ndarray
    dt: float
    digest: str = ""
    warnings: tuple[str, ...] = field(default=())
    step_reason: str = ""

    @classmethod
    def stack(
        cls,
        frames: list[Frame],
        body_names: Sequence[str],
        dt: float,
        digest: str = "",
        warnings: Sequence[str] = (),
        step_reason: str = "",
    ) -> Recording:
        """Return the recording of frames that are given in order."""
        sensors = {
            name: SensorRecording(
                **{
                    item.name: np.stack([getattr(frame.sensors[name], item.name) for frame in frames])
                    for item in fields(SensorFrame)
                }
            )
            for name in frames[0].sensors
        }
        return cls(
            frames=np.array([frame.frame for frame in frames]),
            times=np.array([frame.time for frame in frames]),
            sensors=sensors,
            body_names=tuple(body_names),
            poses=np.stack([frame.poses for frame in frames]),
            velocities=np.stack([frame.velocities for frame in frames]),
            dt=dt,
            digest=digest,
            warnings=tuple(warnings),
            step_reason=step_reason,
        )

    def at(self, frame: int) -> Frame:
        """Return one recorded frame by its frame number; raises KeyError when it was not recorded."""
        (found,) = np.nonzero(self.frames == frame)
        if len(found) == 0:
            raise KeyError(frame)
        i = int(found[0])
        return Frame(
            frame=frame,
            time=float(self.times[i]),
            sensors={name: sensor.at(i) for name, sensor in self.sensors.items()},
            poses=self.poses[i],
            velocities=self.velocities[i],
        )
