# SPDX-License-Identifier: GPL-3.0-or-later
"""The solver's first use: a process compiles it beside the window; small scenes are computed meanwhile, large ones wait.

The window is played here: bpy as a module has none. The whole of it in a real one is in tests/ui/roads/first_use.py.
"""

import json
import subprocess
import sys
import time

import bpy
import numpy as np
import pytest
from blender_scenes import baked, ball, grid

from palpate.addon.bake.bake import bake
from palpate.addon.session import first_use, frame_status
from palpate.addon.timeline import live_cache, playback
from palpate.core.compiled import kernels
from palpate.core.jobs import run_job
from palpate.core.solver import precompile
from palpate.core.solver.simulation import Simulation


@pytest.fixture
def window(monkeypatch, tmp_path):
    """As if there were a window, and nothing compiled; the compiler is replaced by a script that the test chooses."""
    monkeypatch.setattr(first_use, "has_window", lambda: True)
    monkeypatch.setattr(precompile, "_done", False)
    monkeypatch.setattr(precompile, "cache_folder", lambda: tmp_path)  # of the note that it is done; numba's own cache stays

    def compiler(source):
        script = tmp_path / "compiler.py"
        script.write_text(source)
        monkeypatch.setattr(precompile, "PROCESS", script)

    compiler("import sys; sys.stdin.read()")  # until its end
    yield compiler
    first_use.stop()


def make_sensor():
    grid(columns=5, rows=5, size=0.02).palpate.role = "SENSOR"
    ball(location=(0.0, 0.0, 0.009), radius=0.01, segments=32).palpate.role = "TARGET"
    return bpy.context.scene


def scene_to_bake(folder):
    scene = make_sensor()
    scene.palpate.folder, scene.frame_end = str(folder), 3
    return scene


def is_gone(process):
    """Whether a process ends, within a few seconds."""
    for _ in range(100):
        if process.poll() is not None:
            return True
        time.sleep(0.1)
    return False


@pytest.mark.enabling
def test_the_first_sensor_starts_it_and_disabling_ends_it(window):
    assert first_use.progress() is None
    make_sensor()
    process = first_use._compilation.process
    log = first_use._compilation.log
    assert process.poll() is None and not first_use.is_ready()
    assert "first use" in first_use.progress().text
    bpy.ops.preferences.addon_disable(module="palpate")
    assert is_gone(process) and not log.exists()
    assert not bpy.app.timers.is_registered(first_use._poll)
    bpy.ops.preferences.addon_enable(module="palpate")


def test_it_is_started_once(window):
    make_sensor()
    process = first_use._compilation.process
    first_use.begin()
    assert first_use._compilation.process is process


def test_a_small_scene_plays_at_once_and_changes_over_when_the_solver_is_compiled(window):
    """The frames are the same, bit by bit, as those of compiled kernels alone."""
    scene = make_sensor()
    for frame in (1, 2, 3):
        scene.frame_set(frame)
        assert frame_status.status_of(scene).frame is not None, frame
    assert kernels.are_interpreted() and first_use.SLOWLY in first_use.progress().text
    precompile.completion_file().touch()
    assert first_use.is_ready() and first_use.progress() is None
    first_use._poll()
    assert not kernels.are_interpreted()
    scene.frame_set(4)
    run = live_cache.get(scene)
    compiled = Simulation(run.scenario)
    expected = [compiled.observe(), *(compiled.advance() for _ in range(3))]
    for number, frame in enumerate(expected, 1):
        for name, felt in frame.sensors.items():
            np.testing.assert_array_equal(run.frames[number].sensors[name].normal_force, felt.normal_force)


def test_a_large_scene_waits_and_goes_on_when_the_solver_is_compiled(window, monkeypatch):
    monkeypatch.setattr(first_use, "MAX_FRAME", 0.0)
    scene = make_sensor()
    scene.frame_set(2)
    assert "solver is compiled" in frame_status.status_of(scene).text
    assert not playback._errors and first_use.STAGE in first_use.progress().text
    precompile.completion_file().touch()
    assert first_use.is_ready() and first_use.progress() is None
    scene.frame_set(1)
    assert frame_status.status_of(scene).frame is not None


