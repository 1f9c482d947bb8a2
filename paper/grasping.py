# SPDX-License-Identifier: GPL-3.0-or-later
"""Sections 5.2 and 5.3: four objects between two pads (Fig. 10), pick and place (Fig. 11, 12), finger and thumb (Fig. 13)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from ..core.figures.figure_canvas import save_figure
from ..core.figures.figure_style import FigureStyle
from ..core.figures.tactile_strip import strip_figure
from ..core.figures.texel_numbers import texel_numbers
from ..core.figures.time_curves import curves_figure
from ..core.model.recording import Recording
from ..core.model.scenario import Scenario
from ..core.solver.simulation import run
from ..sample_blends import grasps, gripper, hand, pick_and_place
from . import experiment_tools
from .chapter import Chapter, Picture, Row, below, compare, draw_both

STYLE = FigureStyle(colour_map="PAPER", width="single")
"""White is no force and black the largest force, as in the paper."""
HOLD, LAST = 60.0, 10.0
"""Seconds that an object is held, and seconds at the end during which it must not move."""
STILL = 1e-6  # m
HEAVY_KIND, LIGHT, HEAVY = "box", 0.16, 0.40  # kg: masses of the box below and above the limit of friction
FALLEN = 5e-3
"""Metres of descent from which on a box counts as slipping. A held box sinks by half a millimetre while the bristles bend."""


def four_objects(folder: Path, progress: Callable) -> Chapter:
    """Fig. 10: tactile images of a sphere, a box, a cylinder and a spray bottle between two pads, and whether these hold."""
    chapter = Chapter(
        "Four objects between two fingers",
        "Fig. 10, section 5.2.1",
        "Two coupled fingers of a parallel gripper close on an object that stands on a table, until the left one measures 3 N; "
        "then the table is lowered and the object is held for a minute. For each object: the grasp, the tactile images of both "
        "fingers (white 0, black the largest force), and the normal force of each texel of the right finger.",
    )
    for kind in grasps.OBJECTS:
        _one_object(chapter, kind, folder, progress)
    return chapter


def _one_object(chapter: Chapter, kind: str, folder: Path, progress: Callable) -> None:
    """Add the pictures and rows of one object."""
    name = grasps.OBJECTS[kind].name
    scene = experiment_tools.new_scene(partial(grasps.build, kind=kind))
    scenario = experiment_tools.scenario_of(scene)
    texels = {sensor.name: sensor.texels for sensor in scenario.read_out}
    recording = experiment_tools.bake(scene, folder / f"bake-grasp-{kind}")
    last = int(recording.frames[-1])
    numbers = draw_both(
        folder / f"fig10-{kind}-numbers", lambda path: texel_numbers(path, recording, texels, gripper.RIGHT, last, STYLE)
    )
    chapter.pictures += [
        Picture(experiment_tools.picture(scene, folder / f"fig10-{kind}.png", last), f"{name}: the grasp."),
        _strip(folder / f"fig10-{kind}-images", recording, texels, [last], f"{name}: both pads."),
        Picture(numbers, f"{name}: each texel of the right finger."),
    ]
    progress()
    chapter.rows += held_rows(scenario, name, gripper.LEFT, grasps.FORCE)
    progress()


def held_rows(scenario: Scenario, name: str, controlled: str, force: float, seconds: float = HOLD) -> list[Row]:
    """Return the rows of a long hold: the controlled sum, and how far the object moved in the last ten seconds."""
    held = run(replace(scenario, frame_end=scenario.frame_start + round(seconds * scenario.fps)))
    path = experiment_tools.path_of(held, name)
    last = held.times >= held.times[-1] - LAST
    drift = float(np.linalg.norm(path[last] - path[last][0], axis=1).max())
    total = float(held.sensors[controlled].normal_force[-1].sum())
    return [
        compare(
            f"{name.lower()}: sum of the {controlled.lower()}", "—", force, total, 1e-6, "N", "the set point of the controller"
        ),
        below(
            f"{name.lower()}: moved in the last 10 s of {seconds:g} s",
            "—",
            drift,
            STILL,
            "m",
            "bodies are not put to sleep or frozen",
        ),
    ]


def too_heavy(folder: Path, progress: Callable) -> Chapter:
    """Find by bisection how much two pads hold, and compare it with Coulomb's limit."""
    chapter = Chapter(
        "The largest mass that friction holds",
        "section 5.2.1, with Eq. 11",
        "The box again, with several masses: a bisection finds the one that just slips out of the fingers. By Coulomb's law, "
        "two pads with 3 N each hold 2 · mus · 3 N.",
    )
    scene = experiment_tools.new_scene(partial(grasps.build, kind=HEAVY_KIND))
    scenario = slowly(experiment_tools.scenario_of(scene))
    name, low, high = grasps.OBJECTS[HEAVY_KIND].name, LIGHT, HEAVY
    expected = coulomb_limit(scenario)
    for mass, too_much in ((low, False), (high, True)):
        found = slips(scenario, name, mass)
        chapter.rows.append(
            Row(f"{mass:g} kg", "—", "slips" if too_much else "held", "slips" if found else "held", found == too_much)
        )
    progress()
    while high - low > 1e-3 * expected:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if slips(scenario, name, middle) else (middle, high)
    limit = 0.5 * (low + high)
    note = "1 % of 2 · mus · N / g"
    chapter.rows.append(compare("mass that just slips", "—", expected, limit, 0.01 * expected, "kg", note))
    progress()
    return chapter


def coulomb_limit(scenario: Scenario) -> float:
    """Return the mass, kg, that two pads with the grasp's force can just hold by Coulomb's law."""
    mus = scenario.sensors[0].parameters.mus
    return 2 * mus * grasps.FORCE / float(np.linalg.norm(scenario.gravity))


