# SPDX-License-Identifier: GPL-3.0-or-later
"""Measurements of a real sensor beside the sensor in the scene: what was found out about them, and where it is shown.

Results live in this session only; what is kept in the file is the path of the rig, and effects once they are on the sensor.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
import numpy as np

from ...core.errors import SceneError
from ...core.figures import color_maps
from ...core.figures.quantities import ERROR, Scale, error_scale
from ...core.jobs import Progress, part_of_job
from ..authoring import exchange
from ..properties import effect_stack
from ..scene import participants, sensor_reader
from ..scene.stored_names import GAP_COLORS
from ..session import first_use, identity, transforms

if TYPE_CHECKING:
    from ...core.gap.report.comparison import GapErrors
    from ...core.gap.selection.findings import Diagnosis

MARK = "gap: "
"""How the timeline markers of phases begin."""


@dataclass
class Result:
    """Measurements and results of one sensor."""

    diagnosis: Diagnosis
    errors: GapErrors
    headline: str
    lines: list[str]
    experiment: str
    caution: str
    pictures: dict[str, Path]


@dataclass(frozen=True)
class Shown:
    """Model whose error the colours of a sensor show, and their scale."""

    amended: bool
    scale: Scale


_results: dict[str, Result] = {}
_shown: dict[str, Shown] = {}


def of(obj) -> Result | None:
    """Return the measurements and results of a sensor."""
    return _results.get(identity.key(obj))


def _found(obj) -> Result:
    """Return the results of a sensor; raises SceneError where there are none."""
    result = of(obj)
    if result is None:
        raise SceneError(f"Nothing was found for '{obj.name}' yet: use Find Gap first.")
    return result


def shown_on(obj) -> Shown | None:
    """Return which errors the colours of a sensor show; None if they show none, as after an undo."""
    layer = obj.data.color_attributes.active_color
    return _shown.get(identity.key(obj)) if layer is not None and layer.name == GAP_COLORS else None


def rig_path(obj) -> Path:
    """Return the path of a sensor's rig; raises SceneError when none was chosen."""
    if not obj.palpate.measured:
        raise SceneError(f"'{obj.name}' has no measurements: choose its rig.toml first.")
    return Path(bpy.path.abspath(obj.palpate.measured))


def find(obj):
    """Find out what the model misses in a sensor's measurements.

    Yields
    ------
    Progress
        Closing the generator stops it and keeps what was known before.

    Returns
    -------
    Result
    """
    from ...api.gap import read_rig, search
    from ...core.figures.figure_canvas import save_figure
    from ...core.gap.report import sentences
    from ...core.gap.report.plots import picture

    yield from first_use.wait()
    yield Progress("Reading the recordings", 0, 1000)
    rig = read_rig(rig_path(obj))
    gap = yield from part_of_job(search(rig), lambda step: replace(step, stage=f"Finding the gap: {step.stage}"))
    diagnosis, errors = gap.diagnosis, gap.errors
    folder, pictures = Path(tempfile.mkdtemp(prefix="gap-", dir=bpy.app.tempdir)), {}
    for name in ("curves", "gap", "loops"):
        yield Progress("Drawing", 990, 1000)
        pictures[name] = folder / f"{name}.png"
        save_figure(picture(name, diagnosis, errors), pictures[name], 150)
    identity.ensure_uid(obj)
    evidence = sentences.evidence(diagnosis, errors)
    advice, caution = sentences.next_experiment(diagnosis), sentences.caution(diagnosis)
    result = Result(diagnosis, errors, gap.headline, evidence, advice, caution, pictures)
    _shown.pop(identity.key(obj), None)
    _results[identity.key(obj)] = result
    return result


