# SPDX-License-Identifier: GPL-3.0-or-later
"""Exchange of sensors between objects and files: parameters, effects and, for a new pad, the grid of texels."""

from __future__ import annotations

import numpy as np
from bpy_extras.object_utils import object_data_add

from ...core.errors import SceneError
from ...core.geometry.grid_layout import GridLayout
from ...core.model.sensor_parameters import SensorParameters
from ..properties import effect_stack, parameter_properties
from ..scene import participants, sensor_reader
from . import laid_sensors, sensors


def parameters_of(obj) -> SensorParameters:
    """Return the parameters of a sensor or pad."""
    return parameter_properties.sensor_parameters(obj.palpate)


def put_parameters(obj, values: SensorParameters) -> None:
    """Give a sensor or pad these parameters.

    Raises
    ------
    SceneError
        The object is linked from another file, or is no sensor and no pad.
    ParameterError
        A value is not valid. Nothing was changed then.
    """
    if obj.library is not None:
        raise SceneError(f"'{obj.name}' is linked from '{obj.library.filepath}': change it there, or make it local first.")
    if obj.palpate.role not in {"SENSOR", "PAD"}:
        raise SceneError(f"'{obj.name}' is not a sensor: make it one with Physics › Palpate › Make Sensor first.")
    values.check(obj.name)
    parameter_properties.put_sensor_parameters(obj.palpate, values)


def save_toml(context, obj, path) -> None:
    """Write a sensor as TOML: parameters, effects and, if its texels form a flat grid, the grid.

    Raises
    ------
    PalpateError
        The file cannot be written, or a value is not valid.
    """
    from ...core.io.sensor_toml import SensorModel, write_sensor

    values = parameters_of(obj)
    values.check(obj.name)
    write_sensor(path, SensorModel(obj.name, values, effect_stack.stack(obj), grid_table(context, obj)))


def load_toml(context, path) -> tuple:
    """Give the active sensor what a file says; if no sensor is active, make a new pad of the file's grid.

    Returns
    -------
    obj : Object
    effects : int
        Number of its effects.

    Raises
    ------
    PalpateError
        The file is no sensor file, or there is neither an active sensor nor a grid. Nothing was changed then.
    """
    from ...core.io.sensor_toml import read_sensor

    model = read_sensor(path)
    obj = context.object
    if obj is None or obj.palpate.role not in {"SENSOR", "PAD"}:
        obj = _new_pad(context, model)
    put_parameters(obj, model.parameters)
    effect_stack.put_stack(obj, model.effects)
    return obj, len(model.effects)


def _new_pad(context, model):
    grid = model.shape.get("grid")
    if grid is None:
        raise SceneError(f"'{model.name}' has no grid to make a pad of: make the sensor that gets it active first.")
    mesh = laid_sensors.pad_mesh(context, grid["rows"], grid["columns"], tuple(grid["pitch"]), 0.0)
    obj = object_data_add(context, mesh, name=model.name)
    sensors.make_sensor(obj, "MESH")
    return obj


def grid_table(context, obj) -> dict:
    """Return ``{"grid": …}`` for texels in a plane with rows and columns at a constant pitch, else an empty dict."""
    texels = sensor_reader.sensor_in_own_frame(context.scene, obj, participants.depsgraph_of(context.scene))[0].texels
    layout = texels.layout
    if not isinstance(layout, GridLayout):
        return {}
    table = np.empty((layout.rows, layout.columns, 3))
    table[layout.row, layout.column] = texels.position
    across = (table[0, -1] - table[0, 0]) / (layout.columns - 1)
    along = (table[-1, 0] - table[0, 0]) / (layout.rows - 1)
    steps = np.arange(layout.columns)[None, :, None] * across + np.arange(layout.rows)[:, None, None] * along
    pitch = [float(np.linalg.norm(across)), float(np.linalg.norm(along))]
    same = np.abs(table - table[0, 0] - steps).max() < 1e-3 * min(pitch)
    if not same or abs(across @ along) > 1e-3 * pitch[0] * pitch[1]:
        return {}
    return {"grid": {"rows": layout.rows, "columns": layout.columns, "pitch": [float(f"{p:.6g}") for p in pitch]}}
