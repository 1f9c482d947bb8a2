# SPDX-License-Identifier: GPL-3.0-or-later
"""The gaps of readings and of net forces, and how much of them is closed.

With the mean squares M₀ of the base model's residual and F of the noise, ``M₀ - F`` is the gap, and an effect closes a share of
it. Readings and net forces have a gap each. Effects on friction show in net forces only and are judged by them; all others are
judged by the readings, if there are any.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...effects.engine.registry import library, site_of_action
from ...model.sensor import Effect

READINGS, FORCES = 0, 1
"""Columns of arrays that hold a value for readings and one for net forces."""
LEAST_IMPROVEMENT = 0.02
"""Least decrease of the mean square on unseen stretches, in units of the noise's variance."""
UNRESOLVED_SHARE, UNRESOLVED_SQUARE = 0.004, 0.01
"""What no fit can resolve of a gap: a share of it, and a mean square in units of the noise's variance."""


@dataclass(frozen=True)
class Improvement:
    """Part of the gap that an effect closed: as a share of the whole gap, and of the gap that was left before."""

    of_gap: float
    of_remaining: float


@dataclass
class GapSizes:
    """The gaps of readings and of net forces: mean squares of the base model and of noise alone.

    Attributes
    ----------
    base, noise : (2,) float
        Mean squares of the base model's residual and of the noise, for readings and forces, in units of the noise's variance.
    count : (2,) float
        Number of measured values.
    placed : (2,) float or None
        Mean squares of the model that has nothing but a displacement of the texels, once that is the first effect.
    """

    base: np.ndarray
    noise: np.ndarray
    count: np.ndarray
    placed: np.ndarray | None = None

    @property
    def both(self) -> bool:
        """True if readings and net forces were measured."""
        return bool((self.count > 0).all())

    @property
    def main_quantity(self) -> int:
        """READINGS if there are any, else FORCES: what effects other than friction are judged by."""
        return READINGS if self.count[READINGS] > 0 else FORCES

    def quantity_for(self, name: str) -> int:
        """Return READINGS or FORCES: what an effect of this name is judged by."""
        return FORCES if self.both and name in friction_kinds() else self.main_quantity

    def gap(self, quantity: int) -> float:
        """Return the whole gap of readings or of forces."""
        return float(max(self.base[quantity] - self.noise[quantity], 1e-12))

    def sensor_gap(self, quantity: int) -> float:
        """Return the gap of a sensor that is where the model has it: without what a displacement of the texels closes.

        Where a sensor is mounted says nothing about the sensor, and may close a hundred times as much as its own effects.
        """
        whole = self.gap(quantity)
        return whole if self.placed is None else min(whole, float(max(self.placed[quantity] - self.noise[quantity], 1e-12)))

    def closed_share(self, means: np.ndarray, quantity: int) -> float:
        """Return the share of a gap that is closed at these mean squares."""
        return float(np.clip((self.base[quantity] - means[quantity]) / self.gap(quantity), 0.0, 1.0))

    def improvement(self, before: np.ndarray, after: np.ndarray, quantity: int) -> Improvement:
        """Return by how much a gap closes between two pairs of mean squares."""
        closed = float(before[quantity] - after[quantity])
        return Improvement(closed / self.gap(quantity), closed / float(max(before[quantity] - self.noise[quantity], 1e-12)))

    def unresolved(self, quantity: int) -> float:
        """Return how much of a gap no fit can resolve."""
        return UNRESOLVED_SHARE * self.sensor_gap(quantity) + UNRESOLVED_SQUARE

    def has_gap(self, quantity: int) -> bool:
        """Return whether there is a gap that matters."""
        return bool(self.count[quantity] > 0) and self.gap(quantity) > (
            LEAST_IMPROVEMENT if quantity == self.main_quantity else float(self.noise[quantity])
        )


def friction_kinds() -> list[str]:
    """Return the names of the effects that act on friction alone."""
    return [kind.name for kind in library().values() if all(form.friction_law is not None for form in kind.forms)]


def quantities_changed_by(effect: Effect) -> tuple[int, ...]:
    """Return which of READINGS and FORCES an effect can change: a readout not the forces, and friction not the readings."""
    if site_of_action(effect) == "readout":
        return (READINGS,)
    return (FORCES,) if effect.name in friction_kinds() else (READINGS, FORCES)
