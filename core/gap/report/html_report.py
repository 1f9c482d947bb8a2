# SPDX-License-Identifier: GPL-3.0-or-later
"""report.html: one page with its pictures inside, for a reader who has to be convinced."""

from __future__ import annotations

import base64
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...effects.engine.registry import form_of, kind_of
from ...errors import counted
from ...figures.html_templates import render_html
from ...model.sensor_parameters import unit_of
from ..fitting.least_squares import BASE
from ..forward.contact_phases import FEATURES
from ..selection.findings import Diagnosis
from .comparison import closed_share, recording_errors
from .plan_files import planned_sentence
from .plots import CAPTIONS
from .sentences import NOT_IDENTIFIABLE, interval_ends, said_confidence

AS_MUCH = 1.05
"""Up to this ratio the next best effect leaves "as much"."""
WHITE_MEMORY = 1.5
"""Correlation time in samples up to which noise counts as white."""


@dataclass(frozen=True)
class Table:
    """A table of the page: its head, its rows, and the columns that hold numbers."""

    head: list[str]
    rows: list[list[str]]
    numeric: set[int] = field(default_factory=set)


def html_report(result: Diagnosis, found: dict[str, Any], headline: str, pictures: list[str], folder: Path) -> str:
    """Return report.html.

    Parameters
    ----------
    result : Diagnosis
    found : dict
        Contents of gap.json.
    headline : str
        The result in one sentence.
    pictures : list of str
        Names of the pictures that were drawn into `folder`.
    folder : Path
    """
    return render_html(
        Path(__file__).parent / "templates" / "report.html",
        name=result.rig.name,
        extent=_extent(result),
        headline=headline,
        captions=CAPTIONS,
        pictures={name: base64.b64encode((folder / f"{name}.png").read_bytes()).decode() for name in pictures},
        gap=_gap_table(found),
        effects=[(kind_of(one["effect"]), form_of(one["effect"], one["form"]), one) for one in found["found"]],
        said_confidence=said_confidence,
        evidence=_evidence_table(found),
        parameters=_parameter_table(result, found),
        questions=_open_questions(found),
        varies_with=_structure_table(found),
        ruled_out=_ruled_out_table(found),
        recordings=_recordings_table(result),
        trials=_trials_table(result, found),
    )


def _extent(result: Diagnosis) -> str:
    """How much was recorded."""
    trials = result.rig.trials
    seconds = sum(float(t.time[-1] - t.time[0]) for t in trials)
    uses = f"{counted(len(result.of('fit')), 'trial')} fitted, {len(result.of('check'))} for checking only"
    return f"{counted(len(result.rig.texels), 'texel')}, {uses}, {seconds:.0f} s in all."


def _gap_table(found: dict[str, Any]) -> Table:
    """Errors of the models on fitted and on check trials."""
    gap, frictionless, floor = found["gap"], found["base"]["gap_without_friction"], found["gap"]["noise_floor"]
    rows, without = [], [] if frictionless is None else ["base without its friction"]
    head = ["NRMSE, share of the range", *without, "base", "amended", "noise floor", "squared gap closed, noise removed"]
    for use, words in (("fit", "fitted trials"), ("check", "check trials, never fitted")):
        before, after = gap["before"][use], gap["after"][use]
        if before is None:
            continue
        share = closed_share(before, after, floor)
        closed = "–" if share is None else f"{share:.0%}"
        amended = [f"{after:.3%}", f"{floor:.3%}", closed] if found["found"] else ["–", f"{floor:.3%}", "–"]
        rows.append([words, *(f"{frictionless[use]:.3%}" for _ in without), f"{before:.3%}", *amended])
    return Table(head, rows, set(range(1, len(head))))


def _evidence_table(found: dict[str, Any]) -> Table:
    """How much each effect reduces the error, and how much the next best one leaves in its place."""
    rows = []
    for one in found["found"]:
        rival = one["next_best"]
        near = "no close alternative"
        if rival:
            much = "as much" if rival["leaves"] < AS_MUCH else f"{rival['leaves']:.2g} times as much"
            is_open = any(one["effect"] == group[0] and rival["effect"] in group for group in found["ambiguous"])
            near = f"{rival['effect']}, which {'is not distinguished from it' if is_open else f'leaves {much}'}"
        errors = [f"{one[key]:.3%}" for key in ("gap_before", "gap_after")]
        rows.append([one["effect"], *errors, said_confidence(one["confidence"]), near])
    return Table(["effect", "without", "with", "confidence", "next best in its place"], rows, {1, 2, 3})


