# SPDX-License-Identifier: GPL-3.0-or-later
"""What every form of every effect has to keep; a new file in the library is tested by this one as it is."""

import numpy as np
import pytest

from palpate.core.effects.engine import specification
from palpate.core.effects.engine.contact_forces import friction_factors, normal_forces
from palpate.core.effects.engine.readout_chain import ReadoutChain, readings
from palpate.core.effects.engine.registry import (
    actual_placement,
    check,
    complete_values,
    effect,
    form_of,
    from_dict,
    kind_of,
    library,
    to_dict,
)
from palpate.core.effects.engine.specification import TexelInput, TransducerArray
from palpate.core.errors import EffectError
from palpate.core.model.sensor import Effect
from palpate.core.model.sensor_parameters import SensorParameters

FORMS = [(kind.name, form.name) for kind in library().values() for form in kind.forms]
OTHERS = [pytest.mark.long("the other forms of a kind")]
every_form = pytest.mark.parametrize(
    ("name", "form"),
    [
        pytest.param(kind.name, form.name, id=f"{kind.name}-{form.name}", marks=OTHERS if form is not kind.forms[0] else ())
        for kind in library().values()
        for form in kind.forms
    ],
)
"""The quick tier has the first form of each kind, the long tier the others."""

ROWS, COLUMNS, PITCH = 4, 3, 0.0034
PARAMETERS = SensorParameters(k=1000.0, cn=10.0)


def transducers(gain=1.0, zero=0.0) -> TransducerArray:
    row, column = (grid.ravel() for grid in np.mgrid[0:ROWS, 0:COLUMNS])
    position = np.stack([column * PITCH, row * PITCH, np.zeros(ROWS * COLUMNS)], axis=1)
    return TransducerArray(position, np.full(len(position), PITCH**2), row, column, gain, zero)


