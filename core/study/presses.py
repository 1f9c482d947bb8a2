# SPDX-License-Identifier: GPL-3.0-or-later
"""Presses, slides and twists of an object at any place of a sensor's surface, with a depth or a force.

The object's z axis passes through the place, along the normal of the surface or tilted against it, and its lowest point along
that axis does the pressing. It approaches, holds, slides and turns if asked to, holds again, and goes back.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from math import inf, pi

import numpy as np

from ..errors import SceneError
from ..geometry.mesh import mass_properties
from ..geometry.rotations import quaternion_product, quaternions_from_vectors, rotation_matrices
from ..geometry.texels import Texels
from ..model.body import Body, Drive, Motion, Signal
from ..model.parameter import Parameter, specifications, specified
from ..model.scenario import Scenario
from ..model.sensor import Sensor

TWIST_STEPS = 16
"""Samples of a slide and twist; between two of them a turn has far less than half a revolution, so it is unique."""
FORCE_MARGIN = 4.0
"""Largest force of the drive of a press, per force that is asked for: enough to brake the object at the contact."""
SHORTEST_SETTLE = 1e-3
"""Seconds; a drive that looks at the sensor every millisecond reaches no force sooner."""
SETTLING_SHARE = 1 / 3
"""Time constant of the drive's integral, per time in which the force is reached."""
RELAXATION_SHARE = 1 / 16
"""Time in which the drive's damper yields to one texel, per time in which the force is reached. With these two, and no less
damping than is critical on one texel, forces of 0.05 to 5 N on texels of 58.5 to 10,000 N/m are within 5 % after `settle` and a
hold of 0.2 s; the default damping of a drive would take seconds on soft foam."""


@dataclass(frozen=True)
class Press:
    """One press. Lengths in metres, angles in radians; places and directions in the frame of the sensor's body.

    Attributes
    ----------
    sensor, target : str
        Names of the sensor and of the target whose body presses on it.
    place, across, along : float
        The place: `place` chooses a texel, each with a probability in proportion to its area, and the two others a point in a
        square of that area around it, along the texel's x and y axis.
    """

    sensor: str
    target: str
    # fmt: off
    place: float = specified(Parameter("place", "1", 0.5, 0.0, 1.0, "Share of the surface before the texel that is pressed"))
    across: float = specified(Parameter("across", "1", 0.5, 0.0, 1.0, "Where in the cell of the texel, along its x axis"))
    along: float = specified(Parameter("along", "1", 0.5, 0.0, 1.0, "Where in the cell of the texel, along its y axis"))
    depth: float = specified(Parameter("depth", "m", 1e-3, 0.0, inf, "Depth of the object's lowest point below the surface"))
    force: float = specified(Parameter(
        "force", "N", 0.0, 0.0, inf, "Sum of normal forces that is held instead of a depth; zero: the depth counts"))
    speed: float = specified(Parameter("speed", "m/s", 0.02, 0.0, inf, "Speed of approach and return", above_low=True))
    clearance: float = specified(Parameter("clearance", "m", 5e-4, 0.0, inf, "Distance from the place at the start"))
    tilt: float = specified(Parameter("tilt", "rad", 0.0, 0.0, 1.4, "Angle between the approach and the normal"))
    tilt_direction: float = specified(Parameter(
        "tilt_direction", "rad", 0.0, -inf, inf, "Direction of the tilt, from the texel's x axis to its y axis"))
    spin: float = specified(Parameter("spin", "rad", 0.0, -inf, inf, "Turn of the object about its z axis"))
    hold: float = specified(Parameter("hold", "s", 0.05, 0.0, inf, "Rest after the press, and after the slide"))
    slide: float = specified(Parameter("slide", "m", 0.0, 0.0, inf, "Length of the slide"))
    slide_direction: float = specified(Parameter(
        "slide_direction", "rad", 0.0, -inf, inf, "Direction of the slide, from the texel's x axis to its y axis"))
    slide_speed: float = specified(Parameter("slide_speed", "m/s", 0.02, 0.0, inf, "Speed of the slide", above_low=True))
    twist: float = specified(Parameter("twist", "rad", 0.0, -4 * pi, 4 * pi, "Turn about the approach during the slide"))
    twist_speed: float = specified(Parameter("twist_speed", "rad/s", 2.0, 0.0, inf, "Speed of the twist", above_low=True))
    settle: float = specified(Parameter("settle", "s", 0.3, 0.0, inf, "Time in which a force is reached, after the approach"))
    mass: float = specified(Parameter("mass", "kg", 0.1, 0.0, inf, "Of the object, when a force is held", above_low=True))
    # fmt: on


