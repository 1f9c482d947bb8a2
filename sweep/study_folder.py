# SPDX-License-Identifier: GPL-3.0-or-later
"""The output folder of a study: frozen at the first command, compared at every later one.

What the solver sees of a scene is in ``scenes/<scene>.npz``. Beside it are, where a study needs them, what the scene's
properties are (``.json``), a copy of the scene to read with other values (``.blend``), the program of a study without a scene
(``.py``), and the mesh files of targets (``meshes/``).
"""

from __future__ import annotations

import glob
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from ..core.errors import FileError
from ..core.io.bake_folder import folder_names
from ..core.io.file_writing import file_sha256, writable_folder, write_text
from ..core.io.scenario_npz import load_scenario, save_scenario
from ..core.model.scenario import Scenario
from ..core.study.design import MESHES, find_meshes, freeze_meshes, mesh_copy
from ..core.study.scene_property import read_properties
from ..core.study.study_file import (
    LAYOUTS,
    PARTS,
    RUNS,
    SCENES,
    STUDY_NAME,
    Frozen,
    FrozenFile,
    Plan,
    Runs,
    Study,
    differences,
    frozen_text,
    plan_for,
    read_study,
)
from ..core.version import VERSION
from .scripts import REFUSE, SUFFIX, freeze_program, read_blend, require_allowed

BLEND, SCENARIO = ".blend", ".npz"
ReadBlend = Callable[[Path, Path], None]
"""Writes the solver input of a .blend to a file, and to a second file, for some studies, the data for evaluating it again."""
MADE = (PARTS, LAYOUTS, RUNS, SCENES)
"""Folders of a study, in addition to its results."""


@dataclass(frozen=True)
class OpenStudy:
    """A study with its output folder.

    Attributes
    ----------
    folder : Path
    study : Study
    plans : mapping of str to Plan
        By the names of the scenes.
    runs : Runs
    scripts : str
        What is done about the Python of a .blend or a program, one of :data:`.scripts.SCRIPTS`.
    """

    folder: Path
    study: Study
    plans: Mapping[str, Plan]
    runs: Runs
    scripts: str = REFUSE


def open_study(place: Path, folder: Path, scripts: str = REFUSE) -> OpenStudy:
    """Open a study by its folder, or by its file: freeze it in an empty folder, or go on in the folder of the same study.

    Parameters
    ----------
    place : Path
        File, or output folder.
    folder : Path
        Output folder, which is made if it is missing.
    scripts : str
        As of :class:`OpenStudy`.

    Raises
    ------
    PalpateError
        The file or a scene cannot be read, a program is not allowed, the folder holds something else, or another study, or this
        one with another scene.
    """
    if place.is_dir():
        return resume_study(folder, scripts)
    study, read = read_study(place), partial(read_blend, scripts=scripts, more=("--study", str(place)))
    sources = _sources(study, place.parent)
    if (folder / STUDY_NAME).exists():
        opened = resume_study(folder, scripts)
        changed = differences(opened.study, study)
        if changed:
            raise FileError(f"'{folder}' belongs to another study ({'; '.join(changed)}): give another folder with --out.")
        _check_sources(opened, sources, place.parent, read)
        # No result depends on the limits.
        return replace(opened, study=replace(opened.study, run_limit=study.run_limit, run_memory=study.run_memory))
    if folder.exists() and (not folder.is_dir() or {path.name for path in folder.iterdir()} - {*MADE, STUDY_NAME, ".palpate"}):
        raise FileError(f"'{folder}' holds other files and no study: give a new or empty folder with --out.")
    require_allowed(study, scripts)
    with _whole_or_nothing(folder):
        return replace(_frozen(study, place, folder, sources, read), scripts=scripts)


