# SPDX-License-Identifier: GPL-3.0-or-later
"""What `palpate gap` leaves behind: gap.json, sensor.toml, report.html and its pictures (docs/gap.md describes them)."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import Any

from ..effects.library import form_of, kind_of
from ..formats.files import atomic_write
from ..formats.sensor_toml import write_sensor
from .amend import Number, amended, next_experiment, normalised, numbers, stages
from .compare import noise_floor, nrmse, where
from .diagnose import Diagnosis
from .phases import FEATURES
from .plots import PICTURES, draw

FORMAT = "palpate-gap/1"
SURE = 0.5
"""Confidence from which a name is meant as one."""


def summary(result: Diagnosis) -> dict[str, Any]:
    """Return what gap.json holds."""
    model, counted = normalised(result), numbers(result)
    fit, check = result.of("fit"), result.of("check")
    models = stages(result)
    after = [nrmse(fit, one, result.full) for one in models]
    found = []
    for named in result.named:
        effect = model.effects[named.effect]
        own = [one for one in counted if one.effect == named.effect]
        found.append(
            {
                "effect": named.name,
                "form": named.form,
                "parameters": {key: _plain(value) for key, value in effect.values.items()},
                "intervals": {one.name: [one.low, one.high] for one in own},
                "confidence": named.confidence,
                "gap_after": after[min(named.effect + 1, len(after) - 1)],
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
        },
        "gap": {
            "before": {use: nrmse(trials, result.base.model, result.full) for use, trials in (("fit", fit), ("check", check))},
            "after": {use: nrmse(trials, result.best.model, result.full) for use, trials in (("fit", fit), ("check", check))},
            "noise_floor": noise_floor(result),
        },
        "where": where(result, result.base.model),
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
    sunk = max((p.stimulus.sunk for p in result.predictors), default=0)
    if sunk:
        said.append(
            f"Up to {sunk} texels were pressed past the maximum penetration of "
            f"{result.rig.parameters.max_penetration * 1e3:.3g} mm; here they go on acting, in a simulation they would not."
        )
    if not result.of("check"):
        said.append('No trial is for checking only: give one use = "check", so that the result can be judged on it.')
    if len(result.of("fit")) == 1:
        said.append("Only one trial was fitted: halves of it had to judge each other.")
    return said


def write(result: Diagnosis, folder: Path) -> Iterator[tuple[str, float]]:
    """Write everything into a folder, gap.json last.

    Yields
    ------
    what : str
    share : float
    """
    yield "writing the amended sensor", 0.0
    write_sensor(folder / "sensor.toml", amended(result))
    yield "drawing", 0.1
    pictures = draw(result, folder)
    yield "writing the report", 0.9
    found = summary(result)
    with atomic_write(folder / "report.html") as temporary:
        temporary.write_text(page(result, found, pictures, folder), encoding="utf-8")
    with atomic_write(folder / "gap.json") as temporary:
        temporary.write_text(json.dumps(found, indent=2, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")
    yield "done", 1.0


def headline(result: Diagnosis) -> str:
    """Return the result in one sentence."""
    before = nrmse(result.of("fit"), result.base.model, result.full) or 0.0
    after = nrmse(result.of("fit"), result.best.model, result.full) or 0.0
    sure = [n for n in result.named if n.confidence >= SURE]
    if result.verdict == "no gap":
        return f"No gap: the base model with its own parameters refitted leaves {before:.2%} of the range, which is noise."
    if result.verdict == "unexplained":
        strongest = FEATURES.get(result.structure.strongest, "nothing that was looked at")
        part = f" {_names([n.name for n in sure])} is part of it." if sure else ""
        return f"Unexplained: what is left ({after:.2%} of the range) varies most with {strongest}.{part}"
    shrink = f"the error shrinks from {before:.2%} to {after:.2%} of the range"
    if result.ambiguous:
        choices = "; ".join(" or ".join(names) for names in result.ambiguous)
        rest = f" {_names([n.name for n in sure])} is missing for sure." if sure else ""
        return f"Not told apart by these recordings: {choices} ({shrink}).{rest}"
    return f"Missing: {_names([n.name for n in result.named])}; {shrink}."


def evidence(result: Diagnosis) -> list[str]:
    """Return a sentence for each effect that was found, and one for the recordings that only judge."""
    models = stages(result)
    left = [nrmse(result.of("fit"), one, result.full) or 0.0 for one in models]
    said = []
    for named in result.named:
        rivals = f"; it could as well be {' or '.join(named.rivals)}" if named.rivals else ""
        before, after = left[named.effect], left[min(named.effect + 1, len(left) - 1)]
        said.append(f"{named.name} ({named.form}): {before:.2%} → {after:.2%}, confidence {named.confidence:.0%}{rivals}")
    check = result.of("check")
    if check and result.named:
        before, after = (nrmse(check, one, result.full) or 0.0 for one in (models[0], models[-1]))
        said.append(f"never fitted: {before:.2%} → {after:.2%}; noise alone is {noise_floor(result):.2%}")
    return said


def _names(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}" if names else "nothing"


STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #1c2430; max-width: 56rem; margin: 2rem auto; padding: 0 1rem }
h1 { font-size: 1.5rem; margin-bottom: 0 } h2 { font-size: 1.1rem; margin-top: 2rem }
.verdict { font-size: 1.15rem; padding: .8rem 1rem; border-left: 5px solid #1f5fa8; background: #f2f5f9 }
table { border-collapse: collapse } td, th { padding: .2rem .8rem .2rem 0; text-align: left; vertical-align: top }
th { font-weight: 600; border-bottom: 1px solid #9aa3ad } td.number { text-align: right; font-variant-numeric: tabular-nums }
figure { margin: 1.2rem 0 } figcaption { color: #68727f; font-size: .9rem } img { max-width: 100% }
.pair { display: flex; flex-wrap: wrap; gap: 1rem } .pair figure { flex: 1 1 20rem; margin: 0 }
"""


