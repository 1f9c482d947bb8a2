# SPDX-License-Identifier: GPL-3.0-or-later
"""Every parameter of a sensor has one place in the panels, whether somebody chose the place or not."""

from collections import Counter
from unittest.mock import MagicMock

import bpy
import pytest

from palpate.addon.properties.scene_units import ENDING
from palpate.addon.session import session_state
from palpate.core.jobs import Progress
from palpate.core.model.sensor_parameters import HUNT_CROSSLEY, LINEAR, SENSOR_PARAMETERS
from palpate.panels import bake, gap, sensor


def laid_out(settings, *parts):
    """Draw panels on a layout that only writes down what it is asked for; return the layout."""
    layout = MagicMock()
    for nested in ("column", "row", "split", "box", "grid_flow"):
        getattr(layout, nested).return_value = layout
    context = MagicMock(scene=bpy.context.scene, object=bpy.context.object, window_manager=bpy.context.window_manager)
    context.region.width, context.preferences.system.ui_scale = 300, 1.0
    for part in parts:
        part.draw_part(None, layout, settings, context)
    return layout


def drawn(settings, part, owner=None) -> Counter:
    """How often a panel draws each property, in whatever units: those of all owners, or of one."""
    calls = laid_out(settings, part).prop.call_args_list
    return Counter(call.args[1].removesuffix(ENDING) for call in calls if owner in (None, call.args[0]))


@pytest.mark.parametrize(("law", "without"), [(LINEAR, {"exponent", "dissipation"}), (HUNT_CROSSLEY, {"cn"})])
def test_every_parameter_is_drawn_once(settings, law, without):
    settings.role, settings.normal_law = "SENSOR", law
    found = Counter()
    for part in (sensor.Contact, sensor.Friction, sensor.Readout):
        found += drawn(settings, part)
    expected = {name: 0 if name in without else 1 for name in SENSOR_PARAMETERS}
    assert {name: found[name] for name in SENSOR_PARAMETERS} == expected


def test_a_parameter_without_a_place_comes_last(settings, monkeypatch):
    """A new line in the table of parameters is enough to see it."""
    more = {**SENSOR_PARAMETERS, "mass": SENSOR_PARAMETERS["mus"]}  # any property that the object has
    monkeypatch.setattr(sensor, "SENSOR_PARAMETERS", more)
    assert drawn(settings, sensor.Friction)["mass"] == 1
    assert drawn(settings, sensor.Contact)["mass"] == 0


@pytest.mark.parametrize(
    ("part", "operator", "fields"),
    [
        (sensor.Root, "palpate.skin_add", {"method", "spacing", "seed", "lift"}),
        (sensor.Root, "palpate.probe_add", {"shape", "size", "depth"}),
        (gap.Measured, "palpate.gap_plan", {"depth", "speed", "duration"}),
    ],
)
def test_a_panel_has_the_settings_of_its_buttons(settings, part, operator, fields):
    """They were only in Adjust Last Operation, after the operator had done its work once with others."""
    if operator != "palpate.skin_add":
        settings.role = "SENSOR"
    own = bpy.context.window_manager.operator_properties_last(operator)
    assert drawn(settings, part, owner=own).keys() >= fields


def test_a_button_uses_the_settings_of_the_panel():
    bpy.ops.mesh.primitive_grid_add(size=0.05)
    own = bpy.context.window_manager.operator_properties_last("palpate.skin_add")
    own.method, own.spacing = "GRID", 0.01
    assert bpy.ops.palpate.skin_add("INVOKE_DEFAULT", True) == {"FINISHED"}  # as a button does
    assert bpy.context.object.palpate.skin.method == "GRID"
    assert bpy.context.object.palpate.skin.spacing == pytest.approx(0.01)
    own = bpy.context.window_manager.operator_properties_last("palpate.skin_add")  # running the operator has replaced them
    own.method, own.spacing = "NOISE", 0.0


def test_the_kinds_of_figures_are_check_boxes_of_one_column(settings):
    own = bpy.context.scene.palpate.figures
    boxes = {"kinds_scene", "kinds_strip", "kinds_curves", "kinds_numbers", "kinds_video", "kinds_gel"}
    boxes |= {"formats_png", "formats_pdf", "formats_svg", "exports_csv", "exports_hdf5", "exports_mcap"}
    assert drawn(settings, bake.Figures).keys() >= boxes
    own.kinds_strip, own.kinds_gel, own.exports_csv = False, True, True  # a click each, without Shift
    assert own.kinds == {"SCENE", "CURVES", "NUMBERS", "GEL"} and own.exports == {"CSV"}
    own.kinds = {"VIDEO"}
    assert own.kinds_video and not own.kinds_scene and own.bl_rna.properties["kinds_video"].name == "Video"


@pytest.mark.parametrize("operator", ["palpate.gap_find", "palpate.gap_plan", "palpate.figures_make", "palpate.catch_up"])
def test_long_work_has_a_bar_where_its_button_was(settings, operator, monkeypatch):
    settings.role = "SENSOR"
    kind = getattr(bpy.types, f"PALPATE_OT_{operator.split('.')[1]}")
    monkeypatch.setattr(session_state.session, "jobs", {kind.__name__: Progress("Working", 1, 4, 7)})
    layout = laid_out(settings, gap.Measured, bake.Bake, bake.Figures)
    layout.progress.assert_called_once_with(text="Working: frame 7 (ESC: stop)", factor=0.25)
    assert operator not in [call.args[0] for call in layout.operator.call_args_list]