def _frozen(study: Study, file: Path, folder: Path, sources: Mapping[str, Path], read: ReadBlend) -> OpenStudy:
    """Freeze a study with its scenes and meshes in a folder; its own file comes last."""
    mesh_files = find_meshes(study.vary, file.parent)
    for name in (SCENES, PARTS):
        writable_folder(folder / name, create=True)
    meshes = freeze_meshes(mesh_files, folder / SCENES / MESHES)
    plans, entries = {}, []
    for name, source in sources.items():
        digest = _freeze_scene(source, folder, name, read)
        plans[name] = plan_for(
            study, _scene_in(study, folder, name)[0], read_properties(scene_file(folder, name, ".json")), meshes
        )
        entries.append(FrozenFile(source.name, file_sha256(source), name, digest))
    runs = Runs(study, plans, _digests(plans, entries))
    mesh_entries = tuple(FrozenFile(name, copy.stem) for name, copy in meshes.items())
    frozen = Frozen(VERSION, len(runs), tuple(entries), mesh_entries)
    text = frozen_text(file.read_text(encoding="utf-8"), frozen)
    write_text(folder / STUDY_NAME, text)
    return OpenStudy(folder, study, plans, runs)


@contextmanager
def _whole_or_nothing(folder: Path) -> Iterator[None]:
    """Remove what a beginning has written when it is refused: what was in the folder before stays."""
    made = [folder / name for name in MADE if not (folder / name).exists()]
    try:
        yield
    except BaseException:
        for path in made:
            shutil.rmtree(path, ignore_errors=True)
        raise


def scenarios_of(place: Path, scripts: str) -> dict[str, Scenario | None]:
    """Return the names that may be varied, without beginning a study, whether or not the names that it varies are right.

    Parameters
    ----------
    place : Path
        The file of a study, the folder of one, or a scene.
    scripts : str
        As of :class:`OpenStudy`.

    Returns
    -------
    dict of str to Scenario or None
        By the names of the scenes; None for a program.

    Raises
    ------
    PalpateError
        The study or a scene cannot be read.
    """
    if place.is_dir():
        return {name: plan.scenario for name, plan in resume_study(place).plans.items()}
    is_scene = place.suffix in (BLEND, SCENARIO)
    sources = {place.stem: place} if is_scene else _sources(read_study(place), place.parent)
    found: dict[str, Scenario | None] = dict.fromkeys(sources)
    with tempfile.TemporaryDirectory(prefix="palpate-sweep-") as folder:
        for name, source in sources.items():
            scenario = source
            if source.suffix == BLEND:
                scenario = Path(folder) / SCENARIO
                read_blend(source, scenario, scripts)
            if source.suffix != SUFFIX:
                found[name] = load_scenario(scenario)
    return found


def resume_study(folder: Path, scripts: str = REFUSE) -> OpenStudy:
    """Open a study by its folder; `scripts` as of :class:`OpenStudy`.

    Raises
    ------
    PalpateError
        There is no study in it, another version of Palpate began it, or a file of it is damaged.
    """
    if not (folder / STUDY_NAME).is_file():
        raise FileError(f"There is no study in '{folder}': give the file of a study, or the folder that it was run in.")
    study = read_study(folder / STUDY_NAME)
    frozen = frozen_of(study, folder)
    if frozen.version != VERSION:
        raise FileError(
            f"The study in '{folder}' was begun with Palpate {frozen.version}, and this is {VERSION}, which may compute other "
            "numbers: go on with that version, or give another folder with --out."
        )
    plans, meshes = {}, {one.file: mesh_copy(folder / SCENES / MESHES, one.file, one.sha256) for one in frozen.meshes}
    for scene in frozen.scenes:
        scenario, digest = _scene_in(study, folder, scene.name)
        if digest not in (scene.digest, scene.sha256):
            raise FileError(f"The scene '{scene.name}' in '{folder}' is not the one that the study began with: start again.")
        plans[scene.name] = plan_for(study, scenario, read_properties(scene_file(folder, scene.name, ".json")), meshes)
    return OpenStudy(folder, study, plans, Runs(study, plans, _digests(plans, frozen.scenes)), scripts)


def scene_file(folder: Path, name: str, suffix: str) -> Path:
    """Return a file of a scene, or the program, in the folder of a study."""
    return folder / SCENES / f"{name}{suffix}"


def _scene_in(study: Study, folder: Path, name: str) -> tuple[Scenario | None, str]:
    """Return a scene in a study's folder and its digest; None and the SHA-256 of its program for a job."""
    if study.is_job:
        return None, file_sha256(scene_file(folder, name, SUFFIX))  # the processes that run it look at the rest
    scenario = load_scenario(scene_file(folder, name, SCENARIO))
    return scenario, scenario.digest()


