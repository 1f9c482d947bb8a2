# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels hold every parameter that core specifies, with its bounds and default, and give it back as it was typed."""

from palpate.addon.authoring.laid_sensors import COPIED
from palpate.addon.properties.parameter_properties import CONSTANT, put_sensor_parameters, sensor_parameters
from palpate.addon.scene import scene_fingerprint
from palpate.core.model.body import DRIVE_PARAMETERS
from palpate.core.model.parameter import Parameter
from palpate.core.model.sensor_parameters import CONTACT, FRICTION, READOUT, SENSOR_PARAMETERS, SensorParameters


def test_defaults_are_those_of_the_model(settings):
    assert sensor_parameters(settings) == SensorParameters()


def test_every_parameter_is_written_and_read(settings):
    written = SensorParameters(
        k=77.1, cn=0.9, ct=0.2, sigma0=3.3, sigma1=0.4, x0=0.7, mus=0.9, mud=0.8, max_penetration=0.0123,
        normal_law="hunt-crossley", exponent=1.7, dissipation=0.1, points_per_texel=9, gain=-3.1, zero=12.5, unit="V",
    )  # fmt: skip
    default = SensorParameters()
    assert all(getattr(written, name) != getattr(default, name) for name in SENSOR_PARAMETERS)
    put_sensor_parameters(settings, written)
    assert sensor_parameters(settings) == written


def test_every_parameter_is_copied_shown_and_noticed_by_the_timeline():
    assert set(SENSOR_PARAMETERS) <= set(COPIED) and set(SENSOR_PARAMETERS) <= set(scene_fingerprint.OBJECT_PROPERTIES)
    assert {specification.group for specification in SENSOR_PARAMETERS.values()} == {CONTACT, FRICTION, READOUT}


def test_a_parameter_without_keyframes_says_so(settings):
    """The words stand in the tooltip; the context menu, where one looks for Insert Keyframe, has them as well."""
    effects = settings.effects.add().bl_rna.properties
    found = [settings.bl_rna.properties[name] for name, item in SENSOR_PARAMETERS.items() if isinstance(item, Parameter)]
    found += [item for item in effects if item.type == "FLOAT"]
    assert len(found) > 60
    for item in found:
        assert item.description.endswith(CONSTANT) and not item.is_animatable, item.identifier


def test_bounds_of_panels_are_those_that_are_checked(settings):
    drive = {f"drive_{name}": item for name, item in DRIVE_PARAMETERS.items() if item.label}
    for name, specification in {**SENSOR_PARAMETERS, **drive}.items():
        if isinstance(specification, Parameter):
            item = settings.bl_rna.properties[name]
            assert item.hard_min == max(specification.low, -1e9) and item.hard_max == min(specification.high, item.hard_max)
