# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigs: a TOML file that describes a measurement, and one CSV file for each trial (docs/rig-format.md describes both).

Every mistake in a rig raises an error here, in one sentence, before anything is computed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from ...errors import FileError, ParameterError, SensorError
from ...geometry.mesh import TriangleMesh, checked_mesh, turned_outwards
from ...geometry.texels import Texels, texels_from_region
from ...io.csv_table import read_table
from ...io.input_files import LONGEST_NAME, checked_name, read_toml, require_regular
from ...io.schema import Name, known_words, read_words, wanted
from ...io.sensor_toml import SHAPE_WORDS, checked_grid, checked_lengths
from ...model.sensor_parameters import (
    DEPTH_PER_THICKNESS,
    SENSOR_PARAMETERS,
    SensorParameters,
    stated_parameters,
    with_dependent_defaults,
)
from .column_names import FORCE, POSE, QUANTITIES, SLIDE, TURN, Column, read_column_rules, translated
from .cover import COVER_WORDS, Cover, flat_texels, read_cover
from .second_logger import SecondLogger, bridged, joined, with_steady_signs
from .trial import FAULT_KINDS, FREE, SHARED_HEIGHT, Trial, TrialWords, check_free_heights, on_common_clocks, read_start

FORMAT = "palpate-rig/1"
LOWEST_TEMPERATURE, HIGHEST_TEMPERATURE = -273.15, 2000.0
"""°C: what a sensor can have."""
SMALLEST_RESPONSE = 1e-30
"""Responses of a smaller magnitude, in any unit, count as zero."""
RIG_SENSOR_WORDS = {"name", "contact_height", *COVER_WORDS}
"""Words of a [sensor] that belong to the measurement and not to the sensor."""
LONGEST_STEP = 5.0
"""Seconds between samples above which the clock must be in milliseconds."""


@dataclass(frozen=True)
class Indenter:
    """The body that presses on the sensor.

    Attributes
    ----------
    mesh : TriangleMesh
        In metres, in the indenter's own frame. Its origin is the point whose position a pose gives.
    radius : float or None, metres
        Of a sphere; then contact is computed with the exact sphere.
    edges : (3,) float or None, metres
        Full sizes of a box about the origin; then contact is computed with the exact box.
    """

    mesh: TriangleMesh
    radius: float | None = None
    edges: tuple[float, ...] | None = None


_Table = Annotated[dict[str, Any], wanted("describe it there")]


@dataclass(frozen=True)
class RigWords:
    """The words of a rig's file, whose tables are read one by one.

    Attributes
    ----------
    clock : "absolute", "own" or None
        Whether one clock went on through all recordings, or each has its own.
    """

    sensor: _Table
    trial: Annotated[list[dict[str, Any]], wanted("name at least one CSV file", min_length=1)]
    name: Name = ""
    clock: Literal["absolute", "own"] | None = None
    columns: _Table | None = None
    data: _Table = field(default_factory=dict)
    indenter: _Table | None = None
    probe: Annotated[list[dict[str, Any]], wanted("write [[probe]], with a name and a shape, for each")] = field(
        default_factory=list
    )


@dataclass(frozen=True)
class Rig:
    """A sensor, the indenter, and what was recorded.

    Attributes
    ----------
    name : str
    texels : Texels
    parameters : SensorParameters
        Those that the rig states, and defaults for the others.
    given : frozenset of str
        Names of the parameters that the rig states.
    grid : (int, int, (float, float)) or None
        Rows, columns and pitch, if the sensor is given as a grid.
    indenter : Indenter or None
    trials : tuple of Trial
    words : mapping
        The `[sensor]` table of the file.
    warnings : tuple of str
    correct : tuple of str
        Kinds of faults of the data that are to be put right, keys of :data:`.trial.FAULT_KINDS`.
    cover : Cover or None
        Over texels at given places, or strips; None if contact is computed at the texels themselves.
    probes : mapping of str to Indenter
        Those that recordings name, beside the indenter.
    """

    name: str
    texels: Texels
    parameters: SensorParameters
    given: frozenset[str]
    grid: tuple[int, int, tuple[float, float]] | None
    indenter: Indenter | None
    trials: tuple[Trial, ...]
    words: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    correct: tuple[str, ...] = ()
    cover: Cover | None = None
    probes: Mapping[str, Indenter] = field(default_factory=dict)

    def indenter_of(self, trial: Trial) -> Indenter | None:
        """Return the probe of a trial; None if only a depth or a force is known."""
        return self.probes[trial.probe] if trial.probe else self.indenter

    @property
    def surface(self) -> Texels:
        """Points at which contact is computed: those of the cover, or the texels if there is none."""
        return self.texels if self.cover is None else self.cover.surface

    def of(self, use: str) -> tuple[Trial, ...]:
        """Return the trials of one use, "fit" or "check"."""
        return tuple(trial for trial in self.trials if trial.use == use)


