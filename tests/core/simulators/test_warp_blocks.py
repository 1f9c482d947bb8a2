# SPDX-License-Identifier: GPL-3.0-or-later
"""Blocks of threads that share the texels of an environment, without a GPU: Python's threads in the place of a block's."""

from __future__ import annotations

import threading
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from exported_sensors import pad

from palpate.core.errors import PalpateError, ParameterError
from palpate.core.geometry import shapes
from palpate.core.geometry.bvh import Segment, build_tree, segment_entry
from palpate.core.geometry.mesh import TriangleMesh
from palpate.core.simulators.load_search import LoadSearch
from palpate.core.simulators.warp import balance_kernels, block, engine, press_kernels, warp_sensors
from palpate.core.simulators.warp.press_arrays import Jumps, Results, Slots, Worlds, split_leaves
from palpate.core.simulators.warp.warp_sensors import WarpSensors

warp = pytest.importorskip("warp", reason="Warp runs the kernels: pip install warp-lang")

E, DT, SIZE, WEIGHT = 2, 0.002, 0.02, 9.81
SHAPE = shapes.box((SIZE, SIZE, SIZE))


class Block:
    """Run a function by so many threads, and count the passes of the longest loop that one of them takes."""

    def __init__(self, lanes, monkeypatch):
        self._lanes, self._barrier, self._values, self._own = lanes, threading.Barrier(lanes), [0.0] * lanes, threading.local()
        self._monkeypatch, self.longest = monkeypatch, 0

    def run(self, function, world, *arguments):
        """Run it for an environment; whatever a thread raises is raised here."""
        errors = []

        def thread(lane):
            self._own.lane = lane
            try:
                function(world, lane, self._lanes, *arguments)
            except BaseException as error:
                errors.append(error)
                self._barrier.abort()

        threads = [threading.Thread(target=thread, args=(lane,)) for lane in range(self._lanes)]
        with self._monkeypatch.context() as patch:  # Warp reads the same sources elsewhere
            for module in (press_kernels, balance_kernels):
                patch.setattr(module, "block_sum", self._sum)
                patch.setattr(module, "wait_for_block", self._barrier.wait)
                patch.setattr(module, "range", self._counted, raising=False)
            for one in threads:
                one.start()
            for one in threads:
                one.join()
        if errors:
            raise errors[0]

    def _sum(self, value):
        self._values[self._own.lane] = value
        self._barrier.wait()
        total = sum(self._values)
        self._barrier.wait()
        return total

    def _counted(self, *limits):
        self.longest = max(self.longest, len(range(*limits)))
        return range(*limits)


class Run:
    """Steps of plain Python with arrays as :class:`.WarpSensors` makes them."""

    def __init__(self, block):
        item, ours = pad(5, 4), WarpSensors(pad(5, 4), SHAPE, DT, E)
        sensor, self._block = item.sensor, block
        self.sensor, self.targets = (
            SimpleNamespace(**{name: _host(getattr(part, name)) for name in kind._fields})
            for part, kind in ((ours._sensor, warp_sensors.SensorArrays), (ours._targets, warp_sensors.TargetArrays))
        )
        self.n, self.tree = len(sensor.texels), build_tree([warp_sensors._NO_MESH])
        slots, room = Slots.zero(E, *ours._of_slots), Worlds.zero(E, 1)
        self.worlds, self.slots, self.out = room, slots, Results.zero(E, self.n, 1)
        self.jumps, self.start = Jumps.of(sensor.texels, [SHAPE], E), Slots.zero(E, *ours._of_slots)
        self.search = LoadSearch.of(sensor.texels, sensor.parameters.max_penetration, E)

    def step(self, poses, loads=None):
        """Go on by one step, under loads or not, and return the results."""
        self.worlds.poses[:] = poses
        touching = self.sensor, self.targets, self.tree, self.worlds, self.slots
        for world in range(E):
            if loads is not None:
                self.search.given[:] = loads
                rest = self.jumps, self.out, self.start, self.search
                self._block.run(balance_kernels.balance_world, world, loads.shape[1], *touching, *rest)
                continue
            self._block.run(press_kernels.move_world, world, self.sensor, self.worlds)
            for texel in range(self.n):
                press_kernels.press_texel(world, texel, *touching, self.out)
            self._block.run(
                press_kernels.finish_world, world, self.sensor, self.worlds, self.slots, self.jumps, self.out
            )  # fmt: skip
        return self.out


def _host(value):
    return value.numpy() if hasattr(value, "numpy") else value


def poses_of(step):
    """(E, 2, 7): a box that sinks in, slides and turns; in the second environment it is far above at first."""
    poses = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (E, 2, 1))
    poses[:, 1, 2] = SIZE / 2 - 2e-4 - 5e-5 * step
    poses[1, 1, 2] += 1e-3 * (step == 0)
    poses[:, 1, 0], poses[:, 1, 4] = 1e-4 * step, 2e-3 * step
    return poses


