# SPDX-License-Identifier: GPL-3.0-or-later
"""The scenes of a study as its folder keeps them: scenarios, what their properties are, copies of .blend files, and meshes.

::

    scenes/<scene>.npz      the scene as the solver sees it
    scenes/<scene>.json     what the properties of the scene are that the study names, if any
    scenes/<scene>.blend    the scene, which runs with other values of these are read from
    scenes/<program>.py     the program of a study that has no scene
    scenes/meshes/          the mesh files of targets
"""

from __future__ import annotations

from pathlib import Path

from ..core.errors import FileError
from ..core.io.scenario_npz import load_scenario
from ..core.study.mesh_choices import MESHES, StudyMeshes
from ..core.study.run_files import SCENES, STUDY_NAME
from ..core.study.scene_property import read_properties
from ..core.study.study_file import Plan, Study, plan_for, plan_for_job

FROZEN_MESHES = "meshes"
"""Key of the meshes in the table [frozen]."""


def plan_of(study: Study, folder: Path, scene: str, meshes: StudyMeshes) -> Plan:
    """Return what a study means on one of its scenes.

    Raises
    ------
    PalpateError
        A file is damaged, or the study does not fit the scene.
    """
    if study.is_job:
        return plan_for_job(study)
    start = folder / SCENES / f"{scene}.npz"
    return plan_for(study, load_scenario(start), read_properties(start.with_suffix(".json")), meshes)


def frozen_meshes(study: Study, folder: Path) -> StudyMeshes:
    """Return the meshes of a frozen study; raise :class:`FileError` where its file is damaged."""
    entries = study.frozen.get(FROZEN_MESHES, [])
    words = ("file", "sha256")
    if not isinstance(entries, list) or not all(
        isinstance(entry, dict) and all(isinstance(entry.get(word), str) for word in words) for entry in entries
    ):
        raise FileError(f"'{folder / STUDY_NAME}' is damaged: a mesh of its table [frozen] is cut; start again.")
    return StudyMeshes(folder / SCENES / MESHES, entries)
