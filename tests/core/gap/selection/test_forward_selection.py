# SPDX-License-Identifier: GPL-3.0-or-later
"""What earns a place and what is a sure name: gaps of readings and of forces, steps that are seen, and what a formula lacks."""

from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest

from palpate.core.effects.engine.registry import effect, form_of, kind_of
from palpate.core.gap.fitting.least_squares import FRICTION_LEVEL, free_base_parameters, with_values
from palpate.core.gap.forward.predictor import Model, Predictor
from palpate.core.gap.selection.base_model import friction_parameters_to_search
from palpate.core.gap.selection.candidates import Candidate, FittedCandidate
from palpate.core.gap.selection.confidence import EXPLAINED, REPEATED_RATIO, least_share, misfit_of_another
from palpate.core.gap.selection.direct_estimates import companding_starts, few_levels
from palpate.core.gap.selection.forward_selection import SelectionState, SelectionStep, is_accepted
from palpate.core.gap.selection.gap_sizes import FORCES, READINGS, GapSizes, Improvement, friction_kinds
from palpate.core.gap.selection.view_set import view_set_of
from palpate.core.model.sensor_parameters import SensorParameters

WITH_FORCES, READ_ALONE = (GapSizes(np.full(2, 9.0), np.ones(2), np.array([900.0, count])) for count in (300.0, 0.0))


def test_readings_and_forces_have_a_gap_each():
    gap_sizes = GapSizes(np.array([11.0, 101.0]), np.array([1.0, 1.0]), np.array([8400.0, 300.0]))
    assert friction_kinds() == ["stribeck", "viscous-friction"]
    assert gap_sizes.quantity_for("stribeck") == FORCES and gap_sizes.quantity_for("creep") == READINGS
    after = np.array([2.0, 51.0])
    assert gap_sizes.closed_share(after, READINGS) == pytest.approx(0.9)
    assert gap_sizes.closed_share(after, FORCES) == pytest.approx(0.5)
    gain = gap_sizes.improvement(np.array([6.0, 0.0]), after, READINGS)
    assert (gain.of_gap, gain.of_remaining) == pytest.approx((0.4, 0.8))
    alone = GapSizes(np.array([0.0, 101.0]), np.array([1.0, 1.0]), np.array([0.0, 300.0]))
    assert alone.quantity_for("creep") == alone.quantity_for("stribeck") == FORCES  # nothing was read
    trembling = GapSizes(np.array([1.0, 14.3]), np.array([1.0, 13.0]), gap_sizes.count)
    assert gap_sizes.has_gap(FORCES) and not trembling.has_gap(FORCES)  # coloured noise is not known to a tenth


def accepts(kind, closed, remaining=8.0, is_first=False, worse=0.0, forces=0.0):
    """Whether a candidate joins that closes this share of what the model leaves, in two trials of 50 readings each.

    The noise is 1 and the base model leaves 8 above it. `worse` is the second trial's loss as a share of the first one's gain.
    """

    class Counted:
        count = np.array([[50.0, 5.0], [50.0, 5.0]])

    gap_sizes = GapSizes(np.array([9.0, 9.0]), np.ones(2), Counted.count.sum(axis=0))
    before = np.array([[1.0 + remaining, 9.0]] * 2) * Counted.count
    gained = 100.0 * closed * remaining
    after = before - [[gained / (1.0 - worse), 80.0 * forces], [-worse * gained / (1.0 - worse), 0.0]]
    one = FittedCandidate(Candidate(kind_of(kind), kind_of(kind).forms[0]), Counted, after)
    return is_accepted(one, SelectionState(Counted, before), gap_sizes, is_first)


def test_an_effect_joins_that_closes_a_quarter_of_the_gap_or_a_fifth_of_what_is_left():
    """A limit that is changed by a third fails here: what joins decides what is named."""
    assert accepts("creep", 0.28, is_first=True) and not accepts("creep", 0.22, is_first=True)
    assert accepts("creep", 0.22) and not accepts("creep", 0.18)
    assert accepts("creep", 0.5, remaining=0.2) and not accepts("creep", 0.5, remaining=0.12)  # and a hundredth of the whole
    assert accepts("quantization", 0.02), "steps that are seen join, however small a part of the gap they are"
    assert accepts("stribeck", 0.0, forces=0.28) and not accepts("stribeck", 0.9, forces=0.22), "friction is judged by forces"


def test_an_effect_joins_that_does_worse_in_hardly_any_trial():
    assert accepts("creep", 0.5, worse=0.15) and not accepts("creep", 0.5, worse=0.35)


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
    found, other = companding_starts(levels, 7.0, Candidate(kind_of("quantization"), form_of("quantization", "companding")))
    assert (found.values["rounding"], other.values["rounding"]) == (0.0, 0.5)
    assert found.values["growth"] == pytest.approx(growth, rel=0.02) and found.values["scale"] == pytest.approx(scale, rel=0.05)
    assert not companding_starts(levels[:3], 7.0, Candidate(kind_of("quantization"), form_of("quantization", "companding")))


