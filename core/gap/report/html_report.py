# SPDX-License-Identifier: GPL-3.0-or-later
"""report.html: one page, pictures inside, for someone who has to be convinced."""

from __future__ import annotations

import base64
from html import escape
from pathlib import Path
from typing import Any

from ...effects.engine.registry import form_of, kind_of
from ...model.sensor_parameters import unit_of
from ..forward.contact_phases import FEATURES
from ..selection.diagnosis import Diagnosis
from .plots import PICTURES

WIDE = 20.0
"""An interval that reaches so many times below and above the value tells nothing of it."""
STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #1c2430; max-width: 56rem; margin: 2rem auto; padding: 0 1rem }
h1 { font-size: 1.5rem; margin-bottom: 0 } h2 { font-size: 1.1rem; margin-top: 2rem }
.verdict { font-size: 1.15rem; padding: .8rem 1rem; border-left: 5px solid #1f5fa8; background: #f2f5f9 }
table { border-collapse: collapse } td, th { padding: .2rem .8rem .2rem 0; text-align: left; vertical-align: top }
th { font-weight: 600; border-bottom: 1px solid #9aa3ad } td.number { text-align: right; font-variant-numeric: tabular-nums }
figure { margin: 1.2rem 0 } figcaption { color: #68727f; font-size: .9rem } img { max-width: 100% }
.pair { display: flex; flex-wrap: wrap; gap: 1rem } .pair figure { flex: 1 1 20rem; margin: 0; max-width: 30rem }
"""


def render_page(result: Diagnosis, found: dict[str, Any], headline: str, pictures: list[str], folder: Path) -> str:
    """Return report.html.

    Parameters
    ----------
    found : dict
        What gap.json holds.
    headline : str
        The result in one sentence.
    pictures : list of str
        Names of those that were drawn into `folder`.
    """
    shown = {name: _picture(folder / f"{name}.png", PICTURES[name][1]) for name in pictures}
    rig = result.rig
    seconds = sum(float(t.time[-1] - t.time[0]) for t in rig.trials)
    uses = f"{_count(len(result.of('fit')), 'trial')} fitted, {len(result.of('check'))} for checking only"
    parts = [
        f"<h1>{escape(rig.name)}</h1>",
        f"<p>{_count(len(rig.texels), 'texel')}, {uses}, {seconds:.0f} s in all.</p>",
        f'<p class="verdict">{escape(headline)}</p>',
        '<div class="pair">' + shown.get("gap", "") + shown.get("loops", "") + "</div>",
        _gap_table(found),
        _found(found),
        _evidence(found),
        _numbers(result, found),
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


def _count(number: int, what: str) -> str:
    return f"{number} {what}" + ("" if number == 1 else "s")


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
    gap, bare = found["gap"], found["base"]["gap_without_friction"]
    rows = []
    for use, words in (("fit", "fitted trials"), ("check", "check trials, never fitted")):
        before, after = gap["before"][use], gap["after"][use]
        if before is None:
            continue
        floor = gap["noise_floor"]
        left = [max(value**2 - floor**2, 0.0) ** 0.5 for value in (before, after)]
        closed = f"{1.0 - left[1] / left[0]:.0%}" if left[0] > 0.2 * floor else "–"
        row = [words, f"{before:.3%}", f"{after:.3%}" if found["found"] else "–", f"{floor:.3%}"]
        rows.append([*row, closed if found["found"] else "–"])
        if bare is not None:
            rows[-1].insert(1, f"{bare[use]:.3%}")
    head = ["NRMSE, share of the range", "base", "amended", "noise floor", "gap closed, noise removed"]
    if bare is not None:
        head.insert(1, "base without its friction")
    return "<h2>The gap</h2>" + _table(head, rows, set(range(1, len(head))))


def _found(found: dict[str, Any]) -> str:
    words = []
    for one in found["found"]:
        kind, form = kind_of(one["effect"]), form_of(one["effect"], one["form"])
        words.append(
            f"<p><b>{escape(kind.title)}</b> ({escape(one['form'])}), confidence {one['confidence']:.0%}: {escape(kind.text)} "
            f"<i>{escape(form.formula)}</i> – {escape(form.reference)}.</p>"
        )
    return "<h2>What is missing</h2>" + ("".join(words) or "<p>Nothing was added.</p>")


def _evidence(found: dict[str, Any]) -> str:
    """How far each effect brings the error down, and how near another one came to that."""
    if not found["found"]:
        return ""
    rows = []
    for one in found["found"]:
        rival = one["next_best"]
        near = "none came near"
        if rival:
            much = "as much" if rival["leaves"] < 1.05 else f"{rival['leaves']:.2g} times as much"
            near = f"{rival['effect']}, which leaves {much}"
        rows.append([one["effect"], f"{one['gap_before']:.3%}", f"{one['gap_after']:.3%}", f"{one['confidence']:.0%}", near])
    text = (
        "<p>Error on the fitted trials without and with each effect, one after the other. The next best was fitted in its "
        "place; what it leaves is the squared error above the noise, on stretches that no fit had seen.</p>"
    )
    head = ["effect", "without", "with", "confidence", "next best in its place"]
    return "<h2>Evidence</h2>" + text + _table(head, rows, {1, 2, 3})


def _numbers(result: Diagnosis, found: dict[str, Any]) -> str:
    unit = result.rig.parameters.unit
    rows = []
    for name, value in found["base"]["parameters"].items():
        low, high = found["base"]["intervals"][name]
        rows.append(["base model", name, f"{value:.4g}", _interval(value, low, high), unit_of(name, unit)])
    for one in found["found"]:
        for parameter in form_of(one["effect"], one["form"]).parameters:
            value = one["parameters"].get(parameter.name)
            own = parameter.unit_of(unit)
            if isinstance(value, list):
                rows.append(
                    [one["effect"], parameter.name, f"{len(value)} numbers, {min(value):.3g} … {max(value):.3g}", "", own]
                )
            elif value is not None:
                low, high = one["intervals"].get(parameter.name, (value, value))
                rows.append([one["effect"], parameter.name, f"{value:.4g}", _interval(value, low, high), own])
    head = ["", "parameter", "value", "95 % interval", "unit"]
    what = "amended sensor" if found["found"] else "base model, refitted"
    return f"<h2>Parameters of the {what}</h2>" + _table(head, rows, {2, 3})


def _interval(value: float, low: float, high: float) -> str:
    """An interval in words; one that leaves the number's size open is none."""
    if (low >= 0.0 and high > WIDE * value and low * WIDE <= value) or high - low > WIDE**2 * abs(value) > 0.0:
        return "not told by these recordings"
    return f"{low:.4g} … {high:.4g}"


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
    """Effects with one reason in one row; those that were fitted first, the nearest on top."""
    reasons: dict[str, list[str]] = {}
    for entry in found["ruled_out"]:
        reasons.setdefault(entry["why"], []).append(entry["effect"])
    rows = [[", ".join(names), why] for why, names in reasons.items()]
    rows.sort(key=lambda row: (not any(sign.isdigit() for sign in row[1]), row[0]))
    return "<h2>What was ruled out</h2>" + _table(["effect", "why"], rows) if rows else ""


def _recording(result: Diagnosis) -> str:
    read, c = any(p.trial.reading is not None for p in result.predictors), result.coverage
    noise, unit = result.noise[0 if read else 1], result.rig.parameters.unit if read else "N"
    rows = [
        [f"noise of a {'reading' if read else 'net force'}", f"{noise.deviation:.3g} {unit}, from {noise.source}"],
        ["memory of the noise", "none" if noise.correlation_time < 1.5 else f"{noise.correlation_time:.3g} samples"],
        ["texels touched", f"{c.touched_share:.0%}"],
        ["fast to slow loading", f"{c.speed_ratio:.3g} to 1"],
        ["longest hold", f"{c.longest_hold:.3g} s"],
        ["cycles in one trial", f"{c.cycles}"],
        ["unloading recorded", "yes" if c.unloading else "no"],
        ["something without load", f"over {c.unloaded_share:.0%} of a trial"],
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
