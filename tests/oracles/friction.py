# SPDX-License-Identifier: GPL-3.0-or-later
"""Friction through the whole solver: the LuGre equations solved by scipy; discs that turn and slide."""

from __future__ import annotations

import numpy as np
from scipy.integrate import dblquad, solve_ivp
from solver_scenes import GRAVITY, about, box, pad, pressed

from oracles.contact_laws import bristle_rate, friction_force, steady_friction
from oracles.foundation import punch
from palpate.core.model.body import Body, Motion
from palpate.core.model.scenario import Scenario, Target
from palpate.core.model.sensor import Sensor
from palpate.core.model.sensor_parameters import SensorParameters
from palpate.core.solver.simulation import run

LUGRE = SensorParameters(k=100.0, cn=0.0, sigma0=400.0, sigma1=0.5, ct=0.05, x0=0.02)
"""A texel whose bristles bend by a tenth of a millimetre before it slides."""


# ---- driven with a given motion ----
def steady_state(speed: float) -> float:
    """Relative error of a plate's shear at a steady speed against the formula, after sixty bristle lengths."""
    depth, way = 1e-3, 60 * LUGRE.mus * LUGRE.k * 1e-3 / LUGRE.sigma0
    path = [[0, 0, 0.01 - depth], [way, 0, 0.01 - depth]]
    fps = speed / way
    values = {key: getattr(LUGRE, key) for key in ("k", "cn", "ct", "sigma0", "sigma1", "x0", "mus", "mud")}
    sensor = run(pressed(box(0.2, 0.2, 0.02), path, texels=pad(4, 4), fps=fps, dt=0.01 / fps, **values)).sensors["pad"]
    expected = steady_friction(LUGRE, LUGRE.k * depth, speed) + LUGRE.ct * speed
    return float(np.abs(sensor.shear[-1] / expected - [1.0, 0.0]).max())


