# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors and scenarios from objects of Blender; without Blender the functions say so."""

from __future__ import annotations

import importlib.util
from typing import Any

from ...api import arguments
from ...api.arguments import ArgumentError
from ...api.sensors import Sensor
from ...core.errors import PalpateError
from ...core.jobs import run_job
from ...core.model.scenario import Scenario


def sensor_of(obj: Any) -> Sensor:
    """Return the sensor or pad that an object of Blender is, at the present frame, as it is placed in the scene.

    Parameters
    ----------
    obj : bpy.types.Object

    Raises
    ------
    PalpateError
        The object is no sensor, or its mesh or region makes none; or there is no Blender.
    """
    _require_blender()
    import bpy

    from ..authoring import sensor_exchange

    if not isinstance(obj, bpy.types.Object):
        raise ArgumentError(f"obj is {arguments.brief(obj)}: give an object of Blender, as bpy.context.object.")
    item = sensor_exchange.sensors_on_meshes(bpy.context.scene, (obj.name,))[0]
    return Sensor(item.sensor, item.mesh, item.surface, item.position, item.quaternion)


def scenario_of(scene: Any) -> Scenario:
    """Return the scenario of a scene of Blender over its whole frame range; ``simulate`` takes it.

    Parameters
    ----------
    scene : bpy.types.Scene

    Raises
    ------
    PalpateError
        Something in the scene makes no run; or there is no Blender.
    """
    _require_blender()
    import bpy

    from ..scene import scene_reader

    if not isinstance(scene, bpy.types.Scene):
        raise ArgumentError(f"scene is {arguments.brief(scene)}: give a scene of Blender, as bpy.context.scene.")
    return run_job(scene_reader.read_scene(scene)).scenario


def _require_blender() -> None:
    if importlib.util.find_spec("bpy") is None:
        raise PalpateError("This Python has no Blender: call it inside Blender, or run 'pip install bpy'.")