def add_found(obj) -> int:
    """Put the fitted parameters and what was found on the sensor; return how many effects it has now."""
    from ...core.gap.report.amended_sensor import amended_sensor

    result = _found(obj)
    model = amended_sensor(result.diagnosis)
    per_texel = [e.name for e in model.effects if any(isinstance(value, tuple) for value in e.values.values())]
    own = len(_texels(bpy.context, obj)) if per_texel else 0
    if per_texel and own != len(result.diagnosis.rig.texels):
        raise SceneError(
            f"The rig's sensor has {len(result.diagnosis.rig.texels)} texels and '{obj.name}' has {own}: "
            f"{per_texel[0]} has a number for each, so give both the same grid."
        )
    put(obj, model)
    return len(obj.palpate.effects)


def put(obj, model) -> None:
    """Put a sensor's parameters and effects on an object."""
    exchange.put_parameters(obj, model.parameters)
    effect_stack.put_stack(obj, model.effects)


def sensor_called(scene, name: str | None, how: str = "name one with --sensor"):
    """Return a sensor of a scene by its name, or the only one; raises SceneError, which says `how` to name one of several."""
    if name is not None:
        return participants.sensors_called(scene, [name])[0]
    sensors = [obj for obj in scene.objects if obj.palpate.role == "SENSOR"]
    if len(sensors) != 1:
        known = ", ".join(f"'{obj.name}'" for obj in sensors) or "none"
        raise SceneError(f"'{scene.name}' has {len(sensors)} sensors ({known}): {how}.")
    return sensors[0]


def show_on_sensor(context, obj, amended: bool) -> str:
    """Colour the sensor's vertices by the error of their texels; return the largest one in words."""
    from ...core.gap.report.comparison import rms_by_texel

    result = _found(obj)
    d = result.diagnosis
    texels = _texels(context, obj)
    base, values = (ERROR.values(rms_by_texel(d, model), texels) for model in (d.base.model, (d.base, d.best)[amended].model))
    scale = error_scale(float(base.max()))
    if len(texels) != len(values):
        raise SceneError(
            f"The rig's sensor has {len(values)} texels and '{obj.name}' has {len(texels)}: give both the same grid to see it."
        )
    mesh = obj.data
    old = mesh.color_attributes.get(GAP_COLORS)
    if old is not None:
        mesh.color_attributes.remove(old)
    layer = mesh.color_attributes.new(GAP_COLORS, "FLOAT_COLOR", "POINT")
    colours = np.full((len(mesh.vertices), 4), (0.2, 0.2, 0.2, 1.0))
    colours[texels.vertex, :3] = color_maps.linear(scale.colors(values))
    layer.data.foreach_set("color", colours.ravel())
    mesh.color_attributes.active_color = layer
    _shown[identity.key(obj)] = Shown(amended, scale)
    for area in context.screen.areas if context.screen else ():
        if area.type == "VIEW_3D":  # the colours of the scale, not those of a lit surface
            area.spaces.active.shading.color_type = "VERTEX"
            area.spaces.active.shading.light = "FLAT"
    return scale.words(float(values.max()))


def _texels(context, obj):
    return sensor_reader.sensor_in_own_frame(context.scene, obj, participants.depsgraph_of(context.scene))[0].texels


def mark_phases(scene, obj) -> int:
    """Put timeline markers where the most loaded texel of the first fitted trial enters a phase; return how many."""
    from ...core.gap.forward.contact_phases import PHASES, phase_indices, relative_load

    result = _found(obj)
    predictor = result.diagnosis.of("fit")[0]
    texel = int(relative_load(predictor.stimulus).sum(axis=0).argmax())
    at, time = phase_indices(predictor.stimulus)[:, texel], predictor.trial.time
    for marker in [marker for marker in scene.timeline_markers if marker.name.startswith(MARK)]:
        scene.timeline_markers.remove(marker)
    changes = [0, *(int(i) for i in np.flatnonzero(np.diff(at)) + 1)]
    last, count = -1, 0
    for i in changes:
        frame = scene.frame_start + round(float(time[i] - time[0]) * transforms.frames_per_second(scene))
        if frame > last:
            scene.timeline_markers.new(f"{MARK}{PHASES[at[i]]}", frame=frame)
            last, count = frame, count + 1
    return count
