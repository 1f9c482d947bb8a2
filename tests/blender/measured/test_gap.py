# SPDX-License-Identifier: GPL-3.0-or-later
"""Measured data in Blender: a rig is opened, its gap found and shown, and what is missing put on the sensor."""

import json
from functools import partial

import bpy
import gap_cases as cases
import numpy as np
import pytest
from blender_scenes import pad_sensor, refusal, reopen, save

from palpate.addon.measured import gap_results, log_rigs, planned_probe
from palpate.addon.session import identity
from palpate.commands import main
from palpate.core.errors import SceneError
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.logs.questions import OpenQuestion
from palpate.core.jobs import SlicedJob
from palpate.core.solver import precompile


@pytest.fixture(scope="module")
def rig_file(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rig")
    return cases.write(cases.rig(contact=cases.relaxing(), seed=7, trials=4, seconds=9.0), folder)


def pad(columns=cases.COLUMNS, rows=cases.ROWS):
    return pad_sensor(columns=columns, rows=rows)


def brightest(obj):
    """Largest red of the colours that show where the model is wrong."""
    return max(item.color[0] for item in obj.data.color_attributes[gap_results.GAP_COLORS].data)


@pytest.mark.slow("a whole diagnosis, the one in Blender")
def test_from_a_rig_to_an_amended_sensor(scene, rig_file, tmp_path):
    obj = pad()
    assert not bpy.ops.palpate.gap_find.poll() and not bpy.ops.palpate.gap_add.poll()
    assert bpy.ops.palpate.measured_open(filepath=str(rig_file)) == {"FINISHED"}
    assert obj.palpate.measured == str(rig_file)
    assert bpy.ops.palpate.gap_find() == {"FINISHED"}
    result = gap_results.of(obj)
    assert "creep" in result.headline

    obj.palpate.effects.add().kind = "noise"  # the fitted sensor has none, and takes its place
    assert bpy.ops.palpate.gap_add.get_rna_type().name == "Use Fitted Sensor"
    assert bpy.ops.palpate.gap_add() == {"FINISHED"}
    assert [item.kind for item in obj.palpate.effects] == ["creep"]
    assert obj.palpate.k == pytest.approx(80.0, rel=0.1)

    assert gap_results.shown_on(obj) is None
    assert bpy.ops.palpate.gap_show(amended=False) == {"FINISHED"}
    assert not gap_results.shown_on(obj).amended and 0.0 < gap_results.shown_on(obj).scale.high < 100.0
    before = brightest(obj)
    names = {marker.name for marker in scene.timeline_markers}
    assert {"gap: approach", "gap: loading", "gap: unloading"} <= names
    bpy.ops.palpate.gap_show(amended=True)
    assert gap_results.shown_on(obj).amended
    assert brightest(obj) < before  # on one scale the amended sensor is darker
    other = obj.data.color_attributes.new("Own", "FLOAT_COLOR", "POINT")
    obj.data.color_attributes.active_color = other
    assert gap_results.shown_on(obj) is None  # other colours are seen

    assert bpy.ops.palpate.gap_curves() == {"FINISHED"}
    assert bpy.data.images["Palpate Gap Curves"].size[0] > 500
    assert bpy.ops.palpate.gap_report(directory=str(tmp_path / "report")) == {"FINISHED"}
    assert json.loads((tmp_path / "report" / "gap.json").read_text())["found"][0]["effect"] == "creep"
    before = set(rig_file.parent.iterdir())
    assert bpy.ops.palpate.gap_report() == {"FINISHED"}
    assert set(rig_file.parent.iterdir()) - before == {rig_file.parent / "rig-report"}
    assert (rig_file.parent / "rig-report" / "report.html").is_file()
    narrow = pad(columns=3)
    gap_results._results[identity.key(narrow)] = result
    with pytest.raises(SceneError, match=f"24 texels and '{narrow.name}' has 18"):
        gap_results.show_on_sensor(bpy.context, narrow, False)


def test_stopping_keeps_what_was_known(scene, rig_file):
    obj = pad()
    obj.palpate.measured = str(rig_file)
    work = SlicedJob(gap_results.find(obj))
    for _ in range(3):
        work.work(0.0)
    work.cancel()
    assert gap_results.of(obj) is None


def test_a_bad_rig_is_said_in_a_sentence(scene, tmp_path):
    obj = pad()
    (tmp_path / "rig.toml").write_text('format = "something else"\n')
    assert "not a rig" in refusal(bpy.ops.palpate.measured_open, filepath=str(tmp_path / "rig.toml"))
    assert not obj.palpate.measured


@pytest.mark.long("a whole plan of the next recording")
def test_a_planned_experiment_becomes_keyframes_of_a_probe_and_is_undone(scene, rig_file):
    obj = pad()
    assert not bpy.ops.palpate.gap_plan.poll()
    obj.palpate.measured = str(rig_file)
    obj.location, obj.rotation_euler = (0.1, -0.2, 0.3), (0.4, 0.2, -0.7)
    scene.frame_start, scene.frame_end = 5, 20
    bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="before")
    assert bpy.ops.palpate.gap_plan("EXEC_DEFAULT", True, duration=8.0, depth=0.001) == {"FINISHED"}
    probe, obj = bpy.data.objects["Planned Probe"], bpy.data.objects["Pad"]
    assert probe.palpate.role == "TARGET" and scene.frame_end == 5 + 8 * scene.render.fps
    assert "'Planned Probe'" in planned_probe.sentence_of(obj) and "separates" in planned_probe.sentence_of(obj)
    radii = [vertex.co.length for vertex in probe.data.vertices]
    assert max(radii) == pytest.approx(cases.RADIUS, rel=1e-5)  # the shape that pressed in the recordings
    lowest, speeds, before = [], [], None
    for frame in range(scene.frame_start, scene.frame_end + 1):
        scene.frame_set(frame)
        place = np.array(obj.matrix_world.inverted() @ probe.matrix_world.translation)
        lowest.append(place[2] - cases.RADIUS)
        speeds += [] if before is None else [np.linalg.norm(place - before) * scene.render.fps]
        before = place
    assert lowest[0] > 0.0 and lowest[-1] > 0.0 and -0.0011 < min(lowest) < -1e-4
    recorded = max(np.abs(np.diff(t.position[:, 2])).max() * cases.RATE for t in read_rig(rig_file).trials)
    assert max(speeds) <= recorded * 1.01  # single precision of keyframes
    probe.select_set(True)
    assert bpy.ops.palpate.gap_plan(duration=6.0) == {"FINISHED"}  # the selected target follows the next plan
    assert len([one for one in bpy.data.objects if one.name.startswith("Planned Probe")]) == 1
    bpy.ops.ed.undo()
    assert "Planned Probe" not in bpy.data.objects and bpy.context.scene.frame_end == 20
    assert planned_probe.sentence_of(bpy.data.objects["Pad"]) == ""


