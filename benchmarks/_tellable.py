# SPDX-License-Identifier: GPL-3.0-or-later
"""Which effects on top of real recordings can be told at all, computed from what was put on top and not from what was found.

An effect can be told if

- the stimulus shows what it is known by, as an unloading for hysteresis (:func:`.identifiability.indistinguishable`);
- no other kind could pass for it. Each kind is fitted to the added change itself, beside the base model, in its forms in the
  library. What the best one leaves comes on top of what was unexplained before. All other kinds have to leave so many times as
  much as the effect's own that the workflow calls none of them a rival (:data:`.verdict.RIVAL_RATIO`, or
  :data:`.verdict.HARDLY_DISTINGUISHABLE_RATIO` for drift and creep where nothing rests);
- the check recordings show it: without it, at least half of their squared error would not be there, which is what the workflow
  asks of a name (:data:`.check_recordings.CHECK_CLOSED`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ._injected import CleanedRecordings, is_multiplexed
from ._recordings import Recording


@dataclass(frozen=True)
class Tellable:
    """What decides whether an effect can be told.

    Attributes
    ----------
    is_shown : bool
        Whether the stimulus shows what the effect is known by.
    nearest : str
        The kind that could imitate it best.
    leaves : float
        What this kind leaves of the fitted recordings' squares, in units of what was unexplained before.
    wanted : float
        What it has to leave to be no rival: so many times what the effect's own kind leaves.
    check : float
        Share of the squared error of the check recordings that is not there without the effect.
    """

    is_shown: bool
    nearest: str
    leaves: float
    wanted: float
    check: float

    @property
    def fails(self) -> str:
        """Why it cannot be told; empty if it can."""
        from palpate.core.gap.selection.check_recordings import CHECK_CLOSED

        if not self.is_shown:
            return "the stimulus does not show it"
        if self.leaves < self.wanted:
            return f"{self.nearest} could pass for it"
        return "" if self.check >= CHECK_CLOSED else "the check recordings hardly show it"


def tellable(effect: str, cleaned: CleanedRecordings, freed: Any, changed: Recording) -> Tellable:
    """Return whether an effect that was put on top of recordings can be told.

    Parameters
    ----------
    effect : str
    cleaned : CleanedRecordings
    freed : Diagnosis
        Of the cleaned recordings. Its base model, stimulus and coverage count.
    changed : Recording
        With the effect.
    """
    from palpate.core.gap.selection.identifiability import hardly_distinguishable
    from palpate.core.gap.selection.verdict import HARDLY_DISTINGUISHABLE_RATIO, RIVAL_RATIO

    changes = _changes(cleaned.recording, changed)
    similar = hardly_distinguishable(freed.coverage, effect)
    left = {kind: 1.0 + more for kind, more in _left_by_kinds(effect, freed, changes, cleaned.residual_rms).items()}
    own = left.pop(effect, np.inf)  # of a kind that is no candidate in these recordings
    wanted = {kind: own * (HARDLY_DISTINGUISHABLE_RATIO if kind in similar else RIVAL_RATIO) for kind in left}
    nearest = min(left, key=lambda kind: left[kind] / wanted[kind])
    shown = _is_shown(effect, freed, changes, changed)
    return Tellable(shown, nearest, left[nearest], wanted[nearest], _closed_by_truth(freed, changes))


def _changes(before: Recording, after: Recording) -> dict[str, np.ndarray]:
    """What was added to the readings of each recording, (T, n)."""
    made = {}
    for (name, _, old), (_, _, new) in zip(before.trials, after.trials, strict=True):
        made[name] = np.stack([new[key] - old[key] for key in old if key.startswith("texel_")], axis=1)
    return made


def _left_by_kinds(effect: str, freed: Any, changes: dict[str, np.ndarray], left: float) -> dict[str, float]:
    """What the best form of each kind leaves of the change in the fitted recordings, in units of the square of `left`."""
    from palpate.core.effects.engine.declarations import FIT
    from palpate.core.gap.selection.base_model import base_fit
    from palpate.core.gap.selection.candidates import candidates, scales_of
    from palpate.core.gap.selection.screening import screen
    from palpate.core.gap.selection.view_set import view_set_of

    model = freed.base.model
    predictors = []
    for one in freed.of("fit"):
        reading = one.predict(model).reading + changes[one.trial.name]
        predictors.append(one.with_numbers_of(replace(one.trial, reading=reading)))
    forms = [one for one in candidates(predictors, model) if one.kind.found_by == FIT and one.form.friction_law is None]
    views = view_set_of(predictors, (left, freed.noise[1].deviation))
    base = base_fit(freed.rig, views.whole, freed.full[0])
    found = {one.name: base.mean for one in forms}
    for kind in found:
        some = [one for one in forms if one.name == kind]  # alone: beside a better kind it would not be fitted to everything
        for _, _, fitted in screen(views, base, some, scales_of(predictors, base.model)):
            found[kind] = min([found[kind], *(one.fit.mean for one in fitted)])
    return found


def _is_shown(effect: str, freed: Any, changes: dict[str, np.ndarray], changed: Recording) -> bool:
    """Whether the stimulus shows what an effect is known by; the curve that may be half a loop is the true one."""
    from palpate.core.effects.engine.registry import kind_of
    from palpate.core.gap.selection.identifiability import curvature_of, indistinguishable, unidentifiable

    if "rest" in kind_of(effect).known_from and is_multiplexed(changed):
        return False
    deepest = max(freed.of("fit"), key=lambda one: float(one.stimulus.load.max(initial=0.0)))
    texel = int(np.argmax(deepest.stimulus.load.max(axis=0)))
    true = deepest.predict(freed.base.model).reading[:, texel] + np.nan_to_num(changes[deepest.trial.name][:, texel])
    curvature = curvature_of(deepest.stimulus.load[:, texel], true)
    return effect not in unidentifiable(freed.coverage) and not indistinguishable(freed.coverage, effect, curvature)


def _closed_by_truth(freed: Any, changes: dict[str, np.ndarray]) -> float:
    """Share of the base model's squared error on the check recordings that is not there without the effect.

    Channels that jump in a check recording without any effect do not count.
    """
    from palpate.core.gap.selection.base_model import base_fit
    from palpate.core.gap.selection.outlying_channels import TIMES_THE_WORST
    from palpate.core.gap.selection.view_set import view_set_of

    def squares(one: Any, model: Any, change: Any = 0.0) -> np.ndarray:
        square: np.ndarray = np.nanmean((one.trial.reading + change - one.predict(model).reading) ** 2, axis=0)
        return square

    changed = [
        one.with_numbers_of(replace(one.trial, reading=one.trial.reading + changes[one.trial.name])) for one in freed.of("fit")
    ]
    views = view_set_of(changed, (freed.noise[0].deviation, freed.noise[1].deviation)).whole
    base = base_fit(freed.rig, views, freed.full[0]).model
    worst = max(float(np.nanmax(squares(one, freed.base.model))) for one in freed.of("fit"))
    before, after = 0.0, 0.0
    for one in freed.of("check"):
        without = squares(one, freed.base.model)
        measured = np.isfinite(one.trial.reading).sum(axis=0) * ~(without > TIMES_THE_WORST * worst)
        after += float(np.nansum(without * measured))
        before += float(np.nansum(squares(one, base, changes[one.trial.name]) * measured))
    return 1.0 - after / before
