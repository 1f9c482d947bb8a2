# SPDX-License-Identifier: GPL-3.0-or-later
"""The search for the displacement of a target at which a contact exerts a given load, one environment at a time (kernels).

It is Levenberg and Marquardt's method (Marquardt 1963) with Broyden's update (Broyden 1965) of a Jacobian from differences.
:func:`begin_search` says where the first trial is, and :func:`advance_search`, given the wrench of a trial, where the next one
is, or that there is none. Who calls them runs the trials: :mod:`.load_balance` with the solver, and
:mod:`.warp.balance_kernels` on Warp, into which :mod:`.warp.translation` rewrites these functions.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np

from ..compiled.kernels import kernel
from ..compiled.struct_reference import by_reference
from ..geometry.rotations import multiply, quaternion_of_vector
from ..geometry.texels import Texels

IntArray: TypeAlias = np.ndarray
"""An array of integers; the translation for Warp goes by this name."""
TOLERANCE = 1e-9
"""Difference between load and contact at which the search ends, relative to the load; for torques, over the sensor's radius of
gyration. A thousandth of what is promised, which two or three trials more reach, as convergence is faster than linear."""
SMALLEST_LOAD = 1e-3
"""Newtons: below it the tolerance is absolute, as rounding of the pressed-in depth is."""
DIFFERENCE = 1e-6
"""Step of the differences, relative to the maximum penetration: far above rounding, far below a texel's depth."""
TRIALS, HALVINGS = 60, 12
"""Most steps of the search, and of the approach where nothing touches. Contacts that are released one by one took up to 30."""
BISECTIONS = 24
"""Halvings of the way to where a target touches; they leave less than 1e-9 m of a maximum penetration of some millimetres."""
ENOUGH, SLOW = 1e-4, 0.3
"""A trial is accepted if the difference falls by this share. Unless it falls to SLOW, the Jacobian is computed again."""
LEAST_DAMPING, DAMPING_FACTOR, MOST_DAMPING = 1e-12, 10.0, 1e4
"""Of Levenberg and Marquardt's method, relative to the mean square of the Jacobian's columns."""
MOST_RUNS = 3 + (1 + HALVINGS) + 7 * TRIALS + BISECTIONS
"""How often a search has a step run at the most."""

DONE, FIRST, APPROACH, COLUMN, TRIAL, SETTLE, RETREAT, LAST = range(8)
"""Purpose of the next trial: nothing; the place where the last search ended; to find the contact; a column of the Jacobian; a
step of the search; the place that was found; to find where the target begins to touch; the place of one that does not."""
PHASE, DEGREES, COUNT, STEPS, KNOWN, FRESH = range(6)
"""Entries of :attr:`LoadSearch.state`: what the trial is for; degrees of freedom; which column or halving; steps so far; the
degrees of freedom for which the Jacobian holds; whether it was computed at this place."""
LIMIT, DAMPING, LEAST_PUSH, REACH = range(4)
"""Entries of :attr:`LoadSearch.number`: difference at which the search ends (N); damping of its steps; least that a trial with
contact exerted of the load (N²); way of the approach (m)."""


