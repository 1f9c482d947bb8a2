# SPDX-License-Identifier: GPL-3.0-or-later
"""The file of a study: scene, design, and the distributions of the varied parameters, as ``docs/sweep.md`` describes it.

The output folder keeps the file with a table ``[frozen]`` at its end: the version, and digests of the scenes.
"""

from __future__ import annotations

import glob
import hashlib
import json
import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from itertools import accumulate, chain
from pathlib import Path, PurePath
from typing import Annotated, Any

import msgspec
import numpy as np

from ..errors import FileError, ParameterError, did_you_mean
from ..io.input_files import checked_name, is_number, read_toml
from ..io.schema import LARGEST, WORD, Name, Number, Positive, Switch, known_words, read_words, wanted
from ..model.parameter import Parameter, TextParameter
from ..model.scenario import Scenario
from .design import (
    CHOICE,
    DEFAULT_LEVELS,
    DISTRIBUTIONS,
    GRID,
    LOG_UNIFORM,
    MESH,
    NORMAL,
    UNIFORM,
    Design,
    Distribution,
    Value,
    check_count,
    columns_of,
)
from .presses import PLACE_PARAMETERS, PRESS_PARAMETERS, Press, with_press
from .scene_property import SceneProperty, WholeNumber, is_scene_property
from .variation import MOTION_WORDS, PRESS, Variable, variable, variables_of

# The output folder of a study, which docs/sweep.md describes. The names of its parts say how many runs it has, without pyarrow.

STUDY_NAME = "study.toml"
SCENES, PARTS, LAYOUTS, RUNS = "scenes", "parts", "layouts", "runs"
_NAME = re.compile(r"\d+-[0-9a-f]{16}-(\d+)-(\d+)\.parquet")


def part_name(first: int, content: str, done: int, failed: int) -> str:
    """Return the name of a part: the index of its first run, 16 hexadecimal digits of what it has, and its counts."""
    return f"{first:07d}-{content}-{done}-{failed}.parquet"


def part_files(folder: Path) -> list[Path]:
    """Return the parts of a study in the order of their first runs; files that are being written are none."""
    return [folder / PARTS / name for name in sorted(match[0] for match in _found(folder))]


def counted_runs(folder: Path) -> tuple[int, int]:
    """Return how many runs are done and failed; one that was computed twice counts twice."""
    matches = list(_found(folder))
    return sum(int(match[1]) for match in matches), sum(int(match[2]) for match in matches)


def _found(folder: Path) -> Iterator[re.Match[str]]:
    with suppress(FileNotFoundError):
        yield from filter(None, map(_NAME.fullmatch, os.listdir(folder / PARTS)))


FORMAT = "palpate-sweep/1"
FROZEN, JOB = "frozen", "job"
A_STUDY = "a study"
SCENE = "scene"
"""Name of the column that tells the scene of a run, where a study has several."""
_OF_SCENES = ("fps", "images", "recordings", "points", "half_precision", "press")
"""Words that have no meaning for a job."""
_DIRECTIONS = {"tilt_direction": "tilt", "slide_direction": "slide"}
"""Directions of a press, which are any as long as the study says nothing else, and what they direct."""
LARGEST_LEVELS = 10_000
SAME = "same"
"""Word of a number that follows another one: both fingers of a gripper have one stiffness."""


@dataclass(frozen=True)
class FrozenFile:
    """A scene, program or mesh that a study began with: SHA-256 of its file, name in the folder, digest of what runs see."""

    file: str
    sha256: str
    name: str = ""
    digest: str = ""


@dataclass(frozen=True)
class Frozen:
    """Table ``[frozen]`` of the study in an output folder: version of Palpate, number of runs, and files."""

    version: str
    runs: int
    scenes: Annotated[tuple[FrozenFile, ...], msgspec.Meta(min_length=1)]
    meshes: tuple[FrozenFile, ...] = ()


