# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenarios: what is refused, what the digest notices, and the step-size adviser."""

from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.linalg import eigvals
from solver_scenes import cube_on_pad, pressed

from palpate.core.effects.engine.registry import check_scenario
from palpate.core.errors import EffectError, PalpateError, ParameterError
from palpate.core.geometry.rotations import quaternions_from_vectors, rotation_vectors
from palpate.core.model.sensor import Effect
from palpate.core.model.sensor_parameters import SensorParameters
from palpate.core.solver.simulation import run
from palpate.core.solver.time_step_adviser import LONGEST, advise, plan, stability_limit

NUMBERS = [item.name for item in fields(SensorParameters) if item.type == "float"]


ABOVE_ZERO = [(key, value) for key in ("k", "sigma0", "x0", "max_penetration") for value in (0.0, -1.0, np.nan, np.inf)]
NOT_BELOW = [(key, value) for key in ("cn", "ct", "sigma1", "mus", "mud") for value in (-1.0, np.nan)]


@pytest.mark.parametrize(("key", "value"), [*ABOVE_ZERO, *NOT_BELOW, ("mud", 0.5), ("gain", 0.0)])
def test_numbers_that_a_sensor_cannot_have(key, value):
    what = " is .*: give it a value above zero" if (key, value) in ABOVE_ZERO else ""
    with pytest.raises(ParameterError, match=f"^{key} of sensor 'tip'{what}"):
        replace(SensorParameters(), **{key: value}).check("tip")


def test_digest_is_stable_and_notices_every_number():
    scenario = cube_on_pad()
    digest = scenario.digest()
    assert digest == cube_on_pad().digest()
    for key in NUMBERS:
        other = replace(scenario.sensors[0].parameters, **{key: getattr(scenario.sensors[0].parameters, key) * 1.25 + 0.5})
        assert replace(scenario, sensors=(replace(scenario.sensors[0], parameters=other),)).digest() != digest, key
    mesh = scenario.targets[0].mesh
    nudged = mesh.vertices.copy()
    nudged[0, 0] = np.nextafter(nudged[0, 0], 1)
    moved = replace(scenario.targets[0], mesh=replace(mesh, vertices=nudged))
    assert replace(scenario, targets=(moved,)).digest() != digest
    assert replace(scenario, fps=25.0).digest() != digest
    assert replace(scenario, frame_end=49).digest() != digest
    assert replace(scenario, dt=None).digest() != digest


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_found_before_anything_is_solved(value):
    scenario = cube_on_pad()
    bad = np.array([0.0, value, 0.0])
    with pytest.raises(PalpateError, match="gravity of 'scene'"):
        replace(scenario, gravity=bad).check()
    for key, words in {
        "velocity": "The velocity of",
        "angular_velocity": "The angular velocity of",
        "center_of_mass": "centre of mass",
        "inertia": "inertia",
    }.items():
        for i, body in enumerate(scenario.bodies):
            broken = replace(body, **{key: np.full((3, 3), value) if key == "inertia" else bad})
            bodies = (*scenario.bodies[:i], broken, *scenario.bodies[i + 1 :])
            with pytest.raises(PalpateError, match=f"{words}.*'{body.name}'"):
                replace(scenario, bodies=bodies).check()
    target = scenario.targets[0]
    vertices = target.mesh.vertices.copy()
    vertices[3, 1] = value
    with pytest.raises(PalpateError, match=f"vertex of '{target.name}'"):
        replace(scenario, targets=(replace(target, mesh=replace(target.mesh, vertices=vertices)),)).check()


def test_the_effects_of_each_sensor_are_checked():
    scenario = cube_on_pad()
    (good,) = scenario.sensors
    for effect in (Effect("creep", "exponential", {"amount": 7.0, "time": 1.0}), Effect("creap", "", {})):
        bad = replace(good, name="bad", effects=(effect,))
        for sensors in ((bad, good), (good, bad), (good, replace(bad, readout=False), good)):
            with pytest.raises(EffectError, match="creap|sensor 'bad'"):
                check_scenario(replace(scenario, sensors=sensors))


