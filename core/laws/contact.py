# SPDX-License-Identifier: GPL-3.0-or-later
"""The contact law of one texel: penalty normal force and LuGre friction (paper, section 3.2, with its errata).

Where the print is wrong or silent, this is what is computed (docs/model.md has the whole story):

* Eq. 8: with `d` the penetration and ḋ its rate, ``fn = max(k d + cn ḋ, 0)``, along the object's surface normal. No adhesion.
  On request the law of Hunt and Crossley in its place: ``fn = max(k dᵖ (1 + 3/2 α ḋ), 0)``.
* Eq. 10: ``g = fn (mud + (mus - mud) exp(-|v|² / x0²))``; the exponential was lost in print.
* Eq. 9, 13 as printed: ``ż = v - sigma0 |v| / g · z`` and ``ft = sigma0 z + sigma1 ż + ct v``.
* The bristle deflection is carried along as the texel and the surface under it turn, and never exceeds what static friction
  can hold (``sigma0 |z| ≤ mus fn``): where the normal force falls faster than the bristles can slide, Eq. 9 alone would leave
  friction without a normal force.

Over a substep the relative velocity is taken as constant, for which Eq. 9 has a closed solution: no step size makes it blow up.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..compiled.kernels import inlined, kernel
from ..compiled.struct_reference import by_reference
from ..effects.engine.compiled_program import EffectProgram
from ..model.sensor_parameters import HUNT_CROSSLEY, SensorParameters

# Contact rows: one per touching texel and target, in the frame of the sensor's body; they are all that the solver's inner loop
# reads. LANES of them make a block, in which each column lies in one piece: row r of a pair is `rows[block, COLUMN + lane]`,
# block and lane being divmod(r, LANES). A loop over the lanes then runs in vector registers, several rows at a time. Each pair
# begins with a block of its own, and the lanes that its last block leaves over are zero, which is a contact without force.
LANES = 16
NX, NY, NZ = (LANES * i for i in range(3))  # the target's outward normal
PX, PY, PZ = (LANES * i for i in range(3, 6))  # contact point from the body's reference point, m
ZX, ZY, ZZ = (LANES * i for i in range(6, 9))  # bristle deflection, m
DEPTH = LANES * 9  # m
KEEP, GAIN = LANES * 10, LANES * 11  # z(t + dt) = KEEP z + GAIN v
LIMIT = LANES * 12  # largest |z|, m
# Written only where they are not the same for all contacts of a pair: the tangent of the normal law (N, N·s/m), the
# multiplier of the friction coefficients, and what is added to ct (N·s/m).
NORMAL_BIAS, NORMAL_SLOPE = LANES * 13, LANES * 14
FRICTION_SCALE, EXTRA_VISCOSITY = LANES * 15, LANES * 16
ROW = LANES * 17

# Columns of a parameter row, one per sensor or pad.
K, CN, CT, SIGMA0, SIGMA1, X0, MUS, MUD, EXPONENT, DISSIPATION = range(10)
PARAMETERS = 10
LINEAR = 0.0
"""In the place of the exponent: Eq. 8. Any other exponent is that of Hunt and Crossley's law."""


def parameter_row(parameters: SensorParameters, share: float = 1.0, part: float = 1.0) -> np.ndarray:
    """Return the numbers of the contact law as the kernels want them, (PARAMETERS,) float.

    Parameters
    ----------
    parameters : SensorParameters
    share : float
        Of the forces of a texel; one of several contact points has only its share of them.
    part : float
        Of the depth and its rate, and of the way of the bristles, that is the sensor's own (see :mod:`.series_compliance`).
    """
    p = parameters
    exponent = p.exponent if p.normal_law == HUNT_CROSSLEY else LINEAR
    row = np.array([p.k, p.cn, p.ct, p.sigma0, p.sigma1, p.x0, p.mus, p.mud, exponent, p.dissipation], dtype=float)
    row[[K, CN, CT, SIGMA0, SIGMA1]] *= share * part
    row[X0] /= part
    if exponent != LINEAR:
        row[K] *= part ** (exponent - 1.0)
        row[DISSIPATION] *= part
    return row


def stribeck_force(normal_force: np.ndarray, speed: np.ndarray, parameters: SensorParameters) -> np.ndarray:
    """Return what friction can hold at a sliding speed, ``g`` of Eq. 10.

    Parameters
    ----------
    normal_force : (...) float, N
    speed : (...) float, m/s
    parameters : SensorParameters
    """
    row = parameter_row(parameters)
    return normal_force * np.array([stribeck_coefficient(v * v, row) for v in np.ravel(speed)]).reshape(np.shape(speed))


