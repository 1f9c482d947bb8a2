# SPDX-License-Identifier: GPL-3.0-or-later
"""What a proposal guesses is said, and goes by what columns do: families, points, frames, one axis, loads without a zero."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest
from log_rigs import new_rig, template, write_csv

from palpate.commands import main
from palpate.core.errors import FileError
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.logs import questions
from palpate.core.gap.logs.column_meaning import families, unit_of
from palpate.core.gap.logs.guess import toml_value
from palpate.core.gap.logs.log_file import read_log
from palpate.core.gap.logs.log_table import with_distinct_names
from palpate.core.gap.logs.proposal import propose

TIME = np.arange(400) / 50.0
LOAD = np.maximum(np.sin(1.5 * TIME), 0.0) ** 2
RNG = np.random.default_rng(11)


def noise(*size, level=1.0):
    return level * RNG.normal(size=size)


def proposal(*paths):
    return propose([read_log(path) for path in paths])


def columns_of(*paths):
    return proposal(*paths).columns()


@pytest.mark.parametrize("pattern", ["taxel_{i}_{axis}", "B{axis}0{i}", "sensors_0.taxels_{i}.{axis}"])
def test_of_the_axes_of_taxels_the_one_that_follows_the_load_is_proposed_and_asked(tmp_path, pattern):
    axes = {"x": 33000.0 + 0.0 * LOAD, "y": 33000.0 + 300.0 * LOAD * noise(400), "z": 20000.0 + 9000.0 * LOAD}
    columns = {"time": TIME, "Fz": 3.0 * LOAD}
    columns |= {
        pattern.format(i=i, axis=axis): values + noise(400, level=4.0) for i in range(4) for axis, values in axes.items()
    }
    answer = columns_of(write_csv(tmp_path / "skin.csv", columns))["texel"]
    assert answer.value == {"name": pattern.format(i="{}", axis="z"), "first": 0, "count": 4} and answer.is_thin
    assert "follow the load by 1.00, others that could be meant: " in answer.reason and "0.0" in answer.reason


def test_electrodes_that_follow_the_load_go_before_a_larger_family_that_does_not():
    follow = {**{f"pac{i}": 0.2 for i in range(1, 23)}, **{f"ele{i}": 0.97 for i in range(1, 20)}}
    first, second = families(list(follow), follow.__getitem__)
    assert first.columns == tuple(f"ele{i}" for i in range(1, 20)) and first.follows == 0.97
    assert len(second.columns) == 22


def test_a_grid_of_columns_is_in_the_order_of_its_rows():
    names = [f"r{i}c{j}" for j in range(3) for i in range(2)]
    (found,) = families(names, lambda name: 0.0)
    assert found.columns == ("r0c0", "r0c1", "r0c2", "r1c0", "r1c1", "r1c2")


def test_calibration_points_in_no_order_are_sorted_by_the_load(tmp_path):
    load = RNG.uniform(0.0, 8.0, 300)
    columns = {"row": np.arange(300.0), "Fz": -load} | {
        f"B{i}": 10.0 + (1 + i) * load + noise(300, level=0.02) for i in range(4)
    }
    log = write_csv(tmp_path / "points.csv", columns)
    answer = columns_of(log)["time"]
    assert answer.value == {"rate": 1.0} and answer.is_thin and "these are points" in answer.reason
    (trial,) = read_rig(new_rig(tmp_path / "rig", [log], template(tmp_path, [log])).path).trials
    np.testing.assert_allclose(trial.level, np.sort(load), atol=1e-9)
    np.testing.assert_allclose(trial.reading[:, 1], 10.0 + 2.0 * np.sort(load), atol=0.1)


def test_matrices_in_files_are_frames_with_the_load_of_their_names(tmp_path):
    frames = {0.1 * i: np.round(200.0 * (i + RNG.random((8, 6)))) for i in range(12)}
    paths = []
    for load, frame in frames.items():
        paths.append(tmp_path / f"mat_{load:.3f}kPa.csv")
        paths[-1].write_text("\n".join(",".join(f"{value:03.0f}" for value in row) for row in frame) + "\n")
    answers = proposal(*reversed(paths))
    own = answers.columns()
    assert own["time"].is_thin and "each file is a frame" in own["time"].reason
    assert own["force"].value["area"] == "?" and "the area on which the pressure acts" in own["force"].question
    assert answers.of("sensor", "grid").value == {"rows": 8, "columns": 6, "pitch": ["?", "?"]}
    path = template(tmp_path, paths, **{'area = "?"': "area = 2e-3"})
    (trial,) = read_rig(new_rig(tmp_path / "rig", paths, path).path).trials
    np.testing.assert_allclose(trial.level, 2.0 * np.array(list(frames)), atol=1e-9)
    np.testing.assert_array_equal(trial.reading, np.array([frame.ravel() for frame in frames.values()]))


def test_frames_are_recordings_where_the_answers_name_their_files(tmp_path):
    """Of matrices without a clock nobody knows whether a file is a frame: the guess is taken back in the answers."""
    paths = []
    for i in range(3):
        paths.append(tmp_path / f"run_{i}.csv")
        rows = np.column_stack([LOAD[:60:1] * (1 + i) + noise(60, level=1e-3), 50.0 * LOAD[:60] + noise(60, level=0.1)])
        paths[-1].write_text("\n".join(",".join(f"{value:.5f}" for value in row) for row in rows) + "\n")
    found = proposal(*paths)
    assert found.of("logger", "files").value == ["3 frames"] and "name the files instead" in found.columns()["time"].reason
    (tmp_path / "answers.toml").write_text(
        'format = "palpate-log-answers/1"\n[sensor]\ngrid = { rows = 1, columns = 1, pitch = 0.01 }\nunit = "counts"\n'
        '[[logger]]\nfiles = ["run_*.csv"]\n[logger.columns]\ntime = { rate = 50.0 }\nforce = { name = "column_1" }\n'
        'texel = { name = "column_2" }\n' + "".join(f'[[recording]]\nfiles = ["run_{i}.csv"]\n' for i in range(3))
    )
    trials = read_rig(new_rig(tmp_path / "rig", paths, tmp_path / "answers.toml").path).trials
    assert [trial.name for trial in trials] == ["run_0", "run_1", "run_2"] and all(len(trial.time) == 60 for trial in trials)


def test_time_series_of_several_files_without_names_are_no_frames(tmp_path):
    paths = [tmp_path / f"run_{i}.csv" for i in range(3)]
    for path in paths:
        path.write_text("\n".join(f"{i / 10},{RNG.random()},{RNG.random()}" for i in range(40)) + "\n")
    assert len(with_distinct_names([read_log(path) for path in paths])) == 3
    with pytest.raises(FileError, match="less than 8 samples"):
        (tmp_path / "short.csv").write_text("1,2\n3,4\n")
        proposal(tmp_path / "short.csv")


def press(silent):
    """A log of one axis over twelve texels, of which some never answer."""
    depth = 2e-3 * LOAD
    readings = {f"S{i}": (0.0 if i < silent else 60.0) * depth + noise(400, level=4e-4) for i in range(12)}
    return {"time_ms": 1e3 * TIME, "probe_z_mm": 15.0 - 1e3 * depth, **readings}


def test_one_axis_that_most_texels_do_not_feel_is_an_indenter_at_a_place(tmp_path):
    log = write_csv(tmp_path / "run.csv", press(silent=10))
    answers = proposal(log)
    own = answers.columns()
    assert [own[axis].value for axis in "xy"] == [0.0, 0.0] and "factor" not in own["z"].value and "depth" not in own
    assert "10 of 12 texels never answer" in own["z"].reason and answers.of("indenter", "shape").value == {"sphere": "?"}
    path = template(tmp_path, [log], **{'sphere = "?"': "sphere = 0.015", "x = 0.0": "x = 0.004"})
    (trial,) = read_rig(new_rig(tmp_path / "rig", [log], path).path).trials
    assert trial.stimulus == "pose" and isinstance(trial.contact_height, str)
    np.testing.assert_allclose(
        trial.position, np.column_stack([0.004 + 0.0 * TIME, 0.0 * TIME, 0.015 - 2e-3 * LOAD]), atol=1e-9
    )


def test_one_axis_that_all_texels_feel_is_a_depth_and_says_what_that_means(tmp_path):
    own = columns_of(write_csv(tmp_path / "run.csv", press(silent=0)))
    assert own["depth"].value["factor"] == -1.0 and own["depth"].is_thin
    assert "as a plate does: for a ball write x, y and z" in own["depth"].reason


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_load_that_is_never_zero_has_no_zero_and_its_own_sign(tmp_path, sign):
    load = 2.0 + np.sin(1.5 * TIME + 0.3)
    columns = {"time": TIME, "fz": sign * load} | {f"taxel{i}": 400.0 * load + noise(400) for i in range(4)}
    force = columns_of(write_csv(tmp_path / "slide.csv", columns))["force"]
    assert "zero" not in force.value and force.value.get("factor", 1.0) == sign
    assert "nothing shows it without load" in force.reason


def test_a_load_that_rests_at_its_beginning_has_its_zero_there(tmp_path):
    columns = {"time": TIME, "fz": 0.4 + 3.0 * np.where(TIME < 2.0, 0.0, LOAD)}
    columns |= {f"taxel{i}": 400.0 * columns["fz"] for i in range(4)}
    force = columns_of(write_csv(tmp_path / "press.csv", columns))["force"]
    assert force.value["zero"] == pytest.approx(0.4) and "is subtracted" in force.reason and force.is_thin


def test_steps_of_a_friction_rig_with_headers_of_their_own_are_said_and_speeds_are_no_texels(tmp_path):
    """A file of two steps, as tribometers write it: each has a preamble, names, units and a clock from zero on."""
    step = "Run # 1\nStep No. {}\n\nRadius = 3.9\nDuration = 2.1\n\nFx,Fz,Z,V1,V2,V3,T\ng,g,mm,mm/sec,mm/sec,mm/sec,sec\n\n"
    rows = [f"{100 + i},{-200 + i % 3},-0.6{i % 7},{0.1 * i:.1f},{i % 5},{i % 4},{0.02 * i:.2f}" for i in range(40)]
    log = tmp_path / "run.csv"
    log.write_text("".join(step.format(i) + "\n".join(rows) + "\n\n" for i in (1, 2)))
    found = proposal(log)
    assert "texel" not in found.columns() and "unit" not in [guess.word for guess in found.guesses]
    assert found.columns()["time"].value == {"name": "T", "unit": "sec"} and "but it falls" in found.columns()["time"].question
    assert found.columns()["force_z"].value["unit"] == "g"
    assert [note for note in found.notes if "cells with text" in note] == ["'run.csv': 18 cells with text count as missing."]
    with pytest.raises(FileError, match="The time of 'run.csv' goes backwards after sample 40 .* cut the file where the clock"):
        new_rig(tmp_path / "rig", [log], template(tmp_path, [log]))


def test_a_number_that_is_no_temperature_is_asked(tmp_path):
    columns = {"time": TIME, "force": LOAD, "Temp0": 757.0 + noise(400)} | {f"texel_{i}": 10.0 * LOAD for i in range(3)}
    own = columns_of(write_csv(tmp_path / "a.csv", columns))["temperature"]
    assert own.value["unit"] == "?" and "write unit, factor and zero" in own.reason
    assert unit_of("°C", "", np.nan)[0] == "?"  # of a file in which it is missing


def test_the_template_is_written_before_anything_is_refused(tmp_path, capsys):
    columns = {"time": TIME, "force (N)": LOAD} | {f"texel_{i}": 500.0 + noise(400) for i in range(1)}
    log = write_csv(tmp_path / "a.csv", columns)
    assert main(["rig", "new", str(log), "--out", str(tmp_path / "rig"), "--yes"]) == 1
    said = capsys.readouterr().err
    assert "shows no contact" in said and "follow what drove the sensor by 0." in said
    assert "texel_0" in (tmp_path / "rig" / "answers.toml").read_text()
    assert not (tmp_path / "rig" / "rig.toml").exists()


def test_readings_with_large_noise_that_follow_the_load_are_contact(tmp_path):
    columns = {"time": TIME, "force (N)": LOAD, "texel_0": LOAD + noise(400, level=0.3)}
    log = write_csv(tmp_path / "a.csv", columns)
    assert new_rig(tmp_path / "rig", [log], template(tmp_path, [log])).path.exists()


@pytest.mark.parametrize("case", ["skin", "unnamed"])
def test_every_guess_is_a_line_with_its_reason_that_is_corrected_there(tmp_path, case):
    """The template and the questions are one list: each line has its value, its reason and a mark where it is to be checked."""
    axes = {f"taxel_{i}_{axis}": 100.0 * LOAD + noise(400) for i in range(3) for axis in "xyz"}
    columns = {
        "skin": {"time": TIME, "Fz": LOAD, **axes},
        "unnamed": {f"{i}": values for i, values in enumerate([TIME, LOAD, 5.0 * LOAD])},
    }
    found = proposal(write_csv(tmp_path / "a.csv", columns[case]))
    lines = found.text.splitlines()
    for guess in found.guesses:
        mark = "  # CHECK: " if guess.is_thin else "  # "
        assert guess.line in lines and (not guess.reason or guess.line.endswith(mark + guess.reason))
        assert guess.reason or not guess.is_open
        assert (guess.question in found.questions) == (guess.is_unknown or guess.is_thin)
    put = []
    questions.asked(found.confirmed(), lambda question: put.append(question) or "1")
    assert len(put) == sum(guess.is_unknown for guess in found.guesses)


def test_signs_outside_the_basic_plane_stay_in_names(tmp_path):
    log = write_csv(
        tmp_path / "press \U0001f600.csv", {"time": TIME, "depth \U0001d467 (mm)": LOAD, "R1": LOAD, "R2": 2.0 * LOAD}
    )
    made = new_rig(tmp_path / "rig", [log], template(tmp_path, [log]))
    assert 'name = "depth \U0001d467 (mm)"' in made.path.read_text(encoding="utf-8")
    name = "not printed: \x00 \U000e0001"
    assert tomllib.loads(f"value = {toml_value(name)}")["value"] == name
