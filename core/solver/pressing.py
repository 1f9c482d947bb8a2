# SPDX-License-Identifier: GPL-3.0-or-later
"""Single steps of sensors and targets that another program moves, in any number of environments (kernels).

An environment is one sensor with the object in contact with it. All environments share the model and the targets' tree; each
has its own state and neighbour lists, and each thread its own working memory, of which nothing lasts from one environment to
the next.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..compiled.kernels import addressed_kernel, kernel
from ..compiled.struct_reference import address_of_fields, by_reference, call_of_range, reference_at
from ..geometry.rotations import write_backward_step_motion, write_velocity
from .detection.detection_data import DetectionData, NeighbourLists
from .parallel_loops import find_all_contacts
from .solver_model import NO_TRIANGLE, SolverModel, State
from .substep import FramePath, advance_steps, copy_table
from .texel_readout import TexelReadout, read_pair
from .workspace import Workspace


@by_reference
class OwnNumbers(NamedTuple):
    """The parameters of an environment's sensor.

    Attributes
    ----------
    law : (q, 10) float
        As :attr:`.Pairs.law`.
    constants : (rows, c) float
        As :attr:`.EffectProgram.constants`.
    readout : (2,) float
        Zero and gain of the readings.
    """

    law: np.ndarray
    constants: np.ndarray
    readout: np.ndarray


@by_reference
class Environment(NamedTuple):
    """State of an environment from step to step.

    Attributes
    ----------
    detection : DetectionData
    state : State
    found : (1,) bool
        The state has the contacts at the poses where the bodies are.
    own : OwnNumbers
    """

    detection: DetectionData
    state: State
    found: np.ndarray
    own: OwnNumbers


@by_reference
class PressedTexels(NamedTuple):
    """Inputs and results of E environments of a sensor with n texels and T targets.

    Attributes
    ----------
    poses : (E, 1 + T, 7) float
        Position (m) and quaternion of the sensor and of each target at the step's end; read.
    begins : (E,) bool
        The environment begins with this step, at rest at these poses.
    valid : (E,) bool
        Its poses are poses. Of others everything is zero, and they are reset with their next valid poses.
    texels : (E, n, 3) float, N
        Normal force, and shear along the texel's x and y axis.
    readings : (E, n) float
    contact : (E, n) bool
    wrench : (E, T, 6) float, N and N·m
        Force on each target in the world, and torque about the origin of its frame.
    too_deep : (E,) int
        How many contact points are pressed past their maximum penetration, and measure nothing.
    """

    poses: np.ndarray
    begins: np.ndarray
    valid: np.ndarray
    texels: np.ndarray
    readings: np.ndarray
    contact: np.ndarray
    wrench: np.ndarray
    too_deep: np.ndarray

    @classmethod
    def zero(cls, environments: int, texels: int, targets: int) -> PressedTexels:
        """Return room for environments that all begin with their first step."""
        e, n = environments, texels
        return cls(
            poses=np.zeros((e, 1 + targets, 7)),
            begins=np.ones(e, np.bool_),
            valid=np.ones(e, np.bool_),
            texels=np.zeros((e, n, 3)),
            readings=np.zeros((e, n)),
            contact=np.zeros((e, n), np.bool_),
            wrench=np.zeros((e, targets, 6)),
            too_deep=np.zeros(e, np.int64),
        )


@by_reference
class StepMemory(NamedTuple):
    """Working memory for the step of one environment: its :class:`.FramePath` and its :class:`.TexelReadout`.

    `net` is the part of the target that was read last, `whole_net` (6,) the sum over targets, and `centre` (3,), metres, the
    centre of pressure.
    """

    position: np.ndarray
    quaternion: np.ndarray
    velocity: np.ndarray
    commands: np.ndarray
    force: np.ndarray
    shear: np.ndarray
    friction: np.ndarray
    depth: np.ndarray
    slip: np.ndarray
    contact: np.ndarray
    strongest: np.ndarray
    net: np.ndarray
    moment: np.ndarray
    whole_net: np.ndarray
    centre: np.ndarray

    @classmethod
    def zero(cls, texels: int, targets: int) -> StepMemory:
        """Allocate it."""
        b = 1 + targets
        path = FramePath(np.zeros((2, b, 3)), np.zeros((2, b, 4)), np.zeros((1, b, 6)), np.zeros((1, 0, 4)))
        return cls(*path, *TexelReadout.zero(texels, 1), np.zeros(6), np.zeros(3))


@by_reference
class Pressing(NamedTuple):
    """All that a thread needs for steps of environments.

    Attributes
    ----------
    dt : (1,) float, seconds
    painted : (n,) float
        Factors of the texels' gains.
    model : SolverModel
        Whose laws and constants of effects are this thread's, and become those of the environment that it works on.
    workspace : Workspace
    memory : StepMemory
    pressed : PressedTexels
    addresses : (E,) int
        Of each :class:`Environment`.
    example : Environment
        One of them, for its type.
    """

    dt: np.ndarray
    painted: np.ndarray
    model: SolverModel
    workspace: Workspace
    memory: StepMemory
    pressed: PressedTexels
    addresses: np.ndarray
    example: Environment


def make_environments(
    count: int, detection: DetectionData, state: State, own: Callable[[int], OwnNumbers]
) -> list[Environment]:
    """Return environments that begin as this one; the arrays of all of them lie behind one another.

    `own` returns the parameters of each, by number.
    """
    found = np.zeros((count, 1), np.bool_)
    lists, states = ([np.repeat(field[None], count, axis=0) for field in part] for part in (detection.neighbours, state))
    return [
        Environment(
            DetectionData(detection.tree, NeighbourLists(*(rows[i] for rows in lists)), detection.surfaces, detection.shapes),
            State(*(rows[i] for rows in states)),
            found[i],
            own(i),
        )
        for i in range(count)
    ]


def stacked_states(environments: list[Environment]) -> list[np.ndarray]:
    """Return the states of environments of :func:`make_environments`, each array with a leading axis of E."""
    stacks = [field.base for field in (*environments[0].state, environments[0].found)]
    return [stack for stack in stacks if stack is not None]


def addresses_of(environments: list[Environment]) -> np.ndarray:
    """Return the addresses of environments."""
    return np.array([address_of_fields(one) for one in environments], np.int64)


def begin_at(poses: np.ndarray, environment: Environment) -> None:
    """Put an environment back to its beginning, at rest at these poses (b, 7); its next step goes on from there."""
    forget(environment.state)
    environment.found[0] = False
    environment.state.position[...] = poses[:, :3]
    environment.state.quaternion[...] = poses[:, 3:] / np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)


def presser(pressing: Pressing, environments: list[Environment]) -> Callable[[int, int], None]:
    """Return what runs one step of some environments, from the first to the last one excluded, in one thread.

    No other thread may use the working memory of `pressing`.
    """

    def press(first: int, last: int) -> None:
        for number in range(first, last):
            press_environment(number, pressing, environments[number])

    return call_of_range(press_environments, pressing, press)


@addressed_kernel
def press_environments(first: int, last: int, pressing: Pressing) -> None:
    """Run one step of some environments, the last one excluded."""
    for number in range(first, last):
        press_environment(number, pressing, reference_at(pressing.addresses[number], pressing.example))


@kernel
def press_environment(number: int, pressing: Pressing, environment: Environment) -> None:
    """Run one step of an environment and write down what its sensor measures."""
    out, poses, model, workspace = pressing.pressed, pressing.pressed.poses[number], pressing.model, pressing.workspace
    memory, state, dt, own = pressing.memory, environment.state, pressing.dt[0], environment.own
    out.valid[number] = are_poses(poses)
    if not out.valid[number]:
        out.begins[number] = True
        _clear(number, out)
        return
    copy_table(own.law, model.pairs.law)
    copy_table(own.constants, model.effects.constants)
    _write_path(dt, poses, out.begins[number], state, memory)
    if out.begins[number]:
        forget(state)
        environment.found[0] = False
    out.begins[number] = False
    for body in range(len(state.velocity)):  # the working memory is that of another environment
        write_backward_step_motion(state.velocity[body], dt, workspace.bodies.step_motion[body])
    path = FramePath(memory.position, memory.quaternion, memory.velocity, memory.commands)
    advance_steps(dt, 0, 1, path, model, environment.detection, state, workspace, environment.found[0])
    out.too_deep[number] = find_all_contacts(-dt, model, environment.detection, state, workspace)
    environment.found[0] = True
    _read(number, pressing, own.readout, state)


@kernel
def are_poses(poses: np.ndarray) -> bool:
    """Whether all of the poses (b, 7) are finite, with quaternions that are not zero."""
    good = True
    for body in range(poses.shape[0]):
        size, square = 0.0, 0.0
        for i in range(7):
            size += abs(poses[body, i])
        for i in range(3, 7):
            square += poses[body, i] * poses[body, i]
        if not (size < math.inf and 0.0 < square < math.inf):
            good = False
    return good


@kernel
def _clear(number: int, out: PressedTexels) -> None:
    """Let an environment measure nothing."""
    out.too_deep[number] = 0
    out.readings[number, :] = 0.0
    out.contact[number, :] = False
    out.texels[number, :, :] = 0.0
    out.wrench[number, :, :] = 0.0


@kernel
def _write_path(dt: float, poses: np.ndarray, begins: bool, state: State, memory: StepMemory) -> None:
    """Write from where to where the bodies go in this step, and their velocities; at the beginning they are at rest."""
    for body in range(len(poses)):
        w, x, y, z = poses[body, 3], poses[body, 4], poses[body, 5], poses[body, 6]
        length = math.sqrt(w * w + x * x + y * y + z * z)
        for i in range(3):
            memory.position[1, body, i] = poses[body, i]
            memory.position[0, body, i] = poses[body, i] if begins else state.position[body, i]
        for i in range(4):
            memory.quaternion[1, body, i] = poses[body, 3 + i] / length
            memory.quaternion[0, body, i] = memory.quaternion[1, body, i] if begins else state.quaternion[body, i]
        write_velocity(
            memory.position[0, body], memory.quaternion[0, body], memory.position[1, body], memory.quaternion[1, body],
            dt, memory.velocity[0, body],
        )  # fmt: skip


@kernel
def forget(state: State) -> None:
    """Bring a state back to the beginning of a run; where the bodies are is written afterwards."""
    state.velocity[:] = 0.0
    state.triangle[:] = NO_TRIANGLE
    state.pressed_share[:] = 0.0
    state.bristle[:] = 0.0
    state.effect_memory[:] = 0.0


@kernel
def _read(number: int, pressing: Pressing, readout: np.ndarray, state: State) -> None:
    """Write down what the sensor measures, from contacts that were just found."""
    t, out, model, workspace = pressing.memory, pressing.pressed, pressing.model, pressing.workspace
    for texel in range(len(t.force)):
        t.force[texel] = 0.0
    for texel in range(len(t.force)):  # one loop for each array, which is then one block of memory
        t.friction[texel] = 0.0
    for texel in range(len(t.force)):
        t.depth[texel] = 0.0
    for texel in range(len(t.force)):
        t.slip[texel] = 0.0
    for texel in range(len(t.force)):
        t.strongest[texel] = -1.0
    for texel in range(len(t.force)):
        t.contact[texel] = False
    for texel in range(len(t.force)):
        t.shear[texel, 0] = t.shear[texel, 1] = 0.0
    for i in range(4):
        t.moment[0, i] = 0.0
    for i in range(6):
        t.whole_net[i] = 0.0
    for target in range(out.wrench.shape[1]):
        for i in range(6):
            out.wrench[number, target, i] = 0.0
    pair, pairs = 0, len(model.pairs.sensor)
    while pair < pairs:  # pairs with one target follow one another
        target = model.pairs.target[pair]
        for i in range(6):
            t.net[0, i] = 0.0
        while pair < pairs and model.pairs.target[pair] == target:
            texels = TexelReadout(
                t.force, t.shear, t.friction, t.depth, t.slip, t.contact, t.strongest, t.net, t.moment
            )  # fmt: skip
            read_pair(pair, model, state, workspace, texels)
            pair += 1
        for i in range(6):
            t.whole_net[i] += t.net[0, i]
        write_reaction(t.net[0], workspace.bodies.rotation[0], state.position[0], state.position[1 + target],
                        out.wrench[number, target])  # fmt: skip
    for i in range(3):
        t.centre[i] = t.moment[0, i] / t.moment[0, 3] if t.moment[0, 3] > 0.0 else 0.0
    zero, gain = readout[0], readout[1]
    for texel in range(len(t.force)):
        out.texels[number, texel, 0] = t.force[texel]
        out.texels[number, texel, 1] = t.shear[texel, 0]
        out.texels[number, texel, 2] = t.shear[texel, 1]
    for texel in range(len(t.force)):
        out.contact[number, texel] = t.contact[texel]
    for texel in range(len(t.force)):
        out.readings[number, texel] = zero + gain * pressing.painted[texel] * t.force[texel]


@kernel
def write_reaction(
    net: np.ndarray, rotation: np.ndarray, origin: np.ndarray, target_origin: np.ndarray, wrench: np.ndarray
) -> None:
    """Write the wrench on a target (6,), in the world about its origin, from that on the sensor, in and about its frame."""
    for i in range(3):
        for part in range(0, 6, 3):
            wrench[part + i] = -(rotation[i, 0] * net[part] + rotation[i, 1] * net[part + 1] + rotation[i, 2] * net[part + 2])
    x, y, z = origin[0] - target_origin[0], origin[1] - target_origin[1], origin[2] - target_origin[2]
    wrench[3] += y * wrench[2] - z * wrench[1]
    wrench[4] += z * wrench[0] - x * wrench[2]
    wrench[5] += x * wrench[1] - y * wrench[0]