@dataclass(frozen=True)
class Study:
    """A study as its file says, before the scene is known.

    Attributes
    ----------
    scenes : tuple of str
        Files or patterns, relative to the file of the study; with `is_job` one Python file.
    design : Design
    vary : mapping
        By names of variables: a table with a distribution, or a value that is the same in all runs.
    press : mapping or None
        The table of a press.
    fps : float or None
        Frames per second instead of those of the scene.
    run_limit : float or None
        Seconds that a run may take.
    run_memory : float or None
        MB that the process of a run may hold.
    name : str
        For the report and the dataset; empty if the file gives none.
    images : bool
        Whether runs have tactile images.
    recordings : bool
        True if runs have files of their own, as a bake has; with images they do in any case.
    points : bool
        Whether the dataset has the texels of a grid as a list, too, and not as a picture.
    half_precision : bool
        Whether the dataset has forces and readings of texels in 16 bits.
    is_job : bool
        Whether a Python file computes the runs, and no solver a scene.
    frozen : Frozen or None
        What the output folder's copy says beside it.
    """

    scenes: Annotated[tuple[str, ...], wanted('write files, as ["*.blend"]', names=True, min_length=1)]
    design: Design
    vary: Annotated[Mapping[str, Any], wanted("write it as a table, [vary]")] = field(default_factory=dict)
    press: Annotated[Mapping[str, Any] | None, wanted("write it as a table, [press]")] = None
    fps: Positive | None = None
    run_limit: Positive | None = None
    run_memory: Positive | None = None
    name: Name = ""
    images: Switch = False
    recordings: Switch = False
    points: Switch = False
    half_precision: Switch = False
    is_job: bool = False
    frozen: Annotated[Frozen | None, wanted("give another folder with --out, or the study's own file")] = None

    @property
    def has_folders(self) -> bool:
        """True if each run has a folder of its own beside its row in a part."""
        return self.images or self.recordings or self.is_job


@dataclass(frozen=True)
class Plan:
    """A study on one of its scenes.

    Attributes
    ----------
    scenario : Scenario or None
        As the scene says, with the study's frame rate; None for a job.
    varied : dict of str to Distribution
    fixed : dict of str to value
    press : Press or None
        With the numbers that do not vary.
    meshes : mapping of str to Path
        Copies of the files with the shapes that targets may have, by the names that the study gives.
    tied : mapping of str to (str, float or None)
        Names whose value follows that of another name, and the factor of numbers.
    """

    scenario: Scenario | None
    varied: Mapping[str, Distribution]
    fixed: Mapping[str, Value]
    press: Press | None
    meshes: Mapping[str, Path] = field(default_factory=dict)
    tied: Mapping[str, tuple[str, float | None]] = field(default_factory=dict)

    @property
    def scene_properties(self) -> list[str]:
        """Paths of the properties of the scene that the study sets: where there are any, each run is read from the scene."""
        return [name for name in (*self.varied, *self.fixed, *self.tied) if is_scene_property(name)]


@dataclass(frozen=True)
class Run:
    """One run of a study.

    Attributes
    ----------
    index : int
        From zero, over all scenes.
    scene : str
        Name of its scene in the output folder.
    values : dict of str to value
        What varies.
    digest : str
        A hash of the scenario of the scene, of what the study fixes, of `index` and `values`; the name of its folder.
    """

    index: int
    scene: str
    values: Mapping[str, Value]
    digest: str


def read_study(path: str | os.PathLike) -> Study:
    """Read the file of a study.

    Raises
    ------
    FileError, ParameterError
        It cannot be read or says what no study can say.
    """
    return study_of(read_toml(path, "study"), Path(path).name)


def study_of(table: Mapping[str, Any], name: str) -> Study:
    """Return the study that the tables of a file say; raise what :func:`read_study` raises."""
    if table.get("format") != FORMAT:
        raise FileError(f"The format of '{name}' is {table.get('format')!r:.60}: a study begins with format = \"{FORMAT}\".")
    design = read_words(table, Design, f"'{name}'", A_STUDY, besides=table)
    given = [word for word in ("scene", "scenes", JOB) if word in table]
    if len(given) != 1:
        raise FileError(f'\'{name}\' needs scene = "file.blend" or scenes = ["*.blend"] or job = "file.py", one of them.')
    words = {**table, "scenes": table[given[0]] if given == ["scenes"] else [table[given[0]]]}
    others = ("format", "scene", JOB, "design", "samples", "seed")
    study = read_words(words, Study, f"'{name}'", A_STUDY, others, design=design, is_job=JOB in table)
    for word in _OF_SCENES if study.is_job else ():
        if word in table:
            raise FileError(f"{word} of '{name}' has no meaning for a job: leave it out.")
    if design.kind == GRID and "samples" in table:
        raise FileError(f"'{name}' has a grid and samples: a grid takes all combinations, so leave samples out, or use random.")
    if design.kind != GRID and not design.samples:
        raise FileError(f"'{name}' has no samples: give a whole number of runs, above zero.")
    check_count(design.samples)
    return replace(study, vary=dict(_flattened(study.vary)))


