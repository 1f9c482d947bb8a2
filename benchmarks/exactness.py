# SPDX-License-Identifier: GPL-3.0-or-later
"""How exact the solver is: every figure that the tests hold it to, in full length, with its bar as `goal`.

What is measured lives in tests/oracles, where the tests use it too.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from oracles import balance, foundation, friction, loads, plain, rays, sweep
from solver_scenes import GRAVITY, about

SETS, SEGMENTS = 1000, 1_000_000


def figure(name: str, value: float, goal: float, unit: str = "1") -> dict:
    """One line of the table."""
    return {"name": f"exactness.{name}", "value": float(value), "unit": unit, "goal": goal}


def weights() -> Iterator[dict]:
    """Relative error of the texels' sum by mass and resolution, and texels that stay dark."""
    dark = 0
    for grid in loads.GRIDS:
        for mass in (0.1, 1.0, 4.0, 10.0):
            error, unlit = loads.weight_error(grid, mass)
            dark += unlit
            yield figure(f"load.{grid}.{mass:g}kg", error, 1e-6)
    yield figure("load.dark_texels", dark, 0, "texels")


def slope() -> Iterator[dict]:
    """Twenty minutes on a slope of 10°."""
    along, shear, _, _, creep = loads.tilted(1200.0)
    expected = GRAVITY * np.sin(np.radians(10.0))
    yield figure("tilt.shear", shear, expected, "N")
    yield figure("tilt.shear.error", abs(shear - expected), 1e-4, "N")
    yield figure("tilt.net_force.error", abs(along - expected), 1e-4, "N")
    yield figure("tilt.creep.10s_to_1200s", creep, 1e-10, "m")


def foundations() -> Iterator[dict]:
    """Errors at the finest pad, and orders of convergence in the size of a texel (goal: the order of the contact's edge)."""
    for name in foundation.PRESSINGS:
        errors, (force, area) = foundation.convergence(name), foundation.ORDERS[name]
        key = name.replace(" ", "_")
        yield figure(f"foundation.{key}.force.error", errors.normal[-1], 5e-3 if force == 1.5 else 2e-4)
        yield figure(f"foundation.{key}.force.order", errors.order(errors.normal), force)
        yield figure(f"foundation.{key}.area.error", errors.area[-1], 0.015)
        yield figure(f"foundation.{key}.area.order", errors.order(errors.area), area)


def discs() -> Iterator[dict]:
    """Torsion, and slide and twist at once."""
    whole = friction.disc_load(128) * friction.DISC
    yield figure("torsion.error", abs(friction.disc_resistance(0.0, 1.0, 128)[0][1] / whole * 1.5 - 1.0), 4e-3)
    size, worst = friction.disc_load(96) * np.array([1.0, friction.DISC]), 0.0
    for ratio in (0.0, 0.1, 0.3, 0.6, 1.0, 1.5, 3.0, 10.0):
        measured, _ = friction.disc_resistance(ratio * friction.DISC, 1.0, 96)
        worst = max(worst, np.abs(measured / size - friction.limit_curve(ratio * friction.DISC, 1.0)).max())
    yield figure("slide_and_twist.error", worst, 0.01)


def bristles() -> Iterator[dict]:
    """LuGre against its formula and against scipy."""
    yield figure("lugre.steady_state", max(friction.steady_state(v) for v in (1e-4, 1e-3, 1e-2, 2e-2, 0.1, 1.0, 10.0)), 1e-9)
    for name, drag, goal in (("presliding", friction.hysteresis, 1e-4), ("lag", friction.lag, 1e-3)):
        _, shear, expected = drag(2400)
        yield figure(f"lugre.{name}", np.abs(shear - expected).max() / np.abs(expected).max(), goal)
    for rate in (0.5, 2.0, 10.0, 50.0):
        ours, theirs = friction.break_away(rate, 1e-4 / rate)
        yield figure(f"lugre.break_away.{rate:g}N_per_s", abs(ours / theirs - 1.0), 1e-4)
    _, coarse, _, expected, _, _ = friction.pulled(0.01, 2.0, 1e-4)
    _, fine, _, _, _, _ = friction.pulled(0.01, 2.0, 5e-5)
    yield figure("lugre.stick_slip.order", np.log2(np.abs(coarse - expected).max() / np.abs(fine - expected).max()), 1.0)
    yield figure("lugre.stick_slip.extrapolated", np.abs(2 * fine - coarse - expected).max() / expected.max(), 1e-3)


def laws() -> Iterator[dict]:
    """Momenta, energy, invariance, segments, random sets."""
    linear, angular, growth = np.array([balance.collide(seed) for seed in range(12)]).max(axis=0)
    yield figure("momentum.linear", linear, 1e-12)
    yield figure("momentum.angular", angular, 1e-12)
    yield figure("energy.collision", growth, 1e-10)
    yield figure("energy.tumbling.20s", balance.tumbling_flight(1e-3, 20.0)[0], 1e-10)
    scene = balance.tumbling()
    turned = balance.turned_and_moved(scene, about((1, -2, 0.5), 73.0), np.array([0.3, -0.2, 0.7]))
    yield figure("invariance.turned", balance.differences(scene, turned), 1e-9)
    moved = balance.carried(scene, np.array([0.7, -0.3, 0.2]), np.zeros(3))
    yield figure("invariance.moving", balance.differences(scene, moved, 1), 1e-9)
    lifted = balance.carried(scene, np.array([0.7, -0.3, 0.2]), np.array([1.0, 2.0, -0.5]))
    yield figure("invariance.accelerating", balance.differences(scene, lifted, 1), 1e-9)
    yield figure("invariance.bristles_carried_round", balance.round_and_round(), 1e-9)
    solids = rays.solids()
    results = [rays.compare(name, mesh, -(-SEGMENTS // len(solids))) for name, mesh in solids.items()]
    yield figure("segments.wrong_in_a_million", sum(result["wrong"] for result in results), 0, "segments")
    yield figure("segments.leaks", sum(rays.leaks(mesh, 1.0, np.ones(3))[0] for mesh in solids.values()), 0, "segments")
    runs = [sweep.thrown(seed)[0] for seed in range(SETS)]
    yield figure("sweep.sets_with_nan", sum(not np.isfinite(run.total).all() for run in runs), 0, "of 1000 sets")
    for key in ("mechanical_growth", "growth", "overshoot"):
        values = np.array([getattr(run, key) for run in runs])
        yield figure(f"sweep.sets_with_{key}", (values > 1e-9).sum(), 0, "of 1000 sets")


def python() -> Iterator[dict]:
    """Plain Python against the compiled kernels."""
    worst, seconds = plain.differences()
    yield figure("plain_python.difference", max(worst.values()), 1e-12)
    yield figure("plain_python.step.84", seconds, 0.06, "s")


def run() -> Iterator[dict]:
    """All of the above; some minutes."""
    for part in (weights, slope, foundations, discs, bristles, laws, python):
        yield from part()
