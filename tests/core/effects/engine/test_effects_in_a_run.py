# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects in a run: what they do to bodies and readings, frame by frame as over the whole signal."""

from dataclasses import replace

import numpy as np
import pytest
from oracles import contact_laws
from solver_scenes import box, cube_on_pad, pressed, shape
from trimesh.creation import icosphere

from palpate.core.effects.engine.contact_forces import normal_forces
from palpate.core.effects.engine.readout_chain import readings, transducers_of
from palpate.core.effects.engine.registry import effect, library, mounted_texels
from palpate.core.model.sensor_parameters import Painted, SensorParameters
from palpate.core.solver.simulation import run


def with_effects(scenario, *effects):
    return replace(scenario, sensors=(replace(scenario.sensors[0], effects=effects),))


def press(*effects, frames=40):
    """A box that goes 2 mm into the pad and out again."""
    depth = 0.002 * np.sin(np.linspace(0, np.pi, frames))
    path = np.stack([np.zeros(frames), np.zeros(frames), 0.01 - depth], axis=1)
    return with_effects(pressed(box(0.05, 0.06, 0.02), path, k=1000.0, cn=0.0), *effects)


def test_a_misaligned_sensor_feels_what_lies_beside_it():
    """A ball beside the middle presses on texels that are mounted as far beside it."""
    ball = shape(icosphere(subdivisions=3, radius=0.02))
    centred = pressed(ball, [[0.0, 0.0, 0.0185]] * 2)
    shifted = pressed(ball, [[0.002, -0.003, 0.0185]] * 2)
    moved = with_effects(shifted, effect("misalignment", "shift", x=0.002, y=-0.003))
    expected, found = (run(scenario).sensors["pad"] for scenario in (centred, moved))
    np.testing.assert_allclose(found.normal_force, expected.normal_force, atol=1e-15)
    assert found.centre_of_pressure[0] == pytest.approx(expected.centre_of_pressure[0] + [0.002, -0.003, 0.0], abs=1e-12)
    assert not np.allclose(run(shifted).sensors["pad"].normal_force, expected.normal_force)


def test_a_tilted_sensor_is_pressed_harder_at_one_side():
    """About +y the texels at +x sink by x sin(angle)."""
    tilted = with_effects(press(frames=9), effect("misalignment", "tilt", about_x=0.0, about_y=0.05))
    sensor = tilted.sensors[0]
    force = run(tilted).sensors["pad"].normal_force[4]
    expected = 1000.0 * np.maximum(0.002 - sensor.texels.position[:, 0] * np.sin(0.05), 0.0)
    np.testing.assert_allclose(force, expected, rtol=1e-9)
    np.testing.assert_allclose(mounted_texels(sensor).position[:, 2], -sensor.texels.position[:, 0] * np.sin(0.05), atol=1e-15)


def test_readings_of_a_run_are_those_of_the_whole_signal():
    """Frames are read one by one in a run; all kinds of memory, chance and mixing are in this chain."""
    scenario = press(
        effect("load-spreading"),
        effect("hysteresis", "play"),
        effect("crosstalk", "lines"),
        effect("gain-mismatch", seed=1),
        effect("lag", "dead-time", time=0.07),
        effect("lag", "second-order", time=0.1),
        effect("drift", "random-walk", seed=2),
        effect("noise", seed=3),
        effect("quantization", step=1e-3),
    )
    recording = run(scenario)
    felt = recording.sensors["pad"]
    sensor = scenario.sensors[0]
    whole = readings(sensor.effects, transducers_of(sensor), recording.times, felt.normal_force)
    np.testing.assert_allclose(felt.reading, whole, atol=1e-9)
    np.testing.assert_array_equal(felt.normal_force, run(with_effects(scenario)).sensors["pad"].normal_force)


def test_the_digest_tells_effects_apart():
    digests = {with_effects(press(), *stack).digest() for stack in ((), (effect("creep"),), (effect("creep", amount=0.3),))}
    assert len(digests) == 3
    creep = effect("creep", amount=0.3)
    turned = replace(creep, values=dict(reversed(creep.values.items())))
    assert with_effects(press(), creep).digest() == with_effects(press(), turned).digest()


# --- effects on forces act on the bodies


def standing(*effects, mass=0.5, time=2.0, fps=24.0, dt=1e-3, **parameters):
    """A cube that is put down on the pad from no height at all."""
    values = {"k": 1000.0, "cn": 10.0, **parameters}
    return with_effects(cube_on_pad(mass=mass, frames=round(time * fps), fps=fps, dt=dt, gap=0.0, **values), *effects)


