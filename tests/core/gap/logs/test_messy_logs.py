# SPDX-License-Identifier: GPL-3.0-or-later
"""Logs as magnetic skins have them: two files without headers, signed channels, −1 where the scale was too slow, grams."""

import numpy as np
import pytest

from palpate.commands import main
from palpate.core.errors import FileError
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.logs.column_behaviour import is_force, missing_code
from palpate.core.gap.logs.log_file import read_log
from palpate.core.gap.logs.log_table import with_distinct_names
from palpate.core.gap.logs.proposal import propose
from palpate.core.gap.logs.questions import asked

GRAM = 9.80665e-3
CHANNELS = 6


def press(seed):
    """Two loggers of 120 s at 15 Hz: times, heights (mm) and forces (g) of one, times and six signed channels of the other."""
    random = np.random.default_rng(seed)
    time = 1.7e9 + 1000.0 * seed + np.cumsum(random.uniform(0.06, 0.075, 1700))

    def force(at):
        since = at - time[0]
        return 2500.0 * np.maximum(0.0, np.sin(2 * np.pi * since / 13.0 + 0.5)) ** 2 * (0.6 + 0.4 * np.sin(since / 31.0))

    clock = time + 0.002
    load = force(clock)[:, None] / 2500.0
    gain = np.array([1200.0, 350.0, -1300.0, 3000.0, -420.0, 90.0])
    readings = gain * (load + np.array([0.3, -0.2, 0.5, -0.3, 0.2, 0.0]) * load**2) + random.normal(
        0.0, 3.0, (len(time), CHANNELS)
    )
    return time, 288.0 - 12.0 * (force(time) / 2500.0) ** 0.7, force(time), clock, readings


def write_files(folder, seed):
    """The two files of a recording in a folder of its own, as the robot's program names them."""
    time, height, force, clock, readings = press(seed)
    force = np.round(force, 2)
    force[1::2] = -1.0
    random = np.random.default_rng(seed + 50)
    constant = 315.0 - 3.1e-5 * (random.random(len(time)) < 0.1)
    folder.mkdir()
    states, sensor = folder / "states.csv", folder / "sensor.csv"
    np.savetxt(states, np.stack([time, constant, -100.0 + 0 * time, height, force], axis=1), "%.9f", delimiter=",")
    np.savetxt(sensor, np.column_stack([clock, readings]), "%.9f", delimiter=",")
    return [states, sensor]


def test_of_raw_files_what_drove_is_asked_with_how_far_each_column_reaches(tmp_path, capsys):
    logs = write_files(tmp_path / "a_1", 1) + write_files(tmp_path / "b_2", 2)
    command = ["rig", "new", *map(str, logs), "--out", str(tmp_path / "rig")]
    assert main(command) == 1
    assert "column_3: -100, column_4: 276.1 to 288, column_5: 0 to 2480, missing = -1.0)" in capsys.readouterr().out
    replies = {"depth": "force = column_5 g", "texel": "", "grid": "{ rows = 2, columns = 3, pitch = [0.01, 0.01] }"}
    typed = asked(propose([read_log(log) for log in logs]), lambda question: replies[question.split(" ")[0]])
    assert not typed.questions and typed.columns(0)["force"].value == {"name": "column_5", "unit": "g"}
    answers = tmp_path / "rig" / "answers.toml"
    text = answers.read_text().replace('depth = { name = "?", unit = "m" }', 'force = { name = "column_5", unit = "g" }')
    answers.write_text(
        text.replace('rows = "?", columns = "?", pitch = ["?", "?"]', "rows = 2, columns = 3, pitch = [0.01, 0.01]")
    )
    assert main([*command, "--answers", str(answers)]) == 1
    said = capsys.readouterr().err
    assert "'column_5' of 'a_1/states.csv' is -1 in 50% of its samples" in said and "write missing = -1.0 at force if" in said
    answers.write_text(answers.read_text().replace('unit = "g" }', 'unit = "g", missing = -1.0 }'))
    assert main([*command, "--answers", str(answers)]) == 0
    rig = read_rig(tmp_path / "rig" / "rig.toml")
    assert [trial.use for trial in rig.trials] == ["fit", "check"] and len(rig.texels) == CHANNELS
    for seed, trial in zip((1, 2), rig.trials, strict=True):
        time, _, force, clock, readings = press(seed)
        assert trial.stimulus == "force" and trial.reading.shape[1] == CHANNELS
        used = np.isfinite(trial.reading).all(axis=1)
        assert used.mean() > 0.99
        at = trial.time[used] - trial.time[0]  # both count from the first sample within the other logger's time
        np.testing.assert_allclose(trial.level[used], GRAM * np.interp(at, clock - clock[0], force), atol=0.01 * 25)
        assert np.abs(trial.reading[used][:, 2]).max() == pytest.approx(np.abs(readings[:, 2]).max(), rel=1e-6)
    text = (tmp_path / "rig" / "rig.toml").read_text()
    assert "late = 0.0" in text and 'texel = { name = "column_{}", first = 2, count = 6 }  # CHECK: 6 columns' in text
    assert (tmp_path / "rig" / "recordings.png").stat().st_size > 10_000


def test_codes_for_missing_values():
    force = np.maximum(0.0, 100.0 * np.sin(np.arange(2000) * 0.02))
    coded = force.copy()
    coded[::3] = -1.0
    assert missing_code(coded) == -1.0 and missing_code(force) is None
    coded[::3] = 9999.0
    assert missing_code(coded) == 9999.0
    noise = np.round(np.random.default_rng(0).normal(0.0, 0.5, 4000)).clip(-1, 1) + np.where(np.arange(4000) > 3000, 50.0, 0.0)
    assert missing_code(noise) is None  # a converter's −1 around zero
    rail = np.clip(np.abs(300.0 * np.sin(np.arange(2000) * 0.02)), 0, 255)
    assert missing_code(rail) is None


def test_columns_that_rise_with_the_clock_are_no_texels(tmp_path):
    time, _, force, clock, readings = press(1)
    table = np.column_stack([clock, np.arange(len(clock)), readings])
    np.savetxt(tmp_path / "sensor_1.csv", table, "%.9f", delimiter=",")
    np.savetxt(tmp_path / "stage_1.csv", np.column_stack([time, force]), "%.9f", delimiter=",")
    found = propose([read_log(tmp_path / "sensor_1.csv"), read_log(tmp_path / "stage_1.csv")])
    (texels,) = [guess for guess in found.guesses if guess.word == "texel"]
    assert texels.value == {"name": "column_{}", "first": 3, "count": 6}
    assert is_force(force) and not is_force(force + 300.0)


def test_equal_names_in_equal_folders_are_refused(tmp_path):
    first = write_files(tmp_path / "a_1", 1)[0]
    (tmp_path / "other").mkdir()
    second = write_files(tmp_path / "other" / "a_1", 2)[0]
    with pytest.raises(FileError, match="Two logs are called 'a_1/states.csv'"):
        with_distinct_names([read_log(first), read_log(second)])
