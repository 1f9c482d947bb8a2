# SPDX-License-Identifier: GPL-3.0-or-later
"""The next experiment on a probe in the scene: the planned trajectory as keyframes."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import bpy
import numpy as np

from ...core.errors import SceneError
from ...core.jobs import Progress, part_of_job
from ..scene import mesh_arrays
from ..session import fcurves, first_use, identity, transforms
from . import gap_results

if TYPE_CHECKING:
    from ...core.gap.planning.experiment_plan import PlannedExperiment
    from ...core.gap.planning.paths import Trajectory, Wishes

MARK = "palpate_planned_probe"
"""Custom property of probes that were made for a plan."""


_planned: dict[str, tuple[str, str, str]] = {}
"""By key of the sensor, in this session: rig, probe and sentence of its last plan."""


def sentence_of(obj) -> str:
    """Return the kinds that the last plan of a sensor's rig separates; empty without a plan, and once its probe is gone."""
    rig, probe, sentence = _planned.get(identity.key(obj), ("", "", ""))
    return sentence if rig == obj.palpate.measured and probe in bpy.data.objects else ""


def plan(obj, wishes: Wishes):
    """Plan the next experiment of a sensor: between the kinds that the last search left ambiguous, else in advance.

    Yields
    ------
    Progress

    Returns
    -------
    (PlannedExperiment or None, Rig)
        None if the recordings distinguish all kinds.
    """
    from ...core.gap.dataset.rig import read_rig
    from ...core.gap.planning.experiment_plan import plan_after, plan_experiment

    yield from first_use.wait()
    yield Progress("Reading the recordings", 0, 1000)
    rig = read_rig(gap_results.rig_path(obj))
    if rig.indenter is None or all(trial.stimulus != "pose" for trial in rig.trials):
        raise SceneError(
            f"The recordings of '{obj.name}' have no poses that a probe could follow: `palpate gap --plan` writes what to do."
        )
    found = gap_results.of(obj)
    if found is not None and found.diagnosis.ambiguous:
        experiment = yield from part_of_job(plan_after(found.diagnosis, wishes), _named)
        if experiment is not None:
            return experiment, rig
    advance = yield from part_of_job(plan_experiment(rig, wishes), _named)
    return advance.experiment, rig


def _named(step: Progress) -> Progress:
    return replace(step, stage=f"Planning: {step.stage}")


def put_on_probe(context, obj, experiment: PlannedExperiment, rig):
    """Put a planned trajectory on a probe as keyframes, from the first frame on, and make the frame range long enough.

    Parameters
    ----------
    context : Context
        The probe is the selected target beside the sensor, else that of an earlier plan, else a new one with the rig's shape.
    obj : Object
        The sensor, whose pose at the first frame counts.
    experiment : PlannedExperiment
    rig : Rig

    Returns
    -------
    Object
    """
    from ...core.gap.report.plan_files import experiment_words, planned_sentence

    scene, trajectory = context.scene, experiment.trajectory
    metres = transforms.metres_per_unit(scene)
    probe = _probe(context, obj, rig, metres)
    scene.frame_set(scene.frame_start)
    frames, places, turn = keys(obj, trajectory, scene.frame_start, transforms.frames_per_second(scene), metres)
    probe.parent = None
    probe.rotation_mode = "QUATERNION"
    probe.rotation_quaternion = turn
    curves, _ = fcurves.ensure(probe, f"{probe.name} plan")
    fcurves.remove(curves, ("rotation_euler", "rotation_quaternion", "rotation_axis_angle"))
    fcurves.write(curves, "location", frames, places)
    scene.frame_end = max(scene.frame_end, int(np.ceil(frames[-1])))
    scene.frame_set(scene.frame_start)
    identity.ensure_uid(obj)
    sentence = planned_sentence(experiment_words(experiment, f"'{probe.name}'"))
    _planned[identity.key(obj)] = obj.palpate.measured, probe.name, sentence
    return probe


def keys(obj, trajectory: Trajectory, first: int, rate: float, metres: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return frames (k,), locations in the world (k, 3) in Blender units, and the rotation (4,) of a probe on a trajectory.

    Parameters
    ----------
    obj : Object
        The sensor.
    trajectory : Trajectory
    first : int
        Frame of its beginning.
    rate : float
        Frames per second.
    metres : float
        Metres per Blender unit.
    """
    from ...core.geometry.rotations import quaternion_product

    location, quaternion, _ = transforms.decompose(transforms.as_array(obj.matrix_world))
    places = location + trajectory.position @ transforms.rotation(quaternion).T / metres
    turn = quaternion_product(quaternion[None], trajectory.trial.quaternion[:1])[0]
    return first + trajectory.knots * rate, places, turn


def _probe(context, obj, rig, metres: float):
    """The object that follows the trajectory."""
    chosen = [one for one in context.selected_objects if one is not obj and one.palpate.role == "TARGET"]
    if len(chosen) > 1:
        raise SceneError(f"{len(chosen)} targets are selected: select the one that is to follow the plan, or none.")
    if chosen:
        return chosen[0]
    earlier = next((one for one in context.scene.objects if one.get(MARK) == obj.name), None)
    if earlier is not None:
        return earlier
    shape = rig.indenter.mesh
    mesh = mesh_arrays.new_mesh("Planned Probe", shape.vertices / metres, shape.triangles.tolist())
    probe = bpy.data.objects.new("Planned Probe", mesh)
    next((found for found in obj.users_collection if found.is_editable), context.scene.collection).objects.link(probe)
    probe.display_type = "WIRE"
    probe[MARK] = obj.name
    probe.palpate.role = "TARGET"
    return probe
