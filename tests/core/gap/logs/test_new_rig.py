# SPDX-License-Identifier: GPL-3.0-or-later
"""From logs to a rig: what was measured comes out in SI units, what is not known is asked, what cannot be is one sentence."""

from __future__ import annotations

import re
import tomllib

import numpy as np
import pytest
from log_rigs import new_rig, template, write_csv

from palpate.commands import main
from palpate.core.errors import FileError
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.logs import questions
from palpate.core.gap.logs.answers import answers_of, read_answers
from palpate.core.gap.logs.clock_alignment import clock_shift
from palpate.core.gap.logs.log_file import read_log
from palpate.core.gap.logs.new_rig import write_rig
from palpate.core.gap.logs.preview import preview_rows
from palpate.core.gap.logs.proposal import propose
from palpate.core.jobs import run_job

RATE, COUNT = 100.0, 600


def press(seed=0):
    """Times, depths and the readings of four texels of a press or two."""
    random = np.random.default_rng(seed)
    time = np.arange(COUNT) / RATE
    depth = np.interp(time, [0, 1, 2, 3, 3.3, 4, 5, 6], [-1e-3, -1e-3, 1e-3, 1e-3, -1e-3, 5e-4, 5e-4, -1e-3])
    force = 60.0 * np.maximum(depth, 0.0)[:, None] * np.array([1.0, 0.9, 1.1, 1.0]) + 1e-5 * random.normal(size=(COUNT, 4))
    return time, depth, force


def write_press(path, seed=0, **changes):
    """A log of a press in milliseconds, millimetres and counts."""
    time, depth, force = press(seed)
    columns = {"t_ms": time * 1e3, "depth (mm)": depth * 1e3} | {f"R{i + 1}": force[:, i] * 1e4 for i in range(4)}
    columns |= changes
    return write_csv(path, {name: values for name, values in columns.items() if values is not None})


def test_presses_in_other_units_become_a_rig_in_si(tmp_path):
    logs = [write_press(tmp_path / f"press_{i}.csv", i) for i in range(3)]
    written = new_rig(tmp_path / "rig", logs, template(tmp_path, logs))
    rig = read_rig(written.path)
    assert [trial.use for trial in rig.trials] == ["fit", "fit", "check"] and len(rig.texels) == 4
    assert rig.parameters.unit == "counts" and rig.grid == (2, 2, (0.005, 0.005))
    for i, trial in enumerate(rig.trials):
        time, depth, force = press(i)
        np.testing.assert_allclose(trial.time, time, atol=1e-9)
        np.testing.assert_allclose(trial.level, depth, atol=1e-12)
        np.testing.assert_allclose(trial.reading, force * 1e4, rtol=1e-9, atol=1e-9)
    text = written.path.read_text()
    assert '#   depth = { name = "depth (mm)", unit = "mm" }  # the file says so' in text and "read from press_1.csv" in text


def test_the_preview_tells_the_ends_of_a_clock_that_counts_from_1970(tmp_path):
    time = 1_780_000_000.25 + np.arange(100) * 0.5
    lines = [f"{t:.3f},{0.001 * i}" for i, t in enumerate(time)]
    (tmp_path / "a.csv").write_text("time,depth\n" + "\n".join(lines) + "\n", encoding="utf-8")
    rows = {row[1]: row[4:] for row in preview_rows([read_log(tmp_path / "a.csv")])}
    assert [float(end) for end in rows["time"]] == [1_780_000_000.25, 1_780_000_049.75]
    assert rows["depth"] == ("0", "0.099")


def test_the_preview_shows_names_and_units_of_a_file_that_is_too_short_for_a_recording(tmp_path, capsys):
    """As a testing machine writes it, with a preamble whose numbers are no samples."""
    rows = [f"{0.1 * i:.1f},{-0.2 * i:.2f},{-0.5 * i:.1f}" for i in range(5)]
    (tmp_path / "a.csv").write_text("Diameter,14.0\nSpeed,6\n\nTime,Extension,Load\ns,mm,N\n" + "\n".join(rows) + "\n")
    assert main(["rig", "new", str(tmp_path / "a.csv"), "--preview"]) == 0
    assert re.search(r"Extension +mm +5 +-0\.8 +(-?0) *\n", capsys.readouterr().out)
    assert main(["rig", "new", str(tmp_path / "a.csv"), "--out", str(tmp_path / "rig")]) == 1
    assert "'a.csv' has less than 8 samples, and a recording needs as many: leave it out." in capsys.readouterr().err


