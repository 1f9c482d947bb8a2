# SPDX-License-Identifier: GPL-3.0-or-later
"""The plain-data description of a run: everything the solver needs and nothing of Blender."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ..effects.engine.registry import check as check_effects
from ..effects.engine.registry import placed
from ..effects.engine.specification import Effect
from ..errors import ParameterError, SceneError
from ..geometry.mesh import TriangleMesh
from ..geometry.texels import Texels

HUNT_CROSSLEY = "hunt-crossley"
NORMAL_LAWS = ("linear", HUNT_CROSSLEY)
"""What the normal force may be: Eq. 8 of the paper, or ``k dᵖ (1 + 3/2 α ḋ)``."""


MOST_POINTS = 100
"""Contact points that a texel may have."""


@dataclass(frozen=True)
class SensorParameters:
    """What one texel is made of; names as in the paper's Tables 1 and 2, every value per texel.

    Attributes
    ----------
    k : float, N/m
        Normal stiffness (Eq. 8, 18).
    cn : float, N·s/m
        Normal damping (Eq. 8); about 1 % of `k` in number.
    ct : float, N·s/m
        Tangential viscous damping (Eq. 13).
    sigma0 : float, N/m
        Bristle stiffness (Eq. 9, 13).
    sigma1 : float, N·s/m
        Bristle damping (Eq. 13).
    x0 : float, m/s
        Stribeck velocity (Eq. 10).
    mus, mud : float
        Static and dynamic friction coefficients (Eq. 11, 12).
    max_penetration : float, m
        Depth past which a texel no longer acts (section 3.3.3: about twice the foam's thickness).
    normal_law : str
        One of :data:`NORMAL_LAWS`.
    exponent : float
        `p` in the law of Hunt and Crossley (J. Appl. Mech. 42, 1975), whose `k` then is in N/mᵖ; 3/2 is Hertz's.
    dissipation : float, s/m
        `α` in that law, which has no `cn`: slow impacts at speed v leave with ``(1 - α v) v``.
    points_per_texel : int
        Contact points in the cell of each texel, a square number; they share out all that the texel's spring, damper and
        bristles do.
    gain, zero : float
        Linear conversion to what the sensor reports: ``reading = zero + gain · force``, in `unit`.
    unit : str
    """

    k: float = 58.5
    cn: float = 0.0583
    ct: float = 0.01
    sigma0: float = 1.0
    sigma1: float = 0.1
    x0: float = 0.3
    mus: float = 0.435
    mud: float = 0.23
    max_penetration: float = 0.012
    normal_law: str = "linear"
    exponent: float = 1.5
    dissipation: float = 0.2
    points_per_texel: int = 1
    gain: float = 1.0
    zero: float = 0.0
    unit: str = "N"

    def check(self, name: str) -> None:
        """Raise :class:`ParameterError` for the first value that means nothing."""
        for key in ("k", "sigma0", "x0", "max_penetration"):
            value = getattr(self, key)
            if not (np.isfinite(value) and value > 0):
                raise ParameterError(f"{key} of sensor '{name}' is {value:g}: give it a value above zero.")
        for key in ("cn", "ct", "sigma1", "mus", "mud"):
            value = getattr(self, key)
            if not (np.isfinite(value) and value >= 0):
                raise ParameterError(f"{key} of sensor '{name}' is {value:g}: give it a value of zero or more.")
        if not 1 <= self.points_per_texel <= MOST_POINTS or math.isqrt(self.points_per_texel) ** 2 != self.points_per_texel:
            raise ParameterError(
                f"points_per_texel of sensor '{name}' is {self.points_per_texel}: "
                f"give it a square number, as 1, 4 or 9, of at most {MOST_POINTS}."
            )
        if self.normal_law not in NORMAL_LAWS:
            raise ParameterError(
                f"The normal law of sensor '{name}' is '{self.normal_law}': use one of {', '.join(NORMAL_LAWS)}."
            )
        if not 1.0 <= self.exponent <= 4.0:
            raise ParameterError(f"exponent of sensor '{name}' is {self.exponent:g}: give it a value from 1 to 4.")
        if not (np.isfinite(self.dissipation) and self.dissipation >= 0):
            raise ParameterError(f"dissipation of sensor '{name}' is {self.dissipation:g}: give it a value of zero or more.")
        if self.mud > self.mus:
            raise ParameterError(
                f"mud of sensor '{name}' ({self.mud:g}) is larger than mus ({self.mus:g}): "
                "dynamic friction cannot exceed static friction, lower mud or raise mus."
            )
        if not (np.isfinite(self.gain) and np.isfinite(self.zero) and self.gain != 0):
            raise ParameterError(f"gain and zero of sensor '{name}' must be finite and gain not zero.")


@dataclass(frozen=True)
class Painted:
    """Multipliers of a sensor's parameters, texel by texel; None is one everywhere.

    Attributes
    ----------
    k : (n,) float or None
        Of `k` and `cn`, as for more or less of the same foam.
    friction : (n,) float or None
        Of `mus` and `mud`.
    gain : (n,) float or None
        Of `gain`.
    """

    k: np.ndarray | None = None
    friction: np.ndarray | None = None
    gain: np.ndarray | None = None

    def check(self, name: str, count: int) -> None:
        """Raise :class:`ParameterError` for multipliers that mean nothing; `count` is the number of texels."""
        for item in fields(self):
            values = getattr(self, item.name)
            if values is None:
                continue
            if values.shape != (count,):
                raise ParameterError(
                    f"The painted {item.name} of sensor '{name}' has {len(values)} values for {count} texels: paint it anew."
                )
            lowest = 0.0 if item.name == "friction" else np.nextafter(0.0, 1.0)
            if not (np.isfinite(values).all() and values.min(initial=1.0) >= lowest):
                raise ParameterError(
                    f"The painted {item.name} of sensor '{name}' is {values.min():g} at texel {values.argmin()}: "
                    "give every texel a factor above zero."
                )


@dataclass(frozen=True)
class Motion:
    """Poses of a body's frame over time; what is between the samples, :attr:`Scenario.interpolation` says.

    Attributes
    ----------
    times : (m,) float, seconds, increasing
    positions : (m, 3) float, metres, world frame
    quaternions : (m, 4) float, unit, (w, x, y, z), body to world
    """

    times: np.ndarray
    positions: np.ndarray
    quaternions: np.ndarray

    @classmethod
    def at_rest(cls, position: ArrayLike = (0.0, 0.0, 0.0), quaternion: ArrayLike = (1.0, 0.0, 0.0, 0.0)) -> Motion:
        """Return the motion of a body that stays where it is."""
        return cls(np.zeros(1), np.atleast_2d(np.array(position, float)), np.atleast_2d(np.array(quaternion, float)))

    def extended(self, time: float, position: np.ndarray, quaternion: np.ndarray) -> Motion:
        """Return this motion with one more sample at its end (the timeline learns poses frame by frame)."""
        return Motion(
            np.append(self.times, time), np.vstack([self.positions, position]), np.vstack([self.quaternions, quaternion])
        )


@dataclass(frozen=True)
class Signal:
    """A number over time: linear between samples, held before the first and after the last.

    Attributes
    ----------
    times : (m,) float, seconds, increasing
    values : (m,) float
    """

    times: np.ndarray
    values: np.ndarray

    @classmethod
    def constant(cls, value: float) -> Signal:
        """Return the signal that never changes."""
        return cls(np.zeros(1), np.array([float(value)]))

    def at(self, times: np.ndarray) -> np.ndarray:
        """(n,) values at (n,) times."""
        return np.interp(times, self.times, self.values)

    def extended(self, time: float, value: float) -> Signal:
        """Return this signal with one more sample at its end."""
        return Signal(np.append(self.times, time), np.append(self.values, value))


CONTROLS = ("position", "velocity", "force")
"""What the target of a :class:`Drive` is: metres along the axis, metres per second, or newtons of a sensor's tactile sum."""


@dataclass(frozen=True)
class Drive:
    """A servo that slides its body along one axis, with no more than a certain force.

    The body's motion is that of its carrier: the drive adds a way along the axis. The servo's force is
    ``stiffness (x* - x) + damping (v* - v)`` with its own weight and its carrier's acceleration fed forward, all of it
    together limited to `max_force`.

    Attributes
    ----------
    control : str
        One of :data:`CONTROLS`.
    target : Signal
        In m from where the motion has the body, m/s, or N.
    axis : (3,) float
        Unit vector, the direction of positive ways; a finger closes along it.
    axis_in_world : bool
        True when the axis stands still in the world; False when it is given in the body's own frame and turns along.
    stiffness, damping : float, N/m and N·s/m
    max_force : float, N
    max_speed : float, m/s
        That the servo asks for; force control approaches with it.
    sensor : int
        For force control: the sensor whose tactile sum is controlled.
    settling, period : float, seconds
        For force control: time constant of :class:`.grip_controller.GripControl`, and how often it is asked.
    leader : int or None
        Body whose drive moves this body as well, each along its own axis by the same way, as the two fingers of a parallel
        gripper; then only the axis of this drive counts. What is said of forces is said of each of them.
    """

    control: str = "position"
    target: Signal = field(default_factory=lambda: Signal.constant(0.0))
    axis: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    axis_in_world: bool = False
    stiffness: float = 1e5
    damping: float = 1e3
    max_force: float = 40.0
    max_speed: float = 0.05
    sensor: int = -1
    settling: float = 0.1
    period: float = 1e-3
    leader: int | None = None

    def check(self, name: str) -> None:
        """Raise :class:`ParameterError` for the first value that means nothing."""
        if self.control not in CONTROLS:
            raise ParameterError(f"The control of '{name}' is '{self.control}': choose one of {', '.join(CONTROLS)}.")
        for key in ("damping", "max_speed", "settling", "period"):
            value = getattr(self, key)
            if not (np.isfinite(value) and value > 0):
                raise ParameterError(f"{key} of driven body '{name}' is {value:g}: give it a value above zero.")
        for key in ("stiffness", "max_force"):
            value = getattr(self, key)
            if not (np.isfinite(value) and value >= 0):
                raise ParameterError(f"{key} of driven body '{name}' is {value:g}: give it a value of zero or more.")
        if not (np.isfinite(self.axis).all() and abs(np.linalg.norm(self.axis) - 1.0) < 1e-6):
            raise ParameterError(f"The axis of driven body '{name}' is not a unit vector: give it a direction.")
        if not np.isfinite(self.target.values).all():
            raise ParameterError(f"The target of driven body '{name}' is NaN or infinite: check its keyframes and drivers.")


@dataclass(frozen=True)
class Deformation:
    """A surface that changes its shape in its body's frame; linear between samples, held before the first and after the last.

    Attributes
    ----------
    times : (m,) float, seconds, increasing
    values : (m, n, c) float
        Of a target: position of each vertex of its mesh, metres. Of a sensor: position (m), normal and tangent of each texel.
    """

    times: np.ndarray
    values: np.ndarray

    def extended(self, time: float, values: np.ndarray) -> Deformation:
        """Return this with one more sample at its end and all but the last two left out (the timeline looks only ahead)."""
        return Deformation(np.append(self.times[-1:], time), np.concatenate([self.values[-1:], values[None]]))

    def check(self, name: str, shape: tuple[int, ...]) -> None:
        """Raise :class:`SceneError` when the samples do not fit a surface of `shape`, or one is no number."""
        if self.values.shape != (len(self.times), *shape):
            raise SceneError(
                f"'{name}' deforms with {self.values.shape[1]} vertices and has {shape[0]}: "
                "use modifiers that keep the number of vertices."
            )
        if not np.isfinite(self.values).all():
            time = self.times[np.flatnonzero(~np.isfinite(self.values).all(axis=(1, 2)))[0]]
            raise SceneError(
                f"A vertex of '{name}' is NaN or infinite {time:g} s after the first frame: check what deforms it."
            )


@dataclass(frozen=True)
class Body:
    """A rigid body: free when forces move it, driven when it has a drive, else keyframed.

    Attributes
    ----------
    name : str
    motion : Motion
        Of a keyframed body: its path. Of a driven body: its path without the way of its drive. Of a free body: the first
        sample is where it starts.
    free : bool
        True when forces move it, False when `motion` does.
    drive : Drive or None
    mass : float, kg
    center_of_mass : (3,) float, metres, body frame
    inertia : (3, 3) float, kg·m², about the centre of mass, body axes
    velocity, angular_velocity : (3,) float, m/s and rad/s, world frame
        A free body's start.
    """

    name: str
    motion: Motion
    free: bool = False
    mass: float = 1.0
    center_of_mass: np.ndarray = field(default_factory=lambda: np.zeros(3))
    inertia: np.ndarray = field(default_factory=lambda: np.eye(3))
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))
    angular_velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))
    drive: Drive | None = None

    @property
    def moved_by_forces(self) -> bool:
        """Whether forces have a say in where it goes: it is free or driven."""
        return self.free or self.drive is not None


