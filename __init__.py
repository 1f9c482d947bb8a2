# SPDX-License-Identifier: GPL-3.0-or-later
"""Palpate: make any mesh a tactile sensor in Blender.

``import palpate as pp`` is all that a script needs; docs/python.md has a page on its names. Each is imported when it is first
used, and nothing of Blender at module level, so that this costs no time and also works in a plain Python.
"""

import atexit
import importlib
from typing import TYPE_CHECKING, Any

from .core.version import VERSION as __version__

if TYPE_CHECKING:
    from .addon.scripting.scene_objects import scenario_of as scenario_of
    from .addon.scripting.scene_objects import sensor_of as sensor_of
    from .api.bodies import Body as Body
    from .api.contacts import mujoco_contact as mujoco_contact
    from .api.contacts import newton_contact as newton_contact
    from .api.experiment import Plan as Plan
    from .api.experiment import plan_experiment as plan_experiment
    from .api.fits import fit_friction as fit_friction
    from .api.fits import fit_readout as fit_readout
    from .api.fits import fit_stiffness as fit_stiffness
    from .api.gap import Gap as Gap
    from .api.gap import find_gap as find_gap
    from .api.gap import read_rig as read_rig
    from .api.loop import PressedSensor as PressedSensor
    from .api.loop import PressedSensors as PressedSensors
    from .api.recordings import Recording as Recording
    from .api.recordings import read_bake as read_bake
    from .api.recordings import read_recording as read_recording
    from .api.sensors import Sensor as Sensor
    from .api.sensors import export_sensor as export_sensor
    from .api.sensors import read_sensor as read_sensor
    from .api.sensors import sensors_from_blend as sensors_from_blend
    from .api.simulation import simulate as simulate
    from .api.skins import draw_channels as draw_channels
    from .api.skins import magnetic_skin as magnetic_skin
    from .api.skins import save_channels as save_channels
    from .api.study import run_study as run_study
    from .core.errors import PalpateError as PalpateError
    from .core.gap.dataset.rig import Rig as Rig
    from .core.model.scenario import Scenario as Scenario

_PUBLIC = {
    "Body": "api.bodies",
    "Gap": "api.gap",
    "PalpateError": "core.errors",
    "Plan": "api.experiment",
    "PressedSensor": "api.loop",
    "PressedSensors": "api.loop",
    "Recording": "api.recordings",
    "Rig": "core.gap.dataset.rig",
    "Scenario": "core.model.scenario",
    "Sensor": "api.sensors",
    "draw_channels": "api.skins",
    "export_sensor": "api.sensors",
    "find_gap": "api.gap",
    "fit_friction": "api.fits",
    "fit_readout": "api.fits",
    "fit_stiffness": "api.fits",
    "magnetic_skin": "api.skins",
    "mujoco_contact": "api.contacts",
    "newton_contact": "api.contacts",
    "plan_experiment": "api.experiment",
    "read_bake": "api.recordings",
    "read_recording": "api.recordings",
    "read_rig": "api.gap",
    "read_sensor": "api.sensors",
    "run_study": "api.study",
    "save_channels": "api.skins",
    "scenario_of": "addon.scripting.scene_objects",
    "sensor_of": "addon.scripting.scene_objects",
    "sensors_from_blend": "api.sensors",
    "simulate": "api.simulation",
}
"""The public names and their modules; what is not here is internal and may change."""

__all__ = ["__version__", *_PUBLIC]  # noqa: PLE0604


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        from difflib import get_close_matches

        near = get_close_matches(name, _PUBLIC, 1)
        raise AttributeError(
            f"module {__name__!r} has no attribute {name!r}" + (f": did you mean {near[0]!r}?" if near else "")
        )
    if __name__.startswith("bl_ext."):
        from .addon.session import dependencies

        dependencies.choose_numba_cache()
    found = getattr(importlib.import_module(f".{_PUBLIC[name]}", __name__), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *_PUBLIC})


def _rooms(window):
    """What registers, in order; each has register() and unregister()."""
    from .addon.session import dependencies

    if dependencies.missing_modules():
        from .panels import missing

        return [missing]
    from .addon.events import file_handlers
    from .addon.properties import registration

    rooms = [dependencies, registration, file_handlers]
    if window:
        from . import operators, panels
        from .addon.events import handlers

        rooms += [operators, panels, handlers, _CommandLine]
    return rooms


class _CommandLine:
    """``blender --command palpate …``, in Blenders that have commands."""

    handle = None

    @classmethod
    def register(cls):
        import bpy

        if hasattr(bpy.utils, "register_cli_command"):
            cls.handle = bpy.utils.register_cli_command("palpate", cls.run)

    @classmethod
    def unregister(cls):
        import bpy

        if cls.handle is not None:
            bpy.utils.unregister_cli_command(cls.handle)
            cls.handle = None

    @staticmethod
    def run(argv):
        from .commands import main

        return main(argv)


def register(window=True):
    """Called by Blender when the add-on is enabled; a second call changes nothing.

    Without `window` scenes have their settings and are read and saved as ever: no operators and panels, and nothing is played.
    """
    if _registered:
        return
    atexit.register(unregister)  # as a Python module, Blender 4.5 hangs at exit when classes are still registered
    try:
        for room in _rooms(window):
            room.register()
            _registered.append(room)
    except BaseException:
        unregister()
        raise


def unregister():
    """Called by Blender when the add-on is disabled; leaves nothing behind."""
    atexit.unregister(unregister)
    while _registered:
        _registered.pop().unregister()


_registered = []
