# SPDX-License-Identifier: GPL-3.0-or-later
"""Threads change no bit, the loop allocates nothing, and a board without helpers is worked off alone."""

import numpy as np
import pytest
import trimesh
from solver_scenes import about, cube_on_pad, pad, pressed, shape

from palpate.core.compiled import kernels, thread_team
from palpate.core.solver.simulation import Simulation
from palpate.core.solver.structures import MAX_PAIR_POINTS

compiled = pytest.mark.skipif(not kernels.COMPILED, reason="plain Python computes in one thread")


def rolling(threads):
    """A ball rolls over a pad of four parts: lists are rebuilt, texels come and go."""
    ball = shape(trimesh.creation.icosphere(3, 0.02))
    path = [[0.0008 * i - 0.006, 0.0004 * i, 0.0192 - 0.00005 * i] for i in range(8)]
    turns = [about((1, 2, 0), 7.0 * i) for i in range(8)]
    texels = pad(44, 40, 0.001)
    assert len(texels) > 3 * MAX_PAIR_POINTS
    return Simulation(pressed(ball, path, texels, turns=turns, dt=1e-3, sigma0=2000.0, sigma1=5.0), threads)


def falling(threads):
    return Simulation(cube_on_pad(1.0, tilt=8.0, texels=pad(40, 40, 0.0012), dt=1e-3, k=50.0, cn=0.5, sigma0=30.0), threads)


@compiled
@pytest.mark.parametrize("scene", [rolling, falling])
def test_threads_change_no_bit(scene):
    alone, two, four = scene(1), scene(2), scene(4)
    for _ in range(6):
        frames = [simulation.advance() for simulation in (alone, two, four)]
        for other in frames[1:]:
            assert np.array_equal(frames[0].poses, other.poses)
            for name in ("normal_force", "shear", "depth", "slip"):
                assert np.array_equal(getattr(frames[0].sensors["pad"], name), getattr(other.sensors["pad"], name))
    assert frames[0].sensors["pad"].contact.sum() > 50


@compiled
def test_helpers_are_called_where_they_are_worth_while(monkeypatch):
    monkeypatch.delenv("PALPATE_THREADS", raising=False)
    monkeypatch.setattr(thread_team, "count_of_cores", lambda: 4)
    assert thread_team.make_queue(thread_team.POINTS_PER_THREAD - 1)[1] == 0
    assert thread_team.make_queue(thread_team.POINTS_PER_THREAD)[1] == 1
    assert thread_team.make_queue(10**6)[1] == 3
    monkeypatch.setenv("PALPATE_THREADS", "1")
    assert thread_team.make_queue(10**6)[1] == 0


@compiled
def test_a_late_helper_is_not_called_for_a_while():
    queue, number = thread_team.make_queue(10**4, 2)
    called = []
    with thread_team.helper_threads(queue, number, called.append, 1):
        queue[thread_team.LOOPS], queue[thread_team.LATE_LOOPS] = 100, 50
    assert called == [1]
    for _ in range(thread_team.SINGLE_THREAD_FRAMES):
        with thread_team.helper_threads(queue, number, called.append, 2):
            pass
    assert called == [1]
    with thread_team.helper_threads(queue, number, called.append, 3):
        pass
    assert called == [1, 3]


@compiled
def test_the_loop_allocates_nothing():
    """By numba's own count: a hundred times the steps in a frame, and not one allocation more."""
    from numba.core.runtime import _nrt_python, rtsys

    _nrt_python.memsys_enable_stats()
    counts = []
    for steps in (10, 1000):
        simulation = Simulation(cube_on_pad(1.0, tilt=5.0, dt=1 / 24 / steps))
        simulation.advance()
        before = rtsys.get_allocation_stats().alloc
        simulation.advance()
        counts.append(rtsys.get_allocation_stats().alloc - before)
    assert simulation.substeps == 1000
    assert counts[0] == counts[1]
