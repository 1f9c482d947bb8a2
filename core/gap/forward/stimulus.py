# SPDX-License-Identifier: GPL-3.0-or-later
"""The stimulus of each texel during a trial: depth, its rate, the direction of the normal force, and sliding.

It does not depend on fitted parameters, so it is computed once per trial. Spheres and boxes are computed in closed form: for a
sphere so that facets do not look like an effect, for a box so that texels can quickly be tried at many places. Every other
indenter goes through the solver's contact search.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from ...compiled.kernels import kernel
from ...errors import SceneError
from ...geometry.rotations import quaternion_product, rotation_vectors
from ...geometry.texels import Texels
from ...model.body import Body, Motion
from ...model.scenario import Scenario, Target
from ...model.sensor import Sensor
from ...solver.simulation import Simulation
from ..dataset.rig import Rig
from ..dataset.trial import Trial
from .closed_form_contact import Contact, shape_contact

PRECISION, WEIGHT_ERROR = 1e-6, 1e-3
"""Relative error of the force that is carried at the height at which an indenter rests: of the search, and at most."""
FIRST_BISECTIONS, MOST_STEPS = 12, 120
"""Steps of the search: halvings of the bracket at first, then three linear interpolations for each further halving."""
LEAST_WEIGHT = 1e-4
"""Forces below this share of the largest one of a recording need not rest on the sensor: a load cell's noise about zero."""
LONGEST_SPLIT = 3.0
"""Pause between two recordings, in samples, up to which they are parts of one recording that simply goes on."""


@dataclass(frozen=True)
class Stimulus:
    """The stimulus of all texels during a trial.

    Attributes
    ----------
    trial : Trial
    depth : (T, n) float, metres
        Perpendicular penetration; zero without contact, and in force trials.
    rate : (T, n) float, m/s
        Rate of the depth; zero without contact.
    force_share : (T, n) float or None, newtons
        Each texel's share of the known force, in force trials.
    normal : (T, n, 3) float or None
        Direction of the normal force on the sensor: the indenter's outward normal in the sensor's frame. None: straight into
        each texel.
    slide_speed : (T, n) float, m/s
        Speed of sliding over the sensor in contact.
    slip : (T, n, 3) float, m/s, or None
        The same as a vector in the sensor's frame; None if no net force was measured.
    mean_slip : (T, n, 3) float, m/s, or None
        Its mean since the sample before: how far the contact slid, over the time.
    overpressed : int
        Most texels at once that were pressed past their maximum penetration.
    """

    trial: Trial
    depth: np.ndarray
    rate: np.ndarray
    force_share: np.ndarray | None
    normal: np.ndarray | None
    slide_speed: np.ndarray
    slip: np.ndarray | None
    mean_slip: np.ndarray | None
    overpressed: int = 0

    @property
    def load(self) -> np.ndarray:
        """Load of each texel, (T, n) float: depth in metres, or its share of a known force in newtons."""
        return self.depth if self.force_share is None else self.force_share

    @property
    def time(self) -> np.ndarray:
        """(T,) seconds."""
        return self.trial.time


def stimulus_of(trial: Trial, rig: Rig, height: float | None = None) -> Stimulus:
    """Return the stimulus of the texels in a trial of a rig; under a cover the weighted one of its points.

    Parameters
    ----------
    trial : Trial
    rig : Rig
    height : float, metres, optional
        Another contact height than the trial's own, or than the one from which the fit of a free one starts.
    """
    return of_texels(surface_stimulus_of(trial, rig, height=height), rig)


def of_texels(stimulus: Stimulus, rig: Rig) -> Stimulus:
    """Return the stimulus of a rig's texels from that of the points of its surface.

    Loads are weighted as the forces are. Directions and speeds are means, weighted by the load as well.
    """
    if rig.cover is None:
        return stimulus
    to_texels = rig.cover.weights.T
    load = stimulus.load
    total = load @ to_texels
    scale = np.where(total > 0.0, total, 1.0)

    def mean(values: np.ndarray) -> np.ndarray:
        return (load * values) @ to_texels / scale

    def mean_vector(values: np.ndarray) -> np.ndarray:
        return np.stack([mean(values[:, :, axis]) for axis in range(3)], axis=2)

    normal = stimulus.normal
    if normal is not None:
        normal = np.where(total[:, :, None] > 0.0, mean_vector(normal), -rig.texels.normal)
        normal = normal / np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), 1e-12)
    return replace(
        stimulus,
        depth=stimulus.depth @ to_texels,
        rate=stimulus.rate @ to_texels,
        force_share=None if stimulus.force_share is None else total,
        normal=normal,
        slide_speed=mean(stimulus.slide_speed),
        slip=None if stimulus.slip is None else mean_vector(stimulus.slip),
        mean_slip=None if stimulus.mean_slip is None else mean_vector(stimulus.mean_slip),
    )


