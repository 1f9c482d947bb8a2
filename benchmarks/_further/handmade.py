# SPDX-License-Identifier: GPL-3.0-or-later
"""A physical model of each further set, as somebody would write it who knows what was measured and nothing of Palpate.

A model is a list of terms of the stimulus, nonlinear in a few numbers. The numbers are fitted by least squares; the terms'
weights follow from a linear fit, in the fitted recordings alone. What the rig leaves free (a factor of each recording) is free
here, too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from palpate.benchmarks._recordings import Columns, Recording

Terms = Callable[[np.ndarray, Columns, int], list[np.ndarray]]
"""Terms (T,) of one channel from the nonlinear numbers, the columns of a recording, and the number of the channel."""


@dataclass(frozen=True)
class HandmadeModel:
    """Terms, and start and bounds of their nonlinear numbers.

    Attributes
    ----------
    terms : Terms
    start, low, high : tuple of float
    describes : str
        What it consists of.
    """

    terms: Terms
    start: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    describes: str


def low_pass(time: np.ndarray, x: np.ndarray, tau: float) -> np.ndarray:
    """Return x after a low pass of first order, exact where x is constant between samples."""
    out = np.array(x, float)
    keep = np.exp(-np.diff(time) / tau)
    for t in range(1, len(out)):
        out[t] = x[t] + (out[t - 1] - x[t]) * keep[t - 1]
    return out


def _polymer(p, c, channel):
    """Ogden's strip with two Maxwell branches whose stress relaxes; a slack strip does not push."""
    stretch = 1.0 + c["depth"] / 0.08
    stress = stretch ** (p[0] - 1.0) - stretch ** (-0.5 * p[0] - 1.0)
    fast, slow = (stress - low_pass(c["time"], stress, tau) for tau in p[1:3])
    return [np.maximum(stress + p[3] * fast + p[4] * slow, 0.0)]


def _strip(p, c, channel):
    """The same in terms of the neo-Hookean measure of strain."""
    fast, slow = (c["depth"] - low_pass(c["time"], c["depth"], tau) for tau in p[:2])
    return [np.maximum(c["depth"] + p[2] * fast + p[3] * slow, 0.0)]


def _velostat(p, c, channel):
    """A power of the force that goes on rising under load, and the conductance at rest."""
    power = (c["force"] / 5.0) ** p[0]
    return [np.ones_like(power), power, low_pass(c["time"], power, p[1])]


def _barometers(p, c, channel):
    """Pressure under a probe: a power of the depth over a bell around the sensor, and air and silicone that settle."""
    depth = np.maximum(0.004 + p[0] * 1e-3 - c["z"], 0.0) * 1e3
    apart = (c["x"] * 1e3 - p[1] - (-9.75 + 6.5 * channel)) / p[2]
    pressed = depth ** p[3] * np.exp(-0.5 * apart**2)
    return [np.ones_like(pressed), pressed, low_pass(c["time"], pressed, p[4])]


def _barometer(p, c, channel):
    """A power of the depth beyond an onset, and a part of it that settles."""
    power = (np.maximum(c["depth"] - p[0] * 1e-3, 0.0) * 1e3) ** p[1]
    return [np.ones_like(power), power, low_pass(c["time"], power, p[2])]


def _joint(p, c, channel):
    """Coulomb, Stribeck and viscous friction, with a bias."""
    rate = np.gradient(c["slide_x"], c["time"])
    way = np.tanh(rate / p[0])
    return [way, way * np.exp(-((rate / p[1]) ** 2)), rate, np.ones_like(rate)]


def _microfluidic(p, c, channel):
    """A channel that closes: a power of the force beyond an onset, part of which follows late."""
    power = np.maximum(c["force"] / 3.0 - p[0], 0.0) ** p[1]
    return [np.ones_like(power), power, low_pass(c["time"], power, p[2])]


def _hydrogel(p, c, channel):
    """Each electrode's own gain, a part that follows late, and a drift."""
    return [c["force"], low_pass(c["time"], c["force"], p[0]), c["time"]]