@by_reference
class LoadSearch(NamedTuple):
    """The searches of E environments. Torques are over the radius of gyration, N.

    Attributes
    ----------
    extent : (2,) float, metres
        Maximum penetration and radius of gyration of the texels. No way to the contact, and no rotation times the radius, is
        longer than the former. A displacement may be longer by two radii, as soft bristles yield by more than they are pressed
        in.
    normal : (3,) float
        Mean normal of the texels, in the sensor's frame.
    engine : (E, 7) float
        Pose of the target that the other program has.
    given, load : (E, 6) float, N and N·m
        What the contact is to exert on the target, as it was given and over the radius.
    residual : (E, 6) float, N and N·m
        Part of the load that the contact does not exert, for who asks.
    direction : (E, 3) float
        In the world, of a load with one component.
    at, trial, touched : (E, 6) float, metres and rad
        Displacement of the target from the engine's pose: in the world, and rotation vector about its origin. The best so far,
        which at the end is the one that was found; of the next trial; where the contact exerted least of the load.
    excess, found : (E, 6) float, N
        What the contact exerts more than the load, at `at` and at `trial`.
    jacobian, system : (E, 6, 6), (E, 6, 7) float
        Of the excess, by directions with rotations per radius; working memory.
    number : (E, 4) float
    state : (E, 6) int
    """

    extent: np.ndarray
    normal: np.ndarray
    engine: np.ndarray
    given: np.ndarray
    load: np.ndarray
    residual: np.ndarray
    direction: np.ndarray
    at: np.ndarray
    trial: np.ndarray
    touched: np.ndarray
    excess: np.ndarray
    found: np.ndarray
    jacobian: np.ndarray
    system: np.ndarray
    number: np.ndarray
    state: IntArray

    @classmethod
    def of(cls, texels: Texels, max_penetration: float, e: int) -> LoadSearch:
        """Return the searches of E environments of a sensor."""
        offset, normal = texels.position - texels.position.mean(axis=0), texels.normal.mean(axis=0)
        radius = max(float(np.sqrt((offset**2).sum(axis=1).mean())), 1e-300)
        given, load, residual, at, trial, touched, excess, found = np.zeros((8, e, 6))
        return cls(
            extent=np.array([max_penetration, radius]), normal=normal / max(float(np.linalg.norm(normal)), 1e-300),
            engine=np.zeros((e, 7)), given=given, load=load, residual=residual, direction=np.zeros((e, 3)), at=at, trial=trial,
            touched=touched, excess=excess, found=found,
            jacobian=np.zeros((e, 6, 6)), system=np.zeros((e, 6, 7)), number=np.zeros((e, 4)), state=np.zeros((e, 6), np.int64),
        )  # fmt: skip


@kernel
def forget_load(e: int, search: LoadSearch) -> None:
    """Put the target of an environment back to the engine's pose; it has no search."""
    for i in range(6):
        search.at[e, i] = 0.0
        search.trial[e, i] = 0.0
        search.excess[e, i] = 0.0
    search.state[e, KNOWN] = 0
    search.state[e, PHASE] = DONE


@kernel
def begin_search(e: int, degrees: int, rotation: np.ndarray, search: LoadSearch) -> None:
    """Begin with the load that is given.

    Parameters
    ----------
    e : int
    degrees : int
        Components of the load: force along the sensor's mean normal (1), force in the world (3), or force and torque about the
        target's origin (6).
    rotation : (3, 3) float
        Of the sensor.
    search : LoadSearch
    """
    square = 0.0
    for i in range(degrees):
        load = search.given[e, i] / (search.extent[1] if i >= 3 else 1.0)
        search.load[e, i] = load
        square += load * load
    for i in range(3):
        total = 0.0
        for k in range(3):
            total += rotation[i, k] * search.normal[k]
        search.direction[e, i] = total
    for i in range(6):
        if square == 0.0:
            search.at[e, i] = 0.0
        search.trial[e, i] = search.at[e, i]
        search.touched[e, i] = search.at[e, i]
    search.number[e, LIMIT] = TOLERANCE * max(math.sqrt(square), SMALLEST_LOAD)
    search.number[e, DAMPING] = LEAST_DAMPING
    search.number[e, LEAST_PUSH] = math.inf
    search.state[e, PHASE] = FIRST
    search.state[e, DEGREES] = degrees
    search.state[e, STEPS] = 0
    search.state[e, FRESH] = 0


