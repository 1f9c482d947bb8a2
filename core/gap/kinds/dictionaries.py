# SPDX-License-Identifier: GPL-3.0-or-later
"""The kinds as dictionaries: what each can add to a signal, column by column, with bounds; zero coefficients change nothing.

A kind is not a formula but a cone: all sums of its columns with coefficients inside their bounds. Formulas of the same kind
from other papers lie near it. A kind whose formulas have two directions, as hysteresis that leads or trails, has a variant for
each. To add a kind, write the function of its columns and add a line to :data:`VARIANTS`, in the place at which it acts on the
way from the contact to the reading.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from . import operators
from .recorded import Recorded, RecordedRun, load_put_on

Columns = Callable[[np.ndarray, RecordedRun, Recorded], list[np.ndarray]]
"""From the signal (T, n) before a kind, the columns (T, n) that it can add to it."""


@dataclass(frozen=True)
class Variant:
    """One direction of a kind.

    Attributes
    ----------
    kind : str
        The effect's standard name.
    name : str
        Which direction; empty if there is one only.
    columns : callable
    low, high : float
        Bounds of each coefficient.
    in_contact : bool
        Whether it acts on forces, so that the net force shows it as well.
    texel_columns : tuple of str
        Of which parameters of single texels it consists besides: "gain", "offset", "rate", "fading".
    """

    kind: str
    name: str
    columns: Columns
    low: float = 0.0
    high: float = 1.0
    in_contact: bool = False
    texel_columns: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """Kind and direction."""
        return f"{self.kind}/{self.name}" if self.name else self.kind

    @property
    def is_static(self) -> bool:
        """Whether it only bends the curve of reading over load."""
        return self.kind in ("stiffening", "dead-zone", "saturation") or self.label == "adhesion/steady"

    @property
    def needs_neighbours(self) -> bool:
        """Whether it passes something from texel to texel."""
        return self.kind in ("load-spreading", "crosstalk")


# --- contact


def stiffening(x: np.ndarray, run: RecordedRun, recorded: Recorded) -> list[np.ndarray]:
    """Convex powers of the load: each rises the steeper, the larger the load, and begins with slope zero."""
    load = np.maximum(x, 0.0)
    return [load**power for power in (1.5, 2.0, 3.0, 5.0)]


def softening(x: np.ndarray, run: RecordedRun, recorded: Recorded) -> list[np.ndarray]:
    """Force lost by the largest load so far; at all loads, or only below it (Mullins)."""
    load = np.maximum(x, 0.0)
    most = np.maximum(np.maximum.accumulate(load, axis=0), 1e-9)
    below = np.clip(1.0 - load / most, 0.0, 1.0)
    lost = [-x * -np.expm1(-most / size) for size in (0.1, 0.3, 0.9)]
    lost += [-x * shape * -np.expm1(-((most / 0.5) ** 1.5)) for shape in (below, np.sqrt(np.tanh(3.0 * below)))]
    return lost + [-x * shape for shape in (below, np.tanh(below / 0.2), np.tanh(below / 0.6))]


def creep(x: np.ndarray, run: RecordedRun, recorded: Recorded) -> list[np.ndarray]:
    """Stress that relaxes: a Prony series."""
    return [-operators.low_pass(x, run.time, constant, at_rest=True) for constant in _relaxation_times(recorded)]


def _relaxation_times(recorded: Recorded) -> list[float]:
    """Time constants of relaxation, s: from 0.15 s until twice the recording is long."""
    longest = max(2.0 * recorded.duration, 1.0)
    return [float(t) for t in np.geomspace(0.15, longest, max(3, round(np.log(longest / 0.15) / np.log(3.0)) + 1))]


def rising(x: np.ndarray, run: RecordedRun, recorded: Recorded) -> list[np.ndarray]:
    """Readings that go on rising under a constant load."""
    return [operators.low_pass(x, run.time, t, at_rest=True) for t in _relaxation_times(recorded) if t > 0.6]


def leading(x: np.ndarray, run: RecordedRun, recorded: Recorded) -> list[np.ndarray]:
    """Loops that lie below on the way out: elements that stick and slip, and endochronic loops that grow with the load."""
    loops = [operators.stop(x, threshold) for threshold in (0.04, 0.09, 0.18, 0.36)]
    return loops + [x * operators.branch(x, length) for length in (0.04, 0.1, 0.25)]


def trailing(x: np.ndarray, run: RecordedRun, recorded: Recorded) -> list[np.ndarray]:
    """Loops that lie above on the way out: relays that switch off at a smaller load than they switch on at."""
    relays = [operators.relays(x, width) - np.maximum(x, 0.0) for width in (0.04, 0.1, 0.2, 0.4)]
    return relays + [-x * operators.branch(x, length) for length in (0.04, 0.1, 0.25)]


def wear(x: np.ndarray, run: RecordedRun, recorded: Recorded) -> list[np.ndarray]:
    """Force lost by work of pressing and sliding, or by pressing alone."""

    def losses() -> list[np.ndarray]:
        paths = (run.work, load_put_on(run.load) / max(recorded.full_path, 1e-12))
        return [np.expm1(-path / size) for path in paths for size in (0.2, 0.7, 3.0)]

    return [x * loss for loss in run.keep("wear", losses)]


def unloading_pull(x: np.ndarray, run: RecordedRun, recorded: Recorded) -> list[np.ndarray]:
    """Adhesion that pulls on the way out, at all loads or near the release."""

    def columns() -> list[np.ndarray]:
        touching, load = run.elastic > 0.0, np.maximum(run.elastic, 0.0)
        held = operators.falling(run.elastic, 0.01) * touching
        moving = (np.gradient(run.elastic, run.time, axis=0) < 0.0) & touching
        found = [-operators.falling(run.elastic, length) * touching for length in (0.03, 0.1)]
        for width in (0.08, 0.14, 0.25):
            near = np.exp(-((load / width) ** 2)) * -np.expm1(-load / (0.1 * width))
            found += [-held * near, moving * -near]
        return found

    return run.keep("adhesion", columns)


def steady_pull(x: np.ndarray, run: RecordedRun, recorded: Recorded) -> list[np.ndarray]:
    """Adhesion that pulls as long as there is contact."""
    return [np.expm1(-np.maximum(run.elastic, 0.0) / width) for width in (0.015, 0.03, 0.06)]


# --- from texel to texel


def load_spreading(x: np.ndarray, run: RecordedRun, recorded: Recorded) -> list[np.ndarray]:
    """Isotropic kernels that pass load on and keep its sum."""
    apart = np.linalg.norm(recorded.place[:, None] - recorded.place[None], axis=2)
    columns = []
    for width in (0.4, 0.55, 0.75, 1.0, 1.4, 2.2):
        kernel = np.exp(-0.5 * (apart / width) ** 2)
        columns.append(x @ (kernel / kernel.sum(axis=0)).T - x)
    return columns


def crosstalk(x: np.ndarray, run: RecordedRun, recorded: Recorded) -> list[np.ndarray]:
    """Readings that couple into neighbours and into texels of the same row or column, on top of their own."""
    columns = []
    if recorded.rows is not None:
        row, column = recorded.rows.T
        for own, other in ((row, column), (column, row)):
            same, apart = own[:, None] == own[None], np.abs(other[:, None] - other[None])
            for reach in (0.5, 1.5, 4.0, np.inf):
                couple = np.where(same & (apart > 0), np.exp(-(np.maximum(apart, 1) - 1) / reach), 0.0)
                if reach == 0.5:
                    couple = np.where(same & (apart == 1), 1.0, 0.0)
                columns.append(x @ couple / max(1.0, 0.25 * float(couple.sum(axis=0).max())))
    else:
        apart = np.linalg.norm(recorded.place[:, None] - recorded.place[None], axis=2)
        columns.append(x @ ((apart > 1e-9) & (apart < 1.3)))
    order = np.arange(x.shape[1])
    columns.append(x @ (np.abs(order[:, None] - order[None]) == 1))
    return columns


# --- readings


def no_columns(x: np.ndarray, run: RecordedRun, recorded: Recorded) -> list[np.ndarray]:
    """For kinds that are parameters of single texels alone."""
    return []


def dead_zone(x: np.ndarray, run: RecordedRun, recorded: Recorded) -> list[np.ndarray]:
    """What is missing below thresholds."""
    load = np.maximum(x, 0.0)
    return [-np.minimum(load, threshold) for threshold in (0.02, 0.035, 0.06, 0.09, 0.13, 0.18, 0.24, 0.31, 0.4, 0.52)]


def saturation(x: np.ndarray, run: RecordedRun, recorded: Recorded) -> list[np.ndarray]:
    """What is missing above levels."""
    return [-np.maximum(x - level, 0.0) for level in (0.05, 0.15, 0.25, 0.35, 0.45, 0.55, 0.65, 0.75, 0.85, 0.93)]


def lag(x: np.ndarray, run: RecordedRun, recorded: Recorded) -> list[np.ndarray]:
    """Low passes and delays, of which each takes a share of the reading."""
    filters = [operators.low_pass(x, run.time, constant, at_rest=False) for constant in (0.03, 0.06, 0.12, 0.25)]
    return [late - x for late in (*filters, *(operators.delayed(x, run.time, d) for d in (0.04, 0.08, 0.15, 0.25)))]


def drift(x: np.ndarray, run: RecordedRun, recorded: Recorded) -> list[np.ndarray]:
    """Smooth functions of the time."""

    def columns() -> list[np.ndarray]:
        share = ((run.time - run.time[0]) / recorded.duration)[:, None] + np.zeros_like(x)
        return [np.sqrt(share), share, share**2, -np.expm1(-share / 0.1)]

    return run.keep("drift", columns)


VARIANTS: tuple[Variant, ...] = (
    Variant("stiffening", "", stiffening, 0.0, 3.0, in_contact=True),
    Variant("softening", "", softening, in_contact=True),
    Variant("creep", "", creep, in_contact=True),
    Variant("hysteresis", "leading", leading, in_contact=True),
    Variant("hysteresis", "trailing", trailing, in_contact=True),
    Variant("wear", "", wear, 0.0, 2.0, in_contact=True),
    Variant("adhesion", "unloading", unloading_pull, in_contact=True),
    Variant("adhesion", "steady", steady_pull, in_contact=True),
    Variant("load-spreading", "", load_spreading),
    Variant("crosstalk", "", crosstalk),
    Variant("gain-mismatch", "", no_columns, texel_columns=("gain",)),
    Variant("dead-zone", "", dead_zone),
    Variant("saturation", "", saturation),
    Variant("creep", "rising", rising, 0.0, 2.0),
    Variant("hysteresis", "reading", trailing),
    Variant("lag", "", lag),
    Variant("drift", "", drift, -1.0, 1.0, texel_columns=("rate",)),
    Variant("offset", "", no_columns, texel_columns=("offset",)),
    Variant("offset", "fading", no_columns, texel_columns=("fading",)),
)
"""All kinds in the order in which they act. Misalignment is none of these: it changes what the base model is told."""
MISALIGNMENT = Variant("misalignment", "", no_columns, -1.0, 1.0, in_contact=True)
