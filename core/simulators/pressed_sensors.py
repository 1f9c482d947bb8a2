# SPDX-License-Identifier: GPL-3.0-or-later
"""One sensor in thousands of environments of a program that trains or samples: poses in, forces, readings and wrenches out."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ..effects.engine.registry import mounted_texels
from ..errors import ParameterError
from ..geometry.mesh import TriangleMesh
from ..geometry.shapes import Shape
from ..solver.jumps import JumpFinder
from ..solver.pressed_model import PressedModel, targets_of
from ..solver.pressing import PressedTexels, StepMemory
from .environment_parameters import Columns, sensors_of
from .load_balance import LoadBalance, first_numbers, reason_of_pulls
from .sensor_on_mesh import SensorOnMesh

REMEDY = "take shorter steps, or reset where a target is put elsewhere."
CHUNK_POINTS = 16384
"""Texels of the environments that a thread takes at once, about a millisecond."""


@dataclass(frozen=True)
class Contacts:
    """Forces and readings of the sensors of E environments at one step, and the reactions.

    The arrays are those of the :class:`PressedSensors` and are overwritten by its next step, unless `out` was given.

    Attributes
    ----------
    texels : (E, n, 3) float, N
        Normal force, and shear along the texel's x and y axis, on the sensor.
    readings : (E, n) float, the sensor's unit
    contact : (E, n) bool
    wrench : (E, 6) float, N and N·m
        Force on the target in the world, and torque about the origin of its frame. With several targets (E, T, 6).
    too_deep : (E,) int
        How many contact points are pressed past their maximum penetration, and measure nothing.
    valid : (E,) bool
        False where a pose is not finite or a quaternion is zero: everything is zero there, and the environment is reset with
        its next valid poses.
    jumped : (E,) bool
        True where a target went through the sensor within the step, as one that is too fast for it, so that nothing was
        measured. The environment goes on.
    """

    texels: np.ndarray
    readings: np.ndarray
    contact: np.ndarray
    wrench: np.ndarray
    too_deep: np.ndarray
    valid: np.ndarray
    jumped: np.ndarray

    def fault(self) -> str:
        """Return one sentence on environments whose poses are none, and one on those with a jump; empty without such."""
        return fault_of(self.valid, self.jumped)


def fault_of(valid: np.ndarray, jumped: np.ndarray) -> str:
    """Return :meth:`Contacts.fault` of each environment, (E,)."""
    sentences = []
    if not valid.all():
        which = first_numbers(~valid)
        sentences.append(
            f"{np.sum(~valid)} of {len(valid)} environments have a pose that is not a position and quaternion of finite "
            f"numbers ({which}): reset them in the simulation."
        )
    if jumped.any():
        sentences.append(
            f"In {jumped.sum()} of {len(valid)} environments a target went through the sensor within one step "
            f"({first_numbers(jumped)}): {REMEDY}"
        )
    return " ".join(sentences)


class PressedSensors:
    """A sensor and the object in contact with it in many environments, moved by another program.

    Every environment gives the same bits as a :class:`.PressedSensor` of its own that begins where its first step ends,
    whatever the number of threads.

    Parameters
    ----------
    item : SensorOnMesh
        As :func:`.read_probe_list` or :func:`.sensors_on_meshes` returns it.
    target : TriangleMesh or Shape, or a sequence of them
        Each in the frame of the object, metres. Contacts with a shape (sphere, box, capsule, plane) are in closed form.
    dt : float, seconds
        Step of the other program.
    environments : int
    parameters : mapping of str to (E,) float, optional
        Parameters and effects' parameters in which the sensors of environments differ, by name: ``k``, ``mus``,
        ``effect.creep.amount`` (see :mod:`.environment_parameters`).
    threads : int, optional
        How many to compute with; by default the environment variable ``PALPATE_THREADS``, or as many as pay off.

    Raises
    ------
    PalpateError
        The sensor, the meshes or the step make no run, or memory does not suffice.

    Attributes
    ----------
    residual : (E, 1), (E, 3) or (E, 6) float, N and N·m
        Part of the loads given to the last step that no contact balances.
    residual_reason : str
        One sentence where some of these loads pull, with the convention of loads; else empty.
    displacement : (E, 6) float, metres and rad
        Of the targets from their poses at the last step, for the loads: in the world, and rotation vector about their origin.

    Notes
    -----
    Effects draw the same random numbers in every environment, unless `parameters` has seeds.
    """

    def __init__(
        self,
        item: SensorOnMesh,
        target: TriangleMesh | Shape | Sequence[TriangleMesh | Shape],
        dt: float,
        environments: int,
        threads: int | None = None,
        parameters: Columns | None = None,
    ):
        if environments < 1:
            raise ParameterError(f"There are {environments} environments: ask for one at least.")
        self._one_target = isinstance(target, TriangleMesh | Shape)
        targets = targets_of(target)
        model = self._model = PressedModel(item.sensor, targets, dt, 1)
        n = model.texels
        check_memory(environments, model.bytes_of_environment() + n * BYTES_OF_TEXEL, available_memory())
        self._out = PressedTexels.zero(environments, n, len(targets))
        sensors = sensors_of(item.sensor, parameters, environments) if parameters else []
        self._environments, self._sensors = model.environments(environments, sensors), sensors
        self._threads = [
            model.presser(StepMemory.zero(n, len(targets)), self._out, self._environments, model.workspace())
            for _ in range(model.threads(environments, threads))
        ]
        o, self._jumps = self._out, JumpFinder(mounted_texels(item.sensor), targets, self._out)
        wrench = o.wrench[:, 0] if self._one_target else o.wrench
        self._found = Contacts(o.texels, o.readings, o.contact, wrench, o.too_deep, o.valid, self._jumps.jumped)
        self._chunk = max(1, min(CHUNK_POINTS // n, -(-environments // (4 * len(self._threads)))))
        self._chains = [model.readout_chain()] * environments  # each gets its own with its first step
        self._steps = np.zeros(environments, np.int64)
        self._balance: LoadBalance | None = None
        self.residual = np.zeros((environments, 0))
        self.reset()

    def __len__(self) -> int:
        """Return the number of environments."""
        return len(self._environments)

    def __repr__(self) -> str:
        size = f"{len(self._environments)} environments, {self._model.texels} texels"
        return f"<PressedSensors: {size}, step {1e3 / self._model.rate:.4g} ms>"

    @property
    def residual_reason(self) -> str:
        """Which environments have a load at the last step that pulls, and why no contact balances it; else empty."""
        return reason_of_pulls(self._balance.pulls) if self.residual.shape[1] and self._balance is not None else ""

    @property
    def displacement(self) -> np.ndarray:
        """(E, 6) float, metres and rad: of the targets from their poses at the last step, for the loads.

        In the world, and rotation vectors about their origins.
        """
        return np.zeros((len(self), 6)) if self._balance is None else self._balance.displacement.copy()

    def reset(self, mask: ArrayLike | None = None) -> None:
        """Reset environments before their next step: at rest, without bristles and memory of effects.

        Parameters
        ----------
        mask : (E,) bool, optional
            Which; by default all.
        """
        self._out.begins[slice(None) if mask is None else checked_mask(mask, len(self))] = True

    def step(
        self,
        sensor_poses: ArrayLike,
        target_poses: ArrayLike,
        out: Contacts | None = None,
        wrench: ArrayLike | None = None,
    ) -> Contacts:
        """Go on by one step, to these poses, and return the forces there.

        Parameters
        ----------
        sensor_poses : (E, 7) or (7,) float
            Positions (m) and quaternions (w, x, y, z), in one array or as a pair of arrays; (7,) for a sensor that stands at
            the same place everywhere.
        target_poses : (E, 7) float, or (E, T, 7) with several targets
        out : Contacts, optional
            To write into; by default the arrays that the next step overwrites.
        wrench : (E, 6), (E, 3) or (E, 1) float, N and N·m, optional
            Load of each environment, as in :meth:`.PressedSensor.step`.

        Raises
        ------
        ParameterError
            Poses or loads have another shape. Those that are not finite are no error (see :attr:`Contacts.valid`).
        """
        e, t, found = len(self), self._out.wrench.shape[1], self._found
        if out is not None:
            _check_room(out, found)
        self._take("sensor", sensor_poses, [(e, 7), (7,)], self._out.poses[:, 0])
        if self._one_target:
            self._take("target", target_poses, [(e, 7)], self._out.poses[:, 1])
        else:
            self._take("targets", target_poses, [(e, t, 7)], self._out.poses[:, 1:])
        fresh = self._out.begins.copy()
        self._jumps.forget(fresh)
        if wrench is None:
            self.residual = np.zeros((e, 0))
            if self._balance is not None:
                self._balance.forget(np.ones(e, bool))
            self._press()
        else:
            load = checked_numbers("The loads", wrench, [(e, 1), (e, 3), (e, 6)], f"({e}, 6), ({e}, 3) or ({e}, 1)")
            if self._balance is None:
                self._balance = LoadBalance(self._model, self._out, self._environments, self._press)
            self.residual = self._balance.step(load.astype(float))
        self._jumps.find()
        self._read(fresh)
        if out is None:
            return found
        for name in CONTACT_FIELDS:
            np.copyto(getattr(out, name), getattr(found, name))
        return out

    def _take(self, whose: str, poses: ArrayLike, shapes: list[tuple[int, ...]], rows: np.ndarray) -> None:
        """Write poses into rows."""
        if isinstance(poses, tuple | list) and len(poses) == 2 and np.ndim(poses[0]) == np.ndim(poses[1]) > 0:
            position, quaternion = (np.asarray(part) for part in poses)
            if position.shape[-1] == 3 and quaternion.shape[-1] == 4 and position.shape[:-1] == quaternion.shape[:-1]:
                poses = np.concatenate([position, quaternion], axis=-1)
        rows[...] = checked_numbers(f"The poses of the {whose}", poses, shapes, " or ".join(map(str, shapes)))

    def _press(self) -> None:
        """Let the solver take one step in all environments."""
        starts = iter(range(0, len(self), self._chunk))
        helpers = [
            threading.Thread(target=self._work, args=(one, starts), name="palpate helper", daemon=True)
            for one in self._threads[1:]
        ]
        for helper in helpers:
            helper.start()
        self._work(self._threads[0], starts)
        for helper in helpers:
            helper.join()

    def _work(self, press: Callable[[int, int], None], starts: Iterator[int]) -> None:
        """Take chunks of environments until none is left."""
        for start in starts:
            press(start, min(start + self._chunk, len(self)))

    def _read(self, fresh: np.ndarray) -> None:
        """Compute readings that effects act on, environment by environment, as each has a past of its own."""
        self._steps[fresh] = 0
        self._steps += 1
        if not self._model.reads_by_chain:
            return
        for number in np.flatnonzero(self._out.valid):
            chain = self._chains[number]
            if fresh[number]:
                sensor = self._sensors[number] if self._sensors else None
                chain = self._chains[number] = self._model.readout_chain(sensor)
            assert chain is not None
            time, force = self._steps[number] / self._model.rate, np.ascontiguousarray(self._out.texels[number, :, 0])
            self._out.readings[number] = chain.step(float(time), force)


CONTACT_FIELDS = tuple(Contacts.__dataclass_fields__)
BYTES_OF_TEXEL = 3 * 8 + 8 + 1
"""Bytes of the results of a texel."""


def _check_room(out: Contacts, found: Contacts) -> None:
    """Raise :class:`.ParameterError` where arrays to write into are not like those to be written."""
    for name in CONTACT_FIELDS:
        values, wanted = np.asarray(getattr(out, name)), getattr(found, name)
        if values.shape != wanted.shape or values.dtype != wanted.dtype:
            raise ParameterError(
                f"'{name}' of out is {values.dtype} of shape {values.shape}: give {wanted.dtype} of shape {wanted.shape}."
            )


def checked_numbers(what: str, values: ArrayLike, shapes: Sequence[tuple[int, ...]], wanted: str) -> np.ndarray:
    """Return numbers as an array; raise :class:`.ParameterError`, which asks for the wanted shape, where theirs is another."""
    found = np.asarray(values)
    if found.shape not in shapes or found.dtype.kind not in "fiu":
        raise ParameterError(f"{what} are {found.dtype} of shape {found.shape}: give numbers of shape {wanted}.")
    return found


def checked_mask(mask: ArrayLike, environments: int) -> np.ndarray:
    """Return which environments to reset, (E,) bool; raise :class:`.ParameterError` for anything else."""
    found = np.asarray(mask)
    if found.dtype != np.bool_ or found.shape != (environments,):
        raise ParameterError(
            f"The mask of environments to reset is {found.dtype} of shape {found.shape}: give ({environments},) bool."
        )
    return found


def check_memory(environments: int, size: int, there: float) -> None:
    """Raise :class:`.ParameterError` where so many environments of a size, bytes, are more than memory that is there."""
    if environments * size > there:
        raise ParameterError(
            f"{environments} environments take {environments * size / 2**30:.1f} GiB of memory, and {there / 2**30:.1f} GiB "
            f"are free: ask for {int(there / size)} at most."
        )


def available_memory() -> float:
    """Return the bytes of memory that are free; infinite where the system does not say."""
    try:
        for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                return 1024.0 * int(line.split()[1])
    except (OSError, ValueError):
        pass
    return float("inf")