PRESS_PARAMETERS = specifications(Press)
"""The specifications of a press's numbers by name."""
PLACE_PARAMETERS = ("place", "across", "along")
"""Those that say where; a study varies them uniformly unless it says otherwise."""


def with_press(scenario: Scenario, press: Press) -> Scenario:
    """Return a scenario in which a target's body makes a press and nothing else; its frames end with the press.

    Raises
    ------
    SceneError
        There is no such sensor or target, both have one body, or the sensor's body moves.
    ParameterError
        A number is outside its bounds.
    """
    for name, specification in PRESS_PARAMETERS.items():
        specification.check(getattr(press, name), "the press")
    sensor, body = _sensor_of(scenario, press), _body_of(scenario, press)
    place, axis, sideways, upright = _frame(sensor.texels, press)
    lowest = min(float(target.mesh.vertices[:, 2].min()) for target in scenario.targets if target.body == body)
    times, depth, share = _phases(press)
    origin = place + (-(depth + lowest))[:, None] * axis + (share * press.slide)[:, None] * sideways
    turn = share * press.twist + press.spin
    own = quaternion_product(upright[None], quaternions_from_vectors(turn[:, None] * np.array([0.0, 0.0, 1.0])))
    base = scenario.bodies[sensor.body].motion
    to_world = rotation_matrices(base.quaternions[:1])[0]
    motion = Motion(times, base.positions[0] + origin @ to_world.T, quaternion_product(base.quaternions[:1], own))
    pressing = replace(scenario.bodies[body], motion=motion, free=False, drive=None)
    if press.force > 0.0:
        pressing = _driven(pressing, scenario, body, press, -to_world @ axis)
    bodies = tuple(pressing if index == body else other for index, other in enumerate(scenario.bodies))
    last = scenario.frame_start + max(1, math.ceil(times[-1] * scenario.fps - 1e-9))
    return replace(scenario, bodies=bodies, frame_end=last, interpolation="linear")


def place_of(scenario: Scenario, press: Press) -> np.ndarray:
    """Return the (3,) place of a press, metres, in the frame of the sensor's body."""
    return _place_on(_sensor_of(scenario, press).texels, press)[1]


def _frame(texels: Texels, press: Press) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the place, the unit vectors out of it and along the slide, and the object's upright orientation."""
    from scipy.spatial.transform import Rotation

    texel, place = _place_on(texels, press)
    normal, x_axis, y_axis = _axes_of(texels, texel)
    leaning = math.cos(press.tilt_direction) * x_axis + math.sin(press.tilt_direction) * y_axis
    # The object stands on the texel's frame and is turned about the axis that leans it.
    lean = quaternions_from_vectors((press.tilt * np.cross(normal, leaning))[None])[0]
    axis = math.cos(press.tilt) * normal + math.sin(press.tilt) * leaning
    sideways = math.cos(press.slide_direction) * x_axis + math.sin(press.slide_direction) * y_axis
    standing = np.roll(Rotation.from_matrix(np.stack([x_axis, y_axis, normal], axis=1)).as_quat(), 1)
    return place, axis, sideways, quaternion_product(lean[None], standing[None])[0]


def _place_on(texels: Texels, press: Press) -> tuple[int, np.ndarray]:
    """Return the texel that is pressed, and the (3,) place, m."""
    reached = np.cumsum(texels.area)
    texel = min(int(np.searchsorted(reached, press.place * reached[-1], side="right")), len(texels) - 1)
    side = math.sqrt(float(texels.area[texel]))
    _, x_axis, y_axis = _axes_of(texels, texel)
    place = texels.position[texel] + side * ((press.across - 0.5) * x_axis + (press.along - 0.5) * y_axis)
    return texel, place


