# SPDX-License-Identifier: GPL-3.0-or-later
"""A sensor's parameters between an object and the files of other programs; which formats there are is told in core/formats."""

from __future__ import annotations

from ..core.errors import SceneError
from ..core.scenario import SensorParameters
from . import properties, sample


def parameters(obj) -> SensorParameters:
    """Return the parameters of an object's panel."""
    return sample.parameters(obj.palpate)


def put_parameters(obj, values: SensorParameters) -> None:
    """Write parameters into an object's panel.

    Raises
    ------
    SceneError
        The object is linked from another file, or is no sensor and no pad.
    ParameterError
        A value means nothing. Nothing was changed then.
    """
    if obj.library is not None:
        raise SceneError(f"'{obj.name}' is linked from '{obj.library.filepath}': change it there, or make it local first.")
    if obj.palpate.role not in {"SENSOR", "PAD"}:
        raise SceneError(f"'{obj.name}' is no sensor: make it one with Physics › Palpate › Make Sensor first.")
    values.check(obj.name)
    for key in properties.PARAMETERS:
        value = getattr(values, key)
        setattr(obj.palpate, key, str(value) if key == "points_per_texel" else value)
