# SPDX-License-Identifier: GPL-3.0-or-later
"""What `palpate gap` leaves behind: gap.json, sensor.toml, report.html and its pictures (docs/gap.md describes them)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ...io.file_writing import atomic_write
from ...io.sensor_toml import write_sensor
from ...jobs.progress import Job, Progress
from ..fitting.intervals import ParameterInterval, parameter_intervals
from ..forward.contact_phases import FEATURES
from ..selection.diagnosis import Diagnosis
from .amended_sensor import LOUD, amended_sensor, intermediate_models, next_experiment, with_mean_gain_moved
from .comparison import error_location, noise_floor, nrmse, nrmse_without_friction
from .html_report import render_page
from .plots import draw

FORMAT = "palpate-gap/1"
SURE = 0.5
"""Confidence from which a name is meant as one."""


def summary(result: Diagnosis) -> dict[str, Any]:
    """Return what gap.json holds."""
    model, counted = with_mean_gain_moved(result), parameter_intervals(result)
    fit, check = result.of("fit"), result.of("check")
    models = intermediate_models(result)
    after = [nrmse(fit, one, result.full) for one in models]
    found = []
    for named in result.findings:
        effect = model.effects[named.effect]
        own = [one for one in counted if one.effect == named.effect]
        found.append(
            {
                "effect": named.name,
                "form": named.form,
                "parameters": {key: _plain(value) for key, value in effect.values.items()},
                "intervals": {one.name: [one.low, one.high] for one in own},
                "confidence": named.confidence,
                "gap_before": after[named.effect],
                "gap_after": after[min(named.effect + 1, len(after) - 1)],
                "next_best": {"effect": named.next_best, "leaves": round(named.leaves, 3)} if named.next_best else None,
            }
        )
    return {
        "format": FORMAT,
        "name": result.rig.name,
        "verdict": result.verdict,
        "found": found,
        "base": {
            "parameters": {one.name: getattr(model.parameters, one.name) for one in counted if one.effect < 0},
            "intervals": {one.name: [one.low, one.high] for one in counted if one.effect < 0},
            "without_effects": {item.name: getattr(result.base.model.parameters, item.name) for item in result.base.free},
            "gap_without_friction": nrmse_without_friction(result),
        },
        "gap": {
            "before": {use: nrmse(trials, result.base.model, result.full) for use, trials in (("fit", fit), ("check", check))},
            "after": {use: nrmse(trials, result.best.model, result.full) for use, trials in (("fit", fit), ("check", check))},
            "noise_floor": noise_floor(result),
        },
        "where": error_location(result, result.base.model),
        "varies_with": {key: round(value, 4) for key, value in result.base_structure.shares.items()},
        "left_varies_with": {key: round(value, 4) for key, value in result.structure.shares.items()},
        "ruled_out": [{"effect": name, "why": why} for name, why in result.ruled_out],
        "ambiguous": [list(names) for names in result.ambiguous],
        "next_experiment": next_experiment(result),
        "warnings": list(result.rig.warnings) + warnings(result),
    }


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def warnings(result: Diagnosis) -> list[str]:
    """Return what a reader should know about the recordings."""
    said = []
    overpressed = max((p.stimulus.overpressed for p in result.predictors), default=0)
    if overpressed:
        said.append(
            f"Up to {overpressed} texels were pressed past the maximum penetration of "
            f"{result.rig.parameters.max_penetration * 1e3:.3g} mm; here they go on acting, in a simulation they would not."
        )
    share = result.noise[0].deviation / result.full[0]
    if share > LOUD:
        said.append(f"Noise is {share:.0%} of the range: an effect that is not much larger cannot be seen in these recordings.")
    if not result.of("check"):
        said.append('No trial is for checking only: give one use = "check", so that the result can be judged on it.')
    if len(result.of("fit")) == 1:
        said.append("Only one trial was fitted: halves of it had to judge each other.")
    return said


def write_report(result: Diagnosis, folder: Path) -> Job[None]:
    """Write everything into a folder, gap.json last.

    Yields
    ------
    Progress
    """
    yield Progress("writing the amended sensor", 0, 1000)
    write_sensor(folder / "sensor.toml", amended_sensor(result))
    yield Progress("drawing", 100, 1000)
    pictures = draw(result, folder)
    yield Progress("writing the report", 900, 1000)
    found = summary(result)
    with atomic_write(folder / "report.html") as temporary:
        temporary.write_text(render_page(result, found, headline(result), pictures, folder), encoding="utf-8")
    with atomic_write(folder / "gap.json") as temporary:
        temporary.write_text(json.dumps(found, indent=2, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")
    yield Progress("done", 1000, 1000)


def headline(result: Diagnosis) -> str:
    """Return the result in one sentence."""
    before = nrmse(result.of("fit"), result.base.model, result.full) or 0.0
    after = nrmse(result.of("fit"), result.best.model, result.full) or 0.0
    sure = [n for n in result.findings if n.confidence >= SURE]
    if result.verdict == "no gap":
        return f"No gap: the base model with its own parameters refitted leaves {before:.2%} of the range, which is noise."
    if result.verdict == "unexplained":
        strongest = FEATURES.get(result.structure.strongest, "nothing that was looked at")
        part = f" {_names([n.name for n in sure])} is part of it." if sure else ""
        if result.line is not None:
            line, unit = result.line, result.rig.parameters.unit
            said = f"a line at {line.frequency:.3g} Hz of {line.amplitude:.3g} {unit}, there without load too"
            return f"Unexplained: {said}, is {line.share:.0%} of what trembles at rest.{part}"
        return f"Unexplained: what is left ({after:.2%} of the range) varies most with {strongest}.{part}{_own(result, before)}"
    shrink = f"the error shrinks from {before:.2%} to {after:.2%} of the range"
    if result.ambiguous and not sure:
        choices = "; ".join(" or ".join(names) for names in result.ambiguous)
        return f"Not told apart by these recordings: {choices} ({shrink})."
    alike = {names[0]: " or ".join(names) for names in result.ambiguous}
    doubtful = _names([alike.get(n.name, n.name) for n in result.findings if n not in sure])
    if not sure:
        return f"Perhaps missing: {doubtful}; {shrink}."
    besides = f", and perhaps {doubtful}{' (not told apart)' if alike else ''}" if len(sure) < len(result.findings) else ""
    return f"Missing: {_names([n.name for n in sure])}{besides}; {shrink}."


def _own(result: Diagnosis, before: float) -> str:
    """What of an error the base model's own friction closes, as a sentence; nothing where that is no great part."""
    bare = (nrmse_without_friction(result) or {}).get("fit") or 0.0
    if bare < 1.5 * before:
        return ""
    return f" Friction is not missing: the base model has it, and without it the error would be {bare:.2%}."


def evidence(result: Diagnosis) -> list[str]:
    """Return a sentence for each effect that was found, and one for the recordings that only judge."""
    models = intermediate_models(result)
    left = [nrmse(result.of("fit"), one, result.full) or 0.0 for one in models]
    said = []
    for named in result.findings:
        rivals = f"; it could as well be {' or '.join(named.rivals)}" if named.rivals else ""
        before, after = left[named.effect], left[min(named.effect + 1, len(left) - 1)]
        said.append(f"{named.name} ({named.form}): {before:.2%} → {after:.2%}, confidence {named.confidence:.0%}{rivals}")
    check = result.of("check")
    if check and result.findings:
        before, after = (nrmse(check, one, result.full) or 0.0 for one in (models[0], models[-1]))
        said.append(f"never fitted: {before:.2%} → {after:.2%}; noise alone is {noise_floor(result):.2%}")
    return said


def _names(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}" if names else "nothing"


def interval_text(one: ParameterInterval) -> str:
    """Return a number with its interval, for the terminal."""
    return f"{one.value:.4g} ({one.low:.4g} … {one.high:.4g})"