def _axes_of(texels: Texels, texel: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return normal, x axis and y axis of a texel, (3,) each; :attr:`.Texels.bitangent` has the last one of all texels."""
    normal, x_axis = texels.normal[texel], texels.tangent[texel]
    return normal, x_axis, np.cross(normal, x_axis)


def _phases(press: Press) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times (m,) s, depths (m,) m and the share (m,) of slide and twist that is done, at the corners of the motion.

    A press with a force stays where it starts: its drive approaches.
    """
    depth = -press.clearance if press.force > 0.0 else press.depth
    approach = press.clearance / press.speed + press.settle if press.force > 0.0 else (depth + press.clearance) / press.speed
    sliding = max(press.slide / press.slide_speed, abs(press.twist) / press.twist_speed)
    corners = [(0.0, -press.clearance, 0.0), (approach, depth, 0.0), (press.hold, depth, 0.0)]
    if sliding > 0.0:
        corners += [(sliding / TWIST_STEPS, depth, step / TWIST_STEPS) for step in range(1, TWIST_STEPS + 1)]
        corners.append((press.hold, depth, 1.0))
    if press.force == 0.0:
        corners.append((approach, -press.clearance, corners[-1][2]))
    seconds, depths, shares = np.array([corners[0], *(corner for corner in corners if corner[0] > 0.0)]).T
    return np.cumsum(seconds), depths, shares


def _driven(body: Body, scenario: Scenario, index: int, press: Press, down: np.ndarray) -> Body:
    """Return a body with a drive that presses with a force along `down`, a unit vector in the world."""
    mesh = next(target.mesh for target in scenario.targets if target.body == index)
    center, inertia, _ = mass_properties(mesh, press.mass, press.target)
    number = next(i for i, sensor in enumerate(scenario.sensors) if sensor.name == press.sensor)
    stiffness, settle = scenario.sensors[number].parameters.k, max(press.settle, SHORTEST_SETTLE)
    weight = press.mass * float(np.linalg.norm(scenario.gravity))
    drive = Drive(
        control="force",
        target=Signal.constant(press.force),
        axis=down / np.linalg.norm(down),
        axis_in_world=True,
        max_force=FORCE_MARGIN * (press.force + weight),
        max_speed=press.speed,
        sensor=number,
        damping=max(RELAXATION_SHARE * settle * stiffness, 2.0 * math.sqrt(stiffness * press.mass)),
        settling=SETTLING_SHARE * settle,
    )
    return replace(body, drive=drive, mass=press.mass, center_of_mass=center, inertia=inertia)


def _sensor_of(scenario: Scenario, press: Press) -> Sensor:
    sensor = next((sensor for sensor in scenario.sensors if sensor.name == press.sensor), None)
    if sensor is None:
        known = ", ".join(f"'{sensor.name}'" for sensor in scenario.sensors)
        raise SceneError(f"There is no sensor '{press.sensor}' in '{scenario.name}' to press on: choose from {known}.")
    body = scenario.bodies[sensor.body]
    path = np.hstack([body.motion.positions, body.motion.quaternions])
    if body.moved_by_forces or np.abs(path - path[0]).max() > 1e-9:
        raise SceneError(f"The body of sensor '{press.sensor}' moves: a press needs a sensor that rests, remove its motion.")
    return sensor


def _body_of(scenario: Scenario, press: Press) -> int:
    """Return the index of the body that presses."""
    found = next((target.body for target in scenario.targets if target.name == press.target and target.sensor is None), None)
    if found is None:
        known = ", ".join(f"'{target.name}'" for target in scenario.targets if target.sensor is None) or "none"
        raise SceneError(f"There is no target '{press.target}' in '{scenario.name}' to press with: choose from {known}.")
    if any(sensor.body == found for sensor in scenario.sensors):
        raise SceneError(f"'{press.target}' has a sensor on its own body: press with a target that has none.")
    return found
