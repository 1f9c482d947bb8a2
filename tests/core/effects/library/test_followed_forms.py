# SPDX-License-Identifier: GPL-3.0-or-later
"""A form that states that it follows others leaves no more of them than its own error, at the bounds that it states."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from palpate.core.effects.engine.contact_forces import normal_forces
from palpate.core.effects.engine.readout_chain import readings
from palpate.core.effects.engine.registry import actual_placement, effect, library
from palpate.core.effects.engine.specification import TransducerArray
from palpate.core.model.sensor_parameters import SensorParameters

SIDE, PITCH = 8, 0.003
TIME = np.linspace(0.0, 40.0, 161)
ROW, COLUMN = (grid.ravel() for grid in np.mgrid[0:SIDE, 0:SIDE])
POSITION = np.stack([COLUMN * PITCH, ROW * PITCH, np.zeros(SIDE**2)], axis=1)
GRID = TransducerArray(POSITION, np.full(SIDE**2, PITCH**2), ROW, COLUMN)
NORMAL, TANGENT = np.tile([0.0, 0.0, 1.0], (SIDE**2, 1)), np.tile([1.0, 0.0, 0.0], (SIDE**2, 1))
SPRING = SensorParameters(k=1000.0, cn=0.0)
LARGE = {"width": 0.004, "thickness": 0.004, "threshold": 0.2, "level": 2.0}
"""Numbers with which an effect is large in these presses, where its defaults are not."""
STATED = [(kind, form, other) for kind in library().values() for form in kind.forms for other in form.follows]
IS_EXACT = [form.placement is not None or any(p.per_texel for p in form.parameters) for _, form, _ in STATED]


def stated(is_exact):
    """Kinds with a form and another that it follows: exactly, or to its error."""
    chosen = [one for one, exact in zip(STATED, IS_EXACT, strict=True) if exact == is_exact]
    return pytest.mark.parametrize(("kind", "form", "other"), chosen, ids=[f"{one[0].name}-{one[2]}" for one in chosen])


def presses():
    """Depths of a ball that is pressed at two places to three levels, slowly and fast, (t, n) m."""
    times, levels = [0, 3, 6, 9, 13, 16, 20, 22, 28, 34, 40], [0, 1, 1, 2, 2, 0, 0, 3, 3, 0, 0]
    place = np.where(TIME < 18.0, 0.006, 0.010)[:, None]
    apart = (POSITION[None, :, 0] - place) ** 2 + (POSITION[None, :, 1] - place) ** 2
    return np.maximum(1e-3 * np.interp(TIME, times, levels)[:, None] - apart / 0.05, 0.0)


def response(*items, is_contact=False):
    """What the sensor reads, (t, n), or the forces on its texels."""
    if is_contact:
        return normal_forces(items, SPRING, TIME, presses())
    return readings(items, GRID, TIME, SPRING.k * presses())


def places(item):
    """Where the texels are, and their directions."""
    return actual_placement((item,), POSITION, NORMAL, TANGENT)


@stated(is_exact=False)
def test_a_form_leaves_its_error_of_a_form_that_it_follows(kind, form, other):
    on_force = {"is_contact": kind.site_of(form) != "readout"}
    large = {p.name: LARGE[p.name] for p in kind.forms_by_name[other].parameters if p.name in LARGE}
    target = response(effect(kind.name, other, **large), **on_force)
    plain, logs = response(**on_force), [p.low > 0.0 for p in form.parameters]

    def changed(x):
        values = {p.name: float(np.exp(v) if log else v) for p, v, log in zip(form.parameters, x, logs, strict=True)}
        return response(effect(kind.name, form.name, **values), **on_force)

    def on_scale(values):
        return np.array([np.log(v) if log else v for v, log in zip(values, logs, strict=True)])

    low, high = on_scale([p.low for p in form.parameters]), on_scale([p.high for p in form.parameters])
    shares = []
    for times in (1.0, 0.3, 3.0):
        first = np.clip(on_scale([p.default * times for p in form.parameters]), low + 1e-9, high - 1e-9)
        bounds = [*low, 0.5], [*high, 2.0]
        found = least_squares(lambda x: (x[-1] * changed(x[:-1]) - target).ravel(), [*first, 1.0], bounds=bounds)
        shares.append(2.0 * found.cost / ((found.x[-1] * (changed(found.x[:-1]) - plain)) ** 2).sum())
        if shares[-1] <= form.error:
            break
    assert min(shares) <= form.error
    ends = zip(form.parameters, found.x, low, high, strict=False)
    at_ends = {p.name: p.low if x - a < b - x else p.high for p, x, a, b in ends if min(x - a, b - x) < 1e-3 * (b - a)}
    assert form.follows[other].items() <= at_ends.items()


@stated(is_exact=True)
def test_a_form_with_all_numbers_contains_those_with_some(kind, form, other):
    own = kind.forms_by_name[other].parameters
    values = {p.name: 0.3 * p.high for p in own if not p.per_texel}
    values |= {p.name: tuple(np.linspace(0.5, 1.0, SIDE**2)) for p in own if p.per_texel}
    one = effect(kind.name, other, **values)
    if set(values) <= {p.name for p in form.parameters}:
        rest = {p.name: (form.neutral[p.name],) * SIDE**2 if p.per_texel else form.neutral[p.name] for p in form.parameters}
        same = effect(kind.name, form.name, **{**rest, **values})
    else:
        (free,) = form.parameters
        largest = response().max(axis=0)
        factor = response(one).max(axis=0) / np.where(largest > 0.0, largest, 1.0)
        number = (response(one) - response())[-1] if free.unit == "unit" else factor
        same = effect(kind.name, form.name, **{free.name: tuple(number)})
    for a, b in zip(*(response(item) if form.placement is None else places(item) for item in (one, same)), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-12)