def test_recordings_without_poses_are_not_planned_on_a_probe(scene, tmp_path):
    obj = pad()
    rows = "\n".join(f"{i / 20},{0.001 * (i % 20) / 20},{-0.1 * (i % 20)}" for i in range(40))
    (tmp_path / "t.csv").write_text("time,depth,force_z\n" + rows + "\n")
    (tmp_path / "rig.toml").write_text(
        'format = "palpate-rig/1"\n[sensor]\ngrid = { rows = 2, columns = 2, pitch = [0.003, 0.003] }\n'
        '[[trial]]\nfile = "t.csv"\nuse = "fit"\n'
    )
    obj.palpate.measured = str(tmp_path / "rig.toml")
    assert "no poses that a probe could follow" in refusal(bpy.ops.palpate.gap_plan)


@pytest.mark.long("a whole diagnosis")
def test_the_command_puts_the_amended_sensor_into_a_scene(scene, rig_file, tmp_path, capsys):
    obj = pad()
    blend = save(tmp_path)
    assert main(["gap", str(rig_file), "--out", str(tmp_path / "out"), "--blend", str(blend), "--sensor", obj.name]) == 0
    assert "Missing: creep" in capsys.readouterr().out
    assert [item.kind for item in reopen(blend).objects["Pad"].palpate.effects] == ["creep"]


