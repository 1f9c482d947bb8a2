# SPDX-License-Identifier: GPL-3.0-or-later
"""Section 3.1: texels and their normals from a grid, a sphere and a fingertip (Fig. 1 to 3)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..sample_blends import geometries
from . import experiment_tools
from .chapter import Chapter, Picture, Row, below


def sensors(folder: Path, progress: Callable) -> Chapter:
    """Build one sensor of each kind, and compare the normals with closed forms where there are any."""
    chapter = Chapter(
        "Sensors from any mesh",
        "Fig. 1 to 3, section 3.1",
        "Each vertex of a mesh is a texel; its normal is the normalised sum of the unit normals of the triangles around it. On "
        "the grid and on the sphere the exact normal is known.",
    )
    scene = experiment_tools.new_scene(geometries.build)
    scenario = experiment_tools.scenario_of(scene)
    found = {sensor.name: sensor.texels for sensor in scenario.sensors}
    for name, texels in found.items():
        chapter.rows.append(
            Row(f"texels of the {name.lower()}", "—", "—", str(len(texels)), None, type(texels.layout).__name__)
        )
    grid, sphere = found[geometries.GRID], found[geometries.SPHERE]
    up = np.degrees(np.arccos(np.clip(grid.normal[:, 2], -1, 1))).max()
    chapter.rows.append(below("grid: angle of a normal from the vertical", "—", float(up), 1e-5, "°"))
    radial = sphere.position / np.linalg.norm(sphere.position, axis=1, keepdims=True)
    off = np.degrees(np.arccos(np.clip((sphere.normal * radial).sum(axis=1), -1, 1))).max()
    note = "the triangles of an icosphere differ in size, but unit normals weigh them equally, as in the paper"
    chapter.rows.append(below("sphere: angle of a normal from the radius", "—", float(off), 1.0, "°", note))
    progress()
    experiment_tools.bake(scene, folder / "bake-geometries")
    picture = experiment_tools.picture(scene, folder / "fig1-3-sensors.png", scene.frame_end, (1100, 600))
    chapter.pictures.append(
        Picture(picture, "Grid, sphere and fingertip with their texels' normals, a ball pressed on each.", True)
    )
    progress()
    return chapter
