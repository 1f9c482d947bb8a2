# SPDX-License-Identifier: GPL-3.0-or-later
"""The timeline and the bake: showing a cached frame, and what a bake costs beside the solving in it.

A cached frame is what scrubbing costs on top of Blender's own work: the same `frame_set` with playback on, less the time with
it off. The bake is compared with solving the same scenario alone, in turn: it also samples, writes images, keyframes and files.
It ends when the scene shows it and the bake before is removed.
"""

from __future__ import annotations

import os
import shutil
import statistics
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

ROUNDS, SAMPLE_ROUNDS = 5, 3
SAMPLES = Path(__file__).resolve().parent.parent / "sample_blends"
GRIDS = {84: (14, 6), 16384: (128, 128)}
GOALS = {84: 5.0, 16384: 20.0}
"""Milliseconds for a cached frame."""


def scene_of(texels: int, frames: int, folder: Path):
    """Return a scene with a ball that is pressed into a pad of so many texels and drawn over it."""
    import bpy

    rows, columns = GRIDS[texels]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    _enable()
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, frames
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=columns - 1, y_subdivisions=rows - 1, size=0.05)
    pad = bpy.context.object
    pad.palpate.role, pad.palpate.k, pad.palpate.cn = "SENSOR", 5000.0 / texels, 50.0 / texels
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.02, segments=64, ring_count=32, location=(-0.008, 0.0, 0.0215))
    ball = bpy.context.object
    ball.palpate.role = "TARGET"
    for share, place in ((0.0, (-0.008, 0.0, 0.0215)), (0.2, (-0.008, 0.0, 0.018)), (1.0, (0.008, 0.0, 0.018))):
        ball.location = place
        ball.keyframe_insert("location", frame=round(1 + share * (frames - 1)))
    scene.frame_set(1)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"))
    return scene


def _enable() -> None:
    import bpy

    import palpate

    if not hasattr(bpy.types.Object, "palpate"):
        palpate.register()


def cached_frame(texels: int) -> float:
    """Milliseconds that showing a remembered frame adds to Blender's own frame change, with a live picture as in a window."""
    from palpate.addon.display import overlays
    from palpate.addon.session import frame_status
    from palpate.addon.timeline import live_cache

    with tempfile.TemporaryDirectory() as folder:
        scene = scene_of(texels, 6, Path(folder))
        for frame in range(1, 7):
            scene.frame_set(frame)
        run = live_cache.get(scene)
        times = []
        for frame in (2, 5, 3, 6, 4) * ROUNDS:
            scene.palpate.use_live = False
            scene.frame_set(frame - 1)
            start = time.perf_counter()
            scene.frame_set(frame)
            plain = time.perf_counter() - start
            scene.palpate.use_live = True
            scene.frame_set(frame - 1)
            start = time.perf_counter()
            scene.frame_set(frame)
            pictures = overlays.sensor_overlays(scene, run, run.frames[frame])  # in the background nothing is drawn
            overlays.inset_content(scene, run, run.frames[frame])
            times.append(time.perf_counter() - start - plain)
            if live_cache.get(scene) is not run or not pictures or frame_status.status_of(scene).frame is None:
                raise RuntimeError("the frame was computed again or not shown: this would not be the same work")
        return statistics.median(times) * 1e3


def bake_and_solve(texels: int, frames: int) -> tuple[float, float]:
    """Seconds of a bake, and of solving the same scenario."""
    with tempfile.TemporaryDirectory() as folder:
        return _in_turn(scene_of(texels, frames, Path(folder)), ROUNDS)


def sample_bake_and_solve(name: str) -> tuple[float, float]:
    """Seconds of baking a sample, and of solving the same scenario: work of the size that a bake is for."""
    import bpy

    _enable()
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(shutil.copy(SAMPLES / f"{name}.blend", folder))
        bpy.ops.wm.open_mainfile(filepath=str(copy))
        return _in_turn(bpy.context.scene, SAMPLE_ROUNDS)


def _in_turn(scene, rounds: int) -> tuple[float, float]:
    from palpate.addon.bake.bake import bake
    from palpate.core.jobs.job_runner import run_job
    from palpate.core.solver.simulation import run

    run(run_job(bake(scene)).scenario)  # compiles and warms up
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        scenario = run_job(bake(scene)).scenario
        middle = time.perf_counter()
        run(scenario)
        times.append((middle - start, time.perf_counter() - middle))
    return tuple(statistics.median(column) for column in zip(*times, strict=True))


def bake_with_channels(frames: int) -> tuple[float, float]:
    """Processor seconds of a bake of 84 texels with a magnet and a magnetometer below each, and of one without."""
    import bpy

    from palpate.addon.bake.bake import bake
    from palpate.core.jobs.job_runner import run_job

    with tempfile.TemporaryDirectory() as folder:
        scene = scene_of(84, frames, Path(folder))
        pad = next(obj for obj in scene.objects if obj.palpate.role == "SENSOR")
        own = pad.palpate.readout
        own.collection = bpy.data.collections.new("Magnets")
        scene.collection.children.link(own.collection)
        for vertex in pad.data.vertices:
            for part, depth in (("MAGNET", 3e-3), ("MAGNETOMETER", 7e-3)):
                obj = bpy.data.objects.new(part.title(), None)
                own.collection.objects.link(obj)
                obj.location, obj.palpate.magnetic.part = (vertex.co.x, vertex.co.y, -depth), part
        times: dict[str, list[float]] = {"PLACED": [], "NONE": []}
        for _ in range(ROUNDS + 1):  # the first warms up
            for own.kind, found in times.items():
                start = time.process_time()
                run_job(bake(scene))
                found.append(time.process_time() - start)
        return tuple(statistics.median(found[1:]) for found in times.values())


def _over_solve(name: str, whole: float, alone: float) -> dict:
    return {
        "name": f"bake.over_solve.{name}", "value": whole, "unit": "s",
        "peer": "the solve alone", "peer_value": alone, "ratio": whole / alone, "goal": 1.3,
    }  # fmt: skip


def run() -> Iterator[dict]:
    """Cached frames by number of texels, and the bake over the solve: of scenes that are hardly any work, and of samples."""
    os.environ.setdefault("BLENDER_USER_RESOURCES", tempfile.mkdtemp(prefix="palpate-bench-"))
    for texels in GRIDS:
        yield {"name": f"bake.cached_frame.{texels}", "value": cached_frame(texels), "unit": "ms", "goal": GOALS[texels]}
    for texels, frames in ((84, 120), (16384, 24)):
        yield _over_solve(str(texels), *bake_and_solve(texels, frames))
    channels, plain = bake_with_channels(240)
    yield {
        "name": "bake.channels.84", "value": channels, "unit": "s", "goal": 1.3,
        "peer": "one channel", "peer_value": plain, "ratio": channels / plain,
    }  # fmt: skip
    for name in ("demo", "grasp"):
        yield _over_solve(name, *sample_bake_and_solve(name))
