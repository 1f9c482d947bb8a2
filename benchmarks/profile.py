# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the time of a substep goes, per contact, and how far that is from what memory and arithmetic allow here.

The three phases of a step are run again and again, in one thread, where a cube rests on the pad. `flops` are the operations in
the compiled loops per contact (a root or a division counts as one); `bytes` are those of the numbers that a contact's phase
reads and writes, each once. Memory allows no less than bytes over the bandwidth of a copy that does not fit into the caches;
arithmetic no less than flops over the rate of a loop that does nothing else. Both are measured here.
"""

from __future__ import annotations

import functools
import re
import time
from collections.abc import Callable, Iterator

import numba
import numpy as np

from palpate.core.laws.contact_law import read_law
from palpate.core.solver import parallel_loops
from palpate.core.solver.detection import surface_kinematics
from palpate.core.solver.dynamics import contact_assembly, friction_state, relative_kinematics
from palpate.core.solver.simulation import Simulation

from .solver import GRIDS, cube, weighing

ROUNDS = 5
LOOPS = {
    "find contacts": parallel_loops.FIND_CONTACTS,
    "linearise and sum": parallel_loops.SUM_CONTACTS,
    "bend bristles": parallel_loops.UPDATE_FRICTION,
}
BYTES = {
    # contact point 12, bristle 4 (both ways), triangle 12, hint and lists 3; columns of the row: 10 written, 6 and 3 laid flat
    "find contacts": 8 * (12 + 8 + 12 + 3 + 10 + 9),
    "linearise and sum": 8 * (10 + 3),
    "bend bristles": 8 * (12 + 3 + 1 + 3),
}


@numba.njit(nogil=True)
def _repeat(times, loop, model, detection, state, workspace):
    for _ in range(times):
        parallel_loops.run_parallel_loop(loop, model, detection, state, workspace)


@numba.njit(nogil=True)
def _copy(source, target):
    for i in range(len(source)):
        target[i] = source[i]


@numba.njit(nogil=True)
def _multiply_and_add(times, numbers):
    for _ in range(times):
        for i in range(len(numbers)):
            x = numbers[i]
            for _ in range(16):
                x = x * 0.999999 + 1e-9
            numbers[i] = x


def best(work: Callable[[], object]) -> float:
    """Return the shortest time of several tries, seconds of this thread."""
    taken = []
    for _ in range(ROUNDS):
        start = time.thread_time()
        work()
        taken.append(time.thread_time() - start)
    return min(taken)


def bandwidth() -> float:
    """Bytes per second that a copy reads and writes beyond the caches."""
    source, target = np.ones(8_000_000), np.zeros(8_000_000)
    _copy(source, target)
    return 2 * source.nbytes / best(lambda: _copy(source, target))


def arithmetic() -> float:
    """Operations per second where everything stays in registers."""
    numbers = np.ones(512)
    _multiply_and_add(1, numbers)
    return 2000 * 512 * 32 / best(lambda: _multiply_and_add(2000, numbers))


def operations(kernel, *arguments: object) -> int:
    """Operations on vectors in a kernel's compiled code, which are those per contact of its loop."""
    fresh = numba.njit(error_model="numpy")(kernel.py_func)
    fresh(*arguments)
    (code,) = fresh.inspect_llvm().values()
    vector = r"(?:fadd|fsub|fmul|fdiv|call \S*|tail call) <\d+ x double>"
    return len(re.findall(vector, code))


def run() -> Iterator[dict]:
    """Time per contact of each phase, its bytes, and how it compares with what the machine allows."""
    copied, computed = bandwidth(), arithmetic()
    yield {"name": "profile.machine.copy", "value": copied / 1e9, "unit": "GB/s"}
    yield {"name": "profile.machine.arithmetic", "value": computed / 1e9, "unit": "Gflop/s"}
    solid = cube(4)
    for texels in GRIDS:
        simulation = Simulation(weighing(texels, solid), threads=1)
        simulation.advance()
        arrays, times, total = simulation.arrays, max(10, 100_000 // texels), 0.0
        model, workspace = arrays[0], arrays[-1]
        workspace.step[0] = simulation.dt
        state, law = arrays[2], read_law(model.pairs.law, 0)
        motion = relative_kinematics.motion_values(workspace.pairs.known_motion[0])
        in_plane = surface_kinematics._rotate_bristles_into_plane
        flops = {
            "linearise and sum": operations(
                contact_assembly._sum_contacts, 0, simulation.dt, law, model, state.effect_memory, workspace
            ),
            "bend bristles": operations(friction_state._update_bristles, 0, motion, state, workspace),
            "find contacts": 90  # counted by hand
            + operations(in_plane, 0, int(workspace.contacts.number[0]), workspace.contacts.rows),
        }
        for name, loop in LOOPS.items():
            _repeat(1, loop, *arrays)
            taken = best(functools.partial(_repeat, times, loop, *arrays)) / times / texels
            total += taken
            least = max(BYTES[name] / copied, flops[name] / computed)
            yield {
                "name": f"profile.{texels}.{name.replace(' ', '_')}", "value": taken * 1e9, "unit": "ns per contact",
                "peer": f"allowed for {BYTES[name]} bytes, {flops[name]} flops", "peer_value": least * 1e9,
                "ratio": taken / least,
            }  # fmt: skip
        start = time.thread_time()
        simulation.advance()
        step_time = (time.thread_time() - start) / simulation.substeps
        yield {"name": f"profile.{texels}.rest_of_the_step", "value": (step_time - total * texels) * 1e6, "unit": "us"}
