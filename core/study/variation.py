# SPDX-License-Identifier: GPL-3.0-or-later
"""A scenario with varied numbers: which names a study may vary, their bounds, and what each changes.

======================================  =================================================================================
``SENSOR.k`` and every parameter        of :class:`.SensorParameters`
``SENSOR.effect.KIND``                  true or false: whether the sensor has the effect
``SENSOR.effect.KIND.PARAMETER``        parameter of the effect, ``form`` or ``seed``; the effect is added if need be
``BODY.mass``                           kg, of a body that forces move; its inertia grows with it
``BODY.shift.x``, ``y``, ``z``          m, added to the whole motion, in the world
``BODY.turn.x``, ``y``, ``z``           rad, a rotation vector about the body's origin at the first frame, in the world
``BODY.velocity.x``, …                  m/s, of a free body at the start; ``angular_velocity`` in rad/s
``BODY.drive.PARAMETER``                of :class:`.Drive`; ``drive.target`` in the unit of its control, constant
``TARGET.scale``                        factor of its shape about the body's origin
``TARGET.mesh``                         its shape: a mesh file, in metres, in the frame of its body
``gravity.x``, ``y``, ``z``             m/s²
``press.NUMBER``                        of :class:`.Press`
======================================  =================================================================================

Bounds and units come from the specifications that panels and files use.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from ..effects.engine.registry import check_scenario, effect, form_of, kind_of, library
from ..errors import PalpateError, ParameterError, did_you_mean
from ..geometry.mesh import TriangleMesh, mass_properties, outward_faces
from ..geometry.rotations import quaternion_product, quaternions_from_vectors, rotation_matrices
from ..io.input_files import load_mesh
from ..model.body import DRIVE_PARAMETERS, Body, Motion, Signal
from ..model.parameter import ChoiceParameter, Parameter, Specification, TextParameter
from ..model.recording import AXES
from ..model.scenario import Scenario
from ..model.sensor import Effect, Sensor
from ..model.sensor_parameters import SENSOR_PARAMETERS
from ..model.shared_results import SharedResults
from .presses import PRESS_PARAMETERS, Press, with_press

MOST_MESHES_KEPT = 64
"""Meshes that a process keeps in memory."""
PRESS = "press"
"""First word of the numbers of a press."""

_BODY_VECTORS = {"shift": "m", "turn": "rad", "velocity": "m/s", "angular_velocity": "rad/s"}
MOTION_WORDS = (*_BODY_VECTORS, "drive", "mass")
"""First words of the names of what decides how a body moves."""


@dataclass(frozen=True)
class Variable:
    """A number, text or switch that a study may vary.

    Attributes
    ----------
    name : str
        As the study writes it.
    owner : str
        Name of the sensor, body or target; ``gravity`` and ``press`` own theirs.
    words : tuple of str
        The rest of the name.
    specification : Specification or None
        None for a switch, which is true or false.
    """

    name: str
    owner: str
    words: tuple[str, ...]
    specification: Specification | None

    def read(self, value: Any) -> Any:
        """Return a value that a study gives, checked; raise :class:`ParameterError` when it means nothing here."""
        if self.specification is None:
            if not isinstance(value, bool):
                raise ParameterError(f"{self.name} is {value!r:.60}: write true or false.")
            return value
        read = self.specification.read(value)
        if read is None:
            raise ParameterError(f"{self.name} is {value!r:.60}: give {self.specification.wanted}.")
        self.specification.check(read, f"'{self.owner}' in the study")
        return read


def variables_of(scenario: Scenario, has_press: bool = False) -> dict[str, Variable]:
    """Return the parameters of a scenario that can vary, by name, without effects: :func:`variable` knows these too."""
    found: dict[str, Variable] = {}

    def add(owner: str, words: tuple[str, ...], specification: Specification | None) -> None:
        name = ".".join((owner, *words))
        found.setdefault(name, Variable(name, owner, words, specification))

    for sensor in scenario.sensors:
        for key, specification in SENSOR_PARAMETERS.items():
            add(sensor.name, (key,), specification)
    for body in scenario.bodies:
        for words, specification in _body_words(body):
            add(body.name, words, specification)
    for target in scenario.targets:
        if target.sensor is None:
            add(target.name, ("scale",), Parameter("scale", "1", 1.0, 0.0, inf, "Factor of the shape", above_low=True))
            add(target.name, ("mesh",), TextParameter("mesh", "", "File of the shape"))
    for axis in AXES:
        add("gravity", (axis,), Parameter(axis, "m/s²", 0.0, -inf, inf, "Acceleration of gravity"))
    if has_press:
        for key, specification in PRESS_PARAMETERS.items():
            add(PRESS, (key,), specification)
    return found


def _body_words(body: Body) -> Iterable[tuple[tuple[str, ...], Specification]]:
    if body.moved_by_forces:
        yield ("mass",), Parameter("mass", "kg", 1.0, 0.0, inf, "Mass", above_low=True)
    for word, unit in _BODY_VECTORS.items():
        if body.free or "velocity" not in word:
            for axis in AXES:
                yield (word, axis), Parameter(f"{word}.{axis}", unit, 0.0, -inf, inf, f"{word} along {axis}")
    if body.drive is not None:
        for key, specification in DRIVE_PARAMETERS.items():
            yield ("drive", key), specification
        yield ("drive", "target"), Parameter("target", "", 0.0, -inf, inf, "Target of the drive")  # in the unit of its control


def variable(name: str, known: Mapping[str, Variable], scenario: Scenario) -> Variable:
    """Return the variable of a name.

    Parameters
    ----------
    name : str
    known : mapping of str to Variable
        Of :func:`variables_of`.
    scenario : Scenario

    Raises
    ------
    PalpateError
        There is none; the message has the name that is most like it.
    """
    if name in known:
        return known[name]
    for sensor in sorted(scenario.sensors, key=lambda sensor: -len(sensor.name)):
        if name.startswith(f"{sensor.name}.effect."):
            return _effect_variable(name, sensor)
    advice = did_you_mean(name, known, "--list shows the names of this scene.", 0.5)
    raise ParameterError(f"There is no '{name}' to vary in '{scenario.name}': {advice}")


def _effect_variable(name: str, sensor: Sensor) -> Variable:
    """Return the variable ``SENSOR.effect.KIND[.WORD]``."""
    words = tuple(name.removeprefix(f"{sensor.name}.").split("."))
    kind = kind_of(words[1])
    if len(words) == 2:
        return Variable(name, sensor.name, words, None)
    if words[2] == "form":
        return Variable(name, sensor.name, words, TextParameter("form", kind.forms[0].name, "Form of the effect"))
    if words[2] == "seed":
        return Variable(name, sensor.name, words, Parameter("seed", "1", 0.0, 0.0, 2**31 - 1, "Seed of random numbers"))
    known = {p.name: p.scaled(sensor.parameters.gain) for form in kind.forms for p in form.parameters}
    if len(words) > 3 or words[2] not in known:
        advice = did_you_mean(words[2], known, f"it has {', '.join(known)}.")
        raise ParameterError(f"There is no parameter '{'.'.join(words[2:])}' of effect '{kind.name}' in '{name}': {advice}")
    return Variable(name, sensor.name, words, known[words[2]])


def owners_text(scenario: Scenario) -> str:
    """Return all names that may vary in a scenario, one a line, with units and bounds, and the kinds of effects."""
    lines = []
    for item in variables_of(scenario, has_press=True).values():
        specification = item.specification
        if isinstance(specification, Parameter):
            unit = "" if specification.unit in ("", "1") else f" {specification.unit}"
            lines.append(f"{item.name}{unit}: {specification.bounds}")
        elif isinstance(specification, ChoiceParameter):
            lines.append(f"{item.name}: one of {', '.join(str(choice.value) for choice in specification.choices)}")
        else:
            lines.append(f"{item.name}: {'a mesh file' if item.words == ('mesh',) else 'a text'}")
    for sensor in scenario.sensors:
        lines.append(f"{sensor.name}.effect.KIND[.PARAMETER]: KIND is one of {', '.join(library())}")
    return "\n".join(lines)


def varied_scenario(
    scenario: Scenario,
    values: Mapping[str, Any],
    press: Press | None = None,
    meshes: Mapping[str, Path] | None = None,
    shared: SharedResults | None = None,
) -> Scenario:
    """Return a scenario with the values of one run.

    Parameters
    ----------
    scenario : Scenario
        As the scene says.
    values : mapping of str to value
        By names that :func:`variable` knows.
    press : Press, optional
        The numbers of the study's press that do not vary.
    meshes : mapping of str to Path, optional
        The study's copies of the files with the shapes of targets, by the names that the study gives.
    shared : SharedResults, optional
        Of the runs of this process.

    Raises
    ------
    PalpateError
        A value is not possible, or the scenario does not make a run with it.
    """
    shared = shared or SharedResults()
    known = shared.of(variables_of, scenario, press is not None)
    grouped: dict[str, list[tuple[tuple[str, ...], Any]]] = {}
    for name, value in values.items():
        found = variable(name, known, scenario)
        grouped.setdefault(found.owner, []).append((found.words, found.read(value)))
    gravity = np.array(scenario.gravity, dtype=float)
    for words, value in grouped.pop("gravity", ()):
        gravity[AXES.index(words[0])] = value
    if press is not None:
        press = replace(press, **{words[0]: value for words, value in grouped.pop(PRESS, ())})
    sensors = tuple(_varied_sensor(sensor, grouped.get(sensor.name, ())) for sensor in scenario.sensors)
    changed = _with_shapes(replace(scenario, gravity=gravity, sensors=sensors), grouped, meshes or {})
    bodies = tuple(_varied_body(body, grouped.get(body.name, ()), scenario) for body in changed.bodies)
    changed = replace(changed, bodies=bodies)
    if press is not None:
        changed = with_press(changed, press)
    shared.of(check_scenario, changed)
    return changed


def _varied_sensor(sensor: Sensor, changes: Iterable[tuple[tuple[str, ...], Any]]) -> Sensor:
    own = {words[0]: value for words, value in changes if words[0] in SENSOR_PARAMETERS}
    parameters = replace(sensor.parameters, **own) if own else sensor.parameters
    by_kind: dict[str, dict[str, Any]] = {}
    for words, value in changes:
        if words[0] == "effect":
            by_kind.setdefault(words[1], {})[words[2] if len(words) > 2 else ""] = value
    effects = sensor.effects
    for kind, wanted in by_kind.items():
        effects = _varied_effects(effects, kind, wanted, parameters.gain)
    return replace(sensor, parameters=parameters, effects=effects) if own or by_kind else sensor


def _varied_effects(effects: tuple[Effect, ...], kind: str, wanted: dict[str, Any], gain: float) -> tuple[Effect, ...]:
    """Return the effects of a sensor with one kind added, changed or left out; of several of a kind the first is changed."""
    present = wanted.pop("", True)
    old = next((item for item in effects if item.name == kind), None)
    if not present:
        return tuple(item for item in effects if item.name != kind)
    form = str(wanted.pop("form", old.form if old else ""))
    seed = int(wanted.pop("seed", old.seed if old else 0))
    kept = dict(old.values) if old is not None and form_of(kind, form).name == old.form else {}
    fresh = effect(kind, form, seed, gain, **{**kept, **wanted})
    if old is None:
        return (*effects, fresh)
    return tuple(fresh if item is old else item for item in effects)


def _with_shapes(scenario: Scenario, grouped: Mapping[str, list], meshes: Mapping[str, Path]) -> Scenario:
    """Return the scenario with the targets in their shapes and sizes, and the mass properties of the bodies that these are."""
    targets, bodies = list(scenario.targets), list(scenario.bodies)
    for index, target in enumerate(targets):
        own = {words[0]: value for words, value in grouped.get(target.name, ()) if words in (("scale",), ("mesh",))}
        if not own or target.sensor is not None:
            continue
        if target.deformation is not None:
            raise PalpateError(f"'{target.name}' deforms, so its {' and '.join(own)} cannot vary: leave it out of the study.")
        mesh, name = target.mesh, own.get("mesh")
        if name is not None:
            if name not in meshes:
                raise ParameterError(
                    f"The mesh of '{target.name}' is '{name:.80}', and the study has no such file: check its name."
                )
            mesh = _shape_in(meshes[name])
        if own.get("scale", 1.0) != 1.0:
            mesh = replace(mesh, vertices=mesh.vertices * own["scale"])
        targets[index] = target = replace(target, mesh=mesh)
        body = bodies[target.body]
        if body.moved_by_forces and body.name == target.name:
            center, inertia, _ = mass_properties(target.mesh, body.mass, body.name)
            bodies[target.body] = replace(body, center_of_mass=center, inertia=inertia)
    return replace(scenario, targets=tuple(targets), bodies=tuple(bodies))


@lru_cache(maxsize=MOST_MESHES_KEPT)
def _shape_in(copy: Path) -> TriangleMesh:
    """Return the mesh in a copy; if its faces pointed inwards, the beginning of the study has warned of it."""
    return outward_faces(load_mesh(copy), copy.name)[0]


def _varied_body(body: Body, changes: Iterable[tuple[tuple[str, ...], Any]], scenario: Scenario) -> Body:
    vectors: dict[str, np.ndarray] = {}
    drive = body.drive
    for words, value in changes:
        if words == ("mass",):
            body = replace(body, mass=value, inertia=body.inertia * (value / body.mass))
        elif words[0] == "drive" and drive is not None:
            change: dict[str, Any] = {words[1]: Signal.constant(value) if words[1] == "target" else value}
            drive = replace(drive, **change)
        elif words[0] in _BODY_VECTORS:
            before = np.array(getattr(body, words[0], np.zeros(3)), dtype=float)
            vectors.setdefault(words[0], before)[AXES.index(words[1])] = value
    if drive is not body.drive:
        body = replace(body, drive=drive)
    if "shift" in vectors or "turn" in vectors:
        body = replace(body, motion=_moved(body.motion, vectors.pop("shift", np.zeros(3)), vectors.pop("turn", np.zeros(3))))
    rest: dict[str, Any] = dict(vectors)
    return replace(body, **rest) if rest else body


def _moved(motion: Motion, shift: np.ndarray, turn: np.ndarray) -> Motion:
    """Return a motion that is turned as a whole about its first position, and shifted."""
    by = quaternions_from_vectors(turn[None])
    middle = motion.positions[0]
    positions = (motion.positions - middle) @ rotation_matrices(by)[0].T + middle + shift
    return Motion(motion.times, positions, quaternion_product(by, motion.quaternions))
