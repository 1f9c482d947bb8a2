# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps in which the load is given: how far the target must be displaced for the texels to carry it.

Engines with rigid contact report a wrench and no penetration. The displacement of the target from the engine's pose is found at
which the contact exerts this wrench (see :mod:`.load_search`). A trial is a whole step, from the state at the step's beginning,
so that damping, friction and effects are those of the motion that is kept. Damping jumps where a texel touches in motion (not
with Hunt and Crossley's law). A load within such a jump is balanced up to the jump, and the next step goes on from there; where
nothing touches yet, from just short of touching. All environments go through the method together, and none affects another.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..compiled.kernels import kernel
from ..errors import ParameterError
from ..geometry.rotations import rotation_matrices
from ..solver.pressed_model import PressedModel
from ..solver.pressing import Environment, PressedTexels, begin_at, stacked_states
from .load_search import DONE, PHASE, LoadSearch, advance_search, begin_search, forget_load, place_trial


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
        check_targets(out.wrench.shape[1])
        count = len(environments)
        self._out, self._environments, self._press = out, environments, press
        self._search = LoadSearch.of(model.sensor.texels, model.sensor.parameters.max_penetration, count)
        self._rotation = np.zeros((count, 3, 3))
        self._units = np.where(np.arange(6) < 3, -1.0, -self._search.extent[1])
        self._normals, self._degrees = model.sensor.texels.normal, 0
        self._states = stacked_states(environments)
        self._saved = [np.empty_like(field) for field in self._states]
        self.displacement = self._search.at

    def forget(self, chosen: np.ndarray) -> None:
        """Put the targets of some environments (E,) back to the engine's poses."""
        for number in np.flatnonzero(chosen):
            forget_load(int(number), self._search)

    @property
    def pulls(self) -> np.ndarray:
        """See :func:`pulling_loads`."""
        search = self._search
        return pulling_loads(search.given[:, : self._degrees], search.direction, self._rotation, self._normals)

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
        out, degrees = self._out, wrench.shape[1]
        self._degrees = degrees
        whole = np.isfinite(wrench).all(axis=1) & np.isfinite(out.poses).all(axis=(1, 2))
        whole &= (out.poses[:, :, 3:] != 0.0).any(axis=2).all(axis=1)
        out.poses[~whole] = np.nan
        self.forget(out.begins | ~whole)
        for number in np.flatnonzero(out.begins & whole):
            begin_at(out.poses[number], self._environments[number])
        out.begins[whole] = False
        for copy, field in zip(self._saved, self._states, strict=True):
            np.copyto(copy, field)
        np.copyto(self._search.engine, out.poses[:, 1])
        quaternion = out.poses[whole, 0, 3:]
        self._rotation[whole] = rotation_matrices(quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True))
        self._search.given[:, :degrees] = wrench
        _begin_searches(degrees, whole, self._rotation, out.poses, self._search)
        going = True
        while going:
            for copy, field in zip(self._saved, self._states, strict=True):
                np.copyto(field, copy)
            self._press()
            going = _advance_searches(out.wrench, out.texels, out.poses, self._search)
        return (self._search.excess * self._units)[:, :degrees]


def pulling_loads(given: np.ndarray, direction: np.ndarray, rotation: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return where no texel can push along the force of a load, so that contact exerts nothing of it.

    Parameters
    ----------
    given : (E, 6), (E, 3) or (E, 1) float, N and N·m
    direction : (E, 3) float
        Of loads with one component, world.
    rotation : (E, 3, 3) float
        Of the sensors.
    normals : (n, 3) float
        Of the texels.

    Returns
    -------
    (E,) bool
    """
    given = np.where(np.isfinite(given), given, 0.0)
    force = given * direction if given.shape[1] == 1 else given[:, :3]
    along = np.einsum("eji,ej->ei", rotation, force) @ normals.T
    shear = 1e-9 * np.linalg.norm(force, axis=1, keepdims=True)  # rounding: what has no part along a normal is no pull
    return np.asarray((along < -shear).all(axis=1))


def reason_of_pulls(pulls: np.ndarray) -> str:
    """Return which of the environments, (E,) bool, have a load that pulls, and why nothing balances it; else empty."""
    if not pulls.any():
        return ""
    return f"In {pulls.sum()} of {len(pulls)} environments ({first_numbers(pulls)}) the load {PULL}"


def first_numbers(which: np.ndarray) -> str:
    """Return the first environments of a mask."""
    found = np.flatnonzero(which)
    return ", ".join(map(str, found[:8])) + (" …" if len(found) > 8 else "")


PULL = (
    "pulls the target off the sensor, and contact can only push: give the force that the contact exerts on the target, as "
    "(0, 0, 9.81) N for 1 kg at rest on a sensor that faces up."
)
"""Ending of the sentence on a load that contact cannot exert."""


def check_targets(count: int) -> None:
    """Raise :class:`.ParameterError` unless there is one target."""
    if count != 1:
        raise ParameterError(f"A wrench is given for {count} targets: make a sensor for each target whose load is given.")


@kernel
def _begin_searches(degrees: int, whole: np.ndarray, rotation: np.ndarray, poses: np.ndarray, search: LoadSearch) -> None:
    """Begin in the environments of a mask (E,), and write the poses of the first trials."""
    for e in range(whole.shape[0]):
        if whole[e]:
            begin_search(e, degrees, rotation[e], search)
            place_trial(e, poses[e, 1], search)


@kernel
def _advance_searches(wrench: np.ndarray, texels: np.ndarray, poses: np.ndarray, search: LoadSearch) -> bool:
    """Go on after a trial, write the poses of the next trials, and return whether there is one."""
    going = False
    for e in range(poses.shape[0]):
        if search.state[e, PHASE] != DONE:
            touching = False
            for texel in range(texels.shape[1]):
                touching |= texels[e, texel, 0] > 0.0
            advance_search(e, wrench[e, 0], touching, search)
            place_trial(e, poses[e, 1], search)
            going |= search.state[e, PHASE] != DONE
    return going
