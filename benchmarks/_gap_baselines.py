# SPDX-License-Identifier: GPL-3.0-or-later
"""What one would do without ``palpate gap``: refit the base, add effects by BIC, or fit the residual by SINDy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

FEATURES = {
    "depth²": "stiffening", "depth³": "stiffening", "touch": "dead-zone", "rate": "lag", "|rate|": "hysteresis",
    "depth · falling": "hysteresis", "deepest": "softening", "depth · deepest": "softening", "impulse": "wear",
    "settling 1 s": "creep", "settling 8 s": "creep", "neighbours": "crosstalk", "clock": "drift", "one": "offset",
}  # fmt: skip
"""Terms that SINDy may use, and the effect that one would call each by."""


def all_of(case: Any, result: Any, closed: Callable[..., float | None]) -> dict[str, dict[str, Any]]:
    """Return for each baseline whether it named the answer or something else, and the share of the gap it closed."""
    base = {"right": False, "wrong": False, "closed": 0.0}  # refitted: it is the gap that the others close
    names, model = stepwise(result)
    bic = _told(case.answer, names) | {"closed": closed(case, result, model)}
    names, share = sindy(case, result)
    return {"base only": base, "stepwise BIC": bic, "SINDy": _told(case.answer, names) | {"closed": share}}


def _told(answer: list[str], names: list[str]) -> dict[str, bool]:
    return {"right": set(names) == set(answer), "wrong": any(name not in answer for name in names)}


def stepwise(result: Any, most: int = 3) -> tuple[list[str], Any]:
    """Add the form that lowers the BIC on the fitted trials most, until none does."""
    from palpate.core.gap.fitting.least_squares import fit
    from palpate.core.gap.selection.candidates import candidates
    from palpate.core.gap.selection.rao_score import ScoreTest
    from palpate.core.gap.selection.screening import free_with, starting_points
    from palpate.core.gap.selection.view_set import view_set_of

    view_set = view_set_of(result.of("fit"), (result.noise[0].deviation, result.noise[1].deviation))
    current = result.base
    samples = float(current.count.sum())
    bic = float(current.sse.sum()) + _size(current.free, result) * np.log(samples)
    for _ in range(most):
        best, best_bic = None, bic
        taken = {effect.name for effect in current.model.effects}
        score_test = ScoreTest(view_set.whole, current)
        for candidate in candidates(result.of("fit"), current.model):
            if candidate.name in taken:
                continue
            starts = starting_points(candidate, score_test, view_set.whole, result.scales)
            if not starts:
                continue
            free = free_with(current.free, current.model, candidate, result.scales)
            tried = fit(view_set.whole, current.model.with_effect(starts[0][1]), free, max_steps=4, tolerance=1e-3)
            value = float(tried.sse.sum()) + _size(free, result) * np.log(samples)
            if value < best_bic:
                best, best_bic = tried, value
        if best is None:
            break
        current, bic = best, best_bic
    return [effect.name for effect in current.model.effects], current.model


def _size(free: Any, result: Any) -> int:
    return sum(len(result.rig.texels) if item.per_texel else 1 for item in free)


def sindy(case: Any, result: Any) -> tuple[list[str], float | None]:
    """Return the name of the strongest term, and which share of the gap of the readings all of them close."""
    strongest, weights = sindy_terms(result)
    before = after = 0.0
    for predictor in result.of("check"):
        truth = case.clean[int(predictor.trial.name.removeprefix("trial_"))][0]
        miss = (truth - predictor.predict(result.base.model).reading).ravel()
        before, after = before + float(miss @ miss), after + float(((miss - _terms(predictor) @ weights) ** 2).sum())
    return strongest, 1.0 - np.sqrt(after / before) if before > 0 else None


def sindy_terms(result: Any, threshold: float = 0.1) -> tuple[list[str], np.ndarray]:
    """Sequentially thresholded least squares (Brunton, Proctor and Kutz, PNAS 113, 2016) on the residual of the readings."""
    rows = [(_terms(p), (p.trial.reading - p.predict(result.base.model).reading).ravel()) for p in result.of("fit")]
    gram = sum(x.T @ x for x, _ in rows)
    along = sum(x.T @ y for x, y in rows)
    square = sum(float(y @ y) for _, y in rows)
    size = np.sqrt(np.diag(gram) + 1e-30)
    keep, weights = np.ones(len(size), bool), np.zeros(len(size))
    for _ in range(10):
        weights[:] = 0.0
        weights[keep] = np.linalg.lstsq(gram[np.ix_(keep, keep)] + 1e-9 * np.diag(size[keep] ** 2), along[keep], rcond=None)[0]
        share = np.abs(weights) * size / np.sqrt(max(square, 1e-300))
        if (share[keep] >= threshold).all() or not keep.any():
            break
        keep &= share >= threshold
    names = list(FEATURES.values())
    return [names[int(np.argmax(np.abs(weights) * size))]] if keep.any() else [], weights


def _terms(predictor: Any) -> np.ndarray:
    """(T n, terms): the features of each texel at each sample, on their own scales."""
    s = predictor.stimulus
    dt = float(np.median(np.diff(s.time)))
    d = s.depth / max(float(s.depth.max()), 1e-12)
    rate = np.gradient(d, dt, axis=0)
    deepest = np.maximum.accumulate(d, axis=0)
    settled = []
    for tau in (1.0, 8.0):
        q = np.zeros_like(d)
        for t in range(1, len(d)):
            q[t] = q[t - 1] + (d[t] - q[t - 1]) * (1 - np.exp(-dt / tau))
        settled.append(q)
    place = predictor.rig.texels.position
    apart = np.linalg.norm(place[:, None] - place[None], axis=2)
    near = (apart > 0) & (apart < 1.25 * apart[apart > 0].min())
    around = d @ near.T.astype(float)
    clock = np.broadcast_to((s.time - s.time[0])[:, None] / (s.time[-1] - s.time[0]), d.shape)
    columns = [d**2, d**3, d > 0, rate, np.abs(rate), d * (rate < 0), deepest, d * deepest, np.cumsum(d, axis=0) * dt]
    return np.stack([c.ravel() for c in (*columns, *settled, around, clock, np.ones_like(d))], axis=1).astype(float)