def test_a_unit_that_only_the_size_tells_is_asked(tmp_path):
    time, depth, force = press()
    logs = [write_csv(tmp_path / "a.csv", {"time": time, "indentation": depth * 1e3, "reading": force[:, 0]})]
    found = propose([read_log(logs[0])])
    column = found.columns()["depth"]
    assert column.value["unit"] == "mm" and column.is_thin and "no unit is stated, and it changes by 2" in column.reason
    with pytest.raises(
        FileError, match='depth of .a.csv. is .*"mm" }, because no unit is stated, and it changes by 2: answer it'
    ):
        answers_of(found)
    run_job(write_rig([read_log(logs[0])], answers_of(found.confirmed()), tmp_path / "rig"))
    assert "it changes by 2" in (tmp_path / "rig" / "rig.toml").read_text()


def test_a_pose_and_a_force_turned_to_the_sensor(tmp_path):
    time, depth, force = press()
    pose = {"x (mm)": 0.1 * time, "y (mm)": 0 * time, "z (mm)": (8e-3 - depth) * 1e3}
    (log,) = [write_csv(tmp_path / "a.csv", {"time": time, **pose, "Fx [N]": 0 * time, "Fz [N]": force.sum(axis=1)})]
    answers = template(tmp_path, [log], **{'sphere = "?"': "sphere = 0.008"})
    rig = read_rig(new_rig(tmp_path / "rig", [log], answers).path)
    (trial,) = rig.trials
    np.testing.assert_allclose(trial.position[:, 2], 8e-3 - depth, atol=1e-12)
    np.testing.assert_allclose(trial.force[:, 2], -force.sum(axis=1), rtol=1e-9)
    assert np.isnan(trial.force[:, 1]).all() and (trial.force[:, 0] == 0).all()


# --- two loggers


def two_loggers(folder, late=3.217, start=0.0):
    time, depth, force = press()
    clock = np.arange(0.0, 5.9, 0.017)
    answer = np.stack([np.interp(clock, time, force[:, i]) for i in range(4)], axis=1)
    stage = write_csv(folder / "stage_1.csv", {"time": start + time, "depth (mm)": depth * 1e3})
    pad = write_csv(folder / "pad_1.csv", {"seconds": start + clock + late} | {f"s{i}": answer[:, i] for i in range(4)})
    return stage, pad


def test_clocks_of_two_loggers_are_aligned_and_the_shift_is_a_parameter(tmp_path):
    logs = two_loggers(tmp_path)
    written = new_rig(tmp_path / "rig", logs, template(tmp_path, logs))
    words = tomllib.loads(written.path.read_text())["trial"][0]["readings"]
    assert words["late"] == pytest.approx(3.217, abs=0.02)
    assert re.search(r"the second clock is 3\.2\d+ s late", "\n".join(written.notes))
    (trial,) = read_rig(written.path).trials
    late = words["late"]
    expected = np.interp(trial.time - trial.time[0] + max(0.0, 3.217 - late), *press()[:2])
    assert np.abs(trial.level - expected).max() < 1e-4 and len(trial.time) > 330
    text = written.path.read_text().replace(f"late = {late}", "late = 3.217")
    written.path.write_text(text)  # whoever knows better writes it
    (trial,) = read_rig(written.path).trials
    depth, reading = trial.level, trial.reading[:, 0]
    np.testing.assert_allclose(reading, 60.0 * np.maximum(depth, 0.0), atol=3e-4)


def test_files_of_two_loggers_have_names_of_their_own(tmp_path):
    logs = two_loggers(tmp_path)
    answers = template(tmp_path, logs)
    text = answers.read_text()
    answers.write_text(text + text[text.index("[[recording]]") :].replace('"stage_1"', '"stage_1_readings"'))
    new_rig(tmp_path / "rig", logs, answers)
    assert sorted(one.name for one in read_rig(tmp_path / "rig" / "rig.toml").trials) == ["stage_1", "stage_1_readings_"]


def test_a_shift_that_the_recordings_do_not_tell_is_asked(tmp_path):
    time = np.arange(COUNT) / RATE
    wave = 1e-3 * np.maximum(np.sin(2 * np.pi * time), 0.0)
    stage = write_csv(tmp_path / "stage_1.csv", {"time": time, "depth (m)": wave})
    pad = write_csv(tmp_path / "pad_1.csv", {"time": time, "s0": 60 * wave, "s1": 50 * wave})
    answers = template(tmp_path, [stage, pad])
    with pytest.raises(FileError, match="does not tell how late the second clock is: write late = …"):
        new_rig(tmp_path / "rig", [stage, pad], answers)
    answers.write_text(answers.read_text().replace('use = "fit"', 'use = "fit"\nlate = 0.25'))
    (trial,) = read_rig(new_rig(tmp_path / "rig", [stage, pad], answers).path).trials
    assert trial.time[0] == pytest.approx(0.0) and trial.time[-1] == pytest.approx(5.74)


