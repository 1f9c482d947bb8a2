# SPDX-License-Identifier: GPL-3.0-or-later
"""Sections 3.4 and 4: stiffness from foam (Fig. 6), friction from a curve (Fig. 7), the definition in XML (Table 2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..core.gap.calibration.friction import FrictionData, fit_friction, friction_over_time, steady_friction
from ..core.gap.calibration.plots import plot_friction, plot_stiffness
from ..core.gap.calibration.stiffness import FoamData, fit_stiffness, texel_stiffness
from ..core.gap.dataset.column_names import GRAVITY
from ..core.model.sensor_parameters import SensorParameters
from ..core.simulators.openrave_file import OpenRaveSensor, openrave_xml, read_openrave
from .chapter import Chapter, Picture, Row, compare, draw_both

AREA, TEXELS = 0.00125, 84  # m², and how many texels share it (section 3.4.1)
PRESSURE, COMPRESSION = 9810.0, 2.5e-3  # Pa at m: the printed reference point
WEIGHT_AREA, WEIGHT = 804.25e-6, 0.30415  # m², kg
LOAD = 0.08  # N on a texel, Fig. 7


def stiffness(folder: Path, progress: Callable) -> Chapter:
    """Evaluate Eq. 18 on the printed inputs, and fit both lines of Fig. 6 to a foam like the paper's."""
    chapter = Chapter(
        "Stiffness from the compression of the foam",
        "Eq. 18, Fig. 6, section 3.4.1",
        "Eq. 18 evaluated on the paper's printed inputs. The paper shows its measurements only as a plot, so the picture fits "
        "twelve synthetic points on a line like that of Fig. 6: as stiff as the reference point, without force up to 0.3 mm, "
        "with 150 Pa of noise.",
    )
    k = texel_stiffness(PRESSURE, AREA, TEXELS, COMPRESSION)
    chapter.rows += [
        compare("k of a texel, Eq. 18", "58.5 N/m", 58.392857, k, 1e-6, "N/m", "the print is 0.2 % off its own inputs"),
        compare(
            "pressure of 304.15 g on 804.25 mm²", "9810 Pa", 3708.7, WEIGHT * GRAVITY / WEIGHT_AREA, 0.1, "Pa",
            "9810 Pa would need 804 g",
        ),
    ]  # fmt: skip
    x = np.linspace(0.5e-3, 3.8e-3, 12)
    noise = np.random.default_rng(66).normal(0.0, 150.0, len(x))
    slope = PRESSURE / COMPRESSION
    fit = fit_stiffness(FoamData(x, slope * (x - 0.3e-3) + noise), AREA, TEXELS)
    chapter.rows += [
        Row("line through zero, synthetic foam", "—", "—", fit.k.text("N/m"), None, "the line that the model uses"),
        compare("line with offset, synthetic foam", "—", k, fit.k_offset.value, 0.05 * k, "N/m", "noise of 150 Pa"),
        compare("compression without force", "—", 0.3, fit.dead_zone * 1e3, 0.05, "mm", "noise of 150 Pa"),
    ]
    foam = draw_both(folder / "fig6-foam", lambda path: plot_stiffness(path, fit))
    chapter.pictures.append(Picture(foam, "Foam compression with both straight lines (synthetic points)."))
    progress()
    return chapter


def friction(folder: Path, progress: Callable) -> Chapter:
    """Compute the curve of Fig. 7 from its printed parameters, and recover these by a fit."""
    chapter = Chapter(
        "Friction from a force–velocity curve",
        "Eq. 9, 10, 13, Fig. 7, section 3.4.2",
        "The paper fits its curve by hand. Here a recording is computed from the printed parameters (velocity rising by "
        "0.05 m/s every second from rest, 0.3 mN of noise), and the fit has to recover them. Presliding causes the rise at "
        "the left, which steady sliding does not show.",
    )
    law = SensorParameters(sigma0=1.0, sigma1=0.1, x0=0.3, ct=0.01, mus=0.435, mud=0.23)
    time = np.linspace(0.0, 28.0, 560)
    velocity = 0.05 * time
    noise = np.random.default_rng(7).normal(0.0, 3e-4, len(time))
    force = friction_over_time(time, velocity, LOAD, law)
    fit = fit_friction(FrictionData(velocity, force + noise, time), LOAD, replace(law, sigma0=3.0, sigma1=0.02))
    for name, estimate in fit.estimates.items():
        truth = getattr(law, name)
        reach = max(1.5 * (estimate.high - estimate.low) / 2, 1e-12)
        chapter.rows.append(
            compare(name, f"{truth:g}", truth, estimate.value, reach, "", f"95 %: {estimate.low:.3g} to {estimate.high:.3g}")
        )
    peak, fast, floor = map(float, steady_friction(np.array([0.0, 1.0, 5.0]), LOAD, law))
    chapter.rows += [
        compare("friction at which sliding begins", "0.0348 N (mus · 0.08 N)", 0.0348, peak, 1e-12, "N"),
        compare("friction at 5 m/s", "—", 0.0184 + 0.05, floor, 1e-9, "N", "mud · fn + ct · v"),
        Row(
            "g of Eq. 10 at 1 m/s",
            "negative",
            "0.0184 N",
            f"{fast - law.ct:.4f} N",
            None,
            "the printed formula lacks its exponential",
        ),
    ]
    curve = draw_both(folder / "fig7-friction", lambda path: plot_friction(path, fit))
    chapter.pictures.append(Picture(curve, "Friction of one texel under 0.08 N."))
    progress()
    return chapter


def definition(folder: Path, progress: Callable) -> Chapter:
    """Write Table 2 as XML, read it and write it again."""
    chapter = Chapter(
        "The definition in OpenRAVE's XML",
        "Table 2, section 4",
        "The printed table has spaces inside its tags, which no XML reader accepts; this is the table without them.",
    )
    path = folder / "table2.xml"
    text = openrave_xml([OpenRaveSensor("T1", "object1", SensorParameters())])
    path.write_text(text, encoding="utf-8")
    back = read_openrave(path)
    again = openrave_xml(back)
    chapter.rows += [
        _equal("values of Table 2 after a round trip", "to the last bit", back[0].parameters == SensorParameters()),
        _equal("text after a round trip", "to the letter", again == text),
    ]
    progress()
    return chapter


def _equal(what: str, how: str, equal: bool) -> Row:
    return Row(what, "—", f"equal {how}", "equal" if equal else "differs", equal)
