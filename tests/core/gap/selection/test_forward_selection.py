# SPDX-License-Identifier: GPL-3.0-or-later
"""What earns a place and what is a sure name: gaps of readings and of forces, steps that are seen, and what a formula lacks."""

import numpy as np
import pytest

from palpate.core.effects.engine.registry import effect, form_of, kind_of
from palpate.core.gap.dataset.rig import Rig, grid_texels
from palpate.core.gap.fitting.least_squares import LEVEL, base_numbers, changed
from palpate.core.gap.forward.predictor import Model
from palpate.core.gap.selection.candidates import Candidate
from palpate.core.gap.selection.confidence import is_doubtful, least_share, may_be_bent
from palpate.core.gap.selection.diagnosis import free_friction
from palpate.core.gap.selection.direct_estimates import few_levels, growing
from palpate.core.gap.selection.forward_selection import FORCES, READINGS, Account, Gain, Ground, Step, friction_kinds
from palpate.core.gap.selection.screening import Views
from palpate.core.model.sensor_parameters import SensorParameters

WITH_FORCES, READ_ALONE = (Ground(np.full(2, 9.0), np.ones(2), np.array([900.0, count])) for count in (300.0, 0.0))


def test_readings_and_forces_have_a_gap_each():
    ground = Ground(np.array([11.0, 101.0]), np.array([1.0, 1.0]), np.array([8400.0, 300.0]))
    assert friction_kinds() == ["stribeck", "viscous-friction"]
    assert ground.side("stribeck") == FORCES and ground.side("creep") == READINGS
    after = np.array([2.0, 51.0])
    assert ground.closed(after, READINGS) == pytest.approx(0.9) and ground.closed(after, FORCES) == pytest.approx(0.5)
    gain = ground.gain(np.array([6.0, 0.0]), after, READINGS)
    assert (gain.of_all, gain.of_left) == pytest.approx((0.4, 0.8))
    alone = Ground(np.array([0.0, 101.0]), np.array([1.0, 1.0]), np.array([0.0, 300.0]))
    assert alone.side("creep") == alone.side("stribeck") == FORCES  # nothing was read
    trembling = Ground(np.array([1.0, 14.3]), np.array([1.0, 13.0]), ground.count)
    assert ground.matters(FORCES) and not trembling.matters(FORCES)  # coloured noise is not known to a tenth


def test_a_handful_of_values_is_seen():
    rng = np.random.default_rng(1)
    smooth = rng.uniform(0, 1, 4000)
    np.testing.assert_allclose(few_levels(0.25 * np.round(smooth / 0.25)), [0, 0.25, 0.5, 0.75, 1])
    uneven = np.floor(4 * np.sqrt(smooth)) ** 2
    assert list(few_levels(uneven)) == [0, 1, 4, 9]
    assert few_levels(smooth) is None
    assert few_levels(np.round(smooth, 2)) is None  # a hundred values: no step is seen by eye
    assert few_levels(np.ones(4000)) is None


def test_steps_that_grow_are_read_off():
    scale, growth = 0.02, 0.3
    levels = 7.0 + scale * np.expm1(growth * np.arange(-1, 12))
    (found,) = growing(levels, 7.0, Candidate(kind_of("quantization"), form_of("quantization", "companding")))
    assert found.values["growth"] == pytest.approx(growth, rel=0.02) and found.values["scale"] == pytest.approx(scale, rel=0.05)
    assert not growing(levels[:3], 7.0, Candidate(kind_of("quantization"), form_of("quantization", "companding")))


def test_a_stated_fall_of_friction_is_held_and_its_level_free():
    parameters = SensorParameters(k=50.0, mus=0.6, mud=0.45, x0=0.02, ct=0.01)
    texels = grid_texels(1, 2, 3e-3, 3e-3)

    def stating(*names):
        return Rig("two", texels, parameters, frozenset(names), None, (1, 2, (3e-3, 3e-3)), None, ())

    assert free_friction(stating("k", "mus", "mud", "x0", "ct")) == [LEVEL, "sigma0"]
    assert set(free_friction(stating("k", "mus", "mud", "ct"))) == {"mus", "mud", "sigma0", "x0"}
    assert "ct" in free_friction(stating("mus", "mud", "x0"))
    level = base_numbers(parameters, [LEVEL], 1.0)
    moved = changed(Model(parameters), level, [0.9]).parameters
    assert (moved.mus, moved.mud) == pytest.approx((0.9, 0.675))


def test_what_dead_texels_still_answer_is_no_further_effect():
    dead = effect("dead-texels", "listed", dead=(0.0, 1.0, 0.0, 0.0))
    for offset, doubt in (((0.0, 0.3, 0.01, 0.0), True), ((0.1, 0.3, -0.3, 0.2), False)):
        other = effect("offset", "listed", offset=offset)
        account = Account(None, None, {}, {"offset": Gain(0.3, 0.9)})
        assert is_doubtful(other, account, [dead, other], WITH_FORCES) == doubt


