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

from .bvh import cross_plane, find_near, near_entry, segment_entry
from .jit import inlined, kernel
from .scenario import HUNT_CROSSLEY, SensorParameters

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
PUSH, SLOPE = LANES * 13, LANES * 14  # tangent of the normal law where it is not the same for all contacts: N, N·s/m
GRIP = LANES * 15  # painted multiplier of friction, written like these
ROW = LANES * 16

# Columns of a parameter row, one per sensor or pad.
K, CN, CT, SIGMA0, SIGMA1, X0, MUS, MUD, EXPONENT, DISSIPATION = range(10)
PARAMETERS = 10
LINEAR = 0.0
"""In the place of the exponent: Eq. 8. Any other exponent is that of Hunt and Crossley's law."""


def parameter_row(parameters: SensorParameters, share: float = 1.0) -> np.ndarray:
    """Return the numbers of the contact law as the kernels want them, (PARAMETERS,) float.

    Parameters
    ----------
    parameters : SensorParameters
    share : float
        Of the forces of a texel; one of several contact points has only its share of them.
    """
    p = parameters
    exponent = p.exponent if p.normal_law == HUNT_CROSSLEY else LINEAR
    row = np.array([p.k, p.cn, p.ct, p.sigma0, p.sigma1, p.x0, p.mus, p.mud, exponent, p.dissipation], dtype=float)
    row[[K, CN, CT, SIGMA0, SIGMA1]] *= share
    return row


def friction_limit(normal_force: np.ndarray, speed: np.ndarray, parameters: SensorParameters) -> np.ndarray:
    """Return what friction can hold at a sliding speed, ``g`` of Eq. 10.

    Parameters
    ----------
    normal_force : (...) float, N
    speed : (...) float, m/s
    parameters : SensorParameters
    """
    row = parameter_row(parameters)
    return normal_force * np.array([stribeck(v * v, row) for v in np.ravel(speed)]).reshape(np.shape(speed))