def _flattened(table: Mapping[str, Any], start: str = "") -> Iterable[tuple[str, Any]]:
    """Yield the entries of nested tables under their names with dots; a table with a distribution is an entry."""
    for key, value in table.items():
        if isinstance(value, Mapping) and value and not set(value) & {*DISTRIBUTIONS, SAME}:
            if "levels" in value:
                raise ParameterError(f"{start}{key} has levels and no distribution: add one of {', '.join(DISTRIBUTIONS)}.")
            yield from _flattened(value, f"{start}{key}.")
        else:
            yield f"{start}{key}", value


def plan_for(
    study: Study,
    scenario: Scenario | None,
    properties: Mapping[str, SceneProperty] | None = None,
    meshes: Mapping[str, Path] | None = None,
) -> Plan:
    """Return the plan of a study on a scene.

    Parameters
    ----------
    study : Study
    scenario : Scenario or None
        None for a job, which takes any names: numbers, texts, and switches.
    properties : mapping of str to SceneProperty, optional
        What the properties of the scene are that the study names.
    meshes : mapping of str to Path, optional
        Copies of the files with the shapes of targets that the study names.

    Raises
    ------
    ParameterError, FileError
        A name is not known in the scene, or its values are not possible.
    """
    entries, press, meshes = dict(study.vary), None, meshes or {}
    if scenario is None:
        variables, meshes = {name: _free_variable(name, entry) for name, entry in entries.items()}, {}
    else:
        scenario = at_rate(scenario, study.fps)
        if study.press is not None:
            press, of_press = _press(study.press, scenario, study.design.kind == GRID)
            with_press(scenario, press)  # refuses what no press of this study could do
            entries |= of_press
        variables = _variables(entries, scenario, press, properties or {})
    varied: dict[str, Distribution] = {}
    fixed: dict[str, Value] = {}
    tied: dict[str, tuple[str, float | None]] = {}
    for name, entry in entries.items():
        if isinstance(entry, Mapping) and SAME in entry:
            tied[name] = _tie(variables[name], entry, entries)
        elif isinstance(entry, Mapping):
            varied[name] = _distribution(variables[name], _with_files(variables[name], entry, meshes))
        else:
            fixed[name] = variables[name].read(entry)
    if not varied and study.design.kind == GRID:
        raise ParameterError("The study varies nothing: give [vary] or [press] at least one distribution.")
    for name, (other, factor) in tied.items() if scenario is not None else ():
        own = varied.get(other)
        ends = own.words if own is not None and own.kind != NORMAL else (fixed[other],) if own is None else ()
        for end in ends:
            variables[name].read(_times(end, factor))  # refuses what some run could not have
    return Plan(scenario, varied, fixed, press, meshes, tied)


def _variables(
    names: Iterable[str], scenario: Scenario, press: Press | None, properties: Mapping[str, SceneProperty]
) -> dict[str, Variable]:
    """Return what the names of a study mean in a scene; refuse what does not vary there."""
    known = variables_of(scenario, press is not None) | {name: item.variable() for name, item in properties.items()}
    pressing = {scenario.bodies[one.body].name for one in scenario.targets if press is not None and one.name == press.target}
    found: dict[str, Variable] = {}
    for name in names:
        if press is None and name.startswith(f"{PRESS}."):
            raise ParameterError("The study varies numbers of a press and has no [press]: add that table.")
        if is_scene_property(name) and name not in known:
            raise ParameterError(
                f"'{name}' is a property of Blender, and '{scenario.name}' is no .blend: give the .blend itself."
            )
        found[name] = own = variable(name, known, scenario)
        if own.owner in pressing and own.words[0] in MOTION_WORDS:
            raise ParameterError(f"'{name}' has no effect, because [press] moves '{own.owner}': leave it out of [vary].")
    return found


def _free_variable(name: str, entry: Any) -> Variable:
    """Return the variable of a name that only a job knows; the first of its values tells what it is."""
    words = entry.get(CHOICE) if isinstance(entry, Mapping) else [entry]
    first = words[0] if isinstance(words, list) and words else 0.0
    if isinstance(first, bool):
        return Variable(name, name, (JOB,), None)
    if isinstance(first, str):
        return Variable(name, name, (JOB,), TextParameter(name, "", "Text of the job"))
    return Variable(name, name, (JOB,), Parameter(name, "", 0.0, -math.inf, math.inf, "Number of the job"))


@dataclass(frozen=True)
class _TieWords:
    same: Name
    factor: Annotated[float, wanted("give a number, or leave it out", ge=-LARGEST, le=LARGEST)] | None = None


