# SPDX-License-Identifier: GPL-3.0-or-later
"""A sensor's file is read back to the last bit, and a bad one is refused with a sentence."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from palpate.core.effects.engine.registry import effect, library
from palpate.core.errors import EffectError, FileError, ParameterError
from palpate.core.io.sensor_toml import FORMAT, SensorModel, read_sensor, write_sensor
from palpate.core.model.sensor_parameters import SensorParameters

SHAPE = {"grid": {"rows": 14, "columns": 6, "pitch": [0.0034, 0.0034]}, "thickness": 0.006}


def test_everything_comes_back(tmp_path):
    parameters = SensorParameters(
        k=1e3 / 3, cn=math.pi, normal_law="hunt-crossley", points_per_texel=4, gain=-1023.7, zero=512, unit="counts µ"
    )
    every = [effect(kind.name, form.name, gain=-1023.7) for kind in library().values() for form in kind.forms]
    listed = effect("gain-mismatch", "listed", factor=[0.1 + i / 7 for i in range(84)])
    model = SensorModel('a "pad"', parameters, (*every, listed, effect("noise", seed=12, gain=-1023.7)), SHAPE)
    write_sensor(tmp_path / "sensor.toml", model)
    assert read_sensor(tmp_path / "sensor.toml") == model


@settings(max_examples=50, deadline=None)
@given(k=st.floats(1e-300, 1e300), zero=st.floats(-1e300, 1e300), share=st.floats(0.0, 0.95))
def test_numbers_come_back_to_the_last_bit(tmp_path_factory, k, zero, share):
    path = tmp_path_factory.mktemp("sensors") / "sensor.toml"
    model = SensorModel("pad", SensorParameters(k=k, zero=zero), (effect("creep", amount=share),))
    write_sensor(path, model)
    assert read_sensor(path) == model


def test_a_short_file_has_defaults(tmp_path):
    path = tmp_path / "sensor.toml"
    path.write_text(f'format = "{FORMAT}"\n[sensor]\nk = 60\n[[effect]]\nname = "creep"\n', encoding="utf-8")
    assert read_sensor(path) == SensorModel("sensor", SensorParameters(k=60.0), (effect("creep"),))


@pytest.mark.parametrize(
    ("text", "kind", "sentence"),
    [
        ("format = 3", FileError, "begins with format"),
        ("k = ", FileError, "is not TOML"),
        ("HEAD\n[sensor]\nstiffness = 3", FileError, "'stiffness' in \\[sensor\\] is not a word"),
        ("HEAD\n[senor]\nk = 3", FileError, "'senor' in the file"),
        ("HEAD\n[sensor]\nk = 'soft'", FileError, "k of \\[sensor\\] is 'soft': give a number"),
        ("HEAD\n[sensor]\npoints_per_texel = 1.0", FileError, "give a whole number"),
        ("HEAD\n[sensor]\nk = -3", ParameterError, "'sensor.toml': k of sensor 'sensor' is -3"),
        ("HEAD\n[sensor]\nk = nan", ParameterError, "above zero"),
        ("HEAD\n[effect]\nname = 'creep'", FileError, "\\[\\[effect\\]\\]"),
        ("HEAD\n[[effect]]\nname = 'creap'", EffectError, "did you mean 'creep'"),
        ("HEAD\n[[effect]]\nname = 'creep'\namount = 2", EffectError, "from 0 to 0.95"),
        ("HEAD\n[[effect]]\nname = 'creep'\namount = [0.1, 0.2]", EffectError, "one number"),
    ],
)
def test_bad_files(tmp_path, text, kind, sentence):
    path = tmp_path / "sensor.toml"
    path.write_text(text.replace("HEAD", f'format = "{FORMAT}"'), encoding="utf-8")
    with pytest.raises(kind, match=sentence):
        read_sensor(path)


def test_no_file(tmp_path):
    with pytest.raises(FileError, match="There is no sensor"):
        read_sensor(tmp_path / "missing.toml")
    (tmp_path / "picture.toml").write_bytes(b"\x89PNG\xff")
    with pytest.raises(FileError, match="is not a text file"):
        read_sensor(tmp_path / "picture.toml")
    with pytest.raises(FileError, match="does not exist"):
        write_sensor(tmp_path / "no" / "folder" / "sensor.toml", SensorModel("pad"))