def read_rig(path: str | Path) -> Rig:
    """Read a rig and all its recordings.

    Parameters
    ----------
    path : path of the TOML file

    Raises
    ------
    PalpateError
        Something in it cannot be used; the message says what, where, and what to do.
    """
    path = Path(path)
    words = read_toml(path, "rig")
    if words.get("format") != FORMAT:
        raise FileError(f"'{path.name}' is not a rig: its first line must be format = \"{FORMAT}\".")
    found = read_words(words, RigWords, f"'{path.name}'", besides=("format",))
    sensor = found.sensor
    texels, grid, cover = _texels(sensor, path)
    parameters = _parameters(sensor, path)
    probes = _probes(found.probe, path)
    trials, warnings = _read_trials(found, path, len(texels), probes)
    rig = Rig(
        name=found.name or checked_name(path.stem, f"'{path.name}'"),
        texels=texels,
        parameters=parameters,
        given=frozenset(set(sensor) & set(SENSOR_PARAMETERS)),
        grid=grid,
        indenter=None if found.indenter is None else _indenter(found.indenter, f"[indenter] of '{path.name}'", path),
        trials=tuple(trials),
        words=sensor,
        warnings=(*warnings, *_channel_warnings(trials)),
        correct=_faults_to_correct(found.data, path),
        cover=cover,
        probes=probes,
    )
    _check_units(rig, path)
    groups = [trial.repeats for trial in trials if trial.repeats]
    for group in groups:
        if groups.count(group) < 2:
            raise FileError(f"Only one recording of '{path.name}' has repeats = \"{group}\": name it on all repeats.")
    return rig


def _read_trials(words: RigWords, path: Path, texels: int, probes: Mapping[str, Indenter]) -> tuple[list[Trial], list[str]]:
    """Read the recordings that the [[trial]] tables name, put those of one session on one clock, and return remarks, too."""
    stated = {word: words.sensor[word] for word in ("contact_height",) if word in words.sensor}
    height = read_words(stated, TrialWords, f"[sensor] of '{path.name}'").contact_height or 0.0
    rules = read_column_rules(words.columns or {}, path, texels)
    trials, starts, warnings = [], [], []
    for number, entry in enumerate(words.trial, start=1):
        where = f"Trial {number} of '{path.name}'"
        said = read_words(entry, TrialWords, where)
        starts.append(read_start(said.session, said.started, where))
        own = {word: getattr(said, word) for word in ("factor", "zero", "force_zero", "contact_height")}
        if said.specimen and FREE not in own.values():
            raise FileError(f'{where} has a specimen and no free number: write factor = "free" or zero = "free".')
        file = _inside(said.file, f"Trial {number}'s file", path)
        own = {word: said.specimen or Path(said.file).stem if value == FREE else value for word, value in own.items()}
        if said.probe is not None and said.probe not in list(probes):
            known = ", ".join(sorted(probes)) or "none"
            raise FileError(f"probe of {where} is {said.probe!r:.60}: write the name of a [[probe]] of the rig ({known}).")
        if said.readings is None:
            columns = _columns(file, rules)
        else:
            second = read_words(said.readings, SecondLogger, f"the readings of {where}")
            files = file, _inside(second.file, f"Trial {number}'s readings", path)
            first, other = (_columns(one, rules, is_part=True) for one in files)
            columns = joined(first, other, second.late, files)
        trial, notes = _recorded(columns, file, said.use, texels, words.indenter is not None or bool(said.probe))
        warnings += notes
        if own["contact_height"] is None:
            own["contact_height"] = SHARED_HEIGHT if height == FREE else height
        if trial.stimulus == "force":
            own["contact_height"] = 0.0  # the force is known, wherever contact begins
        own |= {"probe": said.probe or "", "repeats": said.repeats, "tared": said.tared, "session": said.session}
        trials.append(replace(trial, **own))
    check_free_heights(trials, path)
    trials, notes = on_common_clocks(trials, starts, words.clock, path)
    names = [trial.name for trial in trials]
    for name in names:
        if names.count(name) > 1:
            raise FileError(
                f"Two trials of '{path.name}' read '{name}.csv': give each recording once, so that none judges itself."
            )
    if not any(trial.use == "fit" for trial in trials):
        raise FileError(f"No trial of '{path.name}' has use = \"fit\": give at least one to fit.")
    if not any((np.abs(part) > SMALLEST_RESPONSE).any() for trial in trials for part in trial.responses):
        raise FileError(
            f"All responses in '{path.name}' are zero: check that the sensor was connected and the right columns exported."
        )
    return trials, [*warnings, *notes]