@pytest.mark.parametrize(
    "words", ['texel = { name = "s{}", first = 0, count = 4 }', 'depth = { name = "depth (mm)", unit = "mm" }']
)
def test_a_logger_without_what_drove_or_what_answered_is_one_sentence(tmp_path, words):
    logs = two_loggers(tmp_path)
    column = re.search(r'name = "([^"]*)"', words)[1].replace("{}", "0")
    answers = template(tmp_path, logs, **{words: f'temperature = {{ name = "{column}", unit = "°C" }}'})
    with pytest.raises(FileError, match="need z, depth or force in one and texel or force_z in the other: name these columns"):
        new_rig(tmp_path / "rig", logs, answers)


def test_clocks_of_the_time_of_day_count_as_one_and_a_shift_between_them_is_said(tmp_path):
    logs = two_loggers(tmp_path, late=0.4, start=1.7e9)
    answers = template(tmp_path, logs)
    written = new_rig(tmp_path / "rig", logs, answers)
    assert tomllib.loads(written.path.read_text())["trial"][0]["readings"]["late"] == 0.0
    assert re.search(r"count as one \(changes agree best with 0\.39 s\): late = …", "\n".join(written.notes))
    answers.write_text(answers.read_text().replace('use = "fit"', 'use = "fit"\nlate = 0.4'))
    written = new_rig(tmp_path / "rig", logs, answers)
    assert tomllib.loads(written.path.read_text())["trial"][0]["readings"]["late"] == 0.4
    assert "times count from 1700000000.000 s" in written.path.read_text()


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ('readings = "a.csv"', "readings of Trial 1"),
        ('readings = { file = "gone.csv" }', "gone.csv', which is not there"),
        ('readings = { file = "../x.csv" }', "outside the rig's folder"),
        ('readings = { file = "press_readings.csv", late = "soon" }', "late of the readings of Trial 1"),
        ('readings = { file = "press_readings.csv", late = 1e6 }', "0 samples at the same time"),
        ('readings = { file = "press_readings.csv", early = 1.0 }', "early"),
        ('readings = { file = "press.csv" }', "have a column 'depth'"),
    ],
)
def test_a_rig_with_a_second_logger_that_cannot_be_used_is_one_sentence(tmp_path, words, sentence):
    time, depth, force = press()
    write_csv(tmp_path / "press.csv", {"time": time, "depth": depth})
    write_csv(tmp_path / "press_readings.csv", {"time": time, "texel_0": force[:, 0]})
    sensor = "[sensor]\ngrid = { rows = 1, columns = 1, pitch = 0.01 }\n"
    (tmp_path / "rig.toml").write_text(f'format = "palpate-rig/1"\n{sensor}[[trial]]\nfile = "press.csv"\n{words}\n')
    with pytest.raises(FileError, match=re.escape(sentence)):
        read_rig(tmp_path / "rig.toml")


def test_only_the_part_that_the_answers_name_is_used(tmp_path):
    log = write_press(tmp_path / "press_0.csv")
    answers = template(tmp_path, [log], **{'use = "fit"': 'use = "fit"\nfrom = 0.5\nto = 4.0'})
    [trial] = read_rig(new_rig(tmp_path / "rig", [log], answers).path).trials
    _, depth, force = press()
    np.testing.assert_allclose(trial.time, np.arange(351) / RATE, atol=1e-9)
    np.testing.assert_allclose(trial.level, depth[50:401], atol=1e-12)
    np.testing.assert_allclose(trial.reading, force[50:401] * 1e4, rtol=1e-9, atol=1e-9)


def test_a_planned_path_is_no_recording(tmp_path):
    """A MAT file may hold shorter arrays that rise steadily beside what was recorded; they have no clock."""
    import scipy.io

    time, depth, force = press()
    planned = {"px": np.linspace(0.0, 11.0, 100), "pz": np.linspace(90.0, 80.0, 100), "path_z": np.linspace(81.0, 92.0, 71)}
    scipy.io.savemat(tmp_path / "press.mat", {"stamp": time, "depth": depth * 1e3, "sensor": force} | planned)
    columns = propose([read_log(tmp_path / "press.mat")]).columns()
    assert columns["depth"].value["name"] == "depth" and not {"x", "y", "z"} & set(columns)


