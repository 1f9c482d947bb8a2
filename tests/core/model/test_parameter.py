# SPDX-License-Identifier: GPL-3.0-or-later
"""One specification of a parameter: bounds that are checked and words that are read."""

from dataclasses import fields
from math import inf, nan

import pytest

from palpate.core.errors import ParameterError
from palpate.core.model.parameter import Choice, ChoiceParameter, Parameter, TextParameter
from palpate.core.model.sensor_parameters import SENSOR_PARAMETERS, SensorParameters, unit_of


def test_every_field_is_specified_under_its_own_name_with_a_default_inside_its_bounds():
    """A default that changes is noticed by the digest of test_digest.py."""
    assert [item.name for item in fields(SensorParameters)] == list(SENSOR_PARAMETERS)
    for name, specification in SENSOR_PARAMETERS.items():
        assert specification.name == name
        assert specification.check(specification.default, "a default") is None
    assert SensorParameters().check("default") is None


@pytest.mark.parametrize(
    ("low", "high", "above", "inside", "outside", "words"),
    [
        (0.0, inf, True, (1e-300, 1e300), (0.0, -1.0, inf, nan), "a value above zero."),
        (0.0, inf, False, (0.0, 1e300), (-1e-300, inf, nan), "a value of zero or more."),
        (1.0, 4.0, False, (1.0, 2.0, 4.0), (0.999, 4.001, nan), "a value from 1 to 4."),
        (-inf, inf, False, (-1e300, 0.0), (inf, -inf, nan), "a finite value."),
    ],
)
def test_bounds_are_checked_and_named(low, high, above, inside, outside, words):
    parameter = Parameter("p", "m", 1.0, low, high, "", above_low=above)
    for value in inside:
        parameter.check(value, "sensor 'tip'")
    for value in outside:
        with pytest.raises(ParameterError, match=f"^p of sensor 'tip' is .*: give it {words}"):
            parameter.check(value, "sensor 'tip'")


def test_words_of_files():
    """A whole number is a number; a truth value, a text and a list are none. Nothing is rounded to a choice."""
    number = Parameter("p", "m", 1.0, 0.0, 9.0, "")
    assert number.read(3) == 3.0 and type(number.read(3)) is float
    assert [number.read(word) for word in (True, "3", [3])] == [None] * 3
    choice = ChoiceParameter("c", 1, (Choice(1, "", ""), Choice(4, "", "")), "")
    assert choice.read(4) == 4 and [choice.read(word) for word in (4.0, True, "4")] == [None] * 3
    with pytest.raises(ParameterError, match="c of a pad is 3: use one of 1, 4"):
        choice.check(3, "a pad")
    assert TextParameter("t", "", "").read("V") == "V" and TextParameter("t", "", "").read(3) is None


def test_units_of_a_sensor_in_volts():
    assert [unit_of(name, "V") for name in ("k", "mus", "gain", "zero", "unit")] == ["N/m", "1", "V/N", "V", "1"]
