# SPDX-License-Identifier: GPL-3.0-or-later
"""One model of all kinds: a cascade from the base model's load to the reading, and its derivatives.

    pose → contact → relaxation → hysteresis → wear → adhesion → [net force] → spatial → gain → dead zone → saturation → lag →
    drift and offset

The base model's load of each texel passes all kinds in the order of :data:`.dictionaries.VARIANTS`. Each adds its columns,
which depend on the signal that comes to it, times its coefficients. The net force is what the loads add up to behind the
contact.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from .dictionaries import MISALIGNMENT, VARIANTS, Variant
from .recorded import Recorded, RecordedRun

STEP = 1e-4
"""Step of the derivatives, of coefficients and of signals whose full load is 1."""
POSE_STEP = np.array([2e-5, 2e-5, 5e-6, 5e-4, 5e-4, 5e-4])
"""Step of the derivatives by a displacement, m and rad."""
POSE_SCALE = np.array([1e-3, 1e-3, 1e-3, 0.1, 0.1, 0.1])
"""Coefficients of misalignment are in these units, m and rad."""
BASE = ("k", "damping", "gain", "zero")
"""Corrections of the base model's own parameters: shares of the stiffness, the damping and the gain, and a zero."""
TEXEL = ("gain", "offset", "rate", "fading")
"""Parameters of single texels: a share of the gain, an offset, a rate of the offset per duration of the recordings, and an
offset that the load takes over, as of a cover that is stretched over the texels."""
GAIN_AT = next(i for i, variant in enumerate(VARIANTS) if "gain" in variant.texel_columns)
DAMPED_AT = next(i for i, variant in enumerate(VARIANTS) if variant.after_clip)
"""The first variant that comes behind the damping."""
CONTACT_ENDS = max(i for i, variant in enumerate(VARIANTS) if variant.in_contact) + 1


@dataclass(frozen=True)
class Point:
    """Coefficients of a model.

    Attributes
    ----------
    members : tuple of Variant
        What the model has.
    coefficients : dict of str to (c,) float
        Of each member, by its label; members of which nothing is said have zeros.
    base : dict of str to float
        Corrections of the base model, by the names in :data:`BASE`.
    texel : dict of str to (n,) float
        Parameters of single texels, by the names in :data:`TEXEL`.
    """

    members: tuple[Variant, ...] = ()
    coefficients: dict[str, np.ndarray] = field(default_factory=dict)
    base: dict[str, float] = field(default_factory=dict)
    texel: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def displacement(self) -> tuple[float, ...]:
        """Displacement of the texels, m and rad."""
        own = self.coefficients.get(MISALIGNMENT.label)
        return (0.0,) * 6 if own is None else tuple(float(v) for v in own * POSE_SCALE)

    def of(self, variant: Variant) -> np.ndarray | None:
        """Return the coefficients of a member that does something, else None."""
        own = self.coefficients.get(variant.label)
        return own if own is not None and own.any() else None


@dataclass(frozen=True)
class Course:
    """Signals of a run at a point: what comes to each variant and what leaves the last, and the net force."""

    signals: list[np.ndarray]
    reading: np.ndarray
    force: np.ndarray