@kernel
def advance_search(e: int, wrench: np.ndarray, touching: bool, search: LoadSearch) -> None:
    """Go on after a trial, with the wrench (6,) on the target, and whether a texel exerts a force."""
    phase, degrees = search.state[e, PHASE], search.state[e, DEGREES]
    _compare(e, wrench, touching, search)
    size = _length(search.found[e], degrees)
    if phase == FIRST:
        _accept(e, search)
        if size <= search.number[e, LIMIT]:
            _settle(e, touching, search)
        elif touching:
            _go_on(e, touching, search)
        else:
            search.state[e, PHASE] = APPROACH
            search.state[e, COUNT] = HALVINGS
            search.number[e, REACH] = search.extent[0] * 0.5**HALVINGS
            _approach(e, search)
    elif phase == APPROACH:
        if touching:
            _accept(e, search)
            search.state[e, KNOWN] = 0
            _go_on(e, touching, search)
        elif search.state[e, COUNT] > 0:
            search.state[e, COUNT] -= 1
            search.number[e, REACH] *= 2.0
            _approach(e, search)
        else:
            for i in range(6):
                search.at[e, i] = 0.0
            search.state[e, KNOWN] = 0
            _settle(e, touching, search)
    elif phase == COLUMN:
        _write_column(e, touching, search)
    elif phase == TRIAL:
        _judge(e, size, touching, search)
    elif phase == SETTLE:
        _accept(e, search)
        _look_for_contact(e, touching, search)
    elif phase == RETREAT:
        _bisect(e, touching, search)
    else:
        _accept(e, search)
        search.state[e, PHASE] = DONE


@kernel
def place_trial(e: int, pose: np.ndarray, search: LoadSearch) -> None:
    """Write the pose (7,) of a target for the next trial."""
    trial, engine = search.trial[e], search.engine[e]
    for i in range(3):
        pose[i] = engine[i] + trial[i]
    c, x, y, z = quaternion_of_vector(trial[3], trial[4], trial[5])
    qw, qx, qy, qz = multiply(c, x, y, z, engine[3], engine[4], engine[5], engine[6])
    pose[3], pose[4], pose[5], pose[6] = qw, qx, qy, qz


@kernel
def _compare(e: int, wrench: np.ndarray, touching: bool, search: LoadSearch) -> None:
    """Write what the contact of a trial exerts more than the load, and where it exerted least."""
    push, degrees = 0.0, search.state[e, DEGREES]
    for i in range(degrees):
        exerted = wrench[i] / (search.extent[1] if i >= 3 else 1.0)
        if degrees == 1:
            exerted = (
                wrench[0] * search.direction[e, 0] + wrench[1] * search.direction[e, 1] + wrench[2] * search.direction[e, 2]
            )
        push += exerted * search.load[e, i]
        search.found[e, i] = exerted - search.load[e, i]
    if touching and 0.0 < push < search.number[e, LEAST_PUSH]:
        search.number[e, LEAST_PUSH] = push
        for i in range(6):
            search.touched[e, i] = search.trial[e, i]


@kernel
def _accept(e: int, search: LoadSearch) -> None:
    """Take the trial as the best so far."""
    for i in range(6):
        search.at[e, i] = search.trial[e, i]
        search.excess[e, i] = search.found[e, i]


@kernel
def _approach(e: int, search: LoadSearch) -> None:
    """Let the next trial be on the way against the force."""
    square = 0.0
    for i in range(3):
        force = _force_along(e, i, search)
        square += force * force
    scale = search.number[e, REACH] / max(math.sqrt(square), 1e-300)
    for i in range(6):
        search.trial[e, i] = 0.0
    for i in range(3):
        search.trial[e, i] = -scale * _force_along(e, i, search)
    _shorten_trial(e, search)


@kernel
def _force_along(e: int, i: int, search: LoadSearch) -> float:
    """Return the load's force along an axis of the world, N."""
    return search.load[e, 0] * search.direction[e, i] if search.state[e, DEGREES] == 1 else search.load[e, i]


@kernel
def _go_on(e: int, touching: bool, search: LoadSearch) -> None:
    """Let the next trial be a step of the search, or for the Jacobian that it needs; or end the search."""
    degrees = search.state[e, DEGREES]
    if _length(search.excess[e], degrees) <= search.number[e, LIMIT] or search.state[e, STEPS] == TRIALS:
        _settle(e, touching, search)
    elif search.state[e, KNOWN] != degrees:
        search.state[e, PHASE] = COLUMN
        search.state[e, COUNT] = 0
        _displace(e, 0, DIFFERENCE * search.extent[0], search)
    else:
        _propose(e, search)