def _parameter_table(result: Diagnosis, found: dict[str, Any]) -> Table:
    """Fitted parameters with their intervals."""
    unit = result.rig.parameters.unit
    ends = {(one.effect, one.name): interval_ends(one) for one in result.intervals}
    rows = []
    for name, value in found["base"]["parameters"].items():
        rows.append(["base model", name, *_value_and_ends(value, ends[BASE, name]), unit_of(name, unit)])
    for index, one in zip((finding.effect for finding in result.findings), found["found"], strict=True):
        for parameter in form_of(one["effect"], one["form"]).parameters:
            value = one["parameters"].get(parameter.name)
            if value is None:
                continue
            if isinstance(value, list):
                said = f"{len(value)} numbers, {min(value):.3g} … {max(value):.3g}", ""
            else:
                said = _value_and_ends(value, ends.get((index, parameter.name), ""))
            rows.append([one["effect"], parameter.name, *said, parameter.unit_of(unit)])
    return Table(["", "parameter", "value", "95 % interval", "unit"], rows, {2, 3})


def _value_and_ends(value: float, ends: str) -> tuple[str, str]:
    """A parameter's value and the ends of its interval; no value where the recordings leave it open."""
    return "–" if ends == NOT_IDENTIFIABLE else f"{value:.4g}", ends


def _open_questions(found: dict[str, Any]) -> list[str]:
    """Rivals, the next experiment with its file, and warnings."""
    lines = [f"These recordings do not distinguish {' from '.join(names)}." for names in found["ambiguous"]]
    planned = found["planned_experiment"]
    lines += [found["next_experiment"], planned_sentence(planned) if planned else ""]
    return [*filter(None, lines), *found["warnings"]]


def _structure_table(found: dict[str, Any]) -> Table:
    """Features on which the residual depends, before and after."""
    shares, after = sorted(found["varies_with"].items(), key=lambda item: -item[1]), found["left_varies_with"]
    rows = [[FEATURES[key], f"{share:.1%}", f"{after.get(key, 0.0):.1%}"] for key, share in shares]
    return Table(["", "base", "amended"], rows, {1, 2})


def _ruled_out_table(found: dict[str, Any]) -> Table:
    """Effects with the same reason share a row; those that were fitted come first."""
    reasons: dict[str, list[str]] = {}
    for entry in found["ruled_out"]:
        reasons.setdefault(entry["why"], []).append(entry["effect"])
    rows = [[", ".join(names), why] for why, names in reasons.items()]
    rows.sort(key=lambda row: (not any(sign.isdigit() for sign in row[1]), row[0]))
    return Table(["effect", "why"], rows)


def _recordings_table(result: Diagnosis) -> Table:
    """Noise of the recordings, and what was done to the sensor in them."""
    has_readings, c = any(p.trial.reading is not None for p in result.predictors), result.coverage
    noise, unit = result.noise[0 if has_readings else 1], result.rig.parameters.unit if has_readings else "N"
    memory = "none" if noise.correlation_time < WHITE_MEMORY else f"{noise.correlation_time:.3g} samples"
    rows = [
        [f"noise of a {'reading' if has_readings else 'net force'}", f"{noise.deviation:.3g} {unit}, from {noise.source}"],
        ["noise correlation", memory],
        ["texels touched", f"{c.touched_share:.0%}"],
        ["fast to slow loading", f"{c.speed_ratio:.3g} to 1"],
        ["longest hold", f"{c.longest_hold:.3g} s"],
        ["cycles in one trial", f"{c.cycles}"],
        ["unloading recorded", "yes" if c.unloading else "no"],
        ["span of unloaded samples", f"{c.unloaded_share:.0%} of a trial"],
        ["sliding", "yes" if c.slides else "no"],
    ]
    return Table(["", ""], rows)


def _trials_table(result: Diagnosis, found: dict[str, Any]) -> Table:
    """One row for each trial, with its errors."""
    errors = {one["trial"]: one for one in (*found["fitted"], *recording_errors(result, "check"))}
    rows = []
    for t in result.rig.trials:
        length, one = f"{t.time[-1] - t.time[0]:.3g} s", errors[t.name]
        left = [f"{one[key]:.3%}" if one[key] is not None else "–" for key in ("before", "after")]
        rows.append([t.name, t.use, t.stimulus, f"{len(t.time)}", length, f"{1.0 / t.step:.4g} Hz", *left])
    return Table(["trial", "use", "stimulus", "samples", "length", "rate", "base", "amended"], rows, {3, 4, 5, 6, 7})