def presses(samples=400, dt=0.02, seed=1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time stamps that are not quite even, depths (m) that come and go and differ from texel to texel, and slides (m)."""
    random = np.random.default_rng(seed)
    time = np.cumsum(dt * random.choice([0.5, 1.0, 1.5], samples)) - dt
    heights = random.uniform(0.3, 1.0, ROWS * COLUMNS)
    wave = np.sin(time) + 0.4 * np.sin(3.1 * time + 1.0) + 0.1 * (time > 4.0)
    depth = np.maximum(0.002 * wave[:, None] * heights, 0.0)
    return time, depth, 1e-4 * random.random(depth.shape) * (depth > 0)


def corners(form, gain=1.0):
    """The defaults, and every combination of least and largest values."""
    yield form.defaults(gain)
    scaled = [parameter.scaled(gain) for parameter in form.parameters]
    for choice in range(2 ** len(scaled)):
        yield {p.name: (p.high if choice >> i & 1 else p.low) for i, p in enumerate(scaled)}


@every_form
def test_a_form_says_what_it_is(name, form):
    kind, found = kind_of(name), form_of(name, form)
    assert kind.site_of(found) in specification.SITES_OF_ACTION
    assert kind.text.endswith(".") and found.formula and found.reference
    assert kind.experiment and not kind.experiment.endswith(".")
    assert {*found.fitted_up_to, *found.over_within} <= {parameter.name for parameter in found.parameters}
    assert set(kind.drawing.values) <= {one.name for one in kind.forms}
    mechanisms = [found.law, found.memoryless, found.coupling, found.friction_law, found.placement]
    assert getattr(found, found.mechanism) is not None
    given = sum(mechanism is not None for mechanism in mechanisms)
    assert given == 1 or (given == 0 and found.delay is not None)
    assert found.delay is None or found.law is not None or given == 0
    assert (found.constants is not None) == (found.law is not None or found.friction_law is not None)
    assert set(found.neutral) <= {parameter.name for parameter in found.parameters}
    for parameter in found.parameters:
        assert parameter.low <= parameter.default <= parameter.high
        assert parameter.text.endswith(".") and parameter.unit
        assert not parameter.log or parameter.low > 0


@every_form
def test_nothing_is_left_of_it_when_it_is_off(name, form):
    off = Effect(name, form, {**form_of(name, form).defaults(), **form_of(name, form).neutral}, seed=3)
    time, depth, slide = presses()
    base_force = normal_forces((), PARAMETERS, time, depth)
    np.testing.assert_allclose(normal_forces((off,), PARAMETERS, time, depth, slide), base_force, rtol=1e-9, atol=1e-12)
    there = transducers(gain=-2.0, zero=5.0)
    np.testing.assert_allclose(readings((off,), there, time, base_force), 5.0 - 2.0 * base_force, rtol=1e-9, atol=1e-9)
    factor, viscous = friction_factors((off,), np.array([0.0, 0.1, 1.0]), 1.0)
    np.testing.assert_allclose(factor, 1.0, rtol=1e-12)
    np.testing.assert_allclose(viscous, 0.0, atol=1e-12)
    normal, tangent = np.tile([0.0, 0.0, 1.0], (len(there), 1)), np.tile([1.0, 0.0, 0.0], (len(there), 1))
    for found, given in zip(actual_placement((off,), there.position, normal, tangent), (there.position, normal, tangent)):
        np.testing.assert_allclose(found, given, atol=1e-15)


@every_form
def test_numbers_stay_finite_at_the_bounds(name, form):
    time, depth, slide = presses()
    depth[100:110] *= 10.0
    for values in corners(form_of(name, form)):
        item = Effect(name, form, values)
        check((item,), "pad")
        force = normal_forces((item,), PARAMETERS, time, depth, slide)
        assert np.isfinite(force).all()
        assert np.isfinite(readings((item,), transducers(), time, force)).all()
        assert np.isfinite(friction_factors((item,), np.array([0.0, 1e-9, 1.0, 1e3]), 1.0)).all()


@every_form
def test_a_reading_that_comes_in_pieces_is_that_of_the_whole_signal(name, form):
    """Both from the start, and after any pause; lengths of step are told apart to a billionth."""
    item = effect(name, form, seed=7)
    time, depth, _ = presses()
    reader = ReadoutChain((item,), transducers())
    pieces = np.split(np.arange(len(time)), [1, 2, 17, 200])
    stream = np.concatenate([reader.read(time[piece], 1000.0 * depth[piece]) for piece in pieces])
    np.testing.assert_allclose(stream, readings((item,), transducers(), time, 1000.0 * depth), rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize(("name", "form"), [names for names in FORMS if form_of(*names).law is not None])
def test_a_law_may_be_asked_before_a_step_and_its_slope_is_the_derivative(name, form):
    """A contact is solved by trials: they change no memory, and the step then gives the force of the last trial."""
    found = form_of(name, form)
    constants = found.constants(complete_values(effect(name, form)), np.array([0.01]))[0]
    state = np.zeros(max(found.state_size, 1))

    def felt(depth, commit=False):
        return found.law(TexelInput(1000.0 * depth, 1000.0, depth, 0.0), constants, state, commit)

    for depth in (0.0, 5e-4, 1.5e-3, 1.2e-3):
        felt(depth, commit=True)
    for depth in (1e-3, 1.9e-3):  # on the way back and on the way in
        before = state.copy()
        (below, _), (force, slope), (above, _) = (felt(depth + change) for change in (-1e-9, 0.0, 1e-9))
        np.testing.assert_allclose(slope, (above - below) / 2e-9, rtol=1e-4, atol=1e-4)
        assert np.array_equal(state, before) and felt(depth)[0] == force
    assert felt(1.9e-3, commit=True)[0] == force


@every_form
def test_the_same_moment_asked_twice_reads_the_same(name, form):
    item = effect(name, form, seed=2)
    time, depth, _ = presses(50)
    reader = ReadoutChain((item,), transducers())
    reader.read(time, 1000.0 * depth)
    once = reader.step(time[-1] + 0.5, 1000.0 * depth[30])
    np.testing.assert_array_equal(reader.step(time[-1] + 0.5, 1000.0 * depth[30]), once)


@every_form
def test_a_toml_table_brings_it_back(name, form):
    item = effect(name, form, seed=5, gain=300.0)
    back = from_dict(to_dict(item), gain=300.0)
    assert back.values == item.values
    assert (back.name, back.form) == (name, form)
    assert back.seed == (5 if form_of(name, form).random else 0)


@every_form
def test_seeds(name, form):
    found, (time, depth, _) = form_of(name, form), presses(60)
    one, same, other = (readings((effect(name, form, seed=seed),), transducers(), time, 1000.0 * depth) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert found.random != np.array_equal(one, other)


@every_form
def test_a_value_outside_the_bounds_is_refused(name, form):
    for parameter in form_of(name, form).parameters:
        for value in (parameter.low - 1.0, 2.0 * abs(parameter.high) + 1.0, np.nan):
            with pytest.raises(EffectError, match=f"{parameter.name} of effect '{name}'"):
                effect(name, form, **{parameter.name: value})