def test_of_two_that_pass_loads_on_one_may_be_what_the_other_lacks():
    both = [effect("crosstalk", "neighbours"), effect("load-spreading", "gaussian")]
    account = Account(None, None, {}, {"crosstalk": Gain(0.7, 0.7), "load-spreading": Gain(0.2, 0.7)})
    assert [is_doubtful(one, account, both, WITH_FORCES) for one in both] == [False, True]


def test_without_net_forces_a_law_of_contact_and_a_readout_bend_one_curve():
    both = [effect("stiffening", "foam"), effect("saturation", "rational")]
    account = Account(None, None, {}, {"stiffening": Gain(0.7, 0.7), "saturation": Gain(0.2, 0.7)})
    assert not any(is_doubtful(one, account, both, WITH_FORCES) for one in both)
    assert [is_doubtful(one, account, both, READ_ALONE) for one in both] == [False, True]


def doubtful(second, gain, again=np.inf, first=None, **values):
    first = first or effect("offset", "listed", offset=(0.1, 0.2, 0.4, 0.3))
    other = effect(*second, **values)

    class Alone(Step):
        def of(self, name):
            return 1.0

    account = Account(None, None, {other.name: Alone([], [], again=again)}, {other.name: gain})
    return is_doubtful(other, account, [first, other], WITH_FORCES)


def test_a_small_effect_is_sure_where_it_closes_nearly_all_that_is_left():
    creep = ("creep", "exponential")
    assert not doubtful(creep, Gain(0.2, 0.3)) and not doubtful(creep, Gain(0.05, 0.9))
    assert doubtful(creep, Gain(0.05, 0.5))
    assert doubtful(creep, Gain(0.2, 0.9), again=1.6)  # more of what is there already would do as well


def test_an_offset_that_fades_is_no_gain():
    gains = ("gain-mismatch", "listed")
    assert doubtful(gains, Gain(0.05, 0.9), factor=(0.95, 0.9, 0.8, 0.86))
    assert not doubtful(gains, Gain(0.05, 0.9), factor=(0.95, 1.1, 0.9, 1.0))


def test_what_a_kernel_lacks_at_the_rim_is_no_gain():
    gains, several = ("gain-mismatch", "listed"), (0.95, 1.1, 0.9, 1.0)
    for first in (effect("load-spreading"), effect("crosstalk")):
        assert doubtful(gains, Gain(0.02, 0.95), first=first, factor=several)
        assert not doubtful(gains, Gain(0.2, 0.95), first=first, factor=several)
    assert not doubtful(gains, Gain(0.02, 0.95), first=effect("lag"), factor=several)


def test_a_rival_closes_nearly_as_much():
    """Of a gap of which most is left whatever is taken, what two leave is much alike and what they close is not."""

    class Two(Step):
        def of(self, name):
            return {"gain-mismatch": 8.0}[name]

    step = Two([], [], before=12.0)
    assert step.worse(10.4, "gain-mismatch") == pytest.approx(4.0 / 1.6)
    assert step.worse(16.0, "gain-mismatch") == pytest.approx(4.0 / 1e-12)  # closes nothing
    assert Two([], [], before=1000.0).worse(10.4, "gain-mismatch") == pytest.approx(1.3)


@pytest.mark.parametrize(
    "beside", [("load-spreading", "gaussian"), ("crosstalk", "neighbours"), ("misalignment", "shift"), None]
)
def test_friction_is_looked_for_where_forces_are(beside):
    """What texels feel of each other is looked at without net forces, in which alone friction shows."""
    views = Views(["whole"], ["narrow"], ["rubbed"], ["thin"])
    model = Model(SensorParameters(), (effect(*beside),) if beside else ())
    for name in friction_kinds():
        kind = kind_of(name)
        assert views.quick(Candidate(kind, kind.forms[0]), model) == (["whole"] if beside else ["rubbed"])
    creep = kind_of("creep")
    assert views.quick(Candidate(creep, creep.forms[0]), model) == (["thin"] if beside else ["narrow"])


def test_what_makes_a_sure_name():
    """Steps are seen, however little of the gap they are; friction has but one other kind, and a lead over that says little."""
    far, near = {"creep": 3.0}, {"creep": 1.2}
    assert least_share("quantization", near) == 0.0
    friction = least_share("stribeck", {"viscous-friction": 3.0})
    assert least_share("hysteresis", far) < least_share("hysteresis", near) == friction == 0.5


def test_numbers_per_texel_bend_to_what_is_not_explained():
    gains = {"hysteresis": Gain(0.6, 0.6), "gain-mismatch": Gain(0.3, 0.7)}
    account = Account(None, None, {}, gains)
    mismatch = effect("gain-mismatch", "listed", factor=(0.9, 1.1))
    assert may_be_bent(mismatch, account) and not may_be_bent(effect("hysteresis", "preisach"), account)
    assert not may_be_bent(mismatch, Account(None, None, {}, {**gains, "hysteresis": Gain(0.2, 0.2)}))
