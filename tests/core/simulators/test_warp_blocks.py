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
from palpate.core.simulators.warp import balance_kernels, engine, press_kernels, warp_sensors
from palpate.core.simulators.warp.balance_kernels import Beginning
from palpate.core.simulators.warp.press_arrays import Jumps, Results, Slots, Worlds, split_leaves
from palpate.core.simulators.warp.warp_sensors import WarpSensors

warp = pytest.importorskip("warp", reason="Warp runs the kernels: pip install warp-lang")

E, DT, SIZE, WEIGHT = 2, 0.002, 0.02, 9.81
SHAPE = shapes.box((SIZE, SIZE, SIZE))


class Block:
    """Run a function by so many threads."""

    def __init__(self, lanes, monkeypatch):
        self._lanes, self._barrier, self._values, self._own = lanes, threading.Barrier(lanes), [0.0] * lanes, threading.local()
        self._monkeypatch = monkeypatch

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


def host(arrays, kind):
    """The arrays of Warp as those of numpy, by name."""
    parts = {name: getattr(arrays, name) for name in kind._fields}
    return SimpleNamespace(**{name: part.numpy() if hasattr(part, "numpy") else part for name, part in parts.items()})


def poses_of(step):
    """(E, 2, 7): a box that sinks in, slides and turns; in the second environment it is far above at first."""
    poses = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (E, 2, 1))
    poses[:, 1, 2] = SIZE / 2 - 2e-4 - 5e-5 * step
    poses[1, 1, 2] += 1e-3 * (step == 0)
    poses[:, 1, 0], poses[:, 1, 4] = 1e-4 * step, 2e-3 * step
    return poses


@pytest.mark.slow("Warp compiles the kernels of steps under loads")
@pytest.mark.parametrize("lanes", [1, 3])
def test_the_threads_of_a_block_share_contact_points_and_search_together(lanes, monkeypatch):
    """Steps of plain Python have Warp's numbers; a step under a load passes through all that a step does."""
    item, ours, block = pad(5, 4), WarpSensors(pad(5, 4), SHAPE, DT, E), Block(lanes, monkeypatch)
    texels, reach = item.sensor.texels, item.sensor.parameters.max_penetration
    sensor, targets = host(ours._sensor, warp_sensors.SensorArrays), host(ours._targets, warp_sensors.TargetArrays)
    tree, worlds = build_tree([warp_sensors._NO_MESH]), Worlds.zero(E, 1)
    slots, start = (Slots.zero(E, *ours._of_slots) for _ in range(2))
    jumps, found, search = Jumps.of(texels, [SHAPE], E), Results.zero(E, len(texels), 1), LoadSearch.of(texels, reach, E)
    touching, rest = (sensor, targets, tree, worlds, slots), (jumps, found, start, Beginning.zero(E), search)
    loads = np.zeros((E, 6))
    for step in range(3):
        loads[:, 2] = WEIGHT * (1.0 + 0.1 * step)
        worlds.poses[:], search.given[:] = poses_of(step), loads
        for world in range(E):
            block.run(balance_kernels.balance_world, world, loads.shape[1], *touching, *rest)
        expected = ours.step(poses_of(step)[:, 0], poses_of(step)[:, 1], wrench=loads)
        for name in ("texels", "readings", "too_deep", "contact"):
            assert np.abs(getattr(found, name) - getattr(expected, name).numpy().astype(float)).max() < 1e-9, (step, name)
        assert np.abs(found.wrench - expected.wrench.numpy()).max() < 1e-6
        assert np.array_equal(worlds.poses[:, 1], poses_of(step)[:, 1])
        assert np.array_equal(jumps.jumped, ours.jumped.numpy())
    assert found.wrench[:, 0, 2] == pytest.approx(loads[:, 2], abs=1e-6)


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