@pytest.mark.parametrize(("k", "c", "m"), [(84000.0, 840.0, 1.0), (58.5, 0.0583, 1e-3), (1e6, 1e4, 1e-3), (1.0, 0.0, 100.0)])
def test_stability_limit_is_where_the_eigenvalue_leaves_the_unit_circle(k, c, m):
    def radius(dt):  # symplectic Euler: v' = v + dt (-k x - c v) / m, x' = x + dt v'
        step = np.array([[1 - dt * dt * k / m, dt - dt * dt * c / m], [-dt * k / m, 1 - dt * c / m]])
        return np.abs(eigvals(step)).max()

    limit = stability_limit(k, c, m)
    assert radius(0.999 * limit) <= 1 + 1e-9
    assert radius(1.001 * limit) > 1


def test_advice_names_the_body_and_its_reason():
    advice = advise(cube_on_pad(1.0))
    assert advice.dt == pytest.approx(0.2 * stability_limit(84e3, 840.0, 1.0))
    assert "'cube'" in advice.reason
    assert "stability limit" in advice.reason
    moved = advise(pressed(cube_on_pad().targets[0].mesh, [[0, 0, 1]]))
    assert moved.dt == LONGEST
    assert np.isinf(moved.limit)


@pytest.mark.parametrize("size", [0.0, 1e-14, 1e-8, 1e-3, 1.0, 3.1])
def test_rotation_vectors_go_both_ways(size):
    vectors = np.random.default_rng(8).normal(size=(20, 3))
    vectors *= size / np.linalg.norm(vectors, axis=1, keepdims=True)
    quaternions = quaternions_from_vectors(vectors)
    np.testing.assert_allclose(rotation_vectors(quaternions), vectors, atol=1e-14, rtol=1e-12)
    np.testing.assert_allclose(rotation_vectors(-quaternions), vectors, atol=1e-14, rtol=1e-12)


def test_the_step_of_a_run_is_explained():
    """What is advised, what is taken (a whole number of steps makes a frame), and what was set against advice."""
    scenario = cube_on_pad(1.0, dt=None)
    advised, chosen = advise(scenario), plan(scenario)
    assert chosen.dt <= advised.dt and chosen.dt * chosen.substeps == pytest.approx(1 / 24, rel=1e-12)
    assert f"{chosen.substeps} per frame" in chosen.reason and advised.reason in chosen.reason and "as set" not in chosen.reason
    assert advised.reason.endswith(f"ms: 20% of the explicit stability limit of 'cube' ({advised.limit * 1e3:.3g} ms).")
    long = plan(replace(scenario, dt=0.01))
    assert "as set" in long.reason and advised.reason in long.reason and "less accurate" in long.reason
    assert "less accurate" not in plan(replace(scenario, dt=1e-5)).reason
    assert run(replace(scenario, frame_end=2)).step_reason == chosen.reason


@pytest.mark.parametrize(("mass", "dt", "which"), [(1e6, 1e-3, "longest"), (1e-9, 1e-6, "shortest")])
def test_advice_at_its_bounds_names_no_share_of_the_limit(mass, dt, which):
    advised = advise(cube_on_pad(mass, dt=None))
    assert advised.dt == dt and "%" not in advised.reason
    assert (
        f": the {which} recommended step; the explicit stability limit of 'cube' is {advised.limit * 1e3:.3g} ms."
        in advised.reason
    )


def test_steps_far_above_the_limit_are_warned_of_once_at_the_start():
    scenario = cube_on_pad(mass=0.01, k=1e5, frames=4, dt=None)
    limit = advise(scenario).limit
    assert plan(scenario).warning == "" == plan(replace(scenario, dt=9.0 * limit, fps=1 / (9.0 * limit))).warning
    long = replace(scenario, dt=20.0 * limit, fps=1 / (20.0 * limit))
    (warning,) = (one for one in run(long).warnings if "stability" in one)
    assert warning.startswith("Frame 1: steps of ") and "are 20 times the explicit stability limit" in warning
    assert "of the contact of 'cube' with 'pad'," in warning and f"{advise(scenario).dt * 1e3:.3g} ms or less" in warning