def _faults_to_correct(table: Mapping[str, Any], path: Path) -> tuple[str, ...]:
    """Kinds of faults of the data that the rig's [data] wants to be put right."""
    known_words(table, ("correct",), f"[data] of '{path.name}'")
    wanted = table.get("correct", [])
    if wanted == "all":
        return tuple(FAULT_KINDS)
    if not isinstance(wanted, list) or not all(isinstance(kind, str) and kind in FAULT_KINDS for kind in wanted):
        raise FileError(
            f"correct of [data] in '{path.name}' is {wanted!r:.80}: write \"all\", or a list of {', '.join(FAULT_KINDS)}."
        )
    return tuple(wanted)


def _inside(name: Any, what: str, path: Path) -> Path:
    """Path of a file beside the rig `path`; a path that leads out of its folder is refused."""
    if not isinstance(name, str) or not name.strip():
        raise FileError(f"{what} of '{path.name}' names no file: write the name of one beside the rig.")
    name = checked_name(name, f"{what} of '{path.name}'")
    folder = path.resolve().parent
    found = (folder / name).resolve()
    if not found.is_relative_to(folder):
        raise FileError(f"{what} of '{path.name}' is '{name}', outside the rig's folder: move the file beside the rig.")
    if len(found.name.encode()) > LONGEST_NAME or not found.is_file():
        raise FileError(
            f"{what} of '{path.name}' is '{name}', which is not there: check the name, it counts from the rig's folder."
        )
    return found


# --- the sensor


def _texels(sensor: dict[str, Any], path: Path) -> tuple[Texels, tuple | None, Cover | None]:
    """Texels of the sensor, its grid if it is given as one, and its cover if it has one."""
    has_cover = not COVER_WORDS.isdisjoint(sensor)
    if ("grid" in sensor) + ("mesh" in sensor) + has_cover != 1:
        raise FileError(
            f"[sensor] of '{path.name}' needs one of grid = {{ rows, columns, pitch }}, mesh = \"….ply\", and sensors or "
            "strips with a cover."
        )
    if has_cover:
        texels, cover = read_cover(sensor, path)
        return texels, None, cover
    if "mesh" in sensor:
        mesh = _mesh(_inside(sensor["mesh"], "The sensor's mesh", path), "the sensor's mesh")
        texels = texels_from_region(mesh, np.ones(len(mesh.vertices), bool), "sensor")
        if len(texels) != len(mesh.vertices):
            raise SensorError(
                f"{len(mesh.vertices) - len(texels)} vertices of the mesh in '{path.name}' are on no face: "
                "remove them, so that texel numbers and vertices agree."
            )
        return texels, None, None
    rows, columns, pitch = checked_grid(sensor["grid"], f"'{path.name}'")
    return grid_texels(rows, columns, *pitch), (rows, columns, pitch), None


