# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays of a scenario for the kernels: :class:`SolverModel`, which is constant, and :class:`State`, which steps change."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..compiled.struct_reference import by_reference
from ..effects.engine.compiled_program import EffectProgram

NO_TRIANGLE, TOO_DEEP = -1, -2
"""Instead of a triangle in :attr:`State.triangle`: nothing is touched; the point was pressed past its maximum penetration."""


@by_reference
class Bodies(NamedTuple):
    """The b bodies of a run.

    Attributes
    ----------
    mode : (b,) int
        :class:`.Mode` of each.
    first_unknown : (b,) int
        Index of each body's first unknown in the linear system: a free body has six, a driven one has one, which coupled bodies
        share; -1 for keyframed bodies.
    unknowns : int
        Number of unknowns of all bodies together.
    mass : (b,) float, kg
    inertia : (b, 3, 3) float, kg·m², body axes
    inverse_inertia : (b, 3, 3) float, 1/(kg·m²), body axes
        Zero for bodies that are not free.
    gravity : (3,) float, m/s²
    initial_velocity : (b, 3) float, m/s
        Of each free body at the start of the run; zero for the others.
    """

    mode: np.ndarray
    first_unknown: np.ndarray
    unknowns: int
    mass: np.ndarray
    inertia: np.ndarray
    inverse_inertia: np.ndarray
    gravity: np.ndarray
    initial_velocity: np.ndarray


@by_reference
class Sensors(NamedTuple):
    """The m sensors of a run.

    Attributes
    ----------
    first_point : (m + 1,) int
        Where the contact points of each sensor begin among all of them.
    max_penetration : (m,) float, metres
    center : (m, 3) float, metres
        Centre of a sphere around each sensor's contact points and their segments, in its body's frame relative to the
        reference point.
    radius : (m,) float, metres
        Of that sphere.
    """

    first_point: np.ndarray
    max_penetration: np.ndarray
    center: np.ndarray
    radius: np.ndarray


@by_reference
class Points(NamedTuple):
    """The N contact points of all sensors.

    Attributes
    ----------
    frame : (N, 12) float
        Position and normal of each contact point, x axis and y axis of its texel, in its body's frame and relative to the
        body's reference point.
    texel : (N,) int
        Texel that each point belongs to, counted through all sensors.
    multipliers : (N, 2) float
        Painted multipliers of each point's stiffness and friction; without rows when nothing is painted.
    """

    frame: np.ndarray
    texel: np.ndarray
    multipliers: np.ndarray


@by_reference
class Pairs(NamedTuple):
    """The q pairs of a sensor and a target that can touch.

    A large sensor has several pairs with each target, one after the other, each with some of its points, for threads to share.

    Attributes
    ----------
    sensor, target : (q,) int
    sensor_body, target_body : (q,) int
    first_point, stop_point : (q,) int
        Range of the contact points of each pair.
    first_slot : (q,) int
        Where the memory of each pair begins in :class:`State`; a pair has one slot for each of its contact points.
    law : (q, 10) float
        Contact law of one contact point of each pair: the fields of :class:`.ContactLaw`.
    force_weight : (q,) float
        Factor with which the pair's force moves the bodies (see :mod:`.contact_law`).
    force_share : (q,) float
        Share of a texel's force with which one of its contact points moves the bodies, the weight included.
    overlap_share : (q,) float
        Share of the overlap that the sensor's own skin takes.
    max_tube_radius, max_list_radius : (q,) float, metres
        Largest distance that a contact point may move before its neighbour list is rebuilt: for tubes that hold one sheet
        or nothing, and for lists of triangles.
    """

    sensor: np.ndarray
    target: np.ndarray
    sensor_body: np.ndarray
    target_body: np.ndarray
    first_point: np.ndarray
    stop_point: np.ndarray
    first_slot: np.ndarray
    law: np.ndarray
    force_weight: np.ndarray
    force_share: np.ndarray
    overlap_share: np.ndarray
    max_tube_radius: np.ndarray
    max_list_radius: np.ndarray


@by_reference
class Drives(NamedTuple):
    """The d actuators of a run.

    Attributes
    ----------
    of_body : (b,) int
        Actuator of each body, -1 without one; coupled bodies share it.
    axis : (b, 3) float
        Direction in which the actuator of each driven body moves it.
    axis_in_world : (b,) bool
        The axis is given in the world's frame; otherwise in the body's.
    unknown : (d,) int
        Index of each actuator's unknown, its speed, in the linear system.
    gains : (d, 4) float
        Columns STIFFNESS, DAMPING, MAX_FORCE and MAX_SPEED of :mod:`.actuators`.
    """

    of_body: np.ndarray
    axis: np.ndarray
    axis_in_world: np.ndarray
    unknown: np.ndarray
    gains: np.ndarray


@by_reference
class SolverModel(NamedTuple):
    """Constants of a run.

    Attributes
    ----------
    bodies : Bodies
    sensors : Sensors
    points : Points
    pairs : Pairs
    drives : Drives
    effects : EffectProgram
        The sensors' effects on forces.
    """

    bodies: Bodies
    sensors: Sensors
    points: Points
    pairs: Pairs
    drives: Drives
    effects: EffectProgram


@by_reference
class State(NamedTuple):
    """State of a run between two steps; copied, it is a checkpoint.

    Attributes
    ----------
    position : (b, 3) float, metres
        Reference point of each body: centre of mass of a free or driven one, origin of a keyframed one.
    quaternion : (b, 4) float
    velocity : (b, 6) float
        Linear (m/s) and angular (rad/s), world axes.
    triangle : (s,) int
        Triangle that the contact point of each slot met last, or NO_TRIANGLE or TOO_DEEP.
    bristle : (s, 3) float, metres
        Bristle deflection, in the frame of the sensor's body.
    pressed_share : (s,) float
        Share of the maximum penetration that is pressed in.
    drives : (d, 3) float
        Columns TRAVEL (m), SPEED (m/s) and FORCE (N) of :mod:`.actuators`.
    effect_memory : (N, columns) float
        What effects remember, by contact point.
    stored_energy : (q,) float, joules
        Energy that was put into the contacts of each pair and has not come out again (see :func:`.check_energy`).
    """

    position: np.ndarray
    quaternion: np.ndarray
    velocity: np.ndarray
    triangle: np.ndarray
    bristle: np.ndarray
    pressed_share: np.ndarray
    drives: np.ndarray
    effect_memory: np.ndarray
    stored_energy: np.ndarray
