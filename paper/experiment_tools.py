# SPDX-License-Identifier: GPL-3.0-or-later
"""Common steps of the experiments: building, sampling, baking and rendering a scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np

from ..addon.bake import bake as baking
from ..addon.render import render
from ..addon.scene import scene_reader
from ..core.jobs import run_job
from ..core.model.recording import Recording
from ..core.model.scenario import Scenario

SAMPLES = 12
"""Samples per pixel of the renders: soft light needs few, because the result is denoised."""


def new_scene(build: Callable) -> bpy.types.Scene:
    """Return the scene of an empty file, filled by a sample's `build`."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    build(bpy.context.scene)
    return bpy.context.scene


def scenario_of(scene) -> Scenario:
    """Return the scenario of a scene, the input of the solver."""
    return run_job(scene_reader.read_scene(scene)).scenario


def bake(scene, folder: Path, on_progress=None) -> Recording:
    """Bake a scene into a folder, put the heat maps into the scene, and return the recording."""
    scene.palpate.folder = str(folder)
    return run_job(baking.bake(scene), on_progress).recording


def picture(scene, path: Path, frame: int, size=(640, 480)) -> Path:
    """Render one frame."""
    return render.render_frame(scene, path, frame, samples=SAMPLES, size=size)


def with_mass(scenario: Scenario, name: str, mass: float) -> Scenario:
    """Return the scenario with another mass of a free body; its inertia changes in proportion."""
    bodies = tuple(
        replace(body, mass=mass, inertia=np.asarray(body.inertia) * (mass / body.mass)) if body.name == name else body
        for body in scenario.bodies
    )
    return replace(scenario, bodies=bodies)


def path_of(recording: Recording, name: str) -> np.ndarray:
    """(F, 3) float, metres: position of a body at every frame."""
    return recording.poses[:, recording.body_names.index(name), :3]