@by_reference
class SolverModel(NamedTuple):
    """What does not change during a run: b bodies, m sensors with N contact points, q pairs of sensor and target.

    A large sensor has several pairs with each target, one after the other, each with some of its points, for threads to share.

    Attributes
    ----------
    points : (N, 12) float
        Position and normal of each contact point, x axis and y axis of its texel, in its body's frame and relative to the
        body's reference point.
    point_start : (m + 1,) int
    texel : (N,) int
        Whose contact point it is, counted through all sensors.
    parameters : (q, PARAMETERS) float
        Of one contact point of each pair's sensor.
    weight : (q,) float
        How much of what a pair's sensor feels moves the bodies.
    painted : (N, 2) float
        Multipliers of each contact point's stiffness and friction; without rows when nothing is painted.
    reach : (m,) float, metres
        Maximum penetration.
    pairs : (q, 2) int
        Sensor and target.
    point_first, point_stop : (q,) int
        The contact points of each pair.
    sensor_body : (m,) int
    target_body : (targets,) int
    slot_start : (q,) int
        Where each pair's memory begins.
    center : (m, 3) float, metres
        Middle of each sensor's contact points and their segments, in its body's frame relative to the reference point.
    radius : (m,) float, metres
        How far they reach from there.
    skin : (q,) float, metres
        How far a contact point may move at the most before it is found out anew what is near it.
    listed : (q,) float, metres
        The same where triangles are listed.
    kind : (b,) int
        KEYFRAMED, FREE or DRIVEN of :mod:`.rotations`.
    at : (b,) int
        Where each body's unknowns begin: six of a free body, one of a driven one, which coupled bodies share; -1 without.
    unknowns : int
        How many there are together.
    mass : (b,) float, kg
    inertia : (b, 3, 3) float, kg·m², body axes
    inverse_inertia : (b, 3, 3) float, 1/(kg·m²), body axes
        Zero for bodies that are not free.
    gravity : (3,) float, m/s²
    thrown : (b, 3) float, m/s
        Velocity of each body at the very start.
    axis : (b, 3) float
        Direction in which the drive of each driven body moves it: in its own frame, or, `axis_in_world`, in the world.
    axis_in_world : (b,) bool
    drive_of : (b,) int
    drive_at : (d,) int
        The unknown of each drive.
    drives : (d, 4) float
        See :mod:`.actuators`.
    program : EffectProgram
        The sensors' effects on forces.
    share, part : (q,) float
        Of a texel's force that one of its contact points moves the bodies with; of the depth that is the sensor's own.
    """

    points: np.ndarray
    point_start: np.ndarray
    texel: np.ndarray
    parameters: np.ndarray
    weight: np.ndarray
    painted: np.ndarray
    reach: np.ndarray
    pairs: np.ndarray
    point_first: np.ndarray
    point_stop: np.ndarray
    sensor_body: np.ndarray
    target_body: np.ndarray
    slot_start: np.ndarray
    center: np.ndarray
    radius: np.ndarray
    skin: np.ndarray
    listed: np.ndarray
    kind: np.ndarray
    at: np.ndarray
    unknowns: int
    mass: np.ndarray
    inertia: np.ndarray
    inverse_inertia: np.ndarray
    gravity: np.ndarray
    thrown: np.ndarray
    axis: np.ndarray
    axis_in_world: np.ndarray
    drive_of: np.ndarray
    drive_at: np.ndarray
    drives: np.ndarray
    program: EffectProgram
    share: np.ndarray
    part: np.ndarray


@by_reference
class State(NamedTuple):
    """What a run carries from step to step; copied, it is a checkpoint.

    Attributes
    ----------
    position : (b, 3) float, metres
        Reference point of each body: centre of mass of a free or driven one, origin of a keyframed one.
    quaternion : (b, 4) float
    velocity : (b, 6) float
        Linear (m/s) and angular (rad/s), world axes.
    hint : (s,) int
        Triangle each contact point met last, -1 for none, -2 once it was pressed past its reach.
    bristles : (s, 4) float
        Bristle deflection (m) in the frame of the sensor's body, and the share of the reach that is pressed in.
    drives : (d, 3) float
        Way along the axis (m), speed (m/s) and force (N) of each drive.
    memory : (N, columns) float
        What effects remember, by contact point.
    tank : (q,) float, joules
        What went into the contacts of each pair and has not come out again (see :mod:`.passivity`).
    """

    position: np.ndarray
    quaternion: np.ndarray
    velocity: np.ndarray
    hint: np.ndarray
    bristles: np.ndarray
    drives: np.ndarray
    memory: np.ndarray
    tank: np.ndarray