def test_a_stated_fall_of_friction_is_held_and_its_level_free():
    parameters = SensorParameters(k=50.0, mus=0.6, mud=0.45, x0=0.02, ct=0.01)

    def stating(*names):
        return cases.grid_rig(1, 2, 3e-3, parameters, given=names)

    assert friction_parameters_to_search(stating("k", "mus", "mud", "x0", "ct")) == [FRICTION_LEVEL, "sigma0"]
    assert set(friction_parameters_to_search(stating("k", "mus", "mud", "ct"))) == {"mus", "mud", "sigma0", "x0"}
    assert "ct" in friction_parameters_to_search(stating("mus", "mud", "x0"))
    level = free_base_parameters(parameters, [FRICTION_LEVEL], 1.0)
    moved = with_values(Model(parameters), level, [0.9]).parameters
    assert (moved.mus, moved.mud) == pytest.approx((0.9, 0.675))


def test_of_two_that_pass_loads_on_one_may_be_what_the_other_lacks():
    both = [effect("crosstalk", "neighbours"), effect("load-spreading", "gaussian")]
    state = SelectionState(None, None, {}, {"crosstalk": Improvement(0.7, 0.7), "load-spreading": Improvement(0.2, 0.7)})
    assert [bool(misfit_of_another(one, state, both, WITH_FORCES)) for one in both] == [False, True]


def test_without_net_forces_a_law_of_contact_and_a_readout_bend_one_curve():
    both = [effect("stiffening", "foam"), effect("saturation", "rational")]
    state = SelectionState(None, None, {}, {"stiffening": Improvement(0.7, 0.7), "saturation": Improvement(0.2, 0.7)})
    assert not any(misfit_of_another(one, state, both, WITH_FORCES) for one in both)
    assert [bool(misfit_of_another(one, state, both, READ_ALONE)) for one in both] == [False, True]


def step(left, **values):
    """A step in which one form of each kind was judged, with what each leaves of the gap."""
    kinds = [kind_of(name) for name in left]
    judged = [FittedCandidate(Candidate(kind, kind.forms[0]), None, None) for kind in kinds]
    return SelectionStep(judged, list(left.values()), **values)


def doubtful(second, improvement, repeated=np.inf, first=None, **values):
    """Whether a second effect is doubtful that leaves 1, beside a first one of which a repetition leaves `repeated`."""
    first = first or effect("offset", "listed", offset=(0.1, 0.2, 0.4, 0.3))
    other = effect(*second, **values)
    found = step({other.name: 1.0}, remaining_repeated=repeated)
    state = SelectionState(None, None, {other.name: found}, {other.name: improvement})
    return bool(misfit_of_another(other, state, [first, other], WITH_FORCES))


def test_a_small_effect_is_sure_where_it_closes_nearly_all_that_is_left():
    creep = ("creep", "exponential")
    assert not doubtful(creep, Improvement(0.2, 0.3)) and not doubtful(creep, Improvement(0.05, 0.9))
    assert doubtful(creep, Improvement(0.05, 0.5))
    assert doubtful(creep, Improvement(0.2, 0.9), repeated=0.95 * REPEATED_RATIO)


def test_a_rival_closes_nearly_as_much():
    """Of a gap of which most is left whatever is taken, what two leave is much alike and what they close is not."""

    much, most = (step({"gain-mismatch": 8.0}, remaining_before=before) for before in (12.0, 1000.0))
    assert much.times_worse(10.4, "gain-mismatch") == pytest.approx(4.0 / 1.6)
    assert much.times_worse(16.0, "gain-mismatch") > 1e9  # closes nothing
    assert most.times_worse(10.4, "gain-mismatch") == pytest.approx(1.3)


@pytest.mark.parametrize(
    "beside", [("load-spreading", "gaussian"), ("crosstalk", "neighbours"), ("misalignment", "shift"), None]
)
def test_friction_is_looked_for_where_forces_are(beside):
    """What texels feel of each other is looked at without net forces, in which alone friction shows."""
    rig = cases.rig(trials=2, seconds=4.0)
    trials = [replace(trial, force=np.zeros((len(trial.time), 3))) for trial in rig.trials]
    views = view_set_of([Predictor(trial, rig) for trial in trials], (1.0, 1.0))
    model = Model(SensorParameters(), (effect(*beside),) if beside else ())
    for name in friction_kinds():
        kind = kind_of(name)
        seen = views.quick(Candidate(kind, kind.forms[0]), model)
        assert seen is (views.whole if beside else views.few_texels_with_forces)
        assert all(view.with_forces for view in seen)
    creep = kind_of("creep")
    seen = views.quick(Candidate(creep, creep.forms[0]), model)
    assert seen is (views.few_samples if beside else views.few_texels)
    assert not any(view.with_forces for view in seen)


def test_what_makes_a_sure_name():
    """Steps are seen, however little of the gap they are."""
    assert least_share("quantization") == 0.0 and least_share("hysteresis") == least_share("stribeck") == EXPLAINED