def surface_stimulus_of(trial: Trial, rig: Rig, texels: Texels | None = None, height: float | None = None) -> Stimulus:
    """Return the stimulus of the points of a rig's surface, which are its texels if it has no cover.

    Parameters
    ----------
    trial : Trial
    rig : Rig
    texels : Texels, optional
        These points at other places than the rig's.
    height : float, metres, optional
        As in :func:`stimulus_of`.
    """
    texels = rig.surface if texels is None else texels
    if height is None:
        height = trial.height_start if isinstance(trial.contact_height, str) else trial.contact_height
    seen = trial if height == 0.0 or trial.stimulus == "force" else _raised(trial, rig, height)
    return replace(_stimulus(seen, rig, texels), trial=trial)


def _raised(trial: Trial, rig: Rig, height: float) -> Trial:
    """The trial as seen from a sensor whose surface is higher (m)."""
    if trial.position is not None:
        up = rig.texels.normal.sum(axis=0)
        return replace(trial, position=trial.position - height * up / max(float(np.linalg.norm(up)), 1e-9))
    assert trial.level is not None
    clipped = trial.level.min() >= 0.0  # such a logger writes zero for whatever is above the surface
    return replace(trial, level=np.where(clipped & (trial.level <= 0.0), 0.0, trial.level + height))


def _stimulus(trial: Trial, rig: Rig, texels: Texels) -> Stimulus:
    """The stimulus of the texels, at the poses and depths of a trial."""
    along: Slides = (None, None)
    if np.ptp(trial.travel, axis=0).any():
        velocities = np.gradient(trial.travel, trial.time, axis=0), _mean_rate(trial.travel, trial.time)
        along = tuple(v[:, None, :1] * texels.tangent + v[:, None, 1:] * texels.bitangent for v in velocities)
    if trial.stimulus == "pose":
        return _posed(trial, rig, texels, along)
    if trial.stimulus == "force" and trial.position is not None and rig.indenter_of(trial) is not None:
        return _weighted(trial, rig, texels, along)
    assert trial.level is not None
    level = np.repeat(np.maximum(trial.level, 0.0)[:, None], len(texels), axis=1)
    if trial.stimulus == "force":
        return _of_forces(trial, level / texel_shares(rig).sum(), None, along)
    rate = np.where(level > 0, np.gradient(trial.level, trial.time)[:, None], 0.0)
    return Stimulus(trial, level, rate, None, None, *_slid(along, level))


def texel_shares(rig: Rig) -> np.ndarray:
    """Return how many texels, by area, each point of a rig's surface stands for, (m,) float."""
    return np.ones(len(rig.texels)) if rig.cover is None else rig.cover.share


Slides = tuple[np.ndarray | None, ...]
"""Velocity (T, n, 3) of a surface that slides by itself, and its mean since the sample before; None if it does not slide."""


def _of_forces(trial: Trial, load: np.ndarray, normal: np.ndarray | None, along: Slides) -> Stimulus:
    """Stimulus of known forces (T, n)."""
    nothing = np.zeros_like(load)
    return Stimulus(trial, nothing, nothing, load, normal, *_slid(along, load))


def _slid(along: Slides, load: np.ndarray) -> tuple[np.ndarray, np.ndarray | None, np.ndarray | None]:
    """Speed (T, n), velocity and mean velocity (T, n, 3) of a surface that slides by itself, where it is loaded."""
    slip, mean = (None if velocity is None else velocity * (load > 0)[:, :, None] for velocity in along)
    return (np.zeros_like(load) if slip is None else np.sqrt(dot(slip, slip))), slip, mean