TAYLOR_COEFFICIENTS = tuple(1.0 / math.factorial(n + 1) for n in range(13, -1, -1))
"""Taylor coefficients of (1 - exp(-y)) / y without their signs, from y¹³ down to y⁰."""
LEADING_COEFFICIENT = 1.0 / math.factorial(15)
"""The one before them, of y¹⁴."""


@inlined
def decay_and_mean(x):
    """Return exp(-x) and (1 - exp(-x)) / x for x ≥ 0, both to 1e-15 of one, zero included.

    Written out so that it runs in vector registers, which a call of the library's exp forbids, and gives the same bits
    everywhere. The series is exact to rounding up to y = 5/8; doubling y six times uses
    ``(1 - exp(-2y)) / 2y = (1 - exp(-y)) / y · (1 + exp(-y)) / 2``, whose factors are positive, so that errors do not grow.
    """
    within = min(x, 40.0)  # exp(-40) is nothing beside one
    half = within * 0.0078125
    y = 2.0 * half
    mean = LEADING_COEFFICIENT
    for coefficient in TAYLOR_COEFFICIENTS:
        mean = coefficient - y * mean
    for _ in range(6):
        mean *= 1.0 - half * mean
        half += half
    return max(1.0 - within * mean, 0.0), (mean if x <= 40.0 else 1.0 / x)


@inlined
def stribeck_coefficient(speed_squared, parameters):
    """Friction coefficient of steady sliding, mud + (mus - mud) exp(-|v|²/x0²) (Eq. 10–12 divided by fn)."""
    share, _ = decay_and_mean(speed_squared / (parameters[X0] * parameters[X0]))
    return parameters[MUD] + (parameters[MUS] - parameters[MUD]) * share


@inlined
def bristle_step(speed_squared, normal_force, dt, parameters):
    """Solve Eq. 9 over `dt` at constant velocity: z(t + dt) = keep · z(t) + gain · v.

    Returns
    -------
    keep : float
    gain : float, seconds
    """
    g = normal_force * stribeck_coefficient(speed_squared, parameters)
    held = g > 0.0  # without friction nothing holds the bristles
    keep, mean = decay_and_mean(parameters[SIGMA0] * dt * math.sqrt(speed_squared) / g if held else 0.0)
    return (keep if held else 0.0), (mean * dt if held else 0.0)


@inlined
def max_bristle_deflection(normal_force, parameters):
    """Largest bristle deflection that static friction holds, metres."""
    return max(normal_force, 0.0) * (parameters[MUS] / parameters[SIGMA0])


@kernel
def friction_force(z, bristle_rate, velocity, parameters):
    """One component of Eq. 13."""
    return parameters[SIGMA0] * z + parameters[SIGMA1] * bristle_rate + parameters[CT] * velocity


@kernel
def bristle_rate(z, velocity, speed_squared, normal_force, parameters):
    """One component of Eq. 9."""
    g = normal_force * stribeck_coefficient(speed_squared, parameters)
    if g <= 0.0:
        return 0.0
    return velocity - parameters[SIGMA0] * math.sqrt(speed_squared) / g * z


@kernel
def normal_force(depth, rate, parameters):
    """Eq. 8 without adhesion, or ``k dᵖ (1 + 3/2 α ḋ)`` of Hunt and Crossley (J. Appl. Mech. 42, 1975, eq. 8 and 13)."""
    if parameters[EXPONENT] == LINEAR:
        return max(parameters[K] * depth + parameters[CN] * rate, 0.0)
    spring = parameters[K] * max(depth, 0.0) ** parameters[EXPONENT]
    return max(spring * (1.0 + 1.5 * parameters[DISSIPATION] * rate), 0.0)


