# SPDX-License-Identifier: GPL-3.0-or-later
"""Every parameter of a sensor has one place in the panels, whether somebody chose the place or not."""

from collections import Counter
from unittest.mock import MagicMock

import bpy
import pytest

from palpate.addon.properties.scene_units import ENDING
from palpate.core.model.sensor_parameters import HUNT_CROSSLEY, LINEAR, SENSOR_PARAMETERS
from palpate.panels import sensor


def drawn(settings, part) -> Counter:
    """How often a panel draws each property, in whatever units, on a layout that only writes down what it is asked for."""
    found, layout = Counter(), MagicMock()
    for nested in ("column", "row", "split", "box"):
        getattr(layout, nested).return_value = layout
    layout.prop.side_effect = lambda _owner, name, **_how: found.update([name.removesuffix(ENDING)])
    context = MagicMock(scene=bpy.context.scene, object=bpy.context.object)
    context.region.width, context.preferences.system.ui_scale = 300, 1.0
    part.draw_part(None, layout, settings, context)
    return found


@pytest.mark.parametrize(("law", "without"), [(LINEAR, {"exponent", "dissipation"}), (HUNT_CROSSLEY, {"cn"})])
def test_every_parameter_is_drawn_once(law, without):
    bpy.ops.mesh.primitive_plane_add()
    settings = bpy.context.object.palpate
    settings.role, settings.normal_law = "SENSOR", law
    found = Counter()
    for part in (sensor.Contact, sensor.Friction, sensor.Readout):
        found += drawn(settings, part)
    assert {name: found[name] for name in SENSOR_PARAMETERS} == {
        name: 0 if name in without else 1 for name in SENSOR_PARAMETERS
    }


def test_a_parameter_without_a_place_comes_last(monkeypatch):
    """A new line in the table of parameters is enough to see it."""
    bpy.ops.mesh.primitive_plane_add()
    more = {**SENSOR_PARAMETERS, "mass": SENSOR_PARAMETERS["mus"]}  # any property that the object has
    monkeypatch.setattr(sensor, "SENSOR_PARAMETERS", more)
    assert drawn(bpy.context.object.palpate, sensor.Friction)["mass"] == 1
    assert drawn(bpy.context.object.palpate, sensor.Contact)["mass"] == 0