def test_a_cube_on_a_creeping_pad_sinks_as_the_closed_form_says():
    """Under a load F on n texels the depth goes from F / nk to F / nk (1 − a), and ``exp(−(1 − a) t / τ)`` is what is left.

    What is not in that formula is how the cube comes to rest in the first tenth of a second: 1e-2 of the way covers it from
    half a second on, by when the pad has forgotten the most of it.
    """
    share, time = 0.5, 1.0
    plain, creeping = run(standing(time=4.0)), run(standing(effect("creep", amount=share, time=time), time=4.0))
    rest = 0.5 * 9.81 / 84 / 1000.0
    depth = creeping.sensors["pad"].depth.mean(axis=1)
    expected = rest / (1 - share) * (1 - share * np.exp(-(1 - share) * creeping.times / time))
    late = creeping.times > 0.5
    np.testing.assert_allclose(depth[late], expected[late], atol=1e-2 * rest)
    assert plain.sensors["pad"].depth.mean(axis=1)[-1] == pytest.approx(rest, rel=1e-6)
    sunk = plain.poses[-1, 1, 2] - creeping.poses[-1, 1, 2]
    assert sunk == pytest.approx(expected[-1] - rest, rel=2e-2)
    force = creeping.sensors["pad"].normal_force.sum(axis=1)[late]
    np.testing.assert_allclose(force, 0.5 * 9.81, rtol=3e-3)  # the pad carries the cube all the while


STACKS = {
    f"{kind.name}-{form.name}": ((effect(kind.name, form.name),), {"k": 1000.0, "cn": 2.0})
    for kind in library().values()
    for form in kind.forms
    if kind.site_of(form) != "readout" and form.law is not None
}
POWER_LAW = {"k": 3e4, "normal_law": "hunt-crossley", "exponent": 1.5, "dissipation": 2.0}
STACKS["Hunt and Crossley"] = (effect("stiffening"), effect("creep")), POWER_LAW


@pytest.mark.parametrize(("items", "law"), STACKS.values(), ids=STACKS)
def test_the_solver_feels_what_the_law_says_over_time(items, law):
    """A keyframed press: the run's forces are those of the whole signal, sampled at every substep."""
    frames, fps, steps = 13, 24.0, 20
    turn = np.linspace(0, 2 * np.pi, frames)
    path = np.stack([np.zeros(frames), np.zeros(frames), 0.01 - 0.0012 * np.maximum(np.sin(turn) + 0.4, -0.1)], axis=1)
    scenario = pressed(box(0.05, 0.06, 0.02), path, dt=1 / (fps * steps), **law)
    felt = run(with_effects(scenario, *items)).sensors["pad"].normal_force
    time = np.arange((frames - 1) * steps + 1) / (fps * steps)
    depth = np.maximum(np.interp(time, np.arange(frames) / fps, 0.01 - path[:, 2]), 0.0)[:, None]
    # The run begins without history: an indenter in contact at its first frame counts from its first step on.
    whole = normal_forces(items, scenario.sensors[0].parameters, time, depth)[::steps, 0]
    scale = np.abs(whole).max()
    np.testing.assert_allclose(felt.min(axis=1)[1:], whole[1:], atol=5e-3 * scale)
    np.testing.assert_allclose(felt.max(axis=1)[1:], whole[1:], atol=5e-3 * scale)


def test_several_contact_points_and_painted_stiffness_share_an_effect():
    """Four points a texel under a flat probe are one texel; a texel painted twice as stiff has twice the force."""
    item = effect("creep", amount=0.5, time=0.2)
    one = run(press(item)).sensors["pad"].normal_force
    four = press(item)
    sensor = four.sensors[0]
    spread = replace(sensor, parameters=replace(sensor.parameters, points_per_texel=4))
    np.testing.assert_allclose(run(replace(four, sensors=(spread,))).sensors["pad"].normal_force, one, rtol=1e-9, atol=1e-12)
    stiff = replace(sensor, painted=Painted(k=np.linspace(1.0, 2.0, 84)))
    painted = run(replace(four, sensors=(stiff,))).sensors["pad"].normal_force
    np.testing.assert_allclose(painted, one * np.linspace(1.0, 2.0, 84), rtol=1e-9, atol=1e-12)


def slid(*effects, speed=0.02):
    """A box that slides over the pad under a constant depth for half a second."""
    frames, fps = 25, 48.0
    path = np.stack([np.zeros(frames), -0.004 + speed * np.arange(frames) / fps, np.full(frames, 0.0095)], axis=1)
    values = {"k": 1000.0, "cn": 0.0, "sigma0": 1e5, "sigma1": 0.0, "ct": 0.0}
    scenario = pressed(box(0.06, 0.12, 0.02), path, fps=fps, dt=1e-3, **values)
    return run(with_effects(scenario, *effects)).sensors["pad"].shear[-1, :, 1]


def test_friction_effects_slow_what_slides():
    """In steady sliding: Eq. 10–12 times the factor, plus the viscous part, 0.5 N on each texel."""
    p, v = SensorParameters(), 0.02
    mu = contact_laws.steady_friction(p, 1.0, v)
    np.testing.assert_allclose(slid(), 0.5 * mu, rtol=1e-3)
    stribeck = effect("stribeck", "exponential", rise=0.8, speed=0.02)
    np.testing.assert_allclose(slid(stribeck), 0.5 * mu * (1 + 0.8 * np.exp(-1)), rtol=1e-3)
    np.testing.assert_allclose(slid(effect("viscous-friction", "load", viscosity=2.0)), 0.5 * mu + 2.0 * 0.5 * v, rtol=1e-3)