def grid_texels(rows: int, columns: int, pitch_x: float, pitch_y: float) -> Texels:
    """Return texels in z = 0, centred on the origin, rows along +y, columns along +x, normals +z; texel 0 is row 0, column 0.

    Parameters
    ----------
    rows, columns : int
    pitch_x, pitch_y : float, metres
    """
    from ...geometry.grid_layout import GridLayout

    row, column = np.divmod(np.arange(rows * columns), columns)
    x, y = (column - 0.5 * (columns - 1)) * pitch_x, (row - 0.5 * (rows - 1)) * pitch_y
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    quads = np.stack([corner, corner + 1, corner + columns + 1, corner + columns], axis=1)
    layout = GridLayout(rows, columns, row, column, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))
    return replace(flat_texels(np.stack([x, y], axis=1), np.full(len(x), pitch_x * pitch_y)), layout=layout)


def _mesh(path: Path, name: str) -> TriangleMesh:
    """A triangle mesh from a file."""
    import trimesh

    require_regular(path)
    try:
        # STL repeats the vertices of each triangle: they are merged, so that each is one texel
        loaded = trimesh.load(path, process=path.suffix.lower() == ".stl", force="mesh")
    except Exception as error:  # whatever a reader of meshes raises for a broken file
        raise FileError(f"'{path.name}' is not a mesh that can be read ({error}): give a PLY, STL or OBJ file.") from error
    if not hasattr(loaded, "faces"):
        raise FileError(f"'{path.name}' holds no faces: give a PLY, STL or OBJ file with triangles.")
    return checked_mesh(loaded.vertices, loaded.faces, name)[0]


def _parameters(sensor: dict[str, Any], path: Path) -> SensorParameters:
    """Parameters of the sensor."""
    where = f"[sensor] of '{path.name}'"
    known_words(sensor, {*SENSOR_PARAMETERS, *SHAPE_WORDS, *RIG_SENSOR_WORDS}, where)
    defaults: dict[str, Any] = {}
    if "thickness" in sensor:
        (thickness,) = checked_lengths(sensor["thickness"], 1, f"thickness of '{path.name}'")
        if thickness > 1.0:
            raise ParameterError(f"thickness of '{path.name}' is {thickness:g} m: give it in metres.")
        defaults["max_penetration"] = DEPTH_PER_THICKNESS * thickness
    values = stated_parameters(sensor, where)
    if not values.get("unit", "N").strip():
        raise ParameterError(f"unit of '{path.name}' is empty: write the unit's name, \"N\" for newtons.")
    parameters = SensorParameters(**(defaults | with_dependent_defaults(values)))
    parameters.check(f"sensor of {path.name}")
    return parameters


# --- the indenter


def _probes(entries: list[dict[str, Any]], path: Path) -> dict[str, Indenter]:
    """The probes that recordings may name."""
    found: dict[str, Indenter] = {}
    for number, entry in enumerate(entries, start=1):
        where = f"[[probe]] {number} of '{path.name}'"
        name = checked_name(entry.get("name", ""), where)
        if name in found:
            raise FileError(f"'{path.name}' has a [[probe]] {name!r} twice: give each a name of its own.")
        found[name] = _indenter(entry, where, path)
    return found


def _indenter(words: dict[str, Any], where: str, path: Path) -> Indenter:
    """The indenter, or a probe."""
    known_words(words, {"shape", "mesh", "name"}, where)
    if ("shape" in words) == ("mesh" in words):
        raise FileError(f"{where} needs either a shape or a mesh, and not both.")
    if "mesh" in words:
        mesh = _mesh(_inside(words["mesh"], "The indenter's mesh", path), "the indenter")
        return Indenter(turned_outwards(mesh, "the indenter"))
    from trimesh.creation import box, cylinder, icosphere

    solids: dict[str, tuple[str, int, Callable[..., Any]]] = {
        "sphere": ("radius", 1, lambda radius: icosphere(subdivisions=4, radius=radius)),
        "box": ("size", 3, lambda *edges: box(edges)),
        "cylinder": ("size", 2, lambda radius, height: cylinder(radius=radius, height=height, sections=256)),
    }
    shape = words["shape"]
    if not isinstance(shape, dict) or len(shape) != 1 or next(iter(shape)) not in solids:
        raise FileError(
            f"The shape in {where} is {shape!r}: write {{ sphere = radius }}, {{ box = [x, y, z] }} or "
            "{ cylinder = [radius, height] }, in metres."
        )
    ((kind, size),) = shape.items()
    what, count, solid_of = solids[kind]
    lengths = checked_lengths(size, count, f"The {kind}'s {what} in {where}")
    solid = solid_of(*lengths)
    mesh = checked_mesh(solid.vertices, solid.faces, "the indenter")[0]
    return Indenter(mesh, lengths[0] if kind == "sphere" else None, lengths if kind == "box" else None)