def test_a_small_bake_does_not_wait(window, tmp_path):
    scene = scene_to_bake(tmp_path / "bake")
    baked(scene)
    assert kernels.are_interpreted() and first_use.progress() is not None
    slowly = {path.relative_to(tmp_path / "bake"): path.read_bytes() for path in (tmp_path / "bake").rglob("tactile_*.exr")}
    precompile.completion_file().touch()
    baked(scene)
    assert not kernels.are_interpreted()
    assert len(slowly) == 3 and all((tmp_path / "bake" / path).read_bytes() == content for path, content in slowly.items())


def test_a_large_bake_waits_with_progress_and_can_be_stopped(window, monkeypatch, tmp_path):
    monkeypatch.setattr(first_use, "MAX_FRAME", 0.0)
    scene = scene_to_bake(tmp_path / "bake")
    job = bake(scene)
    steps = [next(job) for _ in range(8)]
    assert [step.text for step in steps[:3]] == [f"Reading the scene: frame {i}" for i in (1, 2, 3)]
    assert all(step.text.startswith(first_use.STAGE) for step in steps[3:])
    job.close()
    assert not (tmp_path / "bake").exists()
    job = bake(scene)
    for step in job:
        if step.stage.startswith(first_use.STAGE):
            precompile.completion_file().touch()
    assert len(list((tmp_path / "bake").glob("*/tactile_*.exr"))) == 3


def test_how_far_it_is_comes_from_the_process(window):
    window(f"import sys; print({json.dumps(json.dumps({'done': 7, 'total': 9}))}, flush=True); sys.stdin.read()")
    first_use.begin()
    for _ in range(100):
        if first_use.progress().share >= 0.8 * 7 / 9:
            break
        time.sleep(0.05)
    assert 0.8 * 7 / 9 <= first_use.progress().share <= 0.99


def test_the_bar_never_goes_back_and_the_first_functions_promise_no_minutes(monkeypatch, tmp_path):
    """On a busy machine 28 s were promised, then 144 s, then 40 s."""
    log, clock = tmp_path / "log", [0.0]
    monkeypatch.setattr(first_use.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(first_use, "is_ready", lambda: False)
    monkeypatch.setattr(first_use, "_compilation", first_use._Compilation(None, log, 0.0))
    shares, seconds = [], []
    for clock[0], done in ((1.0, 0), (12.0, 4), (14.0, 20), (20.0, 60), (30.0, 110), (45.0, 160), (55.0, 179), (62.0, 179)):
        log.write_text(json.dumps({"done": done, "total": 185}) + "\n")
        shares.append(first_use.progress().share)
        words = first_use.progress().text.rpartition(", ")[2]
        seconds.append(float(words.split()[1]) if words.startswith("about") else 0.0)
    assert shares == sorted(shares) and shares[-1] > 0.85
    assert max(seconds) < 60.0 and max(np.diff(seconds)) < 20.0


def test_when_it_fails_the_solver_is_compiled_at_its_first_use(window, capfd):
    window("raise SystemExit('no compiler here')")
    first_use.begin()
    run_job(first_use.wait())
    assert first_use.is_ready()
    assert "no compiler here" in capfd.readouterr().err


def test_without_a_window_it_is_compiled_in_place_with_a_line_on_stderr(monkeypatch, tmp_path, capfd):
    monkeypatch.setattr(precompile, "_done", False)
    monkeypatch.setattr(precompile, "completion_file", lambda: tmp_path / "stamp")
    make_sensor()
    assert first_use._compilation is None and first_use.is_ready()
    first_use.load_solver()
    assert "first use only" in capfd.readouterr().err
    assert (tmp_path / "stamp").exists() and not precompile.is_needed()
    first_use.load_solver()
    assert capfd.readouterr().err == ""


def test_the_process_loads_the_package_by_its_name_in_blender_and_ends_with_blender(tmp_path):
    """Kernels that were kept under another name could not be read."""
    code = (
        f"import sys; sys.path[:0] = [{str(precompile.PROCESS.parent)!r}]; import precompile_process as c; "
        "c.load('bl_ext.user_default.palpate'); import bl_ext.user_default.palpate.core.solver.precompile as w; "
        "print(w.__name__, 'numba' in sys.modules, flush=True); import threading, time; "
        "threading.Thread(target=w._end_with_parent, daemon=True).start(); time.sleep(60)"  # as while it compiles
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline().split() == ["bl_ext.user_default.palpate.core.solver.precompile", "False"]
    assert process.poll() is None
    process.stdin.close()  # as when Blender is killed
    assert is_gone(process)
    process.stdout.close()