def slowly(scenario: Scenario, times: float = 3.0) -> Scenario:
    """Return the same grasp with a table that is lowered more slowly, so that only the weight pulls on the object."""
    bodies = tuple(
        replace(body, motion=replace(body.motion, times=times * body.motion.times)) if not body.free else body
        for body in scenario.bodies
    )
    frames = round(times * (scenario.frame_end - scenario.frame_start) + 4.0 * scenario.fps)
    return replace(scenario, bodies=bodies, frame_end=scenario.frame_start + frames)


def slips(scenario: Scenario, name: str, mass: float) -> bool:
    """Return True if the object slips out of the fingers when it has this mass."""
    recording = run(experiment_tools.with_mass(scenario, name, mass))
    path = experiment_tools.path_of(recording, name)
    return bool(path[0, 2] - path[-1, 2] > FALLEN)


def work_cycle(folder: Path, progress: Callable) -> Chapter:
    """Fig. 11 and 12: approach, grasp, lift, move down, release."""
    chapter = Chapter(
        "Pick and place",
        "Fig. 11 and 12, section 5.2.2",
        "The arm is keyframed; the fingers close at constant speed until they touch, then control the tactile sum "
        "(3 N). The controller uses only the size of the array, its values and their sum. The cube covers 30 % of each pad. "
        "The paper's simulated pads show equal values, and ours have to as well.",
    )
    scene = experiment_tools.new_scene(pick_and_place.build)
    scenario = experiment_tools.scenario_of(scene)
    texels = {sensor.name: sensor.texels for sensor in scenario.read_out}
    recording = experiment_tools.bake(scene, folder / "bake-pick-and-place")
    progress()
    for stage, frame in pick_and_place.STAGES.items():
        path = folder / f"fig12-{stage.replace(' ', '-')}.png"
        chapter.pictures.append(Picture(experiment_tools.picture(scene, path, frame, (480, 480)), stage.capitalize() + "."))
        progress()
    frames = list(pick_and_place.STAGES.values())
    chapter.pictures.append(_strip(folder / "fig12-images", recording, texels, frames, "Both pads at each stage."))
    parameters = {sensor.name: sensor.parameters for sensor in scenario.read_out}
    forces = draw_both(
        folder / "fig12-forces",
        lambda path: save_figure(curves_figure(recording, texels, parameters, ("force",), STYLE), path, STYLE.dpi),
    )
    chapter.pictures.append(Picture(forces, "Forces over the work cycle."))
    chapter.rows += cycle_rows(recording)
    progress()
    return chapter


def cycle_rows(recording: Recording) -> list[Row]:
    """Return the rows of the work cycle: texels covered, forces while lifted, positions, and the release."""
    lifted = int(np.searchsorted(recording.frames, pick_and_place.STAGES["lift"]))
    left, right = (recording.sensors[name].normal_force[lifted] for name in (gripper.LEFT, gripper.RIGHT))
    path = experiment_tools.path_of(recording, pick_and_place.CUBE)
    loaded = left[left > 0]
    lit, uneven = len(loaded), float(np.ptp(loaded) / loaded.mean())
    raised, beside = float(path[lifted, 2] - path[0, 2]) * 1e3, float(np.linalg.norm(path[-1, :2] - path[0, :2]))
    released = float(recording.sensors[gripper.LEFT].normal_force[-1].sum())
    force, height = pick_and_place.FORCE, pick_and_place.LIFT
    why_lit = "the centres of 4 of 14 rows lie on the cube"
    why_uneven = "the cube hangs below the grip, so its lower edge is pressed a little more"
    return [
        Row("texels covered", "30 % of the area", "24 of 84", f"{lit} of {len(left)}", lit == 24, why_lit),
        compare("tactile sum while lifted", "—", force, float(left.sum()), 1e-3, "N", "the arm has just come to rest"),
        compare("right sum like the left", "similar", float(left.sum()), float(right.sum()), 1e-3, "N", "mirror images"),
        Row("spread of the loaded texels", "none visible", "small", f"{100 * uneven:.2g} %", uneven < 0.5, why_uneven),
        compare("lifted by", "—", height, raised, 2.0, "mm", "the bristles deflect"),
        below("set down beside where it was", "where it was", beside, 1e-4, "m"),
        Row("sum after the release", "0", "0 N", f"{released:.3g} N", released == 0.0),
    ]


def finger_and_thumb(folder: Path, progress: Callable) -> Chapter:
    """Fig. 13: the meshes of two fingers are the sensors."""
    chapter = Chapter(
        "Index finger and thumb",
        "Fig. 13, section 5.3",
        "The finger tips of a hand modelled by script are sensors as they are; between them they hold a cylinder.",
    )
    scene = experiment_tools.new_scene(hand.build)
    recording = experiment_tools.bake(scene, folder / "bake-hand")
    scenario = experiment_tools.scenario_of(scene)
    texels = {sensor.name: sensor.texels for sensor in scenario.read_out}
    chapter.pictures.append(Picture(experiment_tools.picture(scene, folder / "fig13-hand.png", scene.frame_end), "The grasp."))
    last = [int(recording.frames[-1])]
    chapter.pictures.append(_strip(folder / "fig13-images", recording, texels, last, "Both finger tips, laid flat."))
    progress()
    chapter.rows += held_rows(scenario, hand.CYLINDER, hand.INDEX, hand.FORCE)
    progress()
    return chapter


def _strip(stem: Path, recording: Recording, texels, frames, caption: str) -> Picture:
    """Draw the tactile images of some frames."""
    drawn = draw_both(stem, lambda path: save_figure(strip_figure(recording, texels, frames, STYLE), path, STYLE.dpi))
    return Picture(drawn, caption)