def dragged(displacement, velocity, duration: float, steps: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Move a plate along x(t) and compare one texel's shear with scipy's LSODA on the smooth motion.

    Returns
    -------
    times, shear, expected : (steps,) float
        Without the first frame, in which a keyframed body counts as at rest.
    """
    depth, times = 1e-3, np.linspace(0, duration, steps + 1)
    path = np.column_stack([displacement(times), np.zeros(steps + 1), np.full(steps + 1, 0.01 - depth)])
    values = {key: getattr(LUGRE, key) for key in ("k", "cn", "ct", "sigma0", "sigma1", "x0", "mus", "mud")}
    fps = steps / duration
    sensor = run(pressed(box(0.2, 0.2, 0.02), path, texels=pad(2, 2), fps=fps, dt=1 / fps, **values)).sensors["pad"]
    load = LUGRE.k * depth
    exact = solve_ivp(
        lambda t, z: [bristle_rate(LUGRE, load, z[0], velocity(t))],
        (0, duration), [0.0], method="LSODA", t_eval=times, rtol=1e-11, atol=1e-16, max_step=duration / 200,
    )  # fmt: skip
    expected = friction_force(LUGRE, load, exact.y[0], velocity(times))
    return times[1:], sensor.shear[1:, 0, 0], expected[1:]


def hysteresis(steps: int, amplitude: float = 4e-5, cycles: int = 3):
    """To and fro within what the bristles bend, so that nothing slides: the loop of force against displacement."""
    turn = 2 * np.pi
    return dragged(lambda t: amplitude * np.sin(turn * t), lambda t: amplitude * turn * np.cos(turn * t), float(cycles), steps)


def lag(steps: int, mean: float = 0.02, swing: float = 0.018, frequency: float = 40.0):
    """Sliding one way at a speed that swings: friction is higher while it speeds up than while it slows down."""
    turn = 2 * np.pi * frequency
    return dragged(
        lambda t: mean * t - swing / turn * np.sin(turn * t),
        lambda t: mean - swing * np.cos(turn * t),
        3.0 / frequency,
        steps,
    )


# ---- a mass that is pulled ----
def pulled(speed: float, duration: float, dt: float, frames: int = 400, spring: float = 200.0, mass: float = 0.2):
    """A block on a pad with friction, pushed along by a frictionless second pad whose texels are the spring.

    Returns
    -------
    times, position, friction : (frames + 1,) float
        Of the block; newtons along its way, all texels together.
    expected_position, expected_friction : (frames + 1,) float
        The stiff ODE of the block by scipy's LSODA.
    spring : (frames + 1,) float
        Force of the spring that scipy found; where it is never negative the pad can play its part.
    """
    p = SensorParameters(k=1000.0, cn=10.0, sigma0=2e3, sigma1=2.0, ct=0.05, x0=0.005, mus=0.435, mud=0.23)
    floor, side = pad(3, 3, 0.01), pad(2, 2, 0.01)
    load = mass * GRAVITY / len(floor)
    upright = about((0, 1, 0), 90.0)  # the pad's normal, z, becomes x
    mesh = box(0.2, 0.06, 0.04)  # long enough to cover the floor's texels wherever it gets to
    fps = frames / duration
    face = -0.1
    scenario = Scenario(
        bodies=(
            Body("floor", Motion.at_rest()),
            # So heavy to turn that it only slides.
            Body("block", Motion.at_rest((0, 0, 0.02 - load / p.k)), True, mass, np.zeros(3), np.eye(3) * 1e6),
            Body(
                "pusher",
                Motion(
                    np.array([0.0, duration]), np.array([[face, 0, 0.02], [face + speed * duration, 0, 0.02]]),
                    np.tile(upright, (2, 1)),
                ),
            ),
        ),
        sensors=(
            Sensor("floor", 0, floor, p),
            Sensor("pusher", 2, side, SensorParameters(k=spring / 4, cn=0.0, mus=0.0, mud=0.0, ct=0.0, sigma1=0.0)),
        ),
        targets=(Target("block", 1, mesh),),
        frame_end=frames + 1,
        fps=fps,
        gravity=np.array([0, 0, -GRAVITY]),
        dt=dt,
    )  # fmt: skip
    recording = run(scenario)

    def derivative(t, y):
        x, v, z = y
        push = max(spring * (speed * t - x), 0.0)
        return [v, (push - len(floor) * friction_force(p, load, z, v)) / mass, bristle_rate(p, load, z, v)]

    exact = solve_ivp(
        derivative, (0, duration), [0.0, 0.0, 0.0], method="LSODA", t_eval=recording.times, rtol=1e-10, atol=1e-14,
        max_step=0.01,
    )  # fmt: skip
    x, v, z = exact.y
    return (
        recording.times,
        recording.poses[:, 1, 0],
        recording.sensors["floor"].shear[:, :, 0].sum(axis=1),
        x,
        len(floor) * friction_force(p, load, z, v),
        spring * (speed * recording.times - x),
    )


def break_away(rate: float, dt: float, spring: float = 200.0) -> tuple[float, float]:
    """Largest friction before a block slips whose load grows at `rate` (N/s): of the solver, of scipy."""
    speed = rate / spring
    _, _, friction, _, expected, _ = pulled(speed, 1.2 / rate, dt, spring=spring)
    return float(friction.max()), float(expected.max())


# ---- a disc that turns and slides ----
COULOMB = SensorParameters(k=1e3, cn=0.0, sigma0=1e5, sigma1=0.0, ct=0.0, mus=0.3, mud=0.3)
DISC, DEPTH = 0.008, 1e-3


def disc_load(n: int) -> float:
    """µF of the disc, newtons, by its area: what it resists when it slides without turning."""
    return COULOMB.mus * COULOMB.k * DEPTH * np.pi * DISC**2 / (2.4 * DISC / n) ** 2


def disc_resistance(speed: float, spin: float, n: int = 64) -> tuple[np.ndarray, np.ndarray]:
    """Friction force along the way and torque about its axis of a flat disc that slides and turns.

    Parameters
    ----------
    speed : float, m/s
        Along x.
    spin : float, rad/s
    n : int
        Texels along the side of a pad that the disc nearly fills.

    Returns
    -------
    measured : (2,) float
        Force (N) and torque (N·m) on the pad.
    summed : (2,) float
        The same from Coulomb's law at each texel that the disc covers.
    """
    steps, pitch = 40, 2.4 * DISC / n
    span = 2e-4 / max(abs(speed), abs(spin) * DISC)  # so slow a motion against its size that the disc stays where it is
    times = np.linspace(0, span, steps + 1)
    path = np.column_stack([speed * (times - span), 0 * times, np.full(steps + 1, 0.005 - DEPTH)])
    turns = np.array([about((0, 0, 1), np.degrees(spin * t)) for t in times])
    texels = pad(n, n, pitch)
    values = {key: getattr(COULOMB, key) for key in ("k", "cn", "ct", "sigma0", "sigma1", "x0", "mus", "mud")}
    fps = steps / span
    scenario = pressed(punch(DISC, 0.01), path, texels=texels, turns=turns, fps=fps, dt=1 / fps, times=times, **values)
    sensor = run(scenario).sensors["pad"]
    measured = np.array([sensor.net_force[-1, 0], sensor.net_torque[-1, 2]])
    x, y = texels.position[:, 0], texels.position[:, 1]
    vx, vy = speed - spin * y, spin * x
    size = np.hypot(vx, vy)
    pressing = COULOMB.mus * sensor.normal_force[-1] / np.where(size > 0, size, 1.0)
    return measured, np.array([(pressing * vx).sum(), (pressing * (x * vy - y * vx)).sum()])


def limit_curve(speed: float, spin: float) -> tuple[float, float]:
    """The same for a disc of uniform pressure, integrated; shares of µF and of µFR."""
    slide = speed / (abs(spin) * DISC) if spin else np.inf
    if np.isinf(slide):
        return 1.0, 0.0

    def unit(part):
        def integrand(r, angle):
            vx, vy = slide - r * np.sin(angle), r * np.cos(angle)
            size = np.hypot(vx, vy)
            return 0.0 if size == 0.0 else part(r, angle, vx, vy) / size * r / np.pi

        return dblquad(integrand, -np.pi / 2, 3 * np.pi / 2, 0.0, 1.0, epsabs=1e-7)[0]

    force = unit(lambda r, angle, vx, vy: vx)
    torque = unit(lambda r, angle, vx, vy: r * np.cos(angle) * vy - r * np.sin(angle) * vx)
    return force, torque