# --- bad input


@pytest.mark.parametrize(
    ("changes", "replaced", "sentence"),
    [
        ({}, {'depth (mm)", unit = "mm"': 'depth (mm)", unit = "m"'}, "depth of 'press_0' moves by 2 m: its unit"),
        ({}, {'depth (mm)", unit = "mm"': 'depth (mm)", unit = "nm"'}, "spans 2e-09 m: its unit"),
        ({}, {'name = "t_ms", unit = "ms"': 'name = "t_ms", unit = "s"'}, "samples of 'press_0' are 10 s apart"),
        ({}, {"rows = 2, columns = 2": "rows = 3, columns = 2"}, "has 4 texel columns and the sensor has 6 texels"),
        ({}, {'name = "R{}"': 'name = "Q{}"'}, "no column 'Q1', which the answers name for texel"),
        ({}, {'use = "fit"': 'use = "maybe"'}, "write one of fit, check, leave out"),
        ({}, {"press_0.csv": "press_9.csv"}, "which was not given"),
        ({}, {'R{}", first = 1': 'R{}", unit = 3, first = 1'}, "is 3: write its name"),
        ({}, {'use = "fit"': 'use = "fit"\nfrom = 2.0\nto = 1.0'}, "write a `to` that is later than `from`"),
        ({}, {'use = "fit"': 'use = "fit"\nfrom = "later"'}, "is 'later': write seconds"),
        ({}, {'use = "fit"': 'use = "fit"\nfrom = 5.98'}, "has fewer than 8 samples from 5.98 s to 5.99 s"),
        ({"t_ms": np.r_[np.arange(300), np.arange(300)] * 10.0}, {}, "goes backwards after sample 300"),
    ],
)
def test_what_cannot_be_is_one_sentence(tmp_path, changes, replaced, sentence):
    log = write_press(tmp_path / "press_0.csv", **changes)
    answers = template(tmp_path, [log], **replaced)
    with pytest.raises(FileError, match=re.escape(sentence)) as caught:
        new_rig(tmp_path / "rig", [log], answers)
    assert str(caught.value).count(". ") == 0
    assert not (tmp_path / "rig" / "rig.toml").exists()


def test_repeated_and_uneven_time_stamps_are_put_right_and_said(tmp_path):
    time = np.floor(np.arange(COUNT) / 4) * 40.0
    time[400:] += 2000.0
    log = write_press(tmp_path / "press_0.csv", t_ms=time)
    written = new_rig(tmp_path / "rig", [log], template(tmp_path, [log]))
    (trial,) = read_rig(written.path).trials
    np.testing.assert_allclose(trial.time[:396], np.arange(396) / RATE, atol=1e-9)
    assert any("spread evenly" in note for note in written.notes)
    assert any("longest pause between two samples is 0.51 s" in note for note in written.notes)
    time = np.arange(COUNT) * 10.0
    time[7] = time[6]
    log = write_press(tmp_path / "press_0.csv", t_ms=time)
    written = new_rig(tmp_path / "rig", [log], template(tmp_path, [log]))
    np.testing.assert_allclose(read_rig(written.path).trials[0].time[5:9], [0.05, 0.06, 0.07, 0.08], atol=1e-9)
    log = write_csv(log, {name: np.repeat(values, 2) for name, values in read_log(write_press(log)).tables[0].columns.items()})
    written = new_rig(tmp_path / "rig", [log], template(tmp_path, [log]))
    assert len(read_rig(written.path).trials[0].time) == COUNT and "600 samples that are there twice" in written.notes[0]


def test_a_rig_is_not_written_over_its_logs(tmp_path):
    log = write_press(tmp_path / "press_0.csv")
    before = log.read_bytes()
    with pytest.raises(FileError, match="would be overwritten"):
        new_rig(tmp_path, [log], template(tmp_path, [log]))
    assert log.read_bytes() == before


@pytest.mark.parametrize("text", ["", "format = 3", 'format = "palpate-log-answers/1"', "[" * 5000])
def test_answers_that_are_none_are_one_sentence(tmp_path, text):
    (tmp_path / "answers.toml").write_text(text)
    with pytest.raises(FileError, match="answers"):
        read_answers(tmp_path / "answers.toml")


# --- the command