def page(result: Diagnosis, found: dict[str, Any], pictures: list[str], folder: Path) -> str:
    """Return report.html: one file, pictures inside."""
    shown = {name: _picture(folder / f"{name}.png", PICTURES[name][1]) for name in pictures}
    rig = result.rig
    seconds = sum(float(t.time[-1] - t.time[0]) for t in rig.trials)
    uses = f"{len(result.of('fit'))} trials fitted, {len(result.of('check'))} for checking only"
    parts = [
        f"<h1>{escape(rig.name)}</h1>",
        f"<p>{len(rig.texels)} texels, {uses}, {seconds:.0f} s in all.</p>",
        f'<p class="verdict">{escape(headline(result))}</p>',
        '<div class="pair">' + shown.get("gap", "") + shown.get("loops", "") + "</div>",
        _gap_table(found),
        _found_table(result, found),
        _open_questions(found),
        "<h2>Before and after</h2>" + shown.get("curves", ""),
        "<h2>Where the error sits</h2>",
        '<div class="pair">' + shown.get("map", "") + shown.get("phases", "") + "</div>",
        _varies_table(found),
        _ruled_out(found),
        _recording(result),
        f"<h2>Method</h2><p>{METHOD}</p>",
    ]
    title = escape(f"Gap of {rig.name}")
    body = "\n".join(parts)
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>{STYLE}</style></head>\n'
        f"<body>\n{body}\n</body></html>\n"
    )


def _picture(path: Path, caption: str) -> str:
    data = base64.b64encode(path.read_bytes()).decode()
    text = escape(caption)
    return f'<figure><img alt="{text}" src="data:image/png;base64,{data}"><figcaption>{text}</figcaption></figure>'


def _table(head: list[str], rows: list[list[str]], numeric: set[int] = frozenset()) -> str:  # type: ignore[assignment]
    lines = ["<table><tr>" + "".join(f"<th>{escape(cell)}</th>" for cell in head) + "</tr>"]
    for row in rows:
        cells = (f'<td class="number">{escape(c)}</td>' if i in numeric else f"<td>{escape(c)}</td>" for i, c in enumerate(row))
        lines.append("<tr>" + "".join(cells) + "</tr>")
    return "\n".join([*lines, "</table>"])


def _gap_table(found: dict[str, Any]) -> str:
    gap = found["gap"]
    rows = []
    for use, words in (("fit", "fitted trials"), ("check", "check trials, never fitted")):
        before, after = gap["before"][use], gap["after"][use]
        if before is None:
            continue
        floor = gap["noise_floor"]
        left = [max(value**2 - floor**2, 0.0) ** 0.5 for value in (before, after)]
        closed = f"{1.0 - left[1] / left[0]:.0%}" if left[0] > 0.2 * floor else "–"
        rows.append([words, f"{before:.3%}", f"{after:.3%}", f"{floor:.3%}", closed])
    head = ["NRMSE, share of the range", "base", "amended", "noise floor", "gap closed, noise removed"]
    return "<h2>The gap</h2>" + _table(head, rows, {1, 2, 3, 4})