@kernel
def _displace(e: int, column: int, way: float, search: LoadSearch) -> None:
    """Let the next trial be aside of the best place along one direction."""
    for i in range(6):
        search.trial[e, i] = search.at[e, i]
    _add(e, column, way, search)


@kernel
def _add(e: int, column: int, way: float, search: LoadSearch) -> None:
    """Move the next trial along the direction that belongs to a component of the load."""
    if search.state[e, DEGREES] == 1:
        for i in range(3):
            search.trial[e, i] += way * search.direction[e, i]
    else:
        search.trial[e, column] += way / (search.extent[1] if column >= 3 else 1.0)


@kernel
def _write_column(e: int, touching: bool, search: LoadSearch) -> None:
    """Write a column of the Jacobian, and go on to the next one."""
    column, degrees, small = search.state[e, COUNT], search.state[e, DEGREES], DIFFERENCE * search.extent[0]
    for i in range(degrees):
        search.jacobian[e, i, column] = (search.found[e, i] - search.excess[e, i]) / small
    search.state[e, COUNT] = column + 1
    if column + 1 < degrees:
        _displace(e, column + 1, small, search)
    else:
        search.state[e, KNOWN] = degrees
        search.state[e, FRESH] = 1
        _propose(e, search)


@kernel
def _propose(e: int, search: LoadSearch) -> None:
    """Let the next trial be the next step of Levenberg and Marquardt's method."""
    degrees, trace, a = search.state[e, DEGREES], 0.0, search.system[e]
    for i in range(degrees):
        right = 0.0
        for k in range(degrees):
            right -= search.jacobian[e, k, i] * search.excess[e, k]
        a[i, degrees] = right
        for j in range(degrees):
            total = 0.0
            for k in range(degrees):
                total += search.jacobian[e, k, i] * search.jacobian[e, k, j]
            a[i, j] = total
        trace += a[i, i]
    for i in range(degrees):
        a[i, i] += search.number[e, DAMPING] * trace / degrees + 1e-300
    for j in range(degrees):
        pivot = a[j, j]
        for i in range(j + 1, degrees):
            factor = a[i, j] / pivot if pivot > 0.0 else 0.0
            for k in range(j, degrees + 1):
                a[i, k] -= factor * a[j, k]
    _displace(e, 0, 0.0, search)
    for back in range(degrees):
        row = degrees - 1 - back
        rest = a[row, degrees]
        for k in range(row + 1, degrees):
            rest -= a[row, k] * a[k, degrees]
        step = rest / a[row, row] if a[row, row] > 0.0 else 0.0
        step = step if abs(step) < math.inf else 0.0
        a[row, degrees] = step
        _add(e, row, step, search)
    _shorten_trial(e, search)
    search.state[e, PHASE] = TRIAL
    search.state[e, STEPS] += 1


@kernel
def _shorten_trial(e: int, search: LoadSearch) -> None:
    """Shorten displacement and rotation of the next trial to what is allowed."""
    limit, radius, trial = search.extent[0], search.extent[1], search.trial[e]
    for part in range(2):
        square = 0.0
        for i in range(3):
            square += trial[3 * part + i] * trial[3 * part + i]
        most = limit + 2.0 * radius if part == 0 else limit / radius
        for i in range(3):
            trial[3 * part + i] *= most / max(math.sqrt(square), most)


@kernel
def _judge(e: int, after: float, touching: bool, search: LoadSearch) -> None:
    """Accept a step of the search or not, and go on."""
    degrees = search.state[e, DEGREES]
    before, damping = _length(search.excess[e], degrees), search.number[e, DAMPING]
    better, fresh = after < (1.0 - ENOUGH) * before, search.state[e, FRESH] == 1
    _update_jacobian(e, search)
    if better:
        _accept(e, search)
        search.number[e, DAMPING] = max(damping / DAMPING_FACTOR, LEAST_DAMPING)
        if after > SLOW * before:
            search.state[e, KNOWN] = 0
    elif fresh:
        search.number[e, DAMPING] = max(1e-6, damping * DAMPING_FACTOR)
    else:
        search.state[e, KNOWN] = 0
    if better or not fresh:
        search.state[e, FRESH] = 0
    if fresh and not better and damping > MOST_DAMPING:
        _settle(e, touching, search)
    else:
        _go_on(e, touching, search)