class Cascade:
    """The cascade on one set of recordings."""

    def __init__(self, recorded: Recorded):
        self.recorded = recorded

    def course(self, point: Point, number: int) -> Course:
        """Return the signals of a run."""
        run = self._run(point, number)
        signals = self._advance(point, run, (1.0 + point.base.get("k", 0.0)) * run.elastic, 0)
        return Course(signals, signals[-1], self._net_force(number, signals[CONTACT_ENDS]))

    def _run(self, point: Point, number: int) -> RecordedRun:
        """A run with the loads of displaced texels."""
        run = self.recorded.runs[number]
        if not any(point.displacement):
            return run
        load, elastic = self.recorded.source.loads(point.displacement)[number]
        return replace(run, load=load, elastic=elastic, kept={})

    def _net_force(self, number: int, x: np.ndarray) -> np.ndarray:
        total: np.ndarray = (x * self.recorded.runs[number].towards_normal).sum(axis=1)
        return total

    def _advance(self, point: Point, run: RecordedRun, x: np.ndarray, start: int) -> list[np.ndarray]:
        """Signals before the variants from `start` on, and at the end."""
        signals = []
        for index in range(start, len(VARIANTS)):
            signals.append(x)
            variant = VARIANTS[index]
            if index == GAIN_AT:
                gains = self._gains(point)
                x = x if gains is None else x * gains
            own = point.of(variant)
            if own is not None:
                x = x + _combined(own, variant.columns(x, run, self.recorded))
                if variant.in_contact:
                    x = np.where(_is_pressed(x, run, variant), x, 0.0)
            if index == DAMPED_AT - 1:
                factor = (1.0 + point.base.get("k", 0.0)) * (1.0 + point.base.get("damping", 0.0))
                x = np.where(run.elastic > 0.0, np.maximum(x + factor * (run.load - run.elastic), 0.0), 0.0)
        for name, shape in self._offset_shapes(run).items():
            if name in point.texel:
                x = x + point.texel[name] * shape
        return [*signals, x + point.base.get("zero", 0.0)]

    def _gains(self, point: Point) -> np.ndarray | None:
        """Factor of each texel's reading; None if all are 1."""
        common, own = point.base.get("gain", 0.0), point.texel.get("gain")
        if own is None:
            return None if common == 0.0 else np.full(self.recorded.texel_count, 1.0 + common)
        return 1.0 + common + own

    def columns(self, point: Point, number: int, variants: Iterable[Variant]) -> dict[str, list[tuple[np.ndarray, np.ndarray]]]:
        """Return derivatives of a run's readings (T, n) and net force (T,) by base corrections and coefficients.

        Parameters
        ----------
        point : Point
        number : int
            Of the run.
        variants : iterable of Variant
            Of which variants the derivatives by the coefficients are wanted.

        Returns
        -------
        dict of str to list of (reading, force)
            By names of base corrections and labels of variants.
        """
        recorded, run, here = self.recorded, self._run(point, number), self.course(point, number)
        still = np.zeros(len(run.time))
        made: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
        for name in ("k", "damping"):
            if name in recorded.free:
                moved = replace(point, base={**point.base, name: point.base.get(name, 0.0) + STEP})
                made[name] = [self._difference(here, self.course(moved, number), STEP)]
        if "gain" in recorded.free:
            made["gain"] = [(self._behind(point, number, here, here.signals[GAIN_AT], GAIN_AT + 1)[0], still)]
        if "zero" in recorded.free:
            made["zero"] = [(np.ones_like(here.reading), still)]
        for variant in variants:
            if variant is MISALIGNMENT:
                made[variant.label] = self._pose_columns(point, number, here)
                continue
            index = VARIANTS.index(variant)
            signal = here.signals[index]
            directions = variant.columns(signal, run, recorded)
            if variant.in_contact:
                pressed = _is_pressed(here.signals[index + 1], run, variant)
                directions = [np.where(pressed, one, 0.0) for one in directions]
            made[variant.label] = [self._behind(point, number, here, one, index + 1) for one in directions]
        return made

    def texel_columns(self, point: Point, number: int) -> dict[str, np.ndarray]:
        """Return derivatives of a run's readings by the parameters of their own texels, (T, n) each."""
        here = self.course(point, number)
        gain = self._behind(point, number, here, here.signals[GAIN_AT], GAIN_AT + 1)[0]
        return {"gain": gain, **self._offset_shapes(self._run(point, number))}

    def _offset_shapes(self, run: RecordedRun) -> dict[str, np.ndarray]:
        """What parameters of single texels add to their readings, (T, n) each."""

        def shapes() -> dict[str, np.ndarray]:
            share = ((run.time - run.time[0]) / self.recorded.duration)[:, None] + np.zeros_like(run.load)
            return {"offset": np.ones_like(run.load), "rate": share, "fading": 1.0 / (1.0 + run.load)}

        found: dict[str, np.ndarray] = run.keep("offsets", shapes)
        return found

    def _behind(
        self, point: Point, number: int, here: Course, direction: np.ndarray, start: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """What a change of the signal before a variant does to readings and net force."""
        in_contact = start <= CONTACT_ENDS
        acting = start < DAMPED_AT or any(point.of(variant) is not None for variant in VARIANTS[start:])
        if not acting and (start > GAIN_AT or self._gains(point) is None):
            force = self._net_force(number, direction) if in_contact else np.zeros(len(direction))
            return direction, force
        size = STEP
        moved = self._advance(point, self._run(point, number), here.signals[start] + size * direction, start)
        reading = (moved[-1] - here.reading) / size
        if not in_contact:
            return reading, np.zeros(len(direction))
        return reading, (self._net_force(number, moved[CONTACT_ENDS - start]) - here.force) / size

    def _pose_columns(self, point: Point, number: int, here: Course) -> list[tuple[np.ndarray, np.ndarray]]:
        """Derivatives by the displacement of the texels; no height if that is the base model's."""
        made = []
        for axis in range(6):
            if axis == 2 and self.recorded.source.heights_free:
                made.append((np.zeros_like(here.reading), np.zeros_like(here.force)))
                continue
            moved = np.array(point.displacement)
            moved[axis] += POSE_STEP[axis]
            there = replace(point, coefficients={**point.coefficients, MISALIGNMENT.label: moved / POSE_SCALE})
            made.append(self._difference(here, self.course(there, number), POSE_STEP[axis] / POSE_SCALE[axis]))
        return made

    @staticmethod
    def _difference(here: Course, there: Course, size: float) -> tuple[np.ndarray, np.ndarray]:
        return (there.reading - here.reading) / size, (there.force - here.force) / size


def _combined(coefficients: np.ndarray, columns: list[np.ndarray]) -> np.ndarray:
    """Sum of columns times coefficients."""
    total = np.zeros_like(columns[0])
    for value, column in zip(coefficients, columns, strict=True):
        if value != 0.0:
            total += value * column
    return total


def _is_pressed(x: np.ndarray, run: RecordedRun, variant: Variant) -> np.ndarray:
    """Where a force acts: while there is contact; only what acts after the clip pulls."""
    touching: np.ndarray = run.elastic > 0.0
    return touching if variant.after_clip else touching & (x >= 0.0)