def joined_stimuli(stimuli: Sequence[Stimulus], texels: Texels) -> tuple[Stimulus, list[int]]:
    """Return the stimuli of a session's trials as one, and the index of each trial's first sample.

    In a pause between two trials nothing touches the sensor: an unloaded sample follows the one trial, and another one precedes
    the next. There is no pause between the parts of a recording whose samples simply go on.

    Parameters
    ----------
    stimuli : sequence of Stimulus
        In order of time.
    texels : Texels
    """
    if len(stimuli) == 1:
        return stimuli[0], [0]
    parts, starts = [stimuli[0]], [0]
    for before, after in pairwise(stimuli):
        pause = float(after.time[0] - before.time[-1])
        if pause > LONGEST_SPLIT * max(before.trial.step, after.trial.step):
            ends = [before.time[-1] + min(before.trial.step, pause / 3), after.time[0] - min(after.trial.step, pause / 3)]
            nothing = np.zeros((2, len(texels)))
            share = None if before.force_share is None else nothing
            pausing = replace(before.trial, time=np.array(ends))
            parts.append(Stimulus(pausing, nothing, nothing, share, None, nothing, None, None))
        starts.append(sum(len(part.time) for part in parts))
        parts.append(after)
    still = np.zeros((len(texels), 3))
    missing = {"normal": -texels.normal, "slip": still, "mean_slip": still}

    def joined(name: str) -> np.ndarray | None:
        pairs = [(getattr(part, name), (len(part.time), len(texels), 3)) for part in parts]
        if all(one is None for one, _ in pairs):
            return None
        return np.concatenate([np.broadcast_to(missing[name], shape) if one is None else one for one, shape in pairs])

    names = ("depth", "rate", "force_share", "normal", "slide_speed", "slip", "mean_slip")
    arrays: dict[str, Any] = {name: joined(name) for name in names}
    time = np.concatenate([part.time for part in parts])
    overpressed = max(one.overpressed for one in stimuli)
    return replace(stimuli[0], trial=replace(stimuli[0].trial, time=time), overpressed=overpressed, **arrays), starts


def _posed(trial: Trial, rig: Rig, texels: Texels, along: Slides) -> Stimulus:
    """Stimulus of a trial with a known pose."""
    assert trial.position is not None and trial.quaternion is not None
    reach = rig.parameters.max_penetration
    for _ in range(6):
        depth, normal, point, deep = _contact(trial, rig, texels, reach)
        if not deep:
            break
        reach *= 2.0  # a real sensor goes on acting where the model's penetration ends: search from further behind
    else:
        raise SceneError(
            f"The indenter of '{trial.name}.csv' goes right through the sensor (by more than {0.5e3 * reach:.3g} mm): "
            "check the pose's unit, its origin (the shape's centre) and the sign of z."
        )
    contact, (motion, mean_motion) = (depth, normal, point), _motions(trial)
    rate, slide, slip = _split(motion, trial.position, contact, along[0], trial.force is not None)
    mean_slip = None if slip is None else _split(mean_motion, _midway(trial.position), contact, along[1], True)[2]
    overpressed = int((depth > rig.parameters.max_penetration).sum(axis=1).max(initial=0))
    return Stimulus(trial, depth, rate, None, normal, slide, slip, mean_slip, overpressed)


def _motions(trial: Trial) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and angular velocity of an indenter, (T, 6) m/s and rad/s: at the samples, and means since the sample before."""
    assert trial.position is not None and trial.quaternion is not None
    time, samples = trial.time, np.arange(len(trial.time))
    before, after = np.maximum(samples - 1, 0), np.minimum(samples + 1, len(time) - 1)
    motion = np.gradient(trial.position, time, axis=0), _spin(trial.quaternion, time, before, after)
    mean_motion = _mean_rate(trial.position, time), _spin(trial.quaternion, time, before, np.maximum(samples, 1))
    return np.concatenate(motion, axis=1), np.concatenate(mean_motion, axis=1)


def _midway(position: np.ndarray) -> np.ndarray:
    """Places (T, 3) in the middle of the step to each sample."""
    return 0.5 * (position + np.concatenate([position[:1], position[:-1]]))


def _split(
    motion: np.ndarray, centre: np.ndarray, contact: tuple[np.ndarray, ...], surface: np.ndarray | None, with_slip: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Rate of the depth and speed of sliding, (T, n) m/s, and slip (T, n, 3) where an indenter touches texels.

    It moves and turns about its centre as `motion` (T, 6) says; `contact` is depth (T, n), normal and point (T, n, 3).
    """
    depth, normal, point = contact
    nothing = np.zeros((0, 0, 3))
    rate, slide, slip = np.zeros_like(depth), np.zeros_like(depth), np.zeros_like(normal) if with_slip else nothing
    moved = tuple(np.ascontiguousarray(one, dtype=float) for one in (motion[:, :3], motion[:, 3:], centre))
    along = nothing if surface is None else np.ascontiguousarray(surface)
    split_velocities(moved, along, depth, normal, point, (rate, slide, slip))
    return rate, slide, slip if with_slip else None