def _tie(found: Variable, entry: Mapping[str, Any], entries: Mapping[str, Any]) -> tuple[str, float | None]:
    """Return the name that a number follows, and the factor."""
    words = read_words(entry, _TieWords, found.name, A_STUDY)
    if words.same not in entries or isinstance(entries[words.same], Mapping) and SAME in entries[words.same]:
        advice = did_you_mean(words.same, entries, "give that a distribution or a value of its own.")
        raise ParameterError(f"{found.name} follows '{words.same:.60}', which the study does not vary: {advice}")
    if words.factor is not None and not isinstance(found.specification, Parameter):
        raise ParameterError(f"factor of {found.name} is {words.factor:g}, and this is no number: leave it out.")
    return words.same, words.factor


def _times(value: Any, factor: float | None) -> Any:
    return value if factor is None or not is_number(value) else value * factor


def _with_files(found: Variable, entry: Mapping[str, Any], meshes: Mapping[str, Path]) -> Mapping[str, Any]:
    """Return the table of a target's shape with the names of files in the place of patterns; other tables as they are."""
    words = entry.get(CHOICE)
    if found.words != (MESH,) or not isinstance(words, list) or not all(isinstance(word, str) for word in words):
        return entry
    files = [[name for name in meshes if PurePath(name).match(word)] if glob.has_magic(word) else [word] for word in words]
    return {**entry, CHOICE: list(dict.fromkeys(chain.from_iterable(files)))}


def at_rate(scenario: Scenario, fps: float | None) -> Scenario:
    """Return a scenario that is recorded at another frame rate over the same time; None: as it is."""
    if fps is None:
        return scenario
    seconds = (scenario.frame_end - scenario.frame_start) / scenario.fps
    return replace(scenario, fps=fps, frame_end=scenario.frame_start + max(1, math.floor(seconds * fps + 1e-9)))


def _press(table: Mapping[str, Any], scenario: Scenario, is_grid: bool) -> tuple[Press, dict[str, Any]]:
    """Return the press of a study with default numbers, and the entries of the others by their names.

    Sensor and target may go unnamed where there is only one.
    """
    known_words(table, ("sensor", "target", *PRESS_PARAMETERS), "[press]", A_STUDY)
    readable = [sensor.name for sensor in scenario.read_out]
    carriers = {sensor.body for sensor in scenario.sensors}
    pressing = [target.name for target in scenario.targets if target.sensor is None and target.body not in carriers]
    names = {}
    for word, candidates in (("sensor", readable), ("target", pressing)):
        if word not in table and len(candidates) != 1:
            known = ", ".join(f"'{name}'" for name in candidates) or "none"
            raise ParameterError(f"[press] does not say its {word}, and '{scenario.name}' has {known}: add {word} = \"…\".")
        names[word] = checked_name(table.get(word, *candidates[:1]), "[press]")
    if is_grid and not all(word in table for word in PLACE_PARAMETERS):
        raise ParameterError("A grid has no random places to press on: use random, latin-hypercube or sobol.")
    if "depth" in table and "force" in table:
        raise ParameterError("[press] has a depth and a force: give one of the two.")
    entries = {word: table[word] for word in PRESS_PARAMETERS if word in table}
    for word in PLACE_PARAMETERS:
        entries.setdefault(word, {UNIFORM: [0.0, 1.0]})
    for direction, directed in _DIRECTIONS.items():
        if directed in table and not is_grid:
            entries.setdefault(direction, {UNIFORM: [-math.pi, math.pi]})
    return Press(names["sensor"], names["target"]), {f"{PRESS}.{word}": entry for word, entry in entries.items()}


_Pair = Annotated[list[Number], wanted("give two numbers", min_length=2, max_length=2)]


@dataclass(frozen=True)
class _DistributionWords:
    uniform: _Pair | None = None
    log_uniform: _Pair | None = field(default=None, metadata={WORD: "log-uniform"})
    normal: _Pair | None = None
    choice: Annotated[list[Any], wanted("give a list of values", min_length=1)] | None = None
    levels: Annotated[int, wanted(f"give a whole number from 1 to {LARGEST_LEVELS}", ge=1, le=LARGEST_LEVELS)] = DEFAULT_LEVELS


