# SPDX-License-Identifier: GPL-3.0-or-later
"""Write docs/effects.md and its picture from the library of effects: python tools/effects_page.py."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np

from palpate.core.effects.engine.contact_forces import friction_factors, normal_forces
from palpate.core.effects.engine.readout_chain import readings
from palpate.core.effects.engine.registry import actual_placement, effect, library
from palpate.core.effects.engine.specification import TransducerArray, cycles
from palpate.core.figures.figure_canvas import new_figure, save_figure, tidy_axes
from palpate.core.figures.figure_style import GREY, SERIES
from palpate.core.model.sensor_parameters import SensorParameters

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "effects.md"
PICTURE = ROOT / "docs" / "images" / "effects.png"

INTRODUCTION = """\
# Effects

<!-- Written by tools/effects_page.py from core/effects; change it there. -->

An *effect* is a property of real sensors that the [base model](model.md) lacks. Most have several formulas, called *forms*; the
first is the default. In Blender: Physics › Palpate › Effects › *Add Effect*. In a script or a file:

```python
from palpate.core.effects.engine.registry import effect

sensor = dataclasses.replace(sensor, effects=(effect("creep", amount=0.3), effect("noise", "white", spread=2e-3, seed=1)))
```

```toml
[[effect]]                # in sensor.toml
name = "creep"
form = "exponential"
amount = 0.3
```

![Each effect in an experiment that shows it](images/effects.png)

*Base model in grey, forms in colour.*

## Where effects act

Effects act in the order of this page, whatever their order in the stack:

| site | what changes |
| --- | --- |
| contact | the contact law, without memory: forces, hence bodies and readings |
| pad | the same, with a memory in each contact point |
| readout | the reading only |

Readout forms act on the force in newtons, or, marked †, on `reading = zero + gain · force` in the unit of the sensor; their
defaults and bounds then scale with the gain. Forms marked ⚄ take a `seed`; random numbers depend on seed, texel and time only.
Time counts from the first frame.