HANDMADE: dict[str, HandmadeModel] = {
    "polymer": HandmadeModel(
        _polymer,
        (1.3, 3.0, 60.0, 1.0, 1.0),
        (0.1, 0.1, 5.0, 0.0, 0.0),
        (6.0, 30.0, 1000.0, 20.0, 20.0),
        "Ogden, two Maxwell branches (6 numbers)",
    ),
    "polymer-strip": HandmadeModel(
        _strip,
        (3.0, 60.0, 1.0, 1.0),
        (0.1, 5.0, 0.0, 0.0),
        (30.0, 1000.0, 20.0, 20.0),
        "neo-Hooke, two Maxwell branches (5 numbers)",
    ),
    "velostat": HandmadeModel(_velostat, (0.7, 5.0), (0.1, 0.1), (4.0, 200.0), "power law, late part (5 numbers)"),
    "barometer": HandmadeModel(
        _barometer, (1.0, 2.0, 3.0), (-0.5, 0.5, 0.1), (2.5, 5.0, 60.0), "onset, power law, late part (6 numbers)"
    ),
    "barometers": HandmadeModel(
        _barometers,
        (0.0, 0.0, 2.0, 1.5, 5.0),
        (-1.0, -4.0, 0.5, 0.5, 0.1),
        (2.0, 4.0, 10.0, 4.0, 100.0),
        "power law in a bell, late part, gain of each sensor (17 numbers)",
    ),
    "joint": HandmadeModel(_joint, (0.005, 0.05), (1e-4, 1e-3), (0.05, 1.0), "Coulomb, Stribeck, viscous, bias (6 numbers)"),
    "microfluidic": HandmadeModel(
        _microfluidic, (1.5, 1.3, 0.3), (0.0, 0.3, 0.03), (4.0, 4.0, 10.0), "onset, power law, late part (12 numbers)"
    ),
    "hydrogel": HandmadeModel(_hydrogel, (10.0,), (0.5,), (500.0,), "gain, late part and drift of each electrode (49 numbers)"),
}
"""By the name of the set."""


def responses(columns: Columns) -> np.ndarray:
    """(T, n): readings, or the net force along x where there are none."""
    names = [name for name in columns if name.startswith("texel_")] or ["force_x"]
    return np.stack([columns[name] for name in names], axis=1)


def predict_by_hand(model: HandmadeModel, recording: Recording) -> list[np.ndarray]:
    """Fit a model to the recordings of use "fit", and return what it predicts of all recordings, each (T, n)."""
    from scipy.optimize import least_squares

    fitted = [columns for _, use, columns in recording.trials if use == "fit"]
    measured = [responses(columns) for columns in fitted]
    scale = max(float(np.nanmax(m) - np.nanmin(m)) for m in measured)

    count = len(model.start)

    def tables(numbers: np.ndarray, of: list[Columns], channel: int) -> list[np.ndarray]:
        return [np.stack(model.terms(numbers[:count], columns, channel), axis=1) for columns in of]

    def weights(numbers: np.ndarray, channel: int) -> np.ndarray:
        factors = (1.0, *np.exp(numbers[count:])) if free_factors(recording) else (1.0,) * len(fitted)
        table = np.concatenate([factor * t for factor, t in zip(factors, tables(numbers, fitted, channel), strict=True)])
        values = np.concatenate([m[:, channel] for m in measured])
        good = np.isfinite(values)
        return np.linalg.lstsq(table[good], values[good], rcond=None)[0]

    def predicted(numbers: np.ndarray, of: list[Columns]) -> list[np.ndarray]:
        channels = range(measured[0].shape[1])
        by_channel = [[table @ weights(numbers, channel) for table in tables(numbers, of, channel)] for channel in channels]
        return [
            with_own_factor(np.stack(p, axis=1), c, recording) for p, c in zip(zip(*by_channel, strict=True), of, strict=True)
        ]

    def residual(numbers: np.ndarray) -> np.ndarray:
        whole = np.concatenate([((m - p) / scale).ravel() for m, p in zip(measured, predicted(numbers, fitted), strict=True)])
        return whole[np.isfinite(whole)]

    extra = len(fitted) - 1 if free_factors(recording) else 0
    start, low, high = (np.append(v, [e] * extra) for v, e in ((model.start, 0.0), (model.low, -3.0), (model.high, 3.0)))
    numbers = start
    if len(start):
        numbers = least_squares(residual, start, bounds=(low, high), x_scale=np.maximum(np.abs(start), 0.1)).x
    return predicted(numbers, [columns for _, _, columns in recording.trials])


def free_factors(recording: Recording) -> bool:
    """Return whether the rig leaves a factor of each recording free."""
    return "factor" in recording.words


def with_own_factor(predicted: np.ndarray, columns: Columns, recording: Recording) -> np.ndarray:
    """Return a prediction (T, n) times the factor that fits its recording best, where the rig leaves one free."""
    if not free_factors(recording):
        return predicted
    measured = responses(columns)
    good = np.isfinite(measured)
    return predicted * (measured[good] @ predicted[good]) / (predicted[good] @ predicted[good])
