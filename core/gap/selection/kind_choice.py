# SPDX-License-Identifier: GPL-3.0-or-later
"""A second opinion on doubtful effects: the kinds that recordings show whatever their formulas.

Forward selection takes formulas. A name may be in doubt because no formula of the library is that of the sensor: what the
nearest one leaves looks like another effect. The search by kinds fits no formula, so it settles such doubts. Dead texels and
quantization steps are seen in the readings themselves (see :mod:`.direct_estimates`): readings of dead texels do not count in
it, and coarse steps count as noise.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace

import numpy as np

from ...effects.engine.declarations import SILENT_TEXELS
from ..fitting.least_squares import BASE, Fit
from ..fitting.noise_floor import ChannelNoise
from ..kinds.decision import Decision, decided
from ..kinds.recorded import recorded
from ..kinds.search import search_kinds
from .candidates import DIRECTLY_ESTIMATED, Candidate, candidates
from .direct_estimates import coarsest_step, unresponsive_texels
from .view_set import ViewSet


def choose_kinds(
    view_set: ViewSet, base: Fit, noise: tuple[ChannelNoise, ChannelNoise]
) -> Generator[tuple[str, float], None, Decision]:
    """Choose the kinds that fitted recordings show.

    Parameters
    ----------
    view_set : ViewSet
    base : Fit
        The fitted base model.
    noise : (ChannelNoise, ChannelNoise)
        Of readings and of net forces.

    Yields
    ------
    what : str
    share : float
        How much of this is done.

    Returns
    -------
    Decision
    """
    predictors = [view.predictor for view in view_set.whole]
    forms = candidates(predictors, base.model)
    step = coarsest_step(view_set.whole, base.model)
    coarse = replace(noise[0], deviation=float(np.hypot(noise[0].deviation, step / np.sqrt(12.0))))
    free = {item.name for item in base.free if item.effect == BASE}
    seen = recorded(predictors, base.model, free, (coarse, noise[1]), _silent_texels(view_set, base, forms))
    search = yield from search_kinds(seen, {form.name for form in forms} - set(DIRECTLY_ESTIMATED))
    return decided(search)


def _silent_texels(view_set: ViewSet, base: Fit, forms: list[Candidate]) -> np.ndarray | None:
    """Which texels hardly follow the model although they are loaded, (n,) bool; None if all follow."""
    texels = len(view_set.whole[0].predictor.rig.texels)
    listed = [form for form in forms if form.kind.found_by == SILENT_TEXELS]
    effects = [unresponsive_texels(view_set.whole, base.model, form, texels) for form in listed]
    found = [np.asarray(effect.values["dead"], float) > 0.5 for effect in effects if effect is not None]
    return np.any(found, axis=0) if found else None