def _digests(plans: Mapping[str, Plan], scenes: Iterable[FrozenFile]) -> dict[str, str]:
    """Return the inputs of the runs of each scene: its scenario, and its file where each run is read from it."""
    return {one.name: f"{one.digest} {one.sha256}" if plans[one.name].scene_properties else one.digest for one in scenes}


def frozen_of(study: Study, folder: Path) -> Frozen:
    """Return the table [frozen] of a study; raise :class:`FileError` where it has none."""
    if study.frozen is None:
        raise FileError(f"'{folder / STUDY_NAME}' is not the study of an output folder: its table [frozen] is missing.")
    return study.frozen


def _sources(study: Study, base: Path) -> dict[str, Path]:
    """Return the files of a study's scenes by the names that they get in the output folder."""
    files: list[Path] = []
    for pattern in study.scenes:
        found = sorted(glob.glob(str(base / pattern))) if glob.has_magic(pattern) else [str(base / pattern)]
        if not found:
            raise FileError(f"No file next to the study matches the scene '{pattern}': check its name and folder.")
        files += [Path(path) for path in found if Path(path) not in files]
    for file in files:
        if not file.is_file():
            raise FileError(f"There is no scene '{file}': check its name; it is counted from the study's folder.")
        if study.is_job and file.suffix != SUFFIX:
            raise FileError(f"The job '{file}' is not a Python file: give one that ends with {SUFFIX}.")
        if not study.is_job and file.suffix not in (BLEND, SCENARIO):
            raise FileError(f"The scene '{file}' is neither a .blend nor a scenario (.npz): give one of these.")
    stems: dict[str, Path] = {}
    for file in files:
        stem = file.stem if file.stem not in stems else file.name
        if stem in stems:
            raise FileError(f"Two scenes of the study are called '{file.name}': rename one of them.")
        stems[stem] = file
    names = folder_names(stems)
    return {names[stem]: file for stem, file in stems.items()}


def _freeze_scene(source: Path, folder: Path, name: str, read: ReadBlend) -> str:
    """Write a scene, or a program, into a study's folder and return its digest."""
    if source.suffix == SUFFIX:
        return freeze_program(source, scene_file(folder, name, SUFFIX))
    target = scene_file(folder, name, SCENARIO)
    if source.suffix == BLEND:
        read(source, target)
    else:
        save_scenario(target, load_scenario(source))
    return load_scenario(target).digest()


def _check_sources(opened: OpenStudy, sources: Mapping[str, Path], base: Path, read: ReadBlend) -> None:
    """Raise FileError if the scenes are no longer those that the study began with; a .blend is read only if it has changed."""
    frozen = frozen_of(opened.study, opened.folder)
    before, now = {one.name: one for one in frozen.scenes}, set(sources)
    if set(before) != now:
        odd = sorted(set(before) ^ now)[0]
        what = "is new" if odd in now else "is missing"
        raise FileError(f"The scene '{odd}' {what} since the study in '{opened.folder}' began: give another folder with --out.")
    for name, source in sources.items():
        if file_sha256(source) == before[name].sha256:
            continue
        if opened.study.is_job or opened.plans[name].scene_properties:
            raise _changed(source, opened)
        try:
            digest = _freeze_scene(source, opened.folder, f"now-{name}", read)
        finally:
            scene_file(opened.folder, f"now-{name}", SCENARIO).unlink(missing_ok=True)
        if digest != before[name].digest:
            raise _changed(source, opened)
    meshes = {one.file: one.sha256 for one in frozen.meshes}
    for name, file in find_meshes(opened.study.vary, base).items():
        if file_sha256(file) != meshes.get(name):
            raise _changed(file, opened)


def _changed(file: Path, opened: OpenStudy) -> FileError:
    return FileError(
        f"'{file}' has changed since the study in '{opened.folder}' began: give another folder with --out, or "
        f"the folder itself instead of the study's file, which goes on with it as it was."
    )