# --- trials


def _columns(file: Path, rules: Mapping[str, Column], is_part: bool = False) -> dict[str, np.ndarray]:
    """The columns of a trial's file; if another file has the rest of them, rules hold for those that this one has."""
    table = read_table(file)
    if is_part:
        rules = {name: rule for name, rule in rules.items() if name == "texel" or rule.names[0] in table.names}
    columns = translated(table.names, table.values, rules, file)
    if is_part:
        _clock(columns, file)
    return columns


def _recorded(columns: dict[str, np.ndarray], file: Path, use: str, texels: int, has_indenter: bool) -> tuple[Trial, list[str]]:
    """The trial of a CSV file with these columns, and remarks about it."""
    time = _clock(columns, file)
    kind = _stimulus_kind(columns, file, has_indenter)
    reading = _readings(columns, texels, file)
    if reading is None and columns.keys().isdisjoint(FORCE):
        raise FileError(f"'{file.name}' has no response: it needs texel_0 … texel_{texels - 1}, or force_x force_y force_z.")
    force = _vector(columns, FORCE, np.nan)
    if np.isnan(force).all() and (reading is None or np.isnan(reading).all()):
        raise FileError(
            f"Every cell of the response in '{file.name}' is empty: record the trial again, or remove its [[trial]]."
        )
    travel = _vector(columns, SLIDE, 0.0)
    level = None if kind == "pose" else columns[kind].copy()
    position = quaternion = None
    if "x" in columns:
        height = columns["z"] if kind == "pose" else np.zeros(len(time))  # a known weight acts wherever its z is
        position, quaternion = np.stack([columns["x"], columns["y"], height], axis=1), _turns(columns, file)
    stimuli: dict[str, np.ndarray] = {}
    for names, values in ((POSE, position), (TURN, quaternion), ((kind,), level), (SLIDE, travel)):
        if values is not None:
            stimuli |= zip(names, values.reshape(len(time), -1).T, strict=True)
    unknown, notes = _gaps_filled(stimuli, time, file)
    if quaternion is not None:
        quaternion = quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)
    strangers = [name for name in columns if name not in {*QUANTITIES} - {"texel"} and not name.startswith("texel_")]
    if strangers:
        notes.append(f"'{file.name}': {', '.join(map(repr, strangers))} mean nothing here and were left out.")
    temperature = _temperatures(columns, time, file)
    found = Trial(file.stem, use, time, kind, position, quaternion, level, travel, reading, force, temperature=temperature)
    parts = found.without(unknown)
    answers = [None if part is None or np.isnan(part).all() else part for part in (parts.reading, parts.force)]
    found = replace(found, reading=answers[0], force=answers[1])
    weighs = kind == "force" and found.force is not None
    if weighs and position is not None and np.diff(position, axis=0)[found.stays_pressed].any():
        notes.append(
            f"'{file.name}': x or y changes while the weight presses, so it slides and has friction; where it was lifted, "
            "write a force of zero before and after."
        )
    if not found.responses:
        raise FileError(
            f"No response in '{file.name}' has a stimulus at the same time: record both at the same time, or cut the file."
        )
    return found, notes


def _temperatures(columns: Mapping[str, np.ndarray], time: np.ndarray, file: Path) -> tuple[np.ndarray, np.ndarray] | None:
    """Times and temperatures of the samples that have one; None without a column of them."""
    values = columns.get("temperature")
    if values is None or np.isnan(values).all():
        return None
    known = np.isfinite(values)
    if (values[known] < LOWEST_TEMPERATURE).any() or (values[known] > HIGHEST_TEMPERATURE).any():
        worst = values[known][np.argmax(np.abs(values[known]))]
        raise FileError(
            f"`temperature` in '{file.name}' reaches {worst:g} °C: check its unit, [columns] takes "
            'temperature = { name = "…", unit = "K" }.'
        )
    return time[known], values[known]