class World(NamedTuple):
    """What does not change during a run: b bodies, m sensors with N contact points, q pairs of sensor and target.

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
    painted : (N, 2) float
        Multipliers of each contact point's stiffness and friction; without rows when nothing is painted.
    reach : (m,) float, metres
        Maximum penetration.
    pairs : (q, 2) int
        Sensor and target.
    sensor_body : (m,) int
    target_body : (targets,) int
    slot_start : (q,) int
        Where each pair's memory begins.
    center : (m, 3) float, metres
        Middle of each sensor's contact points and their segments, in its body's frame relative to the reference point.
    radius : (m,) float, metres
        How far they reach from there.
    skin : (q,) float, metres
        How far a contact point may move at the most before the triangles near it are collected anew.
    kind : (b,) int
        KEYFRAMED, FREE or DRIVEN of :mod:`.bodies`.
    at : (b,) int
        Where each body's unknowns begin: six of a free body, one of a driven one, which coupled bodies share; -1 without.
    unknowns : int
        How many there are together.
    mass : (b,) float, kg
    inertia : (b, 3, 3) float, kg·m², body axes
    inverse_inertia : (b, 3, 3) float, 1/(kg·m²), body axes
        Zero for bodies that are not free.
    gravity : (3,) float, m/s²
    axis : (b, 3) float
        Direction in which the drive of each driven body moves it: in its own frame, or, `axis_in_world`, in the world.
    axis_in_world : (b,) bool
    drive_of : (b,) int
    drive_at : (d,) int
        The unknown of each drive.
    drives : (d, 4) float
        See :mod:`.servo`.
    """

    points: np.ndarray
    point_start: np.ndarray
    texel: np.ndarray
    parameters: np.ndarray
    painted: np.ndarray
    reach: np.ndarray
    pairs: np.ndarray
    sensor_body: np.ndarray
    target_body: np.ndarray
    slot_start: np.ndarray
    center: np.ndarray
    radius: np.ndarray
    skin: np.ndarray
    kind: np.ndarray
    at: np.ndarray
    unknowns: int
    mass: np.ndarray
    inertia: np.ndarray
    inverse_inertia: np.ndarray
    gravity: np.ndarray
    axis: np.ndarray
    axis_in_world: np.ndarray
    drive_of: np.ndarray
    drive_at: np.ndarray
    drives: np.ndarray


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
    """

    position: np.ndarray
    quaternion: np.ndarray
    velocity: np.ndarray
    hint: np.ndarray
    bristles: np.ndarray
    drives: np.ndarray


SERIES = tuple(1.0 / math.factorial(n + 1) for n in range(13, -1, -1))
"""Taylor coefficients of (1 - exp(-y)) / y without their signs, from y¹³ down to y⁰."""
SMALLEST = 1.0 / math.factorial(15)
"""The one before them, of y¹⁴."""


@inlined
def relaxation(x):
    """Return exp(-x) and (1 - exp(-x)) / x for x ≥ 0, both to 1e-15 of one, zero included.

    Written out so that it runs in vector registers, which a call of the library's exp forbids, and gives the same bits
    everywhere. The series is exact to rounding up to y = 5/8; doubling y six times uses
    ``(1 - exp(-2y)) / 2y = (1 - exp(-y)) / y · (1 + exp(-y)) / 2``, whose factors are positive, so that errors do not grow.
    """
    within = min(x, 40.0)  # exp(-40) is nothing beside one
    half = within * 0.0078125
    y = 2.0 * half
    mean = SMALLEST
    for coefficient in SERIES:
        mean = coefficient - y * mean
    for _ in range(6):
        mean *= 1.0 - half * mean
        half += half
    return max(1.0 - within * mean, 0.0), (mean if x <= 40.0 else 1.0 / x)


@inlined
def stribeck(speed_squared, parameters):
    """Friction coefficient of steady sliding, mud + (mus - mud) exp(-|v|²/x0²) (Eq. 10–12 divided by fn)."""
    share, _ = relaxation(speed_squared / (parameters[X0] * parameters[X0]))
    return parameters[MUD] + (parameters[MUS] - parameters[MUD]) * share


@inlined
def bristle_step(speed_squared, normal_force, dt, parameters):
    """Solve Eq. 9 over `dt` at constant velocity: z(t + dt) = keep · z(t) + gain · v.

    Returns
    -------
    keep : float
    gain : float, seconds
    """
    g = normal_force * stribeck(speed_squared, parameters)
    held = g > 0.0  # without friction nothing holds the bristles
    keep, mean = relaxation(parameters[SIGMA0] * dt * math.sqrt(speed_squared) / g if held else 0.0)
    return (keep if held else 0.0), (mean * dt if held else 0.0)


@inlined
def bristle_limit(normal_force, parameters):
    """Largest bristle deflection that static friction holds, metres."""
    return max(normal_force, 0.0) * (parameters[MUS] / parameters[SIGMA0])


@kernel
def friction_force(z, bristle_rate, velocity, parameters):
    """One component of Eq. 13."""
    return parameters[SIGMA0] * z + parameters[SIGMA1] * bristle_rate + parameters[CT] * velocity


@kernel
def bristle_rate(z, velocity, speed_squared, normal_force, parameters):
    """One component of Eq. 9."""
    g = normal_force * stribeck(speed_squared, parameters)
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
def friction_trace(time, velocity, normal_force, parameters, force):
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


class Neighbours(NamedTuple):
    """Which triangles each contact point can meet; a cache that changes the speed and never the numbers.

    Attributes
    ----------
    near : (s, NEAR) int
    number : (s,) int
        Length of each list, -1 where the tree must be asked.
    only : (s,) int
        The triangle that a texel's line goes through for certain and alone as long as its list holds; else -1.
    pose : (q, 14) float
        Rotation (row by row) and position of each pair's sensor in the target's frame when its lists were made, the skin they
        were made with (-1 while there are none), and how often they have been used.
    """

    near: np.ndarray
    number: np.ndarray
    only: np.ndarray
    pose: np.ndarray


@kernel
def _relative_pose(a, b, position, rotation, pose):
    """Write the sensor's rotation (row by row) and position in the target's frame into `pose`."""
    for i in range(3):
        total = 0.0
        for k in range(3):
            total += rotation[b, k, i] * (position[a, k] - position[b, k])
        pose[9 + i] = total
        for j in range(3):
            pose[3 * i + j] = (
                rotation[b, 0, i] * rotation[a, 0, j]
                + rotation[b, 1, i] * rotation[a, 1, j]
                + rotation[b, 2, i] * rotation[a, 2, j]
            )


@kernel
def _distance_to_box(pose, center, sensor, bounds, root):
    """Distance of the sensor's middle from the target's box, metres."""
    square = 0.0
    for i in range(3):
        x = pose[9 + i] + pose[3 * i] * center[sensor, 0]
        x += pose[3 * i + 1] * center[sensor, 1] + pose[3 * i + 2] * center[sensor, 2]
        out = max(bounds[root, i] - x, x - bounds[root, 3 + i], 0.0)
        square += out * out
    return math.sqrt(square)


@kernel
def _travel(pose, old, pair, center, sensor, radius):
    """Bound on how far any point of the sensor has moved between two poses, metres."""
    shift, turn = 0.0, 0.0
    for i in range(3):
        change = pose[9 + i] - old[pair, 9 + i]
        for j in range(3):
            difference = pose[3 * i + j] - old[pair, 3 * i + j]
            change += difference * center[sensor, j]
            turn += difference * difference
        shift += change * change
    return math.sqrt(shift) + math.sqrt(0.5 * turn) * radius


@kernel
def _keep_lists(pair, sensor, target, pose, world, tree, neighbours):
    """Collect the triangles near each contact point of a pair anew when it has moved by more than the skin of the lists.

    The skin follows the motion: some thirty steps' travel, so that lists are short and yet seldom made.
    """
    skin, used = neighbours.pose[pair, 12], neighbours.pose[pair, 13]
    travel = _travel(pose, neighbours.pose, pair, world.center, sensor, world.radius[sensor])
    neighbours.pose[pair, 13] = used + 1.0
    wanted = world.skin[pair]
    if skin >= 0.0:
        wanted = min(max(32.0 * travel / (used + 1.0), 1e-3 * wanted), wanted)
        too_wide = used == 255.0 and wanted < 0.5 * skin
        if travel <= skin and not too_wide:
            return
    points, reach, slot = world.points, world.reach[sensor], world.slot_start[pair]
    for point in range(world.point_start[sensor], world.point_start[sensor + 1]):
        dx = reach * (pose[0] * points[point, 3] + pose[1] * points[point, 4] + pose[2] * points[point, 5])
        dy = reach * (pose[3] * points[point, 3] + pose[4] * points[point, 4] + pose[5] * points[point, 5])
        dz = reach * (pose[6] * points[point, 3] + pose[7] * points[point, 4] + pose[8] * points[point, 5])
        ox = pose[9] + pose[0] * points[point, 0] + pose[1] * points[point, 1] + pose[2] * points[point, 2] - dx
        oy = pose[10] + pose[3] * points[point, 0] + pose[4] * points[point, 1] + pose[5] * points[point, 2] - dy
        oz = pose[11] + pose[6] * points[point, 0] + pose[7] * points[point, 1] + pose[8] * points[point, 2] - dz
        number, only = find_near(ox, oy, oz, dx, dy, dz, target, wanted, neighbours.near, slot, tree)
        neighbours.number[slot], neighbours.only[slot] = number, only
        slot += 1
    for i in range(12):
        neighbours.pose[pair, i] = pose[i]
    neighbours.pose[pair, 12] = wanted
    neighbours.pose[pair, 13] = 0.0


@kernel
def _forget(pair, sensor, world, state):
    """Nothing of this pair touches: no triangle met, no bristle bent."""
    start = world.slot_start[pair]
    for slot in range(start, start + world.point_start[sensor + 1] - world.point_start[sensor]):
        if state.hint[slot] != -1:
            state.hint[slot] = -1
            for i in range(4):
                state.bristles[slot, i] = 0.0


@kernel
def gather(pair, first, world, tree, neighbours, state, rotation, rows, slots, pose):
    """Collect the contacts of one sensor with one target as rows, from block `first` on.

    The segment of a contact point runs from `reach` deep in the sensor to it; where it enters the target counts. Memory of
    the pair in `state` is brought up to date: the triangle met, and the bristles, which are zero where nothing touches.

    Parameters
    ----------
    pair, first : int
    world : World
    tree : Tree
    neighbours : Neighbours
    state : State
    rotation : (b, 3, 3) float
        Orientation of each body.
    rows : (blocks, ROW) float
    slots : (blocks, LANES) int
        Written: which place in the memory each row belongs to.
    pose : (12,) float
        Working memory.

    Returns
    -------
    count : int
        Rows of this pair.
    sunk : int
        Contact points that were pressed past their maximum penetration and do not act.
    """
    sensor, target = world.pairs[pair, 0], world.pairs[pair, 1]
    a, b = world.sensor_body[sensor], world.target_body[target]
    points, hint, bristles = world.points, state.hint, state.bristles
    reach, root = world.reach[sensor], tree.roots[target]
    _relative_pose(a, b, state.position, rotation, pose)
    if _distance_to_box(pose, world.center, sensor, tree.bounds, root) > world.radius[sensor]:
        _forget(pair, sensor, world, state)
        return 0, 0
    _keep_lists(pair, sensor, target, pose, world, tree, neighbours)
    sunk, slot = 0, world.slot_start[pair] - 1
    block, lane = first, 0
    for point in range(world.point_start[sensor], world.point_start[sensor + 1]):
        slot += 1
        before = hint[slot]
        number = neighbours.number[slot]
        if number == 0 and before == -1:
            continue
        tx = pose[9] + pose[0] * points[point, 0] + pose[1] * points[point, 1] + pose[2] * points[point, 2]
        ty = pose[10] + pose[3] * points[point, 0] + pose[4] * points[point, 1] + pose[5] * points[point, 2]
        tz = pose[11] + pose[6] * points[point, 0] + pose[7] * points[point, 1] + pose[8] * points[point, 2]
        dx = reach * (pose[0] * points[point, 3] + pose[1] * points[point, 4] + pose[2] * points[point, 5])
        dy = reach * (pose[3] * points[point, 3] + pose[4] * points[point, 4] + pose[5] * points[point, 5])
        dz = reach * (pose[6] * points[point, 3] + pose[7] * points[point, 4] + pose[8] * points[point, 5])
        ox, oy, oz = tx - dx, ty - dy, tz - dz
        only = neighbours.only[slot]
        if only >= 0:
            met = cross_plane(ox, oy, oz, dx, dy, dz, tree.faces, only)
            triangle, leaving = only if 0.0 <= met <= 1.0 else -1, 2.0
        elif number >= 0:
            met, triangle, leaving = near_entry(ox, oy, oz, dx, dy, dz, neighbours.near, slot, number, tree.faces)
        else:
            met, triangle, leaving = segment_entry(ox, oy, oz, dx, dy, dz, target, before, tree)
        if triangle < 0:
            # Sunk: the base is inside the object. Either the segment leaves it somewhere, or the object's surface has just run
            # past the base (it was within the last tenth of the reach a step ago) and has not come back since.
            in_box = (
                min(ox, tx) <= tree.bounds[root, 3] and max(ox, tx) >= tree.bounds[root, 0]
                and min(oy, ty) <= tree.bounds[root, 4] and max(oy, ty) >= tree.bounds[root, 1]
                and min(oz, tz) <= tree.bounds[root, 5] and max(oz, tz) >= tree.bounds[root, 2]
            )  # fmt: skip
            ran_past = in_box and (before == -2 or (before >= 0 and bristles[slot, 3] > 0.9))
            if leaving <= 1.0 or ran_past:
                sunk += 1
                hint[slot] = -2
            else:
                hint[slot] = -1
            for i in range(4):
                bristles[slot, i] = 0.0
            continue
        hint[slot] = triangle
        fx, fy, fz = tree.faces[triangle, 9], tree.faces[triangle, 10], tree.faces[triangle, 11]
        nx = pose[0] * fx + pose[3] * fy + pose[6] * fz
        ny = pose[1] * fx + pose[4] * fy + pose[7] * fz
        nz = pose[2] * fx + pose[5] * fy + pose[8] * fz
        rows[block, NX + lane], rows[block, NY + lane], rows[block, NZ + lane] = nx, ny, nz
        # From the point back along its normal to the intersection.
        inside = 1.0 - met
        rows[block, PX + lane] = points[point, 0] - inside * reach * points[point, 3]
        rows[block, PY + lane] = points[point, 1] - inside * reach * points[point, 4]
        rows[block, PZ + lane] = points[point, 2] - inside * reach * points[point, 5]
        rows[block, ZX + lane], rows[block, ZY + lane] = bristles[slot, 0], bristles[slot, 1]
        rows[block, ZZ + lane] = bristles[slot, 2]
        rows[block, DEPTH + lane] = inside * abs(dx * fx + dy * fy + dz * fz)
        bristles[slot, 3] = inside
        slots[block, lane] = slot
        lane += 1
        if lane == LANES:
            block, lane = block + 1, 0
    count = (block - first) * LANES + lane
    if lane > 0:
        for unused in range(lane, LANES):
            for column in range(0, ROW, LANES):
                rows[block, column + unused] = 0.0
    _lay_flat(first, count, rows)
    return count, sunk


@kernel
def _lay_flat(first, count, rows):
    """Lay back into the surface what its turn makes stand out of it of a bristle, which stays as long as it was."""
    for block in range(first, first + (count + LANES - 1) // LANES):
        for lane in range(LANES):
            nx, ny, nz = rows[block, NX + lane], rows[block, NY + lane], rows[block, NZ + lane]
            zx, zy, zz = rows[block, ZX + lane], rows[block, ZY + lane], rows[block, ZZ + lane]
            out_of_plane = zx * nx + zy * ny + zz * nz
            length = zx * zx + zy * zy + zz * zz
            flat_x, flat_y, flat_z = zx - out_of_plane * nx, zy - out_of_plane * ny, zz - out_of_plane * nz
            flat = flat_x * flat_x + flat_y * flat_y + flat_z * flat_z
            scale = math.sqrt(length / flat) if flat > 0.0 and out_of_plane != 0.0 else 1.0
            rows[block, ZX + lane], rows[block, ZY + lane] = scale * flat_x, scale * flat_y
            rows[block, ZZ + lane] = scale * flat_z


@kernel
def count_buried(pair, world, tree, state, rotation, pose):
    """Count the contact points of a sensor that are deeper inside a closed target than they reach, and so feel nothing.

    Looked for once a frame by a long segment from each segment's base; the arguments are those of :func:`gather`.
    """
    sensor, target = world.pairs[pair, 0], world.pairs[pair, 1]
    _relative_pose(world.sensor_body[sensor], world.target_body[target], state.position, rotation, pose)
    points, reach, root = world.points, world.reach[sensor], tree.roots[target]
    size = 0.0
    for i in range(3):
        size += tree.bounds[root, 3 + i] - tree.bounds[root, i]
    buried, slot = 0, world.slot_start[pair] - 1
    for point in range(world.point_start[sensor], world.point_start[sensor + 1]):
        slot += 1
        if state.hint[slot] >= 0:
            continue
        dx = pose[0] * points[point, 3] + pose[1] * points[point, 4] + pose[2] * points[point, 5]
        dy = pose[3] * points[point, 3] + pose[4] * points[point, 4] + pose[5] * points[point, 5]
        dz = pose[6] * points[point, 3] + pose[7] * points[point, 4] + pose[8] * points[point, 5]
        ox = pose[9] + pose[0] * points[point, 0] + pose[1] * points[point, 1] + pose[2] * points[point, 2] - reach * dx
        oy = pose[10] + pose[3] * points[point, 0] + pose[4] * points[point, 1] + pose[5] * points[point, 2] - reach * dy
        oz = pose[11] + pose[6] * points[point, 0] + pose[7] * points[point, 1] + pose[8] * points[point, 2] - reach * dz
        within = (
            tree.bounds[root, 0] <= ox <= tree.bounds[root, 3]
            and tree.bounds[root, 1] <= oy <= tree.bounds[root, 4]
            and tree.bounds[root, 2] <= oz <= tree.bounds[root, 5]
        )
        if within:
            t, _, leaving = segment_entry(ox, oy, oz, size * dx, size * dy, size * dz, target, -1, tree)
            if leaving < t:
                buried += 1
    return buried


@inlined
def linearise(nx, ny, nz, zx, zy, zz, push, stiff_n, grip, vx, vy, vz, dt, parameters):
    """How a contact's force depends on the relative velocity at the step's end, near velocity `v`.

    The force on the target is ``-(push + stiff_n ḋ) n - (bias z + stiff_t v_t)``; `v` is the target's velocity relative to the
    sensor, metres per second. All is zero where the contact separates within the step: no force at all.

    Parameters
    ----------
    nx … zz : float
        Normal and bristle deflection (m).
    push, stiff_n : float, N and N·s/m
        The normal law at the step's end (see :func:`normal_tangent`).
    grip : float
        Painted multiplier of the friction coefficients.
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
    limit = bristle_limit(load, parameters)
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
    stiff_t = (parameters[SIGMA0] + parameters[SIGMA1] / dt) * gain + parameters[CT]
    on = force > 0.0
    return (
        limit, push if on else 0.0, stiff_n if on else 0.0, bias if on else 0.0, stiff_t if on else 0.0,
        keep if on else 0.0, gain if on else 0.0,
    )  # fmt: skip