@kernel
def split_velocities(motion, along, depth, normal, point, split):  # type: ignore[no-untyped-def]
    """Split the velocity of the indenter where it touches texels into the rate of the depth, and sliding.

    Parameters
    ----------
    motion : tuple of three (T, 3) float
        Velocity, angular velocity and position of the indenter.
    along : (T, n, 3) or (0, 0, 3) float, m/s
        Velocity of a surface that slides by itself, if it does.
    depth : (T, n) float
    normal, point : (T, n, 3) float
    split : tuple of (T, n), (T, n) and (T, n, 3) or (0, 0, 3) float
        Rate of the depth, speed of sliding, and sliding velocity if it is wanted; written to, zero before.
    """
    velocity, spin, centre = motion
    rate, slide, slip = split
    moves = along.shape[0] > 0
    for i in range(depth.shape[0]):
        wx, wy, wz = spin[i, 0], spin[i, 1], spin[i, 2]
        for j in range(depth.shape[1]):
            if depth[i, j] <= 0.0:
                continue
            x, y, z = point[i, j, 0] - centre[i, 0], point[i, j, 1] - centre[i, 1], point[i, j, 2] - centre[i, 2]
            vx = velocity[i, 0] + (wy * z - wz * y)
            vy = velocity[i, 1] + (wz * x - wx * z)
            vz = velocity[i, 2] + (wx * y - wy * x)
            if moves:
                vx, vy, vz = vx + along[i, j, 0], vy + along[i, j, 1], vz + along[i, j, 2]
            nx, ny, nz = normal[i, j, 0], normal[i, j, 1], normal[i, j, 2]
            inward = vx * nx + vy * ny + vz * nz
            rate[i, j] = inward
            slide[i, j] = np.sqrt(max(vx * vx + vy * vy + vz * vz - inward * inward, 0.0))
            if slip.shape[0] > 0:
                slip[i, j, 0], slip[i, j, 1], slip[i, j, 2] = vx - inward * nx, vy - inward * ny, vz - inward * nz


def _contact(trial: Trial, rig: Rig, texels: Texels, reach: float) -> Contact:
    """Contact of texels with what pressed in a trial; returns as of :func:`shape_contact`."""
    indenter = rig.indenter_of(trial)
    assert trial.position is not None and trial.quaternion is not None and indenter is not None
    half_edges = None if indenter.edges is None else 0.5 * np.array(indenter.edges)
    size = half_edges if indenter.radius is None else np.array([indenter.radius])
    if size is not None:
        return shape_contact(trial.position, trial.quaternion, size, texels.position, texels.normal, reach)
    start = Motion.at_rest(trial.position[0], trial.quaternion[0])
    scenario = Scenario(
        bodies=(Body("sensor", Motion.at_rest()), Body("indenter", start)),
        sensors=(Sensor("sensor", 0, texels, replace(rig.parameters, max_penetration=reach)),),
        targets=(Target("indenter", 1, indenter.mesh),),
        frame_end=1,
        name=rig.name,
    )
    return Simulation(scenario).contacts_along(1, trial.position, trial.quaternion)


