# SPDX-License-Identifier: GPL-3.0-or-later
"""The sensor for Isaac Lab in a double of its documented interface; Isaac Lab itself was not at hand."""

from __future__ import annotations

import dataclasses
import importlib
import importlib.metadata
import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from exported_sensors import pad

from palpate.core.errors import PalpateError, ParameterError
from palpate.core.geometry import shapes
from palpate.core.simulators.pressed_sensors import PressedSensors

pytest.importorskip("warp", reason="Warp runs the kernels: pip install warp-lang")
torch = pytest.importorskip("torch", reason="Isaac Lab's tensors: pip install torch")

COUNT, DT, SIZE = 3, 0.002, 0.02
POSES: dict[str, np.ndarray] = {}
"""(E, 7) in Isaac Lab's order, (x, y, z, w) last, by path."""


class SensorBase:
    """As documented: `update` marks data as outdated, and asks for them at once if told to."""

    def __init__(self, cfg):
        self.cfg, self.is_initialized = cfg, False

    def reset(self, env_ids=None, env_mask=None):
        """Do nothing: the double has no times."""

    def update(self, dt, force_recompute=False):
        """Compute at once if told to."""
        if self.is_initialized and force_recompute:
            self._update_buffers_impl(np.ones(COUNT, bool))

    def _initialize_impl(self):
        self._num_envs, self._device, self._sim_physics_dt, self.is_initialized = COUNT, "cpu", DT, True


class OldSensorBase(SensorBase):
    """That of Isaac Lab 2."""

    def reset(self, env_ids=None):
        """Do nothing."""


@dataclasses.dataclass
class SensorBaseCfg:
    """Its fields with a meaning here."""

    class_type: type = SensorBase
    prim_path: str = ""


class FrameView:
    """Poses of prims whose path an expression describes."""

    def __init__(self, path, device):
        self._path, self.count = path, len(POSES.get(path, ()))

    def get_world_poses(self):
        """Return positions, and quaternions (x, y, z, w)."""
        rows = torch.from_numpy(POSES[self._path].astype(np.float32))
        return SimpleNamespace(torch=rows[:, :3]), SimpleNamespace(torch=rows[:, 3:])


def configclass(cls):
    """Make factories of mutable defaults, as Isaac Lab does."""
    for name, value in list(vars(cls).items()):
        if isinstance(value, dict) and name in cls.__annotations__:
            setattr(cls, name, dataclasses.field(default_factory=dict))
    return dataclasses.dataclass(cls)


def expand_env_regex_ns(path):
    """Write out the namespace of environments."""
    return path.replace("{ENV_REGEX_NS}", "/World/envs/env_[^/]+")


@pytest.fixture
def plugin(monkeypatch):
    """Return the module, on the double."""

    def load(base=SensorBase):
        parts = {
            "isaaclab": {}, "isaaclab.sensors": {"SensorBase": base, "SensorBaseCfg": SensorBaseCfg}, "isaaclab.sim": {},
            "isaaclab.sim.views": {"FrameView": FrameView}, "isaaclab.utils": {},
            "isaaclab.utils.configclass": {"configclass": configclass}, "isaaclab.cloner": {},
            "isaaclab.cloner.cloner_cfg": {"expand_env_regex_ns": expand_env_regex_ns},
        }  # fmt: skip
        for name, members in parts.items():
            module = ModuleType(name)
            vars(module).update(members)
            monkeypatch.setitem(sys.modules, name, module)
        version = importlib.metadata.version
        monkeypatch.setattr(importlib.metadata, "version", lambda name: "3.0.0" if name == "isaaclab" else version(name))
        monkeypatch.delitem(sys.modules, "palpate.plugins.isaaclab", raising=False)
        return importlib.import_module("palpate.plugins.isaaclab")

    return load


def place(step):
    """Write poses for a step, and return those of the target in our order."""
    finger, cube = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (2, COUNT, 1))
    cube[:, 2] = SIZE / 2 - 2e-4 - 1e-5 * step - 1e-4 * np.arange(COUNT)
    cube[:, 0] = 2e-5 * step
    cube[:, 3], cube[:, 6] = 0.02, np.sqrt(1 - 0.02**2)
    POSES.update({"/World/envs/env_[^/]+/finger": finger, "/World/envs/env_[^/]+/cube": cube})
    rows = [one.astype(np.float32).astype(float)[:, [0, 1, 2, 6, 3, 4, 5]] for one in (finger, cube)]
    return rows


@pytest.mark.slow("Warp compiles the kernels")
def test_a_sensor_goes_on_with_each_update(plugin):
    module, item = plugin(), pad(5, 4)
    place(0)
    targets = {"{ENV_REGEX_NS}/cube": shapes.box((SIZE, SIZE, SIZE))}
    cfg = module.TouchSensorCfg(prim_path="/World/envs/env_[^/]+/finger", sensor=item, targets=targets)
    assert cfg.class_type is module.TouchSensor
    touch, core = cfg.class_type(cfg), PressedSensors(item, shapes.box((SIZE, SIZE, SIZE)), DT, COUNT)
    touch.update(DT)  # before the simulation is ready nothing happens
    touch._initialize_impl()
    for step in range(6):
        sensor, target = place(step)
        if step == 3:
            touch.reset(torch.tensor([1]))
            core.reset(np.arange(COUNT) == 1)
        touch.update(DT)
        expected = core.step(sensor, target)
        assert np.abs(touch.data.texels.numpy() - expected.texels).max() < 1e-9
        assert np.abs(touch.data.wrench.numpy()[:, 0] - expected.wrench).max() < 1e-9
    assert expected.texels.max() > 0.1 and touch.data.contact.dtype == torch.bool
    touch.reset(slice(None))
    touch.reset()
    with pytest.raises(ParameterError, match="is updated after 0.004 s, and the model's timestep is 0.002 s"):
        touch.update(2 * DT)


def test_what_is_missing_is_one_sentence(plugin, monkeypatch):
    module = plugin()
    place(0)
    with pytest.raises(ParameterError, match="has no texels: give `sensor`"):
        module.TouchSensor(module.TouchSensorCfg(prim_path="finger"))
    cfg = module.TouchSensorCfg(
        prim_path="/World/envs/env_[^/]+/finger", sensor=pad(4, 4), targets={"{ENV_REGEX_NS}/ball": shapes.sphere(0.01)}
    )
    with pytest.raises(ParameterError, match=r"'/World/envs/env_\[\^/\]\+/ball' is found 0 times in 3 environments"):
        module.TouchSensor(cfg)._initialize_impl()
    with pytest.raises(PalpateError, match="needs Isaac Lab 3.0 or later"):
        plugin(OldSensorBase)
    monkeypatch.setitem(sys.modules, "isaaclab", None)
    monkeypatch.delitem(sys.modules, "palpate.plugins.isaaclab", raising=False)
    with pytest.raises(PalpateError, match="needs isaaclab, which is not installed: run 'pip install isaaclab'"):
        importlib.import_module("palpate.plugins.isaaclab")