def test_the_command_says_that_it_compiles(rig_file, tmp_path, monkeypatch, capsys):
    def stop():
        raise SceneError("far enough.")

    monkeypatch.setattr(precompile, "is_needed", lambda: True)
    monkeypatch.setattr(precompile, "compile_solver", stop)
    assert main(["gap", str(rig_file), "--out", str(tmp_path)]) == 1
    assert capsys.readouterr().err.splitlines()[0].startswith("Palpate is compiling its solver (first use only)")


def write_presses(folder, texels):
    """Write logs of two presses in milliseconds and millimetres; return their paths and the words of the file selector."""
    time = np.arange(600) * 10.0
    depth = np.interp(time, [0, 1000, 2000, 4000, 5000], [-1.0, -1.0, 1.0, 1.0, -1.0])
    readings = np.maximum(depth, 0.0)[:, None] * (1.0 + 0.01 * np.arange(texels))
    header = "t_ms,depth (mm)," + ",".join(f"R{i + 1}" for i in range(texels))
    paths = [folder / f"press_{i}.csv" for i in range(2)]
    for path in paths:
        np.savetxt(path, np.column_stack([time, depth, readings]), "%.6g", ",", header=header, comments="")
    return paths, {"filepath": str(paths[0]), "directory": str(folder), "files": [{"name": path.name} for path in paths]}


def test_logs_become_a_rig_with_the_answers_beside_it(scene, tmp_path):
    obj = pad(columns=2, rows=2)
    paths, chosen = write_presses(tmp_path, 4)
    other = pad(columns=3, rows=2)
    assert "leave 1 question open, the first: grid of [sensor] is not known" in refusal(bpy.ops.palpate.measured_logs, **chosen)
    assert not other.palpate.measured
    made = partial(log_rigs.make, bpy.context, other, paths, tmp_path / "asked", False)  # as the dialog asks, one by one
    with pytest.raises(OpenQuestion, match="grid of .sensor., as in the brackets .4 texels; their rows and columns"):
        made([])
    with pytest.raises(OpenQuestion, match="as in the brackets"):
        made(["2 by 2"])
    written, _ = made(["2 by 2", "{ rows = 2, columns = 2, pitch = [0.005, 0.005] }"])
    assert len(read_rig(written.path).texels) == 4
    bpy.context.view_layer.objects.active = obj
    answers = tmp_path / "rig" / "answers.toml"
    answers.write_text(answers.read_text().replace('"?", columns = "?", pitch = ["?", "?"]', "2, columns = 2, pitch = 0.005"))
    assert bpy.ops.palpate.measured_logs(**chosen) == {"FINISHED"}
    assert obj.palpate.measured == str(tmp_path / "rig" / "rig.toml")
    assert bpy.data.images["Palpate Recordings"].size[0] > 500
    assert bpy.ops.palpate.measured_open(filepath=obj.palpate.measured) == {"FINISHED"}


@pytest.mark.parametrize(("rows", "columns"), [(14, 6), (6, 14)])
def test_a_rig_from_logs_has_the_grid_of_the_active_sensor(scene, tmp_path, rows, columns):
    bpy.ops.palpate.pad_mesh_add(rows=rows, columns=columns, pitch_x=0.003, pitch_y=0.0034)
    _, chosen = write_presses(tmp_path, 84)
    assert bpy.ops.palpate.measured_logs(**chosen) == {"FINISHED"}
    places = read_rig(bpy.context.object.palpate.measured).texels.position
    assert len(np.unique(places[:, 1].round(7))) == rows and len(np.unique(places[:, 0].round(7))) == columns
    np.testing.assert_allclose(np.ptp(places[:, :2], axis=0), [0.003 * (columns - 1), 0.0034 * (rows - 1)])