@dataclass(frozen=True)
class Sensor:
    """Texels on a body, which differ by what is painted. With `readout` False it is a pad: it acts, and reports nothing.

    Its `effects` are what the base model leaves out (:mod:`.effects`); each has its place, so their order matters only between
    two of a kind.
    """

    name: str
    body: int
    texels: Texels
    parameters: SensorParameters = field(default_factory=SensorParameters)
    readout: bool = True
    painted: Painted = field(default_factory=Painted)
    deformation: Deformation | None = None
    effects: tuple[Effect, ...] = ()

    @property
    def mounted(self) -> Texels:
        """The texels where they really are, with the effects that move them."""
        texels = self.texels
        position, normal, tangent = placed(self.effects, texels.position, texels.normal, texels.tangent)
        return texels if position is texels.position else replace(texels, position=position, normal=normal, tangent=tangent)

    @cached_property
    def settings_digest(self) -> str:
        """Hash of the parameters, of what is painted and of the effects."""
        return digest_of((self.parameters, self.painted, self.effects))


@dataclass(frozen=True)
class Target:
    """A surface that presses on sensors.

    Attributes
    ----------
    name : str
    body : int
    mesh : TriangleMesh
        In the frame of its body, metres; its shape at the first frame.
    deformation : Deformation or None
        Where its vertices go, when it is not rigid.
    sensor : int or None
        The sensor whose surface this is, when it is soft: sensors then feel each other.
    smooth : bool
        Whether the contact normals are interpolated between the vertices, as for smooth shading, or those of the triangles.
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
        `Sensor.body` and `Target.body` index `bodies`. A sensor never touches the targets of its own body.
    frame_start, frame_end : int
        Frames that are recorded, both included; time zero is `frame_start`.
    fps : float
        Frames per second.
    gravity : (3,) float, m/s²
    dt : float or None, seconds
        Longest substep. None: the adviser chooses (:mod:`.time_step_adviser`).
    interpolation : str
        Of motions between their samples, ``linear`` or ``smooth`` (:mod:`.pose_interpolation`).
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

    def check(self) -> None:
        """Raise a :class:`PalpateError` when the parts do not make a run."""
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
            if target.deformation is not None:
                target.deformation.check(target.name, target.mesh.vertices.shape)
            check_effects(sensor.effects, sensor.name, len(sensor.texels), sensor.parameters.gain)
        for body in self.bodies:
            if body.moved_by_forces and not (np.isfinite(body.mass) and body.mass > 0):
                kind = "free" if body.free else "driven"
                raise ParameterError(f"The mass of {kind} body '{body.name}' is {body.mass:g} kg: give it a value above zero.")
            self._check_drive(body)
            path = (body.motion.positions, body.motion.quaternions)
            if not all(np.isfinite(values).all() for values in path):
                raise SceneError(f"The motion of '{body.name}' has a NaN or infinite pose: check its keyframes and drivers.")

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


def digest_of(value: object) -> str:
    """Return a hash of a description: a dataclass of numbers, words, arrays and others of its kind, or a tuple of them."""
    digest = hashlib.sha256(b"palpate-scenario/1")
    _feed(digest, value)
    return digest.hexdigest()


def _feed(digest: hashlib._Hash, value: object) -> None:
    """Hash dataclasses field by field, arrays with type and shape, and everything else by its representation."""
    if is_dataclass(value) and not isinstance(value, type):
        for item in fields(value):
            digest.update(item.name.encode())
            _feed(digest, getattr(value, item.name))
    elif isinstance(value, tuple | list):
        digest.update(f"[{len(value)}".encode())
        for item in value:
            _feed(digest, item)
    elif isinstance(value, dict):
        _feed(digest, sorted(value.items()))
    elif isinstance(value, np.ndarray):
        array = np.ascontiguousarray(value)
        digest.update(f"{array.dtype.str}{array.shape}".encode())
        digest.update(array.tobytes())
    else:
        digest.update(repr(value).encode())
