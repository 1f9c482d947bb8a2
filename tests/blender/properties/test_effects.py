# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects on a sensor in Blender: the stack, what is sampled of it, and that bakes and playing show it."""

import bpy
import numpy as np
import pytest
from blender_scenes import baked, pad_sensor, press, reopen, save

from palpate.addon.properties import effect_stack
from palpate.addon.scene import sensor_reader
from palpate.addon.session import frame_status
from palpate.addon.timeline import staleness
from palpate.core.effects.engine.registry import effect, library
from palpate.core.errors import EffectError


def test_every_effect_can_be_added_moved_and_removed():
    pad = pad_sensor()
    for name in library():
        assert bpy.ops.palpate.effect_add(effect=name) == {"FINISHED"}
    assert [item.name for item in effect_stack.stack(pad)] == list(library())
    assert effect_stack.stack(pad) == tuple(effect(name) for name in library())
    bpy.ops.palpate.effect_move(index=1, way="UP")
    assert [item.kind for item in pad.palpate.effects][:2] == list(library())[1::-1]
    bpy.ops.palpate.effect_move(index=0, way="UP")  # stays where it is
    bpy.ops.palpate.effect_remove(index=0)
    assert len(pad.palpate.effects) == len(library()) - 1
    pad.palpate.effects[0].use = False
    assert len(effect_stack.stack(pad)) == len(library()) - 2


def test_what_is_put_on_is_what_is_sampled():
    pad = pad_sensor()
    pad.palpate.gain = 250.0
    mesh = sensor_reader.sensor_in_own_frame(bpy.context.scene, pad, bpy.context.evaluated_depsgraph_get())[1]
    for kind in library().values():
        for form in kind.forms:
            one = effect(kind.name, form.name, seed=3, gain=250.0)
            effect_stack.put_stack(pad, (one,))
            (found,) = effect_stack.stack(pad)
            assert (found.name, found.form) == (kind.name, form.name)
            assert found.values == pytest.approx(one.values, rel=1e-6)
            assert sensor_reader.read_sensor(pad, 0, mesh, np.eye(3)).effects == (found,)


def test_numbers_for_each_texel():
    pad, factors = pad_sensor(), tuple(np.linspace(0.5, 1.5, 84))
    effect_stack.put_stack(pad, (effect("gain-mismatch", "listed", factor=factors),))
    assert effect_stack.stack(pad)[0].values["factor"] == factors
    pad.palpate.effects[0].gain_mismatch_listed_factor = "1, 2, three"
    with pytest.raises(EffectError, match="factor of effect 'gain-mismatch' of sensor 'Pad' cannot be read"):
        effect_stack.stack(pad)


def test_a_stack_that_means_nothing_leaves_the_old_one():
    pad = pad_sensor()
    effect_stack.put_stack(pad, (effect("creep"),))
    with pytest.raises(EffectError, match="no effect 'rust'"):
        effect_stack.put_stack(pad, (effect_stack.Effect("rust", ""),))
    assert len(pad.palpate.effects) == 1


def test_the_tooltips_and_bounds_are_those_of_the_library():
    properties = effect_stack.PALPATE_PG_effect.bl_rna.properties
    amount = properties["creep_exponential_amount"]
    assert (amount.soft_min, amount.soft_max) == pytest.approx((0.0, 0.95))
    form = next(form for form in library()["creep"].forms if form.name == "exponential")
    assert amount.description.startswith(next(one.text for one in form.parameters if one.name == "amount").rstrip("."))
    assert "creep" in properties["kind"].enum_items and "logarithmic" in properties["creep_form"].enum_items


def test_a_bake_holds_the_readings_and_notices_a_change(tmp_path):
    """A readout effect changes the reading and no force."""
    scene, pad, _ = press(6)
    plain = baked(scene, tmp_path).recording.sensors["Pad"]
    bpy.context.view_layer.objects.active = pad
    bpy.ops.palpate.effect_add(effect="saturation")
    level = 0.4 * float(plain.reading.max())
    pad.palpate.effects[0].saturation_clip_level = level
    assert staleness.is_stale(scene, bpy.context.evaluated_depsgraph_get(), None)
    limited = baked(scene).recording.sensors["Pad"]
    np.testing.assert_array_equal(limited.normal_force, plain.normal_force)
    np.testing.assert_allclose(limited.reading, np.minimum(plain.reading, level), rtol=1e-6)
    assert not staleness.is_stale(scene, bpy.context.evaluated_depsgraph_get(), None)
    pad.palpate.effects[0].use = False
    assert staleness.is_stale(scene, bpy.context.evaluated_depsgraph_get(), None)


def test_playing_gives_the_bakes_readings(tmp_path):
    """Noise of a seed and a lag, frame by frame on the timeline."""
    scene, pad, _ = press(6)
    effect_stack.put_stack(pad, (effect("noise", spread=1e-3, seed=4), effect("lag", time=0.1)))
    played = []
    for frame in range(1, 7):
        scene.frame_set(frame)
        played.append(frame_status.status_of(scene).frame.sensors["Pad"].reading)
    np.testing.assert_array_equal(np.array(played), baked(scene, tmp_path).recording.sensors["Pad"].reading)


def test_the_stack_is_in_the_file(tmp_path):
    stack = (effect("hysteresis", "bouc-wen", share=0.25), effect("noise", seed=9))
    effect_stack.put_stack(pad_sensor(), stack)
    scene = reopen(save(tmp_path))
    assert effect_stack.stack(scene.objects["Pad"]) == stack