def _clock(columns: Mapping[str, np.ndarray], file: Path) -> np.ndarray:
    """Times of the samples."""
    if "time" not in columns:
        raise FileError(f"'{file.name}' has no column `time`: add one, in seconds.")
    time = columns["time"]
    (missing,) = np.nonzero(np.isnan(time))
    if len(missing):
        raise FileError(f"Line {missing[0] + 2} of '{file.name}' has no time: each sample needs one, in seconds.")
    if len(time) < 8:
        many = "one sample" if len(time) == 1 else f"{len(time)} samples"
        raise FileError(f"'{file.name}' has {many}: a trial needs at least 8 to say how the sensor answers.")
    (back,) = np.nonzero(np.diff(time) <= 0)
    if len(back):
        line = back[0] + 3
        how = "stands still" if time[back[0] + 1] == time[back[0]] else "goes backwards"
        raise FileError(
            f"Time {how} at line {line} of '{file.name}' ({time[back[0] + 1]:g} s after {time[back[0]]:g} s): "
            "sort the samples, or cut the file where the clock was reset."
        )
    step = float(np.median(np.diff(time)))
    if step > LONGEST_STEP:
        raise FileError(
            f"The samples of '{file.name}' are {step:g} s apart: `time` must be in seconds, it looks like milliseconds."
        )
    return time


def _stimulus_kind(columns: Mapping[str, np.ndarray], file: Path, has_indenter: bool) -> str:
    """Kind of the rig's stimulus: "pose", "depth" or "force"."""
    lacking = [name for name in POSE if name not in columns]
    kinds = [kind for kind in ("depth", "force") if kind in columns]
    is_at_place = kinds == ["force"] and lacking in ([], ["z"])
    if len(lacking) < 3 and not is_at_place:
        if lacking:
            raise FileError(f"'{file.name}' has no column {', '.join(lacking)}: a pose needs x, y and z.")
        kinds.append("pose")
    if not kinds:
        raise FileError(f"'{file.name}' has no stimulus: it needs the columns x y z, or depth, or force.")
    if len(kinds) > 1:
        raise FileError(
            f"'{file.name}' has more than one stimulus ({' and '.join(sorted(kinds))}): keep the one that drove the rig."
        )
    if (is_at_place or kinds == ["pose"]) and not has_indenter:
        what = "says where a force acts" if is_at_place else "gives the indenter's pose"
        raise FileError(f"'{file.name}' {what} and the rig has no [indenter]: describe its shape.")
    return kinds[0]


def _readings(columns: Mapping[str, np.ndarray], texels: int, file: Path) -> np.ndarray | None:
    """Readings of all texels, (T, n); None without any."""
    names = [name for name in columns if name.startswith("texel_")]
    if not names:
        return None
    wanted = [f"texel_{i}" for i in range(texels)]
    lost = [name for name in wanted if name not in columns]
    if lost and wanted[-1] in columns:
        raise FileError(
            f"'{file.name}' has no column {lost[0]}{' and others' if len(lost) > 1 else ''} of the sensor's {texels} texels: "
            "export every texel; one that is not connected has empty cells."
        )
    if len(names) != texels:
        raise FileError(f"'{file.name}' has {len(names)} texel columns and the sensor has {texels} texels: make them agree.")
    if lost:
        raise FileError(f"'{file.name}' has no column {lost[0]}: texels are numbered texel_0 to texel_{texels - 1}.")
    return np.stack([columns[name] for name in wanted], axis=1)


def _vector(columns: Mapping[str, np.ndarray], names: tuple[str, ...], missing: float) -> np.ndarray:
    """Columns of a vector, (T, c), with one value in those that are missing."""
    otherwise = np.full(len(columns["time"]), missing)
    return np.stack([columns.get(name, otherwise) for name in names], axis=1)


