# SPDX-License-Identifier: GPL-3.0-or-later
"""Multipliers per texel: painted alike they are another parameter, painted differently each texel keeps its own law."""

from dataclasses import replace

import numpy as np
import pytest
from oracles import contact_laws
from solver_scenes import box, cube_on_pad, pad, pressed

from palpate.core.errors import ParameterError
from palpate.core.model.sensor_parameters import Painted
from palpate.core.solver.simulation import run
from palpate.core.solver.time_step_adviser import advise

N = len(pad())
PLATE, DEPTH = box(0.4, 0.4, 0.05), 0.003


def press_and_slide(slide_frames, step=0.004):
    """Where a plate is that is pressed 3 mm deep and then slides along the pad, frame by frame."""
    down = [(0.0, 0.0, 0.025 - depth) for depth in (0.0, 0.002, DEPTH)]
    return down + [(0.0, step * i, 0.025 - DEPTH) for i in range(1, slide_frames + 1)]


def with_painted(scenario, **maps):
    return replace(scenario, sensors=(replace(scenario.sensors[0], painted=Painted(**maps)),))


def with_parameters(scenario, **values):
    sensor = scenario.sensors[0]
    return replace(scenario, sensors=(replace(sensor, parameters=replace(sensor.parameters, **values)),))


def felt(scenario):
    return run(scenario).sensors["pad"]


def test_painted_alike_is_another_parameter_to_the_last_bit():
    """Halving and doubling are exact in binary, so the recordings must be equal, not just close."""
    scenario = pressed(PLATE, press_and_slide(3), sigma0=100.0)
    p = scenario.sensors[0].parameters
    painted = felt(with_painted(scenario, k=np.full(N, 0.5), friction=np.full(N, 2.0), gain=np.full(N, 4.0)))
    set_so = felt(with_parameters(scenario, k=p.k / 2, cn=p.cn / 2, mus=p.mus * 2, mud=p.mud * 2, gain=4.0))
    for name in ("normal_force", "shear", "reading", "slip", "net_force", "net_torque"):
        assert np.array_equal(getattr(painted, name), getattr(set_so, name)), name
    assert np.abs(set_so.shear).max() > 0.01


def test_ones_change_nothing():
    scenario = cube_on_pad(tilt=5.0, frames=6)
    plain, painted = run(scenario), run(with_painted(scenario, k=np.ones(N), friction=np.ones(N), gain=np.ones(N)))
    assert np.array_equal(plain.sensors["pad"].shear, painted.sensors["pad"].shear)
    assert np.array_equal(plain.poses, painted.poses)


def test_every_texel_has_its_own_spring_and_its_own_friction():
    """A flat plate 3 mm deep: fn = m k d on each texel; slid until all slip, ft = mud g(v) of its own load plus ct v."""
    rng = np.random.default_rng(1)
    k, friction, gain = (rng.uniform(0.2, 3.0, N) for _ in range(3))
    scenario = pressed(PLATE, press_and_slide(14), sigma0=1e4, sigma1=0.0)
    recording = felt(with_painted(scenario, k=k, friction=friction, gain=gain))
    p = scenario.sensors[0].parameters
    speed = 0.004 * 24.0
    force = p.k * k * DEPTH
    assert recording.depth[-1] == pytest.approx(DEPTH, rel=1e-12)
    assert recording.normal_force[-1] == pytest.approx(force, rel=1e-9)
    g = contact_laws.steady_friction(p, force * friction, speed)
    assert np.hypot(*recording.shear[-1].T) == pytest.approx(g + p.ct * speed, rel=1e-6)
    assert recording.reading[-1] == pytest.approx(gain * force, rel=1e-9)


def test_a_free_cube_rests_tilted_on_a_pad_that_is_softer_on_one_side():
    """Two springs k and k/2 under the ends: equilibrium of force and moment is that of the plane through Σ k_i d_i."""
    texels = pad()
    soft = np.where(texels.position[:, 1] > 0, 0.5, 1.0)
    scenario = with_painted(cube_on_pad(frames=72, mus=1.5, mud=1.0, sigma0=1000.0, sigma1=10.0), k=soft)
    recording = run(scenario)
    felt = recording.sensors["pad"]
    assert felt.normal_force[-1].sum() == pytest.approx(9.81, rel=2e-3)  # the rest is friction, since the cube leans
    cop = felt.normal_force[-1] @ texels.position[:, 1] / felt.normal_force[-1].sum()
    assert abs(cop - recording.poses[-1, 1, 1]) < 1e-3
    high, low = felt.depth[-1][soft == 0.5].mean(), felt.depth[-1][soft == 1.0].mean()
    assert high > 1.2 * low


def test_the_advised_step_knows_the_paint():
    scenario = with_parameters(cube_on_pad(), sigma0=1.0, sigma1=0.0, ct=0.0)
    softer = with_painted(scenario, k=np.full(N, 0.25))
    assert advise(softer).limit == pytest.approx(advise(with_parameters(scenario, k=250.0, cn=2.5)).limit, rel=1e-12)


@pytest.mark.parametrize(
    ("maps", "text"),
    [
        ({"k": np.zeros(N)}, "painted k of sensor 'pad' is 0 at texel 0"),
        ({"gain": np.where(np.arange(N) == 3, np.nan, 1.0)}, "painted gain"),
        ({"friction": np.full(N, -1.0)}, "painted friction"),
        ({"k": np.ones(3)}, "3 values for 84 texels"),
    ],
)
def test_paint_that_means_nothing_is_refused(maps, text):
    with pytest.raises(ParameterError, match=text):
        with_painted(cube_on_pad(), **maps).check()


def test_no_friction_may_be_painted():
    """A plate that is pressed on such a pad slides over it without any friction; on a plain pad it does not."""
    scenario = with_parameters(pressed(PLATE, press_and_slide(3), sigma0=1e4), sigma1=0.0, ct=0.0)
    slippery, plain = felt(with_painted(scenario, friction=np.zeros(N))), felt(scenario)
    assert np.array_equal(slippery.normal_force, plain.normal_force)
    assert not slippery.shear.any() and not slippery.friction.any()
    assert plain.friction.max() > 0.01