def _distribution(found: Variable, entry: Mapping[str, Any]) -> Distribution:
    """Return the distribution that a table says, checked against the bounds of its variable."""
    words = read_words(entry, _DistributionWords, found.name, A_STUDY)
    given = {kind: getattr(words, kind.replace("-", "_")) for kind in DISTRIBUTIONS if kind in entry}
    if len(given) != 1:
        raise ParameterError(f"{found.name} has {len(given)} distributions: give one of {', '.join(DISTRIBUTIONS)}.")
    ((kind, numbers),) = given.items()
    if kind == CHOICE:
        return Distribution(CHOICE, tuple(found.read(word) for word in numbers))
    if not isinstance(found.specification, Parameter):
        raise ParameterError(f"{found.name} is not a number that can be {kind}: use choice.")
    if isinstance(found.specification, WholeNumber):
        raise ParameterError(f"{found.name} is a whole number, which cannot be {kind}: use choice.")
    first, second = numbers
    low, high = found.specification.low, found.specification.high
    if found.specification.above_low:
        low = float(np.nextafter(low, math.inf))
    if kind == NORMAL:
        if not second > 0.0:
            raise ParameterError(f"normal of {found.name} has the deviation {second:g}: give mean and deviation, above zero.")
        return Distribution(NORMAL, (found.read(first), second), words.levels, low, high)
    if not first < second:
        raise ParameterError(f"{kind} of {found.name} runs from {first:g} to {second:g}: give the lower number first.")
    if kind == LOG_UNIFORM and not first > 0.0:
        raise ParameterError(f"log-uniform of {found.name} begins at {first:g}: give numbers above zero, or use uniform.")
    return Distribution(kind, (found.read(first), found.read(second)), words.levels, low, high)


class Runs:
    """All runs of a study in order, each made when it is asked for: a million of them take 8 bytes for each varied number.

    Parameters
    ----------
    study : Study
    plans : mapping of str to Plan
        By the names of the scenes.
    digests : mapping of str to str
        Of the scenes: of their scenarios, and of their files where each run is read from the scene.

    Raises
    ------
    ParameterError
        There are too many.
    """

    def __init__(self, study: Study, plans: Mapping[str, Plan], digests: Mapping[str, str]):
        counts = {scene: study.design.count(plan.varied) for scene, plan in plans.items()}
        check_count(sum(counts.values()))
        self._plans, self._count = plans, sum(counts.values())
        self._firsts = dict(zip(counts, accumulate(counts.values(), initial=0)))
        self._columns = {scene: columns_of(study.design, plan.varied) for scene, plan in plans.items()}
        self._hashes = {scene: _hash_of(plan, digests[scene]) for scene, plan in plans.items()}

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, at: int) -> Run:
        index = range(self._count)[at]
        scene = next(name for name, first in reversed(self._firsts.items()) if first <= index)
        found = {name: column[index - self._firsts[scene]] for name, column in self._columns[scene].items()}
        values = {name: float(value) if isinstance(value, np.floating) else value for name, value in found.items()}
        own = self._hashes[scene].copy()
        own.update(json.dumps([index, values]).encode())
        plan = self._plans[scene]
        known = {**plan.fixed, **values}
        values |= {name: _times(known[other], factor) for name, (other, factor) in plan.tied.items()}
        named = {SCENE: scene, **values} if len(self._plans) > 1 else values
        return Run(index, scene, named, own.hexdigest()[:24])


def _hash_of(plan: Plan, digest: str) -> hashlib._Hash:
    """Return a hash of what all runs of a scene have in common."""
    fps = None if plan.scenario is None else plan.scenario.fps
    press = [] if plan.press is None else [plan.press.sensor, plan.press.target]
    same: dict[str, Any] = {"scene": digest, "fixed": dict(plan.fixed), "fps": fps, "press": press, "tied": dict(plan.tied)}
    if plan.meshes:
        same["meshes"] = {name: copy.stem for name, copy in plan.meshes.items()}
    return hashlib.sha256(json.dumps(same, sort_keys=True).encode())


def frozen_text(text: str, frozen: Frozen) -> str:
    """Return the text of a study with the table ``[frozen]`` at its end."""
    import tomli_w

    return text.rstrip("\n") + "\n\n" + tomli_w.dumps({FROZEN: asdict(frozen)})


def differences(before: Study, now: Study) -> list[str]:
    """Return the differences of two studies, one phrase each."""
    old, new = _stated(before), _stated(now)
    names = [name for name in {**old, **new} if old.get(name) != new.get(name)]
    return [f"{name} was {_shown(old.get(name))} and is {_shown(new.get(name))}" for name in names]


def _stated(study: Study) -> dict[str, Any]:
    """Return all that a study says about its results, by words."""
    words = ("name", "scenes", "fps", "images", "recordings", "points", "half_precision")
    design = {"design": study.design.kind, "samples": study.design.samples, "seed": study.design.seed}
    press = {} if study.press is None else {"[press]": True} | {f"{PRESS}.{name}": value for name, value in study.press.items()}
    return {word: getattr(study, word) for word in words} | design | dict(study.vary) | press


def _shown(value: Any) -> str:
    return "missing" if value is None else f"{value!r:.80}"