def _found_table(result: Diagnosis, found: dict[str, Any]) -> str:
    units = {"k": "N/m", "cn": "N·s/m", "ct": "N·s/m", "sigma0": "N/m", "x0": "m/s", "zero": result.rig.parameters.unit}
    rows = []
    for name, value in found["base"]["parameters"].items():
        low, high = found["base"]["intervals"][name]
        rows.append(["base model", name, f"{value:.4g}", f"{low:.4g} … {high:.4g}", units.get(name, "")])
    words = []
    for one in found["found"]:
        kind, form = kind_of(one["effect"]), form_of(one["effect"], one["form"])
        words.append(
            f"<p><b>{escape(kind.title)}</b> ({escape(one['form'])}), confidence {one['confidence']:.0%}: {escape(kind.text)} "
            f"<i>{escape(form.formula)}</i> – {escape(form.reference)}.</p>"
        )
        for parameter in form.parameters:
            value = one["parameters"].get(parameter.name)
            if isinstance(value, list):
                text = f"{len(value)} numbers, {min(value):.3g} … {max(value):.3g}"
                rows.append([one["effect"], parameter.name, text, "", parameter.unit])
            elif value is not None:
                low, high = one["intervals"].get(parameter.name, (value, value))
                rows.append([one["effect"], parameter.name, f"{value:.4g}", f"{low:.4g} … {high:.4g}", parameter.unit])
    head = ["", "parameter", "value", "95 % interval", "unit"]
    return "<h2>What is missing</h2>" + ("".join(words) or "<p>Nothing was added.</p>") + _table(head, rows, {2, 3})


def _open_questions(found: dict[str, Any]) -> str:
    lines = []
    for names in found["ambiguous"]:
        lines.append(f"These recordings do not tell {' from '.join(escape(name) for name in names)}.")
    if found["next_experiment"]:
        lines.append(escape(found["next_experiment"]))
    lines += [escape(text) for text in found["warnings"]]
    return "<h2>Open questions</h2><ul>" + "".join(f"<li>{line}</li>" for line in lines) + "</ul>" if lines else ""


def _varies_table(found: dict[str, Any]) -> str:
    rows = []
    order = sorted(found["varies_with"], key=lambda key: -found["varies_with"][key])
    for key in order:
        before, after = found["varies_with"][key], found["left_varies_with"].get(key, 0.0)
        rows.append([FEATURES.get(key, key), f"{before:.1%}", f"{after:.1%}"])
    text = (
        "<p>Share of the squared residual that a regression on each predicts in trials it has not seen; noise gives zero.</p>"
    )
    return "<h2>What the residual varies with</h2>" + text + _table(["", "base", "amended"], rows, {1, 2})


def _ruled_out(found: dict[str, Any]) -> str:
    rows = [[entry["effect"], entry["why"]] for entry in found["ruled_out"]]
    return "<h2>What was ruled out</h2>" + _table(["effect", "why"], rows) if rows else ""


def _recording(result: Diagnosis) -> str:
    noise, c = result.noise[0], result.coverage
    rows = [
        ["noise of a reading", f"{noise.deviation:.3g} {result.rig.parameters.unit} ({noise.source})"],
        ["noise is new after", f"{noise.memory:.3g} samples"],
        ["texels touched", f"{c.texels:.0%}"],
        ["fast to slow loading", f"{c.rates:.3g} to 1"],
        ["longest hold", f"{c.longest_hold:.3g} s"],
        ["cycles in one trial", f"{c.cycles}"],
        ["unloading recorded", "yes" if c.unloading else "no"],
        ["sliding", "yes" if c.slides else "no"],
    ]
    trials = [
        [t.name, t.use, t.stimulus, f"{len(t.time)}", f"{t.time[-1] - t.time[0]:.3g} s", f"{1.0 / t.step:.4g} Hz"]
        for t in result.rig.trials
    ]
    head = ["trial", "use", "stimulus", "samples", "length", "rate"]
    return "<h2>The recordings</h2>" + _table(["", ""], rows) + "<p></p>" + _table(head, trials, {3, 4, 5})


METHOD = """
The base model's own parameters are refitted first. Then every form of every effect is fitted jointly with them and judged by
its squared error on recordings that the fit has not seen; an effect is kept when it closes enough of the gap there, further
ones when they close enough of what is left. NRMSE is the root mean square of measured minus simulated over all samples and
channels, divided by the range of the measurements. Intervals allow for coloured noise (sums of gradients by texel and trial)
and for formulas that are not quite the sensor's (by trial).
"""


def interval_text(one: Number) -> str:
    """Return a number with its interval, for the terminal."""
    return f"{one.value:.4g} ({one.low:.4g} … {one.high:.4g})"