@pytest.mark.parametrize("lanes", [1, 3, 8])
def test_the_threads_of_a_block_share_contact_points(lanes, monkeypatch):
    """The numbers are Warp's; no thread takes more passes than its share, apart from loops over the numbers of a row."""
    shared, ours = Block(lanes, monkeypatch), WarpSensors(pad(5, 4), SHAPE, DT, E)
    run = Run(shared)
    for step in range(4):
        poses = poses_of(step)
        found, expected = run.step(poses), ours.step(poses[:, 0], poses[:, 1])
        for name in ("texels", "readings", "wrench", "too_deep", "contact"):
            assert np.abs(getattr(found, name) - getattr(expected, name).numpy().astype(float)).max() < 1e-12, (step, name)
        assert np.array_equal(run.jumps.jumped, ours.jumped.numpy())
    assert found.wrench[:, 0, 2].min() > 0.1
    assert shared.longest == max(12, -(-run.n // lanes))


@pytest.mark.slow("Warp compiles the kernels of steps under loads")
@pytest.mark.parametrize("lanes", [1, 4])
def test_the_threads_of_a_block_search_together(lanes, monkeypatch):
    shared, ours = Block(lanes, monkeypatch), WarpSensors(pad(5, 4), SHAPE, DT, E)
    run = Run(shared)
    for step in range(3):
        poses, loads = poses_of(1), np.zeros((E, 6))
        loads[:, 2] = WEIGHT * (1.0 + 0.1 * step)
        found, expected = run.step(poses, loads), ours.step(poses[:, 0], poses[:, 1], wrench=loads)
        assert np.abs(found.texels - expected.texels.numpy()).max() < 1e-9
        assert np.abs(found.wrench[:, 0] - loads).max() < 1e-6
        assert np.array_equal(run.worlds.poses[:, 1], poses[:, 1])
    assert shared.longest == max(12, -(-run.n // lanes))


def test_a_gpu_gets_a_thread_for_each_texel(monkeypatch):
    """Threads of each kernel of a step, and of their blocks: a few move an environment, and a warp adds its texels up."""
    launched, ours = [], WarpSensors(pad(5, 4), SHAPE, DT, E)
    monkeypatch.setattr(warp, "launch", lambda kernel, dim, block_dim, **_: launched.append((dim, block_dim)))
    ours._on_gpu = True
    ours.step(poses_of(0)[:, 0], poses_of(0)[:, 1])
    assert launched == [((E, warp_sensors.MOVERS), block.THREADS), ((E, 20), block.THREADS), ((E, block.WARP), block.WARP)]
    launched.clear()
    ours.step(wrench=np.zeros((E, 6)))
    assert launched == [((E, block.WARP), block.WARP)]


def test_a_gpu_meets_fewer_triangles_and_finds_the_same():
    """Lines into a ball and a cube, in trees with four triangles to a leaf and with one."""
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.01)
    tree = build_tree(
        [TriangleMesh(np.array(one.vertices), np.array(one.faces)) for one in (ball, trimesh.creation.box((SIZE,) * 3))]
    )
    fine, draw = split_leaves(tree), np.random.default_rng(1)
    assert fine.number.max() == 1 < tree.number.max() and len(fine.number) == fine.roots[-1]
    entered = 0
    for mesh in (0, 1):
        for _ in range(200):
            base = draw.standard_normal(3)
            base *= 0.018 / np.linalg.norm(base)
            segment = Segment(*base, *(-draw.uniform(0.2, 1.2) * base + 0.002 * draw.standard_normal(3)))
            found = segment_entry(segment, mesh, -1, tree)
            assert segment_entry(segment, mesh, -1, fine) == found
            entered += found[1] >= 0
    assert 100 < entered < 400


# --- devices


def test_a_device_that_does_not_do_is_one_sentence(monkeypatch):
    """A driver that is too old; a card whose float64 is slow; memory in pieces; a device that is lost between two steps."""
    card = SimpleNamespace(is_cuda=True, arch=89, name="a card", alias="cuda:0")
    fake = SimpleNamespace(
        get_devices=lambda: ["cpu"], get_cuda_driver_version=lambda: (11, 2), is_cuda_available=lambda: False,
        get_device=lambda name: card, __version__="1.19.0",
    )  # fmt: skip
    with pytest.raises(ParameterError, match=r"^The NVIDIA driver is for CUDA 11\.2, which is too old for Warp 1\.19\.0: "):
        engine.require_device(fake, "cuda:0", False)
    fake.get_devices = lambda: ["cpu", "cuda:0"]
    with pytest.warns(UserWarning, match=r"^'a card' is slow in float64: single=True is faster there, and less exact\.$"):
        assert engine.require_device(fake, "cuda:0", False) == "cuda:0"
    assert engine.require_device(fake, "cuda:0", True) == "cuda:0"

    def lost(*_arguments, **_options):
        raise RuntimeError("Error launching kernel: move_target on device cuda:0: CUDA error 46")

    ours = WarpSensors(pad(4, 4), SHAPE, DT, E)
    monkeypatch.setattr(warp, "full", lost)
    with pytest.raises(ParameterError, match=r"cpu has no 0\.0 GiB of memory in one piece for 2 environments: ask for fewer"):
        WarpSensors(pad(4, 4), SHAPE, DT, E)
    monkeypatch.setattr(warp, "launch", lost)
    with pytest.raises(PalpateError, match="^cpu did not take the step and its arrays are lost, so make the sensors again: "):
        ours.step(poses_of(0)[:, 0], poses_of(0)[:, 1])
