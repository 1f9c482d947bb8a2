# SPDX-License-Identifier: GPL-3.0-or-later
"""Section 5.1: weights measured by the pad (Table 3), and a cube held by friction on a slope for twenty minutes (Fig. 9)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..core.figures.figure_canvas import new_figure, save_figure
from ..core.figures.figure_style import GREY, INK, NORMAL_COLOUR
from ..core.model.scenario import Scenario
from ..core.solver.simulation import run
from ..sample_blends import tilt, weighing
from . import experiment_tools
from .chapter import Chapter, Picture, Row, below, compare, draw_both

PRINTED = {0.1: ("0.9800 N", 0.98), 1.0: ("9.7999 N", 9.8), 4.0: ("—", 39.2), 10.0: ("97.9899 N", 98.0)}
PAPERS_GRAVITY = 9.8
"""m/s²: gravity with which Table 3 computes the required forces."""
SETTLED, MINUTES = 10.0, 20.0  # s, min of Fig. 9
FPS = 10


def weigh(folder: Path, progress: Callable) -> Chapter:
    """Table 3, and additionally 4 kg."""
    chapter = Chapter(
        "Weighing",
        "Table 3, section 5.1.1",
        "A cube of steel comes to rest on the level 14 × 6 pad (k = 1000 N/m, cn = 10 N·s/m, time step 0.1 ms, as in the "
        "paper) for two seconds; the row is the sum of all texels' normal forces at the end. Gravity is 9.8 m/s² here, as in "
        "Table 3.",
    )
    scene = experiment_tools.new_scene(weighing.build)
    scenario = replace(experiment_tools.scenario_of(scene), gravity=np.array([0.0, 0.0, -PAPERS_GRAVITY]))
    for mass, (printed, required) in PRINTED.items():
        recording = run(experiment_tools.with_mass(scenario, weighing.CUBE, mass))
        readings = recording.sensors[weighing.PAD]
        total, lit = float(readings.normal_force[-1].sum()), int(readings.contact[-1].sum())
        note = f"{lit} of {readings.contact.shape[1]} texels lit; the paper's tolerance is 1e-4"
        chapter.rows.append(compare(f"{mass:g} kg", printed, required, total, 1e-6 * required, "N", note))
        progress()
    experiment_tools.bake(scene, folder / "bake-weighing")
    chapter.pictures.append(
        Picture(
            experiment_tools.picture(scene, folder / "weighing.png", scene.frame_end),
            "1 kg at rest; the colours show each texel's force.",
        )
    )
    progress()
    return chapter


def hold(folder: Path, progress: Callable, minutes: float = MINUTES) -> Chapter:
    """Fig. 9: twenty simulated minutes on a slope."""
    chapter = Chapter(
        "Held on a slope",
        "Fig. 8b and 9, section 5.1.2",
        "1 kg on the pad tilted by 10 degrees. The paper's cube settles within ten seconds and keeps its place to ten decimals "
        "for twenty minutes. Ours has to as well, without putting bodies to sleep or freezing them. The bristles are as stiff "
        "as the foam (1000 N/m): with Table 2's 1 N/m they would carry 1.7 N only after 20 mm, and the cube would leave the "
        "pad before.",
    )
    scene = experiment_tools.new_scene(tilt.build)
    sampled = experiment_tools.scenario_of(scene)
    scenario = replace(sampled, fps=float(FPS), frame_end=sampled.frame_start + round(60 * minutes * FPS), dt=1e-3)
    recording = run(scenario)
    progress()
    times, path = recording.times, experiment_tools.path_of(recording, weighing.CUBE)
    moved = np.linalg.norm(path - path[0], axis=1)
    readings = recording.sensors[weighing.PAD]
    settled = times >= SETTLED
    wander = float(np.linalg.norm(path[settled] - path[settled][0], axis=1).max())
    # Both components of the weight, and how exactly the texels have to measure them
    weight = tilt.MASS * float(np.linalg.norm(scenario.gravity))
    slope = math.radians(tilt.TILT)
    along = float(np.hypot(readings.net_force[-1, 0], readings.net_force[-1, 1]))
    across = float(-readings.net_force[-1, 2])
    for name, share, force in (("along", math.sin(slope), along), ("across", math.cos(slope), across)):
        expected = weight * share
        chapter.rows.append(compare(f"force {name} the slope", "—", expected, force, 1e-4 * expected, "N", "relative 1e-4"))
    what = f"moved from 10 s to {60 * minutes:g} s"
    chapter.rows.append(
        below(what, "constant to 10 decimals", wander, 1e-10, "m", "largest distance from its position at 10 s")
    )
    chapter.rows.append(_with_table_2(sampled, weight * math.sin(slope)))
    progress()
    creep = draw_both(folder / "fig9-creep", lambda path: _draw_creep(path, times, moved))
    experiment_tools.bake(scene, folder / "bake-tilt")
    chapter.pictures += [
        Picture(experiment_tools.picture(scene, folder / "tilt.png", scene.frame_end), "1 kg held at 10 degrees."),
        Picture(creep, "Distance of the cube from its start (Fig. 9)."),
    ]
    progress()
    return chapter


def _with_table_2(scenario: Scenario, force: float) -> Row:
    """Return the row for bristles of 1 N/m: before they carry `force`, the cube has travelled over the pad's edge."""
    (sensor,) = scenario.sensors
    law = replace(sensor.parameters, sigma0=1.0, sigma1=0.1)
    soft = replace(scenario, sensors=(replace(sensor, parameters=law),), fps=24.0, frame_end=scenario.frame_start + 48)
    recording = run(soft)
    needed = force / (len(sensor.texels) * law.sigma0)
    lit = int(recording.sensors[weighing.PAD].contact[-1].sum())
    went = "it has left the pad" if lit == 0 else f"{lit} texels lit"
    return Row(
        "the same with Table 2's sigma0 = 1 N/m",
        "—",
        f"{needed * 1e3:.1f} mm of travel",
        f"after 2 s {went}",
        None,
        "m g sin 10° / (84 · 1 N/m); the cube's centre is over the edge after about 18 mm",
    )


def _draw_creep(path: Path, times: np.ndarray, moved: np.ndarray) -> None:
    """Draw the cube's distance from its start over time."""
    figure = new_figure(3.5, 2.5)
    axes = figure.add_axes((0.185, 0.18, 0.77, 0.77))
    axes.plot(times[1:], moved[1:] * 1e6, color=NORMAL_COLOUR, lw=1.3)
    axes.axvline(SETTLED, color=GREY, lw=0.6, ls="--")
    axes.text(SETTLED * 1.15, moved.max() * 0.15e6, "10 s", fontsize=8, color=GREY)
    axes.set_xscale("log")
    axes.set_xlabel("time (s)")
    axes.set_ylabel("distance from start (µm)")
    axes.set_ylim(0.0, None)
    axes.tick_params(labelsize=8, length=2.5, width=0.6, colors=INK)
    axes.spines[["top", "right"]].set_visible(False)
    save_figure(figure, path, 200)