def _weighted(trial: Trial, rig: Rig, texels: Texels, along: Slides) -> Stimulus:
    """Stimulus of a known force at a known place.

    The indenter sinks in until springs of the rig's stiffness carry the force, and each texel carries its spring's share. Where
    net forces were measured, its motion along x and y slides over the sensor.
    """
    indenter = rig.indenter_of(trial)
    assert trial.position is not None and trial.quaternion is not None and trial.level is not None and indenter is not None
    force = np.maximum(trial.level, 0.0)
    states, back = np.unique(np.column_stack([trial.position, trial.quaternion, force]), axis=0, return_inverse=True)
    back, wanted = back.ravel(), states[:, 7]
    least = LEAST_WEIGHT * float(wanted.max(initial=0.0))
    size = float(np.linalg.norm(indenter.mesh.vertices, axis=1).max())
    high = np.full(len(states), float(texels.position[:, 2].max()) + size)
    low = high - 2.0 * size - rig.parameters.max_penetration - float(np.ptp(texels.position[:, 2]))
    share = texel_shares(rig)
    part = replace(trial, time=np.arange(float(len(states))), position=states[:, :3].copy(), quaternion=states[:, 3:7].copy())
    reach = 4.0 * (rig.parameters.max_penetration + size)
    excess, lack = np.zeros(len(states)), wanted.copy()  # of the force at the lower and the upper end
    was_enough = np.zeros(len(states), bool)
    for number in range(MOST_STEPS):
        middle = 0.5 * (low + high)
        if number >= FIRST_BISECTIONS and number % 4:  # Illinois: linear, and an end that stays counts half
            total = excess + lack
            middle = high + np.divide(lack, total, out=np.full(len(states), 0.5), where=total > 0.0) * (low - high)
        assert part.position is not None
        part.position[:, 2] = middle
        depth, normal, point, _ = _contact(part, rig, texels, reach)
        carried = depth @ share
        over = rig.parameters.k * carried - wanted
        if number >= FIRST_BISECTIONS and (np.abs(over) <= PRECISION * wanted)[wanted > least].all():
            break
        enough = over >= 0.0
        excess = np.where(enough, over, np.where(was_enough, excess, 0.5 * excess))
        lack = np.where(enough, np.where(was_enough, 0.5 * lack, lack), -over)
        low, high, was_enough = np.where(enough, middle, low), np.where(enough, high, middle), enough
    (lost,) = np.nonzero((wanted > least) & (np.abs(rig.parameters.k * carried - wanted) > WEIGHT_ERROR * wanted))
    if len(lost):
        x, y = states[lost[0], :2]
        raise SceneError(
            f"{wanted[lost[0]]:.3g} N at x = {x:.3g} m, y = {y:.3g} m of '{trial.name}.csv' do not rest on the sensor: check "
            "the units of force, x and y, and k."
        )
    load = (np.where(wanted > 0.0, wanted / np.where(carried > 0.0, carried, 1.0), 0.0)[:, None] * depth)[back]
    found = _of_forces(trial, load, normal[back], along)
    if trial.force is None:
        return found
    assert part.position is not None
    contact, centre = (load, normal[back], point[back]), part.position[back]
    pressed_before, pressed_after = np.append(True, trial.stays_pressed), np.append(trial.stays_pressed, True)
    sideways = np.array([1.0, 1.0, 0.0, 1.0, 1.0, 1.0])  # its height follows from a force that is noisy
    motion, mean_motion = (one * sideways for one in _motions(trial))
    motion *= (pressed_before & pressed_after)[:, None]
    _, slide, slip = _split(motion, centre, contact, along[0], True)
    mean_slip = _split(mean_motion * pressed_before[:, None], _midway(centre), contact, along[1], True)[2]
    return replace(found, slide_speed=slide, slip=slip, mean_slip=mean_slip)


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the scalar product along the last axis; three products are several times as fast as einsum over so few."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def _mean_rate(values: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Mean rate of columns (T, c) since the sample before; of the first sample, that of the second."""
    rates = np.diff(values, axis=0) / np.diff(time)[:, None]
    return np.concatenate([rates[:1], rates])


def _spin(quaternion: np.ndarray, time: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Mean angular velocity in the sensor's frame between pairs of samples (p,), (p, 3) rad/s."""
    if not np.diff(quaternion, axis=0).any():
        return np.zeros((len(before), 3))
    conjugate = quaternion * np.array([1.0, -1.0, -1.0, -1.0])
    return rotation_vectors(quaternion_product(quaternion[after], conjugate[before])) / (time[after] - time[before])[:, None]
