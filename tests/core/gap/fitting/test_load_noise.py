# SPDX-License-Identifier: GPL-3.0-or-later
"""Loads that weights put on in steps have no noise, and measured loads have theirs: two families of simulated loads.

`LEAST_NOISY_SHARE` was set on the first family and is judged on the second one, which has other shapes, rates and noise.
"""

import numpy as np
import pytest

from palpate.core.gap.fitting.noise_floor import LEAST_NOISY_SHARE, PRESSED_SHARE, _load_noise

LOADS = 60


def weights(rng):
    """Weights that are put down within one to four samples."""
    rate, parts = rng.uniform(10.0, 200.0), []
    for _ in range(rng.integers(3, 25)):
        weight, count, up = rng.uniform(0.1, 2.0), int(rng.uniform(0.5, 6.0) * rate) + 4, rng.integers(1, 5)
        rise = np.arange(up) / up if rng.random() < 0.5 else np.sort(rng.random(up))
        parts += [np.zeros(count), weight * rise, np.full(count, weight)]
    return np.concatenate(parts)


def staircases(rng):
    """Weights piled up and taken off again, that swing for some samples after each step."""
    rate, height, parts = rng.uniform(20.0, 400.0), 0.0, []
    for sign in rng.permutation([1.0] * rng.integers(4, 12) + [-1.0] * 4):
        height = max(height + sign * rng.uniform(0.1, 0.6), 0.0)
        count, swings = int(rng.uniform(0.8, 5.0) * rate) + 20, rng.integers(0, 5)
        step = np.full(count, height)
        step[:swings] += 0.2 * height * rng.normal(size=swings)
        parts.append(np.maximum(step, 0.0))
    return np.concatenate(parts)


def pressed(rng):
    """Ramps and holds of a force sensor with white noise and steps of up to four deviations; and the noise."""
    rate, parts = rng.uniform(20.0, 500.0), []
    for _ in range(rng.integers(2, 10)):
        height, up, count = rng.uniform(0.2, 2.0), int(rng.uniform(0.2, 2.0) * rate), int(rng.uniform(0.3, 4.0) * rate)
        ramp = np.linspace(0.0, height, up)
        parts += [np.zeros(count // 2 + 2), ramp, np.full(count, height), ramp[::-1]]
    return measured(rng, np.concatenate(parts), rng.normal)


def waves(rng):
    """Loads that swing slowly, of a sensor with noise of heavy tails."""
    rate = rng.uniform(30.0, 300.0)
    time = np.arange(int(rng.uniform(8.0, 30.0) * rate)) / rate
    load = np.maximum(rng.uniform(0.5, 3.0) * np.sin(2 * np.pi * rng.uniform(0.05, 0.3) * time) + rng.uniform(-0.2, 1.0), 0.0)
    return measured(rng, load, lambda size: rng.laplace(0.0, np.sqrt(0.5), size))


def measured(rng, load, noise):
    deviation = 10 ** rng.uniform(-2.8, -1.6) * load.max()
    values, step = load + deviation * noise(size=len(load)), rng.choice([0.0, 1.0, 2.0, 3.0, 4.0]) * deviation
    return (np.round(values / step) * step if step else values), np.hypot(deviation, step / np.sqrt(12.0))


def noisy_share(load):
    second = np.diff(load, 2)
    on = load[1:-1] > PRESSED_SHARE * load.max()
    return np.count_nonzero(second[on]) / on.sum()


def test_the_share_was_set_between_weights_and_measured_loads():
    rng = np.random.default_rng(1)
    most = max(noisy_share(weights(rng)) for _ in range(LOADS))
    least = min(noisy_share(pressed(rng)[0]) for _ in range(LOADS))
    assert most < 0.8 * LEAST_NOISY_SHARE and least > 1.25 * LEAST_NOISY_SHARE


@pytest.mark.parametrize("family", [weights, staircases])
def test_weights_have_no_noise(family):
    rng = np.random.default_rng(2)
    assert [_load_noise(family(rng)) for _ in range(LOADS)] == [0.0] * LOADS


@pytest.mark.parametrize("family", [pressed, waves])
def test_measured_loads_have_their_noise(family):
    rng = np.random.default_rng(3)
    ratios = []
    for _ in range(LOADS):
        load, noise = family(rng)
        ratios.append(_load_noise(load) / noise)
    assert min(ratios) > 0.8 and max(ratios) < 1.7  # coarse steps are not normal: their median is a step