*fₑ* is the elastic force (`k d`, or Hunt and Crossley's), to which damping is added after the effects of the pad; *f* the
resulting force, *r* the reading, *r₀* the reading before the effect. \\* marks one number per texel, or one for all.
"""


def page() -> str:
    """Return the text of docs/effects.md."""
    return "".join([INTRODUCTION, *(section(kind) for kind in library().values())])


def section(kind) -> str:
    """Return what the page says of one effect: formulas, parameters and the experiment that shows it."""
    lines = [f"\n## {kind.title}\n", f"`{kind.name}` · {kind.site}. {kind.text}", f"*Shown by:* {kind.experiment}.\n"]
    cited: set[str] = set()
    for form in kind.forms:
        source = source_of(form.reference, cited)
        site = kind.site_of(form)
        marks = f" ({site})" * (site != kind.site) + "†" * form.after_conversion + "⚄" * form.random
        formula = " ".join(form.formula.replace(" · ", "·").replace(" / ", "/").split())
        lines.append(f"- **{form.name}**{marks}: {formula}. *{source.removesuffix('.')}.*")
    return "\n".join([*lines, "", *parameter_lines(kind)]) + "\n"


def source_of(reference: str, cited: set[str]) -> str:
    """Return the works and sections of a reference, without what they are cited for; of a cited one the first author."""
    source = "; ".join(work.partition(": ")[0].replace(", section ", ", §") for work in reference.split("; "))
    if source in cited:
        return re.split(r",| (?=\(| et al)", source)[0]
    cited.add(source)
    return source


def parameter_lines(kind) -> list[str]:
    """Return one line for each parameter, and the forms that have it if another form gives the name another meaning."""
    forms: dict[tuple, list[str]] = {}
    for form in kind.forms:
        for p in form.parameters:
            unit = "" if p.unit == "1" else f" {p.unit}"
            forms.setdefault((p.name, f"{p.default:g}", unit, p.text, p.per_texel), []).append(form.name)
    names = [name for name, *_ in forms]
    lines = []
    for (name, default, unit, text, per_texel), having in forms.items():
        only = f" ({', '.join(having)})" if names.count(name) > 1 else ""
        lines.append(f"- `{name}={default}`{'*' * per_texel}{unit}{only}: {text}")
    return lines


# --- the picture

ROWS, COLUMNS, PITCH = 14, 6, 0.0034
LINE = 0.1
"""Share of a plot's height that each line of its legend takes, above the curves."""


def picture(path: Path) -> None:
    """Draw each effect in an experiment that shows it."""
    kinds = list(library().values())
    rows = -(-len(kinds) // 4)
    figure = new_figure(10.0, 2.32 * rows)
    grid = figure.subplots(rows, 4)
    for axes in grid.ravel()[len(kinds) :]:
        axes.set_axis_off()
    for axes, kind in zip(grid.ravel(), kinds, strict=False):
        DRAWINGS[kind.drawing.over](axes, kind)
        axes.set_title(kind.title, fontsize=9.5, loc="left", color="#1c2430")
    figure.subplots_adjust(left=0.055, right=0.985, top=0.972, bottom=0.04, wspace=0.34, hspace=0.5)
    save_figure(figure, path, 110)


def _setting():
    row, column = (index.ravel() for index in np.mgrid[0:ROWS, 0:COLUMNS])
    position = np.stack([column * PITCH, row * PITCH, np.zeros(ROWS * COLUMNS)], axis=1)
    return TransducerArray(position, np.full(len(position), PITCH**2), row, column), SensorParameters(k=1000.0, cn=0.0)


def _curves(axes, kind, x, base, of_form, xlabel, ylabel):
    """Draw the base model in grey and each form in colour, with the values that the kind states for its drawing."""
    if base is not None:
        axes.plot(x, base, color=GREY, lw=1.0, label="_")
    for form, colour in zip(kind.forms, SERIES, strict=False):
        if any(parameter.per_texel for parameter in form.parameters) and form.name not in kind.drawing.values:
            continue
        item = effect(kind.name, form.name, **{"seed": 1, **kind.drawing.values.get(form.name, {})})
        axes.plot(x, of_form(item), color=colour, lw=1.1, label=form.name)
    tidy_axes(axes)
    axes.set_xlabel(xlabel, labelpad=1)
    axes.set_ylabel(ylabel, labelpad=1)
    low, high = axes.get_ylim()
    axes.set_ylim(top=low + (high - low) / (1.0 - LINE * len(axes.get_legend_handles_labels()[0])))
    axes.legend(loc="best", fontsize=8, frameon=False, handlelength=1.0, borderpad=0.1, labelspacing=0.2)


def _pressed(time, depth, slide=None):
    """Return a function from effects to the readings of one texel over a history of depths."""
    site, parameters = _setting()
    one = type(site)(np.zeros((1, 3)), np.ones(1))
    slide = None if slide is None else slide[:, None]
    return lambda *items: readings(items, one, time, normal_forces(items, parameters, time, depth[:, None], slide))[:, 0]


def _force_over_depth(axes, kind):
    depth = kind.drawing.depth
    texel = _pressed(np.linspace(0, 20, len(depth)), depth)
    _curves(axes, kind, depth * 1e3, texel(), texel, "depth (mm)", "force (N)")


def _over_time(axes, kind):
    time = kind.drawing.time
    texel = _pressed(time, kind.drawing.depth)
    _curves(axes, kind, time, texel(), texel, "time (s)", "reading (N)")


def _reading_over_force(axes, kind):
    site, force = _setting()[0], np.linspace(0, 2, 801)
    one = type(site)(np.zeros((1, 3)), np.ones(1))
    texel = lambda item: readings((item,), one, force, force[:, None])[:, 0]  # noqa: E731
    _curves(axes, kind, force, force, texel, "force (N)", "reading (N)")


def _over_speed(axes, kind):
    v, p = np.linspace(0, 0.06, 400), SensorParameters()

    def drag(*items):
        factor, viscous = friction_factors(items, v, np.ones_like(v)) if items else (1.0, 0.0)
        return factor * (p.mud + (p.mus - p.mud) * np.exp(-((v / p.x0) ** 2))) + (viscous + p.ct) * v

    _curves(axes, kind, v * 1e3, drag(), drag, "sliding speed (mm/s)", "friction at 1 N (N)")


def _peaks(axes, kind):
    """Draw the peak reading of each of forty pressings under steady sliding."""
    time = np.linspace(0, 40, 4001)
    texel = _pressed(time, cycles(40, time), np.full(len(time), 1e-3))
    top = lambda *items: texel(*items)[1:].reshape(40, 100).max(axis=1)  # noqa: E731
    _curves(axes, kind, np.arange(1, 41), top(), top, "pressing", "peak (N)")


def _across(axes, kind):
    """Draw a column of the pad under a load on one texel."""
    site = _setting()[0]
    force = np.zeros((1, ROWS * COLUMNS))
    force[0, 7 * COLUMNS + 3] = 1.0
    column = lambda *items: readings(items, site, np.zeros(1), force)[0].reshape(ROWS, COLUMNS)[:, 3]  # noqa: E731
    _curves(axes, kind, np.arange(ROWS), column(), column, "row", "reading (N)")


def _texels(axes, kind):
    site = _setting()[0]
    force = np.ones((1, ROWS * COLUMNS))
    even = lambda *items: readings(items, site, np.zeros(1), force)[0][:36]  # noqa: E731
    _curves(axes, kind, np.arange(36), even(), even, "texel", "reading (N)")
    axes.set_ylim(bottom=0)


def _ball(axes, kind):
    """Draw the forces of a ball on the centre of the pad along one column."""
    site = _setting()[0]
    middle = site.position.mean(axis=0)
    up, across = np.tile([0.0, 0.0, 1.0], (len(site), 1)), np.tile([1.0, 0.0, 0.0], (len(site), 1))

    def forces_along_column(*items):
        position, _, _ = actual_placement(items, site.position, up, across)
        r = np.linalg.norm((position - middle)[:, :2], axis=1)
        depth = np.maximum(position[:, 2] + 0.002 - 0.04 + np.sqrt(np.maximum(0.04**2 - r**2, 0)), 0)
        return 1000.0 * depth.reshape(ROWS, COLUMNS)[:, 3]

    _curves(axes, kind, np.arange(ROWS), forces_along_column(), forces_along_column, "row", "force of a ball (N)")


DRAWINGS = {
    "time": _over_time,
    "depth": _force_over_depth,
    "force": _reading_over_force,
    "speed": _over_speed,
    "pressings": _peaks,
    "row": _across,
    "texel": _texels,
    "ball": _ball,
}
"""What draws the experiments of core/effects/engine/specification.py."""


def main() -> int:
    """Write both files."""
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
    picture(PICTURE)
    print(f"wrote {PAGE} and {PICTURE}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
