# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact heights that a rig leaves open: where their fit starts.

Misfit has many local minima in the height: a recording that never touches at the height of the rig has no slope at all. So the
height at which loads and responses are best correlated is searched for first, on a grid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ...errors import SceneError
from ..dataset.rig import Rig
from ..dataset.trial import Trial
from ..forward.response_check import correlation, responses_of
from ..forward.stimulus import stimulus_of

GRID_STEPS, FINER_STEPS = 20, 5
"""Heights on either side of the rig's, up to the largest penetration, and again on either side of the best one."""
MOST_SAMPLES = 300
"""Number of samples of a recording, evenly spaced, on which heights are compared."""


def with_starting_heights(rig: Rig) -> Rig:
    """Return the rig with a start for each contact height that is free; the same rig if there is none."""
    trials = list(rig.trials)
    names = dict.fromkeys(str(trial.contact_height) for trial in trials if isinstance(trial.contact_height, str))
    for name in names:
        of_name = [trial for trial in trials if trial.contact_height == name]
        height = _best_height(rig, [_thinned(trial) for trial in of_name if trial.use == "fit"])
        trials = [replace(trial, height_start=height) if trial.contact_height == name else trial for trial in trials]
    return replace(rig, trials=tuple(trials)) if names else rig


def _best_height(rig: Rig, trials: Sequence[Trial]) -> float:
    """The height at which loads and responses are best correlated."""
    step = rig.parameters.max_penetration / GRID_STEPS
    best = 0.0
    for size, count in ((step, GRID_STEPS), (step / FINER_STEPS, FINER_STEPS)):
        others = [best + number * size for number in range(-count, count + 1) if number]
        best = max(best, *others, key=lambda height: _agreement(rig, trials, height))
    return best


def _agreement(rig: Rig, trials: Sequence[Trial], height: float) -> float:
    """Magnitude of the correlation of loads with responses; -1 where nothing touches, or the indenter goes right through."""
    try:
        stimuli = [stimulus_of(trial, rig, height=height) for trial in trials]
    except SceneError:
        return -1.0
    pairs = responses_of(rig, stimuli, "reading")
    net = responses_of(rig, [one for one in stimuli if one.trial.reading is None], "force")
    values = [abs(correlation(part)) for part in (pairs, net) if part]
    return max(values) if any(load.any() for load, _ in pairs + net) else -1.0


def _thinned(trial: Trial) -> Trial:
    """The trial with some of its samples only."""
    return trial.part(slice(None, None, max(1, -(-len(trial.time) // MOST_SAMPLES))))
