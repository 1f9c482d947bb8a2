# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators with memory of which the columns of variants are made. Each takes a signal (T, n) of T samples and n channels.

Signals are dimensionless: 1 is the largest force of the base model. States are zero before the first sample.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...compiled.kernels import kernel


@kernel
def run_stop(x, threshold, out):  # type: ignore[no-untyped-def]
    """Write the stop operator of `x` (T, n) into `out`: it follows `x` and slips at ±threshold (Prandtl)."""
    for i in range(x.shape[1]):
        state, before = 0.0, 0.0
        for t in range(x.shape[0]):
            state = min(max(state + x[t, i] - before, -threshold), threshold)
            before = x[t, i]
            if before <= 0.0:
                state = 0.0
            out[t, i] = state


@kernel
def run_relays(x, width, out):  # type: ignore[no-untyped-def]
    """Write relays that switch on `width` above where they switch off, added up (Preisach): between x - width and x, ≥ 0."""
    for i in range(x.shape[1]):
        state = 0.0
        for t in range(x.shape[0]):
            state = min(max(state, x[t, i] - width, 0.0), max(x[t, i], 0.0))
            out[t, i] = state


@kernel
def run_branch(x, length, out):  # type: ignore[no-untyped-def]
    """Write z with ``dz = (±1 - z) |dx| / length`` (Duhem): 1 on the rising branch, -1 on the falling one, 0 without load."""
    for i in range(x.shape[1]):
        z, before = 0.0, 0.0
        for t in range(x.shape[0]):
            change = x[t, i] - before
            aim = 1.0 if change >= 0.0 else -1.0
            z = aim + (z - aim) * np.exp(-abs(change) / length)
            before = x[t, i]
            if before <= 0.0:
                z = 0.0
            out[t, i] = z


@kernel
def run_falling(x, length, out):  # type: ignore[no-untyped-def]
    """Write u with ``du = (a - u) |dx| / length``, a = 1 while the load falls and 0 while it rises; 0 without load."""
    for i in range(x.shape[1]):
        u, before = 0.0, 0.0
        for t in range(x.shape[0]):
            change = x[t, i] - before
            aim = 1.0 if change < 0.0 else 0.0
            u = aim + (u - aim) * np.exp(-abs(change) / length)
            before = x[t, i]
            if before <= 0.0:
                u = 0.0
            out[t, i] = u


@kernel
def run_low_pass(x, keep, new, first, out):  # type: ignore[no-untyped-def]
    """Write the low pass of `x` for an input that is straight between samples; `first` is its state at the first sample.

    `keep` and `new` (T,) are the weights of the state before and of the present sample; the rest is that of the sample before.
    """
    for i in range(x.shape[1]):
        out[0, i] = first[i]
    for t in range(1, x.shape[0]):
        old = 1.0 - keep[t] - new[t]
        for i in range(x.shape[1]):
            out[t, i] = keep[t] * out[t - 1, i] + old * x[t - 1, i] + new[t] * x[t, i]


def _operator(run: Callable[[np.ndarray, float, np.ndarray], None]) -> Callable[[np.ndarray, float], np.ndarray]:
    """Return a kernel as a function of a signal (T, n) and its one number, which returns (T, n)."""

    def apply(x: np.ndarray, size: float) -> np.ndarray:
        out = np.empty_like(x)
        run(x, size, out)
        return out

    return apply


stop = _operator(run_stop)
"""The stop operator of a signal for a threshold."""
relays = _operator(run_relays)
"""The sum of relays that switch off a width below where they switch on."""
branch = _operator(run_branch)
"""On which branch a signal is: 1 rising, -1 falling, in between for a path of some length after a turn."""
falling = _operator(run_falling)
"""How long a signal has been falling: 0 to 1, within a path of some length."""


def low_pass(x: np.ndarray, time: np.ndarray, constant: float, at_rest: bool) -> np.ndarray:
    """Return the low pass of a signal, exact for straight lines between samples, (T, n).

    Parameters
    ----------
    x : (T, n) float
    time : (T,) float, s
    constant : float, s
    at_rest : bool
        Whether the state begins at zero (a load that begins) rather than at the first sample (a filter that runs on).
    """
    step = np.diff(time, prepend=time[0] - 1.0)
    keep = np.exp(-step / constant)
    new = 1.0 - (1.0 - keep) * constant / step
    out = np.empty_like(x)
    run_low_pass(x, keep, new, np.zeros(x.shape[1]) if at_rest else x[0].copy(), out)
    return out


def delayed(x: np.ndarray, time: np.ndarray, delay: float) -> np.ndarray:
    """Return a signal that comes `delay` seconds later; before, its first sample, (T, n)."""
    late = np.clip(time - delay, time[0], None)
    after = np.clip(np.searchsorted(time, late, side="right"), 1, len(time) - 1)
    share = ((late - time[after - 1]) / (time[after] - time[after - 1]))[:, None]
    out: np.ndarray = (1.0 - share) * x[after - 1] + share * x[after]
    return out


def load_put_on(load: np.ndarray) -> np.ndarray:
    """Return the load that was put on each texel so far, (T, n)."""
    total: np.ndarray = np.cumsum(np.maximum(np.diff(load, axis=0, prepend=0.0), 0.0), axis=0)
    return total
