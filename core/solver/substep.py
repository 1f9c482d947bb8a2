# SPDX-License-Identifier: GPL-3.0-or-later
"""The substeps of frames, and what is observed at the end of each frame (kernels).

In each substep, contacts are found where the bodies are, the velocities at its end are solved for, the bristles are brought
forward, and the positions follow with those velocities. :func:`advance_frames` is the only driver. It runs one frame, a part of
one, or many at once: a frame of a small sensor takes less time than the Python around it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..compiled.kernels import inlined, kernel
from ..geometry.rotations import write_backward_step_motion
from .detection.deformation import refit_boxes, set_moment
from .detection.detection_data import DetectionData
from .detection.narrow_phase import count_too_deep
from .dynamics.actuators import move_drives
from .dynamics.effect_kernels import commit_effect_memory
from .dynamics.modes import move, place, prescribe_velocity, write_inertia
from .fast_crossings import CrossingLimits, may_cross
from .implicit_velocities import solve_velocities
from .parallel_loops import UPDATE_FRICTION, find_all_contacts, run_parallel_loop, write_all_contacts
from .solver_model import SolverModel, State
from .texel_readout import TexelReadout, read_texels
from .workspace import Workspace


class FramePath(NamedTuple):
    """Prescribed motion during the steps of a frame.

    Attributes
    ----------
    position, quaternion : (steps + 1, b, 3) and (steps + 1, b, 4) float
        Of keyframed bodies at the beginning of each step, and at the end of the last; of driven ones without their travel.
    velocity : (steps, b, 6) float
        Their velocities during each step.
    commands : (steps, d, 4) float
        Commands to the actuators.
    """

    position: np.ndarray
    quaternion: np.ndarray
    velocity: np.ndarray
    commands: np.ndarray


NOTHING, TEXELS, FRAME = range(3)
"""Observations after the steps: nothing; the texels alone, for controllers; or all of :class:`ObservedFrames`."""


class ObservedFrames(NamedTuple):
    """Observations at the end of each of F frames.

    Attributes
    ----------
    texels : TexelReadout
        With a leading axis of length F in each array.
    position, quaternion, velocity : (F, b, 3), (F, b, 4) and (F, b, 6) float
        Of the :class:`.State`. Before the first frame is observed, its row holds the poses at its beginning.
    rotation : (F, b, 3, 3) float
        Of the bodies.
    too_deep, too_deep_between : (F, q) int
        Contact points of each pair that are pressed past their maximum penetration: at the frame, and in the worst step before.
    may_cross : (F,) bool
        Whether a target may have been too fast (see :mod:`.fast_crossings`).
    """

    texels: TexelReadout
    position: np.ndarray
    quaternion: np.ndarray
    velocity: np.ndarray
    rotation: np.ndarray
    too_deep: np.ndarray
    too_deep_between: np.ndarray
    may_cross: np.ndarray

    @classmethod
    def zero(cls, frames: int, texels: int, sensors: int, bodies: int, pairs: int) -> ObservedFrames:
        """Return the observations of sensors without contact."""
        f, b = frames, bodies
        return cls(
            texels=TexelReadout.zero(texels, sensors, f),
            position=np.zeros((f, b, 3)),
            quaternion=np.zeros((f, b, 4)),
            velocity=np.zeros((f, b, 6)),
            rotation=np.zeros((f, b, 3, 3)),
            too_deep=np.zeros((f, pairs), np.int64),
            too_deep_between=np.zeros((f, pairs), np.int64),
            may_cross=np.zeros(f, np.bool_),
        )

    def part(self, frames: slice) -> ObservedFrames:
        """Return some of the frames, by their indices; the arrays are views."""
        texels = TexelReadout(*(values[frames] for values in self.texels))
        return ObservedFrames(texels, *(values[frames] for values in self[1:]))


@inlined
def advance_steps(
    dt: float,
    first: int,
    last: int,
    path: FramePath,
    model: SolverModel,
    detection: DetectionData,
    state: State,
    workspace: Workspace,
    known: bool,
) -> int:
    """Run some of the substeps of one frame; the state is brought forward in place.

    Parameters
    ----------
    dt : float, seconds
    first, last : int
        Steps to run, the last one excluded.
    path : FramePath
    model : SolverModel
    detection : DetectionData
    state : State
    workspace : Workspace
    known : bool
        The state has the contacts at the beginning of the first step, which need not be found then.

    Returns
    -------
    too_deep : int
        Largest number of contact points that were pressed too deep to act in any one step; if it is not zero,
        ``workspace.contacts.most_too_deep`` has their numbers in that step, by pair.
    """
    worst = 0
    surfaces = detection.surfaces
    deforms = surfaces.any_deforms[0]
    if deforms and first == 0:
        refit_boxes(surfaces, detection.tree)
    for step in range(first, last):
        _place(path.position[step], path.quaternion[step], model, state, workspace)
        _set_prescribed_velocities(step, dt, path, model, state, workspace)
        if deforms:
            set_moment(step, step + 1, dt, model, surfaces)
        too_deep = 0
        if known and step == first:
            write_all_contacts(dt, model, detection, state, workspace)
        else:
            too_deep = find_all_contacts(dt, model, detection, state, workspace)
        if too_deep > worst:
            worst = too_deep
            for pair in range(len(model.pairs.sensor)):
                workspace.contacts.most_too_deep[pair] = workspace.contacts.too_deep[pair]
        for body in range(len(model.bodies.mode)):
            write_inertia(body, model, workspace)
        solve_velocities(dt, path.commands[step], model, detection, state, workspace)
        if len(workspace.effects.contacts.force) > 0:
            commit_effect_memory(dt, model, state, workspace)
        run_parallel_loop(UPDATE_FRICTION, model, detection, state, workspace)
        if len(model.drives.gains) > 0:
            move_drives(dt, path.commands[step], model, state, workspace)
        for body in range(len(model.bodies.mode)):
            move(body, dt, model, state, workspace)
    if deforms:
        set_moment(last, last - 1, dt, model, surfaces)
    _place(path.position[last], path.quaternion[last], model, state, workspace)
    for body in range(len(model.bodies.mode)):
        write_backward_step_motion(state.velocity[body], dt, workspace.bodies.step_motion[body])
    return worst


@kernel
def advance_frames(
    dt: float,
    steps: tuple[int, int],
    observed: int,
    path: FramePath,
    limits: CrossingLimits,
    model: SolverModel,
    detection: DetectionData,
    state: State,
    workspace: Workspace,
    seen: ObservedFrames,
) -> None:
    """Run steps of F frames and observe each; the state is brought forward in place.

    Parameters
    ----------
    dt : float, seconds
    steps : (int, int)
        Steps of each frame to run, the last one excluded; none where both are equal.
    observed : int
        NOTHING, TEXELS or FRAME.
    path : FramePath
        With a leading axis of length F in each array.
    limits : CrossingLimits
    model : SolverModel
    detection : DetectionData
    state : State
    workspace : Workspace
    seen : ObservedFrames
        Zero at first, apart from the poses before the first frame; written.
    """
    first, last = steps
    for frame in range(len(seen.may_cross)):
        own = FramePath(path.position[frame], path.quaternion[frame], path.velocity[frame], path.commands[frame])
        if last > first:
            worst = advance_steps(dt, first, last, own, model, detection, state, workspace, False)
            known = 0
            for pair in range(len(model.pairs.sensor)):
                known += seen.too_deep_between[frame, pair]
            if worst > known:
                for pair in range(len(model.pairs.sensor)):
                    seen.too_deep_between[frame, pair] = workspace.contacts.most_too_deep[pair]
        if observed == NOTHING:
            continue
        find_all_contacts(-dt, model, detection, state, workspace)
        if observed == FRAME:
            for pair in range(len(model.pairs.sensor)):
                seen.too_deep[frame, pair] = count_too_deep(pair, model, detection, state, workspace)
        t = seen.texels
        out = TexelReadout(
            t.force[frame], t.shear[frame], t.friction[frame], t.depth[frame], t.slip[frame], t.contact[frame],
            t.strongest[frame], t.net[frame], t.moment[frame],
        )  # fmt: skip
        read_texels(model, state, workspace, out)
        if last > first:
            previous = max(frame - 1, 0)
            before = seen.position[previous], seen.quaternion[previous]
            after = state.position, state.quaternion
            seen.may_cross[frame] = may_cross(limits, dt, own.velocity, before, after)
        copy_table(state.position, seen.position[frame])
        copy_table(state.quaternion, seen.quaternion[frame])
        copy_table(state.velocity, seen.velocity[frame])
        for body in range(len(state.position)):
            copy_table(workspace.bodies.rotation[body], seen.rotation[frame, body])


@kernel
def copy_table(values: np.ndarray, out: np.ndarray) -> None:
    """Write the values (r, c) into `out`, without a temporary array."""
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            out[i, j] = values[i, j]


@inlined
def _set_prescribed_velocities(
    step: int, dt: float, path: FramePath, model: SolverModel, state: State, workspace: Workspace
) -> None:
    """Remember the velocities at a step's beginning, and give keyframed and driven bodies those of the path."""
    for drive in range(len(model.drives.gains)):
        workspace.drives.mass[drive] = workspace.drives.load[drive] = 0.0
    for body in range(len(model.bodies.mode)):
        for i in range(6):
            workspace.bodies.velocity_before[body, i] = state.velocity[body, i]
        prescribe_velocity(body, dt, path.velocity[step, body], path.quaternion[step + 1, body], model, state, workspace)


@inlined
def _place(position: np.ndarray, quaternion: np.ndarray, model: SolverModel, state: State, workspace: Workspace) -> None:
    """Put the bodies where their paths have them at the beginning of a step."""
    for body in range(len(model.bodies.mode)):
        place(body, position, quaternion, model, state, workspace)