@kernel
def normal_tangent(depth, rate, dt, parameters):
    """Tangent of the normal force at a step's end as a function of the rate: ``force = push + slope · rate``.

    Parameters
    ----------
    depth : float, metres
        At the step's beginning; at its end it is ``depth + dt · rate``.
    rate : float, m/s
        Where the law is touched; Eq. 8 is its own tangent everywhere.
    dt : float, seconds

    Returns
    -------
    push : float, N
    slope : float, N·s/m
        Never negative. Both are zero where the law of Hunt and Crossley gives no force.
    """
    if parameters[EXPONENT] == LINEAR:
        return parameters[K] * depth, parameters[K] * dt + parameters[CN]
    damping = 1.5 * parameters[DISSIPATION]
    end, share = depth + dt * rate, 1.0 + damping * rate
    if end <= 0.0 or share <= 0.0:
        return 0.0, 0.0
    spring = parameters[K] * end ** parameters[EXPONENT]
    slope = spring * (parameters[EXPONENT] * dt * share / end + damping)
    return spring * share - slope * rate, slope


@kernel
def friction_along_path(time, velocity, normal_force, parameters, force):
    """Friction of one contact point along a straight path, from rest, under a constant normal force (Eq. 9, 13).

    Parameters
    ----------
    time : (m,) float, seconds, increasing
    velocity : (m,) float, m/s
        Between samples the mean of its ends counts, for which Eq. 9 is solved exactly.
    normal_force : float, N
    parameters : (8,) float
    force : (m,) float, N
        Written.
    """
    z = 0.0
    for i in range(len(time)):
        if i > 0:
            v = 0.5 * (velocity[i - 1] + velocity[i])
            keep, gain = bristle_step(v * v, normal_force, time[i] - time[i - 1], parameters)
            z = keep * z + gain * v
        v = velocity[i]
        force[i] = friction_force(z, bristle_rate(z, v, v * v, normal_force, parameters), v, parameters)


@inlined
def linearise_contact(nx, ny, nz, zx, zy, zz, push, stiff_n, grip, drag, sticks, vx, vy, vz, dt, parameters):
    """How a contact's force depends on the relative velocity at the step's end, near velocity `v`.

    The force on the target is ``-(push + stiff_n ḋ) n - (bias z + stiff_t v_t)``; `v` is the target's velocity relative to the
    sensor, metres per second. All is zero where the contact separates within the step: no force at all. Where it `sticks` the
    normal force may pull; friction is zero then.

    Parameters
    ----------
    nx … zz : float
        Normal and bristle deflection (m).
    push, stiff_n : float, N and N·s/m
        The normal law at the step's end (see :func:`normal_tangent`).
    grip : float
        Multiplier of the friction coefficients.
    drag : float, N·s/m
        Added to `ct`.
    sticks : bool
    vx … vz : float, m/s

    Returns
    -------
    limit : float, metres
        How far the bristles can bend under the normal force at the step's end.
    push, stiff_n : float, N and N·s/m
    bias, stiff_t : float, N/m and N·s/m
    keep, gain : float
        What becomes of the bristles, ``z(t + dt) = keep z + gain v_t``.
    """
    rate = vx * nx + vy * ny + vz * nz
    tx, ty, tz = vx - rate * nx, vy - rate * ny, vz - rate * nz
    force = max(push + stiff_n * rate, 0.0)
    load = grip * force
    limit = max_bristle_deflection(load, parameters)
    square = zx * zx + zy * zy + zz * zz
    held = limit / math.sqrt(square) if square > limit * limit else 1.0  # the load fell: the rest has slipped already
    keep, gain = bristle_step(tx * tx + ty * ty + tz * tz, load, dt, parameters)
    keep *= held
    zx, zy, zz = keep * zx + gain * tx, keep * zy + gain * ty, keep * zz + gain * tz
    square = zx * zx + zy * zy + zz * zz
    # The closed solution for constant velocity may overshoot: slide at the limit instead.
    scale = limit / math.sqrt(square) if square > limit * limit else 1.0
    keep, gain = scale * keep, scale * gain
    bias = parameters[SIGMA0] * keep + parameters[SIGMA1] / dt * (keep - held)
    stiff_t = (parameters[SIGMA0] + parameters[SIGMA1] / dt) * gain + parameters[CT] + drag
    on = force > 0.0
    acts = on or sticks
    return (
        limit, push if acts else 0.0, stiff_n if acts else 0.0, bias if on else 0.0, stiff_t if on else 0.0,
        keep if on else 0.0, gain if on else 0.0,
    )  # fmt: skip
