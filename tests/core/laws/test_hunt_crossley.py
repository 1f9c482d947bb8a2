# SPDX-License-Identifier: GPL-3.0-or-later
"""The normal law of Hunt and Crossley against its own ODE, its energy integral and the implicit step's equation."""

from dataclasses import replace

import numpy as np
import pytest
from oracles import contact_laws
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from solver_scenes import GRAVITY, cube_on_pad, pad

from palpate.core.errors import ParameterError
from palpate.core.laws import normal_force
from palpate.core.laws.contact_law import contact_law
from palpate.core.model.sensor_parameters import SensorParameters
from palpate.core.solver.simulation import run
from palpate.core.solver.time_step_adviser import advise

LAW = {"normal_law": "hunt-crossley", "exponent": 1.5, "dissipation": 0.4, "k": 2e4, "mus": 0.0, "mud": 0.0}
TEXELS = 16


def bounce(speed, dt, seconds, **values):
    """A cube of 0.1 kg that flies level onto a pad of 4 × 4 texels without gravity; 1,000 frames a second."""
    values = {**LAW, **values}
    values["k"] *= 1e-3 ** (1.5 - values["exponent"])  # as stiff at 1 mm, whatever the exponent
    scenario = cube_on_pad(0.1, texels=pad(4, 4), gap=0.0, dt=dt, fps=1000.0, frames=round(seconds * 1000) + 1, **values)
    cube = replace(scenario.bodies[1], velocity=np.array([0.0, 0.0, -speed]))
    return replace(scenario, bodies=(scenario.bodies[0], cube), gravity=np.zeros(3))


def rate(_, y, p):
    depth, v = y
    return [v, -TEXELS * contact_laws.normal_force(p, depth, v) / 0.1]


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0])
def test_impact_follows_the_ode_of_scipy_to_the_first_order_of_the_step(exponent):
    """The error falls with the step, and is below 2e-3 of the largest depth at 5 µs."""
    errors = []
    for dt in (2e-5, 5e-6):
        scenario = bounce(0.3, dt, 0.03, exponent=exponent)
        recording = run(scenario)
        exact = solve_ivp(
            rate, (0, 0.03), [0.0, 0.3], args=(scenario.sensors[0].parameters,), t_eval=recording.times, rtol=1e-10, atol=1e-14
        )
        depth = 0.025 - recording.poses[:, 1, 2]
        inside = exact.y[0] > 0
        errors.append(np.abs(depth - exact.y[0])[inside].max() / exact.y[0].max())
    assert errors[1] < 2e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.15)


@pytest.mark.parametrize("speed", [0.05, 0.3, 1.0])
@pytest.mark.parametrize("exponent", [1.0, 1.5])
def test_coefficient_of_restitution(speed, exponent):
    """Exactly, m v dv/dx = -F integrates to G(v) = v/λ - ln(1 + λ v)/λ², equal before and after (λ = 3α/2); slowly e = 1 - α v.

    Tolerances: 2e-3 is the damping of the implicit step itself at 2 µs; 1 - α v leaves out terms of (α v)².
    """
    scenario = bounce(speed, 2e-6, 0.06, exponent=exponent)
    final = run(scenario).velocities[-1, 1, 2]
    lam = 1.5 * LAW["dissipation"]

    def integral(v):
        return v / lam - np.log1p(lam * v) / lam**2

    expected = -brentq(lambda v: integral(v) - integral(speed), -speed, -1e-9)
    assert final == pytest.approx(expected, rel=2e-3)
    assert final / speed == pytest.approx(1 - LAW["dissipation"] * speed, abs=(LAW["dissipation"] * speed) ** 2 + 2e-3)


@pytest.mark.parametrize("dt", [1e-5, 1e-4, 1e-3, 1e-2])
def test_a_step_solves_its_implicit_equation(dt):
    """m (v' - v) = -dt F(d + dt v', v') whatever the step, so that no step size makes it blow up."""
    scenario = bounce(0.3, dt, 0.0)
    scenario = replace(scenario, fps=1 / dt, frame_end=2)
    start = replace(scenario.bodies[1].motion, positions=np.array([[0, 0, 0.024]]))
    scenario = replace(scenario, bodies=(scenario.bodies[0], replace(scenario.bodies[1], motion=start)))
    v = -run(scenario).velocities[-1, 1, 2]
    law = scenario.sensors[0].parameters

    def residual(v):
        return v - 0.3 - dt * rate(0, (1e-3 + dt * v, v), law)[1]

    assert v == pytest.approx(brentq(residual, -10, 0.3, xtol=1e-15), rel=1e-9, abs=1e-10)


def test_the_tangent_touches_the_law():
    rng = np.random.default_rng(1)
    row = contact_law(SensorParameters(normal_law="hunt-crossley", exponent=1.7, dissipation=0.3, k=1e4))
    for depth, v, dt in zip(rng.uniform(0, 1e-2, 50), rng.normal(size=50), 10 ** rng.uniform(-6, -2, 50), strict=True):
        push, slope = normal_force.normal_tangent(depth, v, dt, row)
        assert slope >= 0.0
        assert push + slope * v == pytest.approx(normal_force.normal_force(depth + dt * v, v, row), rel=1e-12, abs=1e-15)
        h = 1e-6
        up, down = (normal_force.normal_force(depth + dt * x, x, row) for x in (v + h, v - h))
        assert slope == pytest.approx((up - down) / (2 * h), rel=1e-5, abs=1e-8)


def test_weight_at_rest_and_the_advised_step():
    scenario = cube_on_pad(1.0, **{**LAW, "k": 1e5, "dissipation": 5.0}, dt=2e-3, frames=48)
    sensor = run(scenario).sensors["pad"]
    assert sensor.normal_force[-1].sum() == pytest.approx(GRAVITY, rel=1e-9)
    np.testing.assert_allclose(sensor.depth[-1], (GRAVITY / 84 / 1e5) ** (2 / 3), rtol=1e-9)
    assert advise(scenario).dt < 1e-4


@pytest.mark.parametrize(
    ("values", "word"),
    [({"normal_law": "hertz"}, "'hertz'"), ({"exponent": 0.5}, "exponent"), ({"dissipation": -1.0}, "dissipation")],
)
def test_values_that_mean_nothing_are_refused(values, word):
    with pytest.raises(ParameterError, match=word):
        SensorParameters(**values).check("pad")