def test_without_answers_a_template_is_written_and_the_same_command_goes_on_with_it(tmp_path, capsys):
    logs = [str(write_press(tmp_path / f"press_{i}.csv", i)) for i in range(2)]
    out = tmp_path / "rig"
    assert main(["rig", "new", *logs, "--out", str(out)]) == 1
    said = capsys.readouterr()
    assert "leave 1 question open, the first: grid of [sensor] is not known" in said.err and "depth (mm)" in said.out
    answers = out / "answers.toml"
    assert main(["rig", "new", *logs, "--out", str(out), "--answers", str(answers)]) == 1
    assert 'still "?"' in capsys.readouterr().err
    answers.write_text(answers.read_text().replace('"?", columns = "?", pitch = ["?", "?"]', "2, columns = 2, pitch = 0.005"))
    assert main(["rig", "new", *logs, "--out", str(out), "--answers", str(answers)]) == 0
    said = capsys.readouterr().out
    assert "2 recordings, 1 to fit and 1 to check; 4 texels" in said
    assert (out / "recordings.png").read_bytes().startswith(b"\x89PNG") and read_rig(out / "rig.toml").trials
    assert main(["rig", "new", *logs, "--out", str(out)]) == 1  # answers that were filled in are kept
    assert "has answers already" in capsys.readouterr().err and "0.005" in answers.read_text()


def test_questions_at_the_terminal_are_answered_as_in_the_file(tmp_path):
    time, depth, force = press()
    log = write_csv(tmp_path / "a.csv", {"time": time, "way": depth * 1e3, "indentation": depth * 1e3, "reading": force[:, 0]})
    found = propose([read_log(log)])
    assert found.columns()["depth"].is_thin
    for typed, value in {
        "way mm": {"name": "way", "unit": "mm"},
        "way": {"name": "way", "unit": "mm"},
        '{ name = "way", unit = "cm" }': {"name": "way", "unit": "cm"},
        "0.001": 0.001,
        "": {"name": "indentation", "unit": "mm"},
    }.items():
        answered = questions.asked(found, lambda question, typed=typed: typed)
        assert answered.columns()["depth"].value == value and not answered.questions
    assert "depth" not in questions.asked(found, lambda question: "-").columns()


# --- the shift of two clocks


def presses(seed, seconds=30.0, rate=200.0):
    """A height above a sensor that wanders, and times of it."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 1.0 / rate)
    knots = np.sort(random.uniform(0.0, seconds, 14))
    return time, np.interp(time, knots, random.uniform(-3.0, 3.0, 14))


@pytest.mark.parametrize("late", [0.0, 3.217, -12.34, 86_400.5, -1.7e9])
@pytest.mark.parametrize("rate", [37.0, 500.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_shift_is_found_from_a_motion_that_only_touches_at_times(late, rate, sign):
    time, height = presses(3)
    clock = np.arange(-1.0, 32.0, 1.0 / rate)
    force = np.maximum(-np.interp(clock, time, height), 0.0) ** 1.5
    force += 0.02 * np.random.default_rng(1).normal(size=len(force))
    found = clock_shift((time, height), (clock + late, 40.0 + sign * force))
    assert found.is_sure and found.correlation > 0.8
    assert abs(found.late - late) < 0.05


def test_presses_that_repeat_do_not_tell_the_shift():
    time = np.arange(0.0, 30.0, 0.01)
    wave = np.maximum(np.sin(2.0 * np.pi * time), 0.0)
    assert not clock_shift((time, wave), (time + 0.3, wave)).is_sure


def test_what_does_not_change_has_no_shift():
    time, height = presses(0)
    assert clock_shift((time, np.zeros(len(time))), (time, height)) is None
    assert clock_shift((time, height), (time, np.full(len(time), np.nan))) is None


# --- docs/logs.md


def test_the_template_of_the_page_is_the_one_that_is_written(repository, tmp_path):
    page = (repository / "docs" / "logs.md").read_text(encoding="utf-8")
    time = np.arange(0, 600) * 10.0
    rows = [f"{t},{1.0 - np.cos(t / 400):.4f},{i},{i},{i},{i}" for i, t in enumerate(time)]
    for i in range(3):
        (tmp_path / f"press_{i}.csv").write_text("t_ms,depth (mm),R1,R2,R3,R4\n" + "\n".join(rows))
    text = propose([read_log(tmp_path / f"press_{i}.csv") for i in range(3)]).text
    (shown,) = re.findall(r'```toml\n(format = "palpate-log-answers.*?)# …\n```', page, re.DOTALL)
    written = [line for line in text.splitlines() if line and not line.startswith("#")]
    lines = [line for line in shown.splitlines() if line]
    assert lines == written[: len(lines)] and len(lines) > 10
