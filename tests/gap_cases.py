# SPDX-License-Identifier: GPL-3.0-or-later
"""Small sensors with something hidden in them, made by formulas of their own: a ball on a pad of 6 × 4 texels."""

import numpy as np
import trimesh
from scipy.signal import lfilter

from palpate.benchmarks._recordings import Recording
from palpate.core.gap.dataset.rig import Indenter, Rig, grid_texels
from palpate.core.gap.dataset.trial import Trial
from palpate.core.gap.selection.diagnosis import diagnose
from palpate.core.gap.selection.findings import Diagnosis
from palpate.core.geometry.mesh import checked_mesh
from palpate.core.jobs import run_job
from palpate.core.model.sensor_parameters import SensorParameters

ROWS, COLUMNS, PITCH, RADIUS, RATE = 6, 4, 0.0034, 0.010, 40.0
TOP = 0.0015


def depth_trial(time, level, slide=None, reading=None, force=None, name="t", use="fit"):
    """A trial in which all texels have one depth, `level` (T,) m; `slide` (T,) m is the travel along x."""
    travel = np.column_stack([np.zeros(len(time)) if slide is None else slide, np.zeros(len(time))])
    return Trial(name, use, time, "depth", None, None, level, travel, reading, force)


def grid_rig(rows, columns, pitch, parameters, trials=(), given=()):
    """A rig with a grid of texels and no indenter."""
    texels = grid_texels(rows, columns, pitch, pitch)
    grid = (rows, columns, (pitch, pitch))
    return Rig("small", texels, parameters, frozenset(given), grid, None, tuple(trials))


def path(rng, seconds):
    """Lowest point of the ball over time: cycles of press, hold and release, unequal in depth, speed and length."""
    parts, dt = [np.full(int(0.8 * RATE), 0.001)], 1.0 / RATE
    while sum(map(len, parts)) < seconds * RATE:
        deep, down, up = rng.uniform(0.0008, 0.0025), *10 ** rng.uniform(-2.9, -2.0, 2)
        parts.append(np.linspace(0.001, -deep, max(3, int((0.001 + deep) / down / dt)), endpoint=False))
        parts.append(np.full(int(rng.uniform(0.3, 2.0) / dt), -deep))
        parts.append(np.linspace(-deep, 0.001, max(3, int((0.001 + deep) / up / dt)), endpoint=False))
        parts.append(np.full(int(rng.uniform(0.3, 0.8) / dt), 0.001))
    return np.concatenate(parts)[: int(seconds * RATE)]


def rig(change=None, seed=0, trials=5, seconds=12.0, noise=0.004, colour=0.0, k=80.0, stated=60.0, contact=None):
    """A rig whose sensor is the base model with `contact(force, time)` done to its forces and `change(reading, time)` after."""
    rng = np.random.default_rng(seed)
    texels = grid_texels(ROWS, COLUMNS, PITCH, PITCH)
    made, readings = [], []
    for _ in range(trials):
        z = path(rng, seconds)
        time = np.arange(len(z)) / RATE
        x, y = rng.uniform(-0.004, 0.004), rng.uniform(-0.007, 0.007)
        position = np.column_stack([np.full_like(z, x), np.full_like(z, y), z + RADIUS])
        away = ((texels.position[:, :2] - [x, y]) ** 2).sum(axis=1)
        height = np.sqrt(np.maximum(RADIUS**2 - away, 0.0))
        depth = np.maximum((height - position[:, 2:]) * height / RADIUS, 0.0) * (away < RADIUS**2)
        rate = -np.gradient(position[:, 2:], time, axis=0) * height / RADIUS * (depth > 0)
        force = k * depth if contact is None else contact(k * depth, time)
        force = np.maximum(force + 0.01 * k * rate, 0.0)
        readings.append(force if change is None else change(force, time))
        made.append((time, position))
    full = max(np.abs(reading).max() for reading in readings)
    recorded = []
    for i, ((time, position), reading) in enumerate(zip(made, readings, strict=True)):
        white = rng.normal(size=(len(time) + 200, len(texels)))
        tremble = lfilter([np.sqrt(1 - colour**2)], [1, -colour], white, axis=0)[200:]
        turns = np.tile([1.0, 0.0, 0.0, 0.0], (len(time), 1))
        use = "check" if i == trials - 1 else "fit"
        measured = reading + noise * full * tremble
        recorded.append(Trial(f"t{i}", use, time, "pose", position, turns, None, np.zeros((len(time), 2)), measured, None))
    ball = trimesh.creation.icosphere(2, RADIUS)
    indenter = Indenter(checked_mesh(ball.vertices, ball.faces, "ball")[0], RADIUS)
    parameters = SensorParameters(k=stated, cn=0.01 * stated)
    grid = (ROWS, COLUMNS, (PITCH, PITCH))
    words = {"grid": {"rows": ROWS, "columns": COLUMNS, "pitch": [PITCH, PITCH]}}
    return Rig("small", texels, parameters, frozenset({"k"}), grid, indenter, tuple(recorded), words)


def diagnosed(rig):
    """The whole diagnosis of a rig."""
    result = run_job(diagnose(rig))
    assert isinstance(result, Diagnosis)
    return result


def relaxing(amount=0.3, times=(0.4, 2.0)):
    """Creep as two equal exponentials."""

    def act(force, time):
        dt = time[1] - time[0]
        for tau in times:
            a = np.exp(-dt / tau)
            force = force - amount / len(times) * lfilter([1 - a], [1, -a], force, axis=0)
        return force

    return act


def write(rig, folder):
    """Write a rig as files; return the path of its TOML."""
    grid = f"grid = {{ rows = {ROWS}, columns = {COLUMNS}, pitch = {PITCH} }}"
    sensor = f"{grid}\nk = {rig.parameters.k}\n[indenter]\nshape = {{ sphere = {RADIUS} }}"
    trials = []
    for trial in rig.trials:
        columns = dict(zip("xyz", trial.position.T, strict=True)) | {f"texel_{i}": one for i, one in enumerate(trial.reading.T)}
        trials.append((trial.name, trial.use, {"time": trial.time, **columns}))
    return Recording(rig.name, sensor, trials).write(folder)
