# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties of the scene by their paths: what they are, other values, and mistakes that end in one sentence."""

import bpy
import pytest
from blender_scenes import press

from palpate.addon.study import scene_overrides
from palpate.core.errors import ParameterError
from palpate.core.study.scene_property import read_overrides, read_properties, write_overrides, write_properties

BALL = 'bpy.data.objects["Ball"]'


@pytest.fixture
def ball():
    _, _, target = press()
    wave = target.modifiers.new("Wave", "WAVE")
    wave.height = 0.1
    target["stiff"] = 2.0
    target.id_properties_ui("stiff").update(min=1.0, max=5.0)
    target["count"] = 3
    return target


@pytest.mark.parametrize(
    ("path", "kind", "bounds"),
    [
        (f"{BALL}.scale[1]", "number", (float("-inf"), float("inf"))),
        (f'{BALL}.modifiers["Wave"].height', "number", (float("-inf"), float("inf"))),
        (f"{BALL}.modifiers['Wave'].use_cyclic", "switch", None),
        (f'{BALL}.modifiers["Wave"].texture_coords', "choice", None),
        (f"{BALL}.modifiers[0].damping_time", "number", None),
        (f'{BALL}["stiff"]', "number", (1.0, 5.0)),
        (f'{BALL}["count"]', "whole number", None),
        (f"{BALL}.palpate.contact_normals", "choice", None),
        ('bpy.data.scenes["Scene"].gravity[1]', "number", None),
        ('bpy.data.meshes["Sphere"].vertices[3].co[0]', "number", None),
    ],
)
def test_a_property_says_what_it_is_and_takes_values(ball, path, kind, bounds):
    found = scene_overrides.describe(path)
    assert (found.name, found.kind) == (path, kind)
    limits = found.variable().specification
    assert bounds is None or (limits.low, limits.high) == bounds
    value = {"number": 2.5, "whole number": 4, "switch": False, "choice": found.choices[-1:]}[kind]
    value = value[0] if kind == "choice" else value
    scene_overrides.apply({path: value})
    assert scene_overrides.find_property(path).get() == value


@pytest.mark.parametrize(
    ("path", "sentence"),
    [
        ('bpy.data.objects["Bal"].scale[0]', "There is no 'Bal' in 'bpy.data.objects', which the study names as .* 'Ball'?"),
        (f"{BALL}.scal[0]", "did you mean 'scale'?"),
        (f'{BALL}.modifiers["Wve"].height', "did you mean 'Wave'?"),
        (f"{BALL}.scale", r"has 3 components: add \[0\] to \[2\]"),
        (f"{BALL}.scale[3]", "There is no '3' in"),
        (f"{BALL}.location[0]", "has keyframes or a driver"),
        (f"{BALL}.name", "cannot be set|is not a number"),
        (f"{BALL}.modifiers", "is not a number, switch or choice"),
        (f"{BALL}.matrix_world", "components"),
        ("bpy.data.object.x", "did you mean 'objects'?"),
        (f"{BALL}.select_set(True)", "There is no 'select_set'"),
        ("bpy.ops.wm.quit_blender()", "begin it with bpy.data"),
    ],
)
def test_mistakes_are_one_sentence(ball, path, sentence):
    with pytest.raises(ParameterError, match=sentence) as raised:
        scene_overrides.describe(path)
    assert "\n" not in str(raised.value)


def test_values_out_of_bounds_leave_everything_as_it_was(ball):
    with pytest.raises(ParameterError, match="a value from 1 to 5"):
        scene_overrides.apply({f"{BALL}.scale[1]": 3.0, f'{BALL}["stiff"]': 7.0})
    with pytest.raises(ParameterError, match="a whole number"):
        scene_overrides.apply({f"{BALL}.scale[1]": 3.0, f'{BALL}["count"]': 1.5})
    assert ball.scale[1] == 1.0


def test_a_driver_concerns_its_own_component(ball):
    ball.driver_add("scale", 2).driver.expression = "2"
    with pytest.raises(ParameterError, match="a driver"):
        scene_overrides.describe(f"{BALL}.scale[2]")
    assert scene_overrides.describe(f"{BALL}.scale[1]").kind == "number"


def test_files_give_back_what_they_were_given(ball, tmp_path):
    values = {f"{BALL}.scale[1]": 0.1 + 0.2, f'{BALL}.modifiers["Wave"].use_cyclic': True, f'{BALL}["count"]': 4}
    write_overrides(tmp_path / "o.toml", values)
    assert read_overrides(tmp_path / "o.toml") == values
    described = [scene_overrides.describe(path) for path in (*values, f'{BALL}["stiff"]', f"{BALL}.palpate.contact_normals")]
    write_properties(tmp_path / "p.json", described)
    assert list(read_properties(tmp_path / "p.json").values()) == described
    assert bpy.data.objects["Ball"]["count"] == 3
