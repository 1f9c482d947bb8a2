# SPDX-License-Identifier: GPL-3.0-or-later
"""OpenRAVE's sensor definitions: Table 2 in and out, exact round trips, and what is no definition."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from palpate.core.errors import FileError
from palpate.core.model.sensor_parameters import SensorParameters
from palpate.core.simulators.openrave_file import OpenRaveSensor, read_openrave, write_openrave

TABLE_2 = """\
<AttachedSensor>
  <link>object1</link>
  <sensor name="T1" type="SimTactileSensor">
    <thickness>0.006</thickness>
    <k>58.5</k>
    <cn>0.0583</cn>
    <sigma0>1.0</sigma0>
    <sigma1>0.1</sigma1>
    <x0>0.3</x0>
    <ct>0.01</ct>
    <mus>0.435</mus>
    <mud>0.23</mud>
  </sensor>
</AttachedSensor>
"""


def test_table_2_is_read_and_written_to_the_letter(tmp_path):
    path = tmp_path / "table2.xml"
    path.write_text(TABLE_2, encoding="utf-8")
    (sensor,) = read_openrave(path)
    assert (sensor.name, sensor.link, sensor.missing) == ("T1", "object1", ())
    assert sensor.parameters == SensorParameters()  # the defaults are those of Table 2
    write_openrave(tmp_path / "again.xml", [sensor])
    assert (tmp_path / "again.xml").read_text(encoding="utf-8") == TABLE_2


positive = st.floats(1e-9, 1e9)


@settings(max_examples=200, deadline=None)
@given(
    st.text(st.characters(codec="utf-8", exclude_categories=("C", "Z")), min_size=1), st.lists(positive, min_size=9, max_size=9)
)
def test_any_sensor_comes_back_bit_for_bit(tmp_path_factory, name, numbers):
    k, cn, sigma0, sigma1, x0, ct, a, b, depth = numbers
    law = SensorParameters(k, cn, ct, sigma0, sigma1, x0, max(a, b), min(a, b), depth)
    sensors = [OpenRaveSensor(name, name, law), OpenRaveSensor("other", "a <link> & 'more'", SensorParameters())]
    path = tmp_path_factory.mktemp("xml") / "robot.xml"
    for robot in (None, 'a "robot"'):
        write_openrave(path, sensors, robot)
        assert read_openrave(path) == sensors


def test_sensors_inside_a_robot_are_found_and_gaps_are_named(tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(
        '<?xml version="1.0"?>\n<Robot><KinBody/><AttachedSensor><sensor type="BaseLaser2D"/></AttachedSensor>'
        '<AttachedSensor><link>tip</link><sensor name="L" type="simtactilesensor"><k>120</k></sensor></AttachedSensor></Robot>',
        encoding="utf-8",
    )
    (sensor,) = read_openrave(path)
    assert sensor.parameters == replace(SensorParameters(), k=120.0)
    assert sensor.missing == ("thickness", "cn", "sigma0", "sigma1", "x0", "ct", "mus", "mud")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "has no <AttachedSensor>"),
        ("<Robot></Robot>", "has no <AttachedSensor>"),
        ("< AttachedSensor >\n</AttachedSensor>", "Line 1 of .* is not XML"),
        (TABLE_2.replace("58.5", "stiff"), "<k> of sensor 'T1' .* is 'stiff', which is not a number"),
        (TABLE_2.replace("58.5", "-1"), "k of sensor 'T1' is -1"),
        (TABLE_2.replace("58.5", "nan"), "k of sensor 'T1' is nan"),
        (TABLE_2.replace("<ct>0.01</ct>", "<k>3</k>"), "two <k>"),
    ],
)
def test_what_is_no_definition_gets_a_sentence(tmp_path, text, words):
    path = tmp_path / "robot.xml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FileError, match=words):
        read_openrave(path)


@pytest.mark.parametrize("name", ["\udcff\udcfe", "a\0b", "\x1b[31m"])
def test_names_that_xml_cannot_hold_get_a_sentence(tmp_path, name):
    for sensors, robot in (
        ([OpenRaveSensor("T", "finger", SensorParameters())], name),
        ([OpenRaveSensor(name, "f", SensorParameters())], "hand"),
    ):
        with pytest.raises(FileError, match="XML cannot hold the name"):
            write_openrave(tmp_path / "robot.xml", sensors, robot)
    assert not list(tmp_path.iterdir())