@kernel
def _update_jacobian(e: int, search: LoadSearch) -> None:
    """Change the Jacobian so that it gives the difference that a trial made (Broyden 1965, his first method)."""
    degrees, square = search.state[e, DEGREES], 0.0
    for k in range(degrees):
        step = _moved(e, k, search)
        square += step * step
    if square > 0.0:
        for i in range(degrees):
            missing = search.found[e, i] - search.excess[e, i]
            for k in range(degrees):
                missing -= search.jacobian[e, i, k] * _moved(e, k, search)
            for k in range(degrees):
                search.jacobian[e, i, k] += missing * _moved(e, k, search) / square


@kernel
def _moved(e: int, k: int, search: LoadSearch) -> float:
    """Return how far a trial is from the best place, along the direction of a component of the load."""
    if search.state[e, DEGREES] == 1:
        total = 0.0
        for i in range(3):
            total += search.direction[e, i] * (search.trial[e, i] - search.at[e, i])
        return total
    return (search.trial[e, k] - search.at[e, k]) * (search.extent[1] if k >= 3 else 1.0)


@kernel
def _settle(e: int, touching: bool, search: LoadSearch) -> None:
    """End the search at the best place, where a last trial brings the state if another one was run there."""
    same = True
    for i in range(6):
        if search.trial[e, i] != search.at[e, i]:
            same = False
    if same:
        _look_for_contact(e, touching, search)
    else:
        search.state[e, PHASE] = SETTLE
        _displace(e, 0, 0.0, search)


@kernel
def _look_for_contact(e: int, touching: bool, search: LoadSearch) -> None:
    """Put a target that found no contact for its load where the next search begins.

    Where the contact would exert more as soon as it touches, as damping jumps there, this is just short of touching: the next
    step then begins there, at rest, and has no such jump. Elsewhere it is the engine's pose.
    """
    loaded, away = False, False
    for i in range(search.state[e, DEGREES]):
        if search.load[e, i] != 0.0:
            loaded = True
    for i in range(6):
        if search.at[e, i] != 0.0:
            away = True
    if not loaded or not away or touching:
        search.state[e, PHASE] = DONE
    elif search.number[e, LEAST_PUSH] < math.inf:
        search.state[e, PHASE] = RETREAT
        search.state[e, COUNT] = BISECTIONS
        for i in range(6):  # later trials may write `touched`, so that its value is kept in a place that is not used any more
            search.system[e, i, 0] = search.touched[e, i]
        _halve(e, search)
    else:
        search.state[e, PHASE] = LAST
        for i in range(6):
            search.trial[e, i] = 0.0


@kernel
def _halve(e: int, search: LoadSearch) -> None:
    """Let the next trial be in the middle between a place that does not touch and one that does."""
    for i in range(6):
        search.trial[e, i] = 0.5 * (search.at[e, i] + search.system[e, i, 0])


@kernel
def _bisect(e: int, touching: bool, search: LoadSearch) -> None:
    """Replace one of the two places by the one between them, and go on."""
    for i in range(6):
        if touching:
            search.system[e, i, 0] = search.trial[e, i]
        else:
            search.at[e, i] = search.trial[e, i]
    search.state[e, COUNT] -= 1
    if search.state[e, COUNT] > 0:
        _halve(e, search)
    else:
        search.state[e, PHASE] = LAST
        _displace(e, 0, 0.0, search)


@kernel
def _length(values: np.ndarray, count: int) -> float:
    """Return the length of a vector's first entries."""
    square = 0.0
    for i in range(count):
        square += values[i] * values[i]
    return math.sqrt(square)