def _turns(columns: Mapping[str, np.ndarray], file: Path) -> np.ndarray:
    """Orientations of the indenter, (T, 4)."""
    found = [name for name in TURN if name in columns]
    if not found:
        return np.tile([1.0, 0.0, 0.0, 0.0], (len(columns["x"]), 1))
    if len(found) < 4:
        lacking = ", ".join(name for name in TURN if name not in columns)
        raise FileError(f"'{file.name}' has no column {lacking}: an orientation needs qw, qx, qy and qz.")
    steady = with_steady_signs(columns)
    turns = np.stack([steady[name] for name in TURN], axis=1)
    length = np.linalg.norm(turns, axis=1)
    (bad,) = np.nonzero(np.abs(length - 1.0) > 0.05)
    if len(bad):
        raise FileError(
            f"Line {bad[0] + 2} of '{file.name}': qw qx qy qz have length {length[bad[0]]:.3g}, a rotation has length 1."
        )
    return turns


def _gaps_filled(stimuli: Mapping[str, np.ndarray], time: np.ndarray, file: Path) -> tuple[np.ndarray, list[str]]:
    """Interpolate missing values of the columns of the stimulus in place; return remarks, too.

    The first result, (T,) bool, has the samples in gaps that are too long for it: what answered there cannot be judged.
    """
    unknown, total = np.zeros(len(time), bool), 0
    for name, column in stimuli.items():
        missing = np.isnan(column)
        if missing.all():
            raise FileError(f"Every cell of column '{name}' in '{file.name}' is empty: record the trial again.")
        if missing.any():
            total += int(missing.sum())
            unknown |= np.isnan(bridged(time, column))
            column[missing] = np.interp(time[missing], time[~missing], column[~missing])
    notes = [f"'{file.name}': {total} missing values of the stimulus were interpolated."] if total else []
    if unknown.any():
        notes.append(
            f"'{file.name}': responses at {unknown.sum()} samples are not used, because the stimulus is missing for too long "
            "there."
        )
    return unknown, notes


def _channel_warnings(trials: list[Trial]) -> list[str]:
    """Name the texels without any value, and those whose reading has the same value, not zero, in all recordings."""
    readings = [trial.reading for trial in trials if trial.reading is not None]
    if not readings:
        return []
    values = np.concatenate(readings)
    measured = ~np.isnan(values).all(axis=0)
    high, low = np.nanmax(values, axis=0, initial=-np.inf), np.nanmin(values, axis=0, initial=np.inf)
    notes = []
    for found, what in ((~measured, "no values in any recording"), (measured & (high == low) & (high != 0), "one value only")):
        names = [f"texel_{i}" for i in np.flatnonzero(found)]
        if names:
            more = f" and {len(names) - 3} more" if len(names) > 3 else ""
            notes.append(f"{', '.join(names[:3])}{more}: {what}; check the connection, they say nothing about the sensor.")
    return notes


def _check_units(rig: Rig, path: Path) -> None:
    """Refuse lengths that must be millimetres: a depth far beyond the sensor's back, or a pose far away from it.

    How a weight at a place is shared follows from how far it sinks in, so its rig has to state the stiffness.
    """
    deepest = rig.parameters.max_penetration
    for trial in rig.trials:
        if trial.stimulus == "depth":
            assert trial.level is not None
            if trial.level.max() > 20 * deepest:
                raise FileError(
                    f"`depth` of '{trial.name}.csv' reaches {trial.level.max():g} m, "
                    f"and the sensor can be pressed in by {deepest:g} m: "
                    "give it in metres."
                )
        elif trial.position is not None:
            indenter = rig.indenter_of(trial)
            assert indenter is not None
            spans = [float(np.linalg.norm(np.ptp(points, axis=0))) for points in (rig.surface.position, indenter.mesh.vertices)]
            if np.abs(trial.position).max() > 20 * max(sum(spans), deepest):
                raise FileError(
                    f"The pose in '{trial.name}.csv' reaches {np.abs(trial.position).max():g} m from a sensor of "
                    f"{spans[0]:.3g} m: give x, y and z in metres."
                )
            if trial.stimulus == "force" and "k" not in rig.given:
                raise FileError(
                    f"'{trial.name}.csv' has a force at a place, and [sensor] of '{path.name}' no k: state it, it says how far "
                    "the indenter sinks in and which texels share the force."
                )
