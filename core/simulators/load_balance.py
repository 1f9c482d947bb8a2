# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps in which the load is given: how far the target must be displaced for the texels to carry it.

Engines with rigid contact report a wrench and no penetration. The displacement of the target from the engine's pose is found at
which the contact exerts this wrench, by Levenberg and Marquardt's method (Marquardt 1963) with Broyden's update (Broyden 1965)
of a Jacobian from differences. A trial is a whole step, from the state at the step's beginning, so that damping, friction and
effects are those of the motion that is kept. Damping jumps where a texel touches in motion (not with Hunt and Crossley's law).
A load within such a jump is balanced up to the jump, and the next step goes on from there; where nothing touches yet, from just
short of touching. All environments go through the
method together, and none affects another.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..errors import ParameterError
from ..geometry.rotations import quaternion_product, quaternions_from_vectors, rotation_matrices
from ..solver.pressed_model import PressedModel
from ..solver.pressing import Environment, PressedTexels, begin_at, stacked_states

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


class LoadBalance:
    """Finds displacements of the target of E environments.

    Parameters
    ----------
    model : PressedModel
    out : PressedTexels
        Whose poses `press` reads and whose wrench it writes; of one target.
    environments : list of Environment
    press : callable
        Runs one step of all environments.

    Raises
    ------
    ParameterError
        There are several targets.

    Attributes
    ----------
    displacement : (E, 6) float, metres and rad
        Of the target from the engine's pose: in the world, and rotation vector about its origin.
    """

    def __init__(self, model: PressedModel, out: PressedTexels, environments: list[Environment], press: Callable[[], None]):
        if out.wrench.shape[1] != 1:
            raise ParameterError(
                f"A wrench is given for {out.wrench.shape[1]} targets: make a sensor for each target whose load is given."
            )
        count, texels = len(environments), model.sensor.texels
        self._out, self._environments, self._run = out, environments, press
        offset, normal = texels.position - texels.position.mean(axis=0), texels.normal.mean(axis=0)
        self._normal = normal / max(float(np.linalg.norm(normal)), 1e-300)
        self._radius = float(np.sqrt((offset**2).sum(axis=1).mean()))
        self._limit = model.sensor.parameters.max_penetration
        self._states = stacked_states(environments)
        self._saved = [np.empty_like(field) for field in self._states]
        self._jacobian = np.zeros((count, 6, 6))
        self._known = np.zeros((count, 6), bool)  # by degrees of freedom, less one
        self.displacement = np.zeros((count, 6))

    def forget(self, chosen: np.ndarray) -> None:
        """Put the targets of some environments (E,) back to the engine's poses."""
        self.displacement[chosen] = 0.0
        self._known[chosen] = False

    def step(self, wrench: np.ndarray) -> np.ndarray:
        """Run one step under a load, and return the part of it that the contact does not exert.

        Parameters
        ----------
        wrench : (E, m) float, N and N·m
            That the contact exerts on the target: force along the sensor's mean normal (m = 1), force in the world (3), or
            force and torque about the target's origin (6). Of environments with poses or a wrench that are not finite
            everything becomes zero.

        Returns
        -------
        residual : (E, m) float, N and N·m
        """
        out = self._out
        whole = np.isfinite(wrench).all(axis=1) & np.isfinite(out.poses).all(axis=(1, 2))
        whole &= (out.poses[:, :, 3:] != 0.0).any(axis=2).all(axis=1)
        out.poses[~whole] = np.nan
        self.forget(out.begins | ~whole)
        for number in np.flatnonzero(out.begins & whole):
            begin_at(out.poses[number], self._environments[number])
        out.begins[whole] = False
        for copy, field in zip(self._saved, self._states, strict=True):
            np.copyto(copy, field)
        search = _Search(self, whole, np.where(whole[:, None], wrench, 0.0))
        found = search.run()
        self.displacement[whole] = found[whole]
        return search.residual()

    def directions(self, degrees: int, poses: np.ndarray) -> np.ndarray:
        """Return the displacements (E, 6, m) that belong to the components of the load, rotations per radius."""
        count = len(poses)
        basis = np.zeros((count, 6, degrees))
        if degrees == 1:
            basis[:, :3, 0] = rotation_matrices(poses[:, 0, 3:]) @ self._normal
            return basis
        basis[:, np.arange(degrees), np.arange(degrees)] = 1.0
        basis[:, 3:] /= self._radius
        return basis

    def press(self, engine: np.ndarray, displacement: np.ndarray) -> np.ndarray:
        """Run the step with the target displaced from the engine's poses (E, 7), and return the wrench on it (E, 6)."""
        out = self._out
        for copy, field in zip(self._saved, self._states, strict=True):
            np.copyto(field, copy)
        out.poses[:, 1, :3] = engine[:, :3] + displacement[:, :3]
        out.poses[:, 1, 3:] = quaternion_product(quaternions_from_vectors(displacement[:, 3:]), engine[:, 3:])
        self._run()
        return out.wrench[:, 0].copy()

    @property
    def limit(self) -> float:
        """Longest way to the contact, and largest rotation times `radius`, metres.

        A displacement may be longer by two radii, as soft bristles yield by more than they are pressed in.
        """
        return self._limit

    @property
    def radius(self) -> float:
        """Radius of gyration of the texels, metres."""
        return self._radius

    def touching(self) -> np.ndarray:
        """(E,) bool: a texel exerts a force after the step that was run last."""
        return (self._out.texels[:, :, 0] > 0.0).any(axis=1)

    def poses(self) -> np.ndarray:
        """(E, 2, 7) float: the engine's poses, a copy."""
        return self._out.poses.copy()

    def jacobian(self, degrees: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the Jacobians (E, m, m) of the step before, to be overwritten, and which of them are known (E,)."""
        return self._jacobian[:, :degrees, :degrees], self._known[:, degrees - 1]

    def keep_known(self, degrees: int, known: np.ndarray) -> None:
        """Note for which environments (E,) the Jacobian was written; it holds for this number of degrees of freedom."""
        self._known[:] = False
        self._known[:, degrees - 1] = known


class _Search:
    """The search of one step."""

    def __init__(self, balance: LoadBalance, whole: np.ndarray, wrench: np.ndarray):
        self._balance, self._whole, degrees = balance, whole, wrench.shape[1]
        poses = balance.poses()
        self._engine = poses[:, 1]
        poses[~whole] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
        self._basis = balance.directions(degrees, poses)
        self._scale = np.ones(degrees)
        self._scale[3:] = balance.radius
        self._load = wrench / self._scale
        self._tolerance = TOLERANCE * np.maximum(np.linalg.norm(self._load, axis=1), SMALLEST_LOAD)
        self._jacobian, known = balance.jacobian(degrees)
        self._known = known.copy()
        self._at = np.where((self._load != 0.0).any(axis=1)[:, None], balance.displacement, 0.0)
        self._last = self._at
        self._least_push, self._touching = np.full(len(whole), np.inf), self._at  # where the contact exerts least of the load
        self._excess = self._evaluate(self._at)

    def run(self) -> np.ndarray:
        """Return the displacements (E, 6) at which the state and what is measured are now."""
        searched = self._approach()
        stuck = ~searched
        damping = np.full(len(stuck), LEAST_DAMPING)
        fresh = np.zeros(len(stuck), bool)
        for _ in range(TRIALS):
            size = np.linalg.norm(self._excess, axis=1)
            active = ~stuck & (size > self._tolerance)
            if not active.any():
                break
            fresh |= self._differentiate(active & ~self._known)
            trial = np.where(active[:, None], self._bounded(self._at + self._step(damping, active)), self._at)
            excess = self._evaluate(trial)
            after = np.linalg.norm(excess, axis=1)
            better = active & (after < (1.0 - ENOUGH) * size)
            worse = active & ~better
            self._update(active, trial, excess)
            self._at = np.where(better[:, None], trial, self._at)
            self._excess = np.where(better[:, None], excess, self._excess)
            stuck |= worse & fresh & (damping > MOST_DAMPING)
            damping = np.where(worse & fresh, np.maximum(1e-6, damping * DAMPING_FACTOR), damping)
            damping = np.where(better, np.maximum(damping / DAMPING_FACTOR, LEAST_DAMPING), damping)
            self._known &= ~((worse & ~fresh) | (better & (after > SLOW * size)))
            fresh &= ~better & self._known
        self._balance.keep_known(self._load.shape[1], self._known & searched)
        if not np.array_equal(self._last, self._at):
            self._excess = self._evaluate(self._at)
        lost = self._whole & (self._load != 0.0).any(axis=1) & ~self._balance.touching() & (self._at != 0.0).any(axis=1)
        if lost.any():
            self._retreat(lost)
        return self._at

    def residual(self) -> np.ndarray:
        """Return the load less what the contact exerts, (E, m), N and N·m."""
        return -self._excess * self._scale

    def _retreat(self, lost: np.ndarray) -> None:
        """Put targets that found no contact for their load where the next search begins.

        Where the contact would exert more as soon as it touches, as damping jumps there, this is just short of touching: the
        next step then begins there, at rest, and has no such jump. Elsewhere it is the engine's pose.
        """
        jumps = lost & np.isfinite(self._least_push)
        away, touching = np.where(jumps[:, None], self._at, 0.0), self._touching
        for _ in range(BISECTIONS if jumps.any() else 0):
            middle = np.where(jumps[:, None], 0.5 * (away + touching), self._at)
            self._evaluate(middle)
            met = (jumps & self._balance.touching())[:, None]
            away, touching = np.where(met, away, middle), np.where(met, middle, touching)
        self._at = np.where(lost[:, None], np.where(jumps[:, None], away, 0.0), self._at)
        self._excess = self._evaluate(self._at)

    def _evaluate(self, displacement: np.ndarray) -> np.ndarray:
        """Run a trial, and return what the contact exerts more than the load, (E, m), N; torques over the radius."""
        self._last = displacement
        wrench = self._balance.press(self._engine, displacement)
        given = np.matmul(wrench[:, None], self._basis)[:, 0]
        push = np.sum(given * self._load, axis=1)
        # The least, not the last: which trials come last depends on the other environments.
        less = self._balance.touching() & (push > 0.0) & (push < self._least_push)
        self._touching = np.where(less[:, None], displacement, self._touching)
        self._least_push = np.where(less, push, self._least_push)
        return np.where(self._whole[:, None], given - self._load, 0.0)

    def _bounded(self, displacement: np.ndarray) -> np.ndarray:
        """Shorten displacements, and rotations, to what is allowed."""
        bounded = displacement.copy()
        turn, way = self._balance.limit / self._balance.radius, self._balance.limit + 2.0 * self._balance.radius
        for part, most in ((bounded[:, :3], way), (bounded[:, 3:], turn)):
            part *= most / np.maximum(np.linalg.norm(part, axis=1, keepdims=True), most)
        return bounded

    def _approach(self) -> np.ndarray:
        """Move targets that should be in contact, and are not, against the load until they are.

        Returns
        -------
        searched : (E,) bool
        """
        loaded = self._whole & (np.linalg.norm(self._excess, axis=1) > self._tolerance)
        away = loaded & ~self._balance.touching()
        if not away.any():
            return loaded
        size = np.linalg.norm(self._load[:, :3], axis=1, keepdims=True)
        force = np.matmul(self._basis[:, :3, :3], self._load[:, :3, None])[:, :, 0]
        against = np.zeros_like(self._at)
        against[:, :3] = np.where(away[:, None], -force / np.maximum(size, 1e-300), 0.0)
        open_ = away.copy()
        for halving in range(HALVINGS, -1, -1):
            trial = self._bounded(against * (self._balance.limit * 0.5**halving))
            trial = np.where(open_[:, None], trial, self._at)
            excess = self._evaluate(trial)
            met = open_ & self._balance.touching()
            self._at, self._excess = np.where(met[:, None], trial, self._at), np.where(met[:, None], excess, self._excess)
            open_ &= ~met
            self._known &= ~met
            if not open_.any():
                break
        self._at = np.where(open_[:, None], 0.0, self._at)
        return loaded & ~open_

    def _differentiate(self, chosen: np.ndarray) -> np.ndarray:
        """Compute the Jacobian of some environments again; return them."""
        if chosen.any():
            small = DIFFERENCE * self._balance.limit
            for column in range(self._jacobian.shape[2]):
                aside = np.where(chosen[:, None], self._at + small * self._basis[:, :, column], self._at)
                slope = (self._evaluate(aside) - self._excess) / small
                self._jacobian[chosen, :, column] = slope[chosen]
            self._known |= chosen
        return chosen

    def _step(self, damping: np.ndarray, active: np.ndarray) -> np.ndarray:
        """Return the next step (E, 6) of Levenberg and Marquardt's method."""
        jacobian = np.where(active[:, None, None], self._jacobian, np.eye(self._jacobian.shape[1]))
        transposed = np.swapaxes(jacobian, 1, 2)
        normal = transposed @ jacobian
        mean = np.trace(normal, axis1=1, axis2=2) / normal.shape[1]
        normal += (damping * mean + 1e-300)[:, None, None] * np.eye(normal.shape[1])
        step = np.linalg.solve(normal, -(transposed @ self._excess[:, :, None]))
        return np.nan_to_num(self._basis @ step, nan=0.0, posinf=0.0, neginf=0.0)[:, :, 0]

    def _update(self, active: np.ndarray, trial: np.ndarray, excess: np.ndarray) -> None:
        """Change the Jacobian so that it gives the difference that a trial made (Broyden 1965, his first method)."""
        moved = trial - self._at
        moved[:, 3:] *= self._balance.radius**2  # the basis has rotations per radius
        step = np.matmul(moved[:, None], self._basis)[:, 0]
        square = np.einsum("ei,ei->e", step, step)
        usable = active & (square > 0.0)
        missing = excess - self._excess - (self._jacobian @ step[:, :, None])[:, :, 0]
        change = missing[:, :, None] * step[:, None, :] / np.where(usable, square, 1.0)[:, None, None]
        self._jacobian += np.where(usable[:, None, None], change, 0.0)
