# SPDX-License-Identifier: GPL-3.0-or-later
"""A known weight at a known place, and recordings with several probes."""

import numpy as np
import pytest
from gap_cases import diagnosed
from rig_files import RIG, TEXELS, refusal, write
from scipy.optimize import brentq

from palpate.core.errors import FileError, SceneError
from palpate.core.gap.dataset.rig import grid_texels, read_rig
from palpate.core.gap.forward.predictor import Model, predictors_of
from palpate.core.gap.forward.stimulus import stimulus_of

K, RADIUS = 80.0, 0.008
GAINS = np.array([1.0, 1.1, 0.6, 1.2, 0.9, 1.2])
WEIGHTS = f"""
format = "palpate-rig/1"
name = "weights on a pad"
[sensor]
grid = {{ rows = 3, columns = 2, pitch = [0.003, 0.004] }}
k = {K}
unit = "counts"
[indenter]
shape = {{ sphere = {RADIUS} }}
[[trial]]
file = "a.csv"
[[trial]]
file = "b.csv"
use = "check"
"""


def shares(x, y, weight):
    """Forces of springs of equal stiffness under a ball of a weight, by root finding."""
    position = grid_texels(3, 2, 0.003, 0.004).position  # the pitch of x is 3 mm
    height = np.sqrt(np.maximum(RADIUS**2 - (position[:, 0] - x) ** 2 - (position[:, 1] - y) ** 2, 0.0))

    def depth(z):
        return np.where(height > 0, np.maximum(height - z, 0.0) * height / RADIUS, 0.0)

    z = brentq(lambda z: K * depth(z).sum() - weight, -0.05, RADIUS)
    return K * depth(z)


def weighed(seed, gain=300.0):
    """A CSV of weights of 20 to 200 g put down at several places, read in counts by texels of different gains."""
    rng, rows = np.random.default_rng(seed), [",".join(["time", "x", "y", "force", *(f"texel_{i}" for i in range(TEXELS))])]
    time = 0.0
    for _ in range(10):
        x, y, weight = rng.uniform(-0.002, 0.002), rng.uniform(-0.004, 0.004), rng.uniform(0.02, 0.2) * 9.81
        for on in (0.0, 1.0):
            load = on * shares(x, y, weight)
            for _ in range(20):
                reading = 40.0 + gain * GAINS * load + 0.5 * rng.normal(size=TEXELS)
                rows.append(",".join(f"{value:.9g}" for value in (time, x, y, on * weight, *reading)))
                time += 0.05
    return "\n".join(rows) + "\n"


def test_texels_share_a_weight_as_springs_do(tmp_path):
    rig = read_rig(write(tmp_path, WEIGHTS, a=weighed(0), b=weighed(1)))
    trial = rig.trials[0]
    load = stimulus_of(trial, rig).load
    np.testing.assert_allclose(load.sum(axis=1), trial.level, rtol=1e-6)
    for i in (25, 185, 305):
        x, y, _ = trial.position[i]
        np.testing.assert_allclose(load[i], shares(x, y, trial.level[i]), rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("k", [80.0, 1e3, 1e6, 1e9])
def test_weights_of_any_depth_are_carried_with_a_load_cells_noise(tmp_path, k):
    """From millimetres to nanometres deep, with forces of both signs about zero; the load is the whole force."""
    rng = np.random.default_rng(3)
    lines = weighed(0).splitlines()
    cells = [line.split(",") for line in lines[1:]]
    for row in cells:
        row[3] = f"{float(row[3]) + 2e-4 * rng.normal():.9g}"
    text = WEIGHTS.replace(f"k = {K}", f"k = {k}")
    rig = read_rig(write(tmp_path, text, a=[lines[0].split(","), *cells], b=weighed(1)))
    trial = rig.trials[0]
    load = stimulus_of(trial, rig).load.sum(axis=1)
    heavy = trial.level > 1e-3
    np.testing.assert_allclose(load[heavy], trial.level[heavy], rtol=1e-9)
    assert (load[trial.level <= 0.0] == 0.0).all()


def test_weights_at_places_give_the_gain_of_each_texel(tmp_path):
    found = diagnosed(read_rig(write(tmp_path, WEIGHTS, a=weighed(0), b=weighed(1))))
    assert found.verdict == "explained"
    assert [one.name for one in found.findings if one.confidence >= 0.5] == ["gain-mismatch"]
    factors = np.asarray(found.best.model.effects[0].values["factor"])
    np.testing.assert_allclose(found.best.model.parameters.gain * factors, 300.0 * GAINS, rtol=0.01)


def test_a_weight_that_slides_rubs_and_one_that_is_lifted_does_not(tmp_path):
    """A block has the friction of steady sliding after 1 mm, and none where it was lifted before it was moved as far."""
    speed, time = 2e-3, 0.02 * np.arange(120)
    law = f"k = {K}\nmus = 0.5\nmud = 0.4\nx0 = 0.01\nsigma0 = 1e4\nsigma1 = 0.4\nct = 0.01"
    text = WEIGHTS.replace(f"k = {K}", law).replace(f"sphere = {RADIUS}", "box = [0.05, 0.05, 0.01]")
    lifted = np.abs(time - 1.2) < 0.05
    ways = {
        "a": (speed * np.clip(time - 0.2, 0.0, 2.0), 1.0),
        "b": (np.where(time < 1.26, 0.0, 4e-3), np.where(lifted, 6e-4, 1.0)),
    }
    for name, (x, force) in ways.items():
        table = np.column_stack([time, x, 0.0 * x, force + 0.0 * x, np.ones((120, 3 + TEXELS))])
        header = ["time", "x", "y", "force", "force_x", "force_y", "force_z", *(f"texel_{i}" for i in range(TEXELS))]
        np.savetxt(tmp_path / f"{name}.csv", table, delimiter=",", header=",".join(header), comments="", fmt="%.9g")
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    rig = read_rig(tmp_path / "rig.toml")
    slid, put = (predictor.predict(Model(rig.parameters)).force for predictor in predictors_of(rig.trials, rig))
    steady = 0.4 + 0.1 * np.exp(-((speed / 0.01) ** 2))
    np.testing.assert_allclose(slid[60:100], np.tile([steady + 0.06 * speed, 0.0, -1.0], (40, 1)), rtol=1e-3, atol=1e-12)
    assert not put[:, 0].any()
    np.testing.assert_allclose(put[:, 2], np.where(lifted, -6e-4, -1.0))
    assert [note.split("'")[1] for note in rig.warnings if "slides" in note] == ["a.csv"]


def test_mistakes_with_weights_are_said(tmp_path):
    with pytest.raises(FileError, match="no k"):
        read_rig(write(tmp_path, WEIGHTS.replace(f"k = {K}", ""), a=weighed(0), b=weighed(1)))
    with pytest.raises(FileError, match="where a force acts"):
        read_rig(write(tmp_path, WEIGHTS.replace("[indenter]", "").replace(f"shape = {{ sphere = {RADIUS} }}", "")))
    beside = weighed(0).splitlines()
    beside[25:] = [",".join([*line.split(",")[:1], "0.03", *line.split(",")[2:]]) for line in beside[25:]]
    rig = read_rig(write(tmp_path, WEIGHTS, a="\n".join(beside) + "\n"))
    with pytest.raises(SceneError, match=r"do not rest.*"):
        predictors_of(rig.trials, rig)


def test_each_recording_names_its_probe(tmp_path):
    block = '\n[[probe]]\nname = "block"\nshape = { box = [0.004, 0.004, 0.01] }\n'
    text = RIG.replace('file = "again.csv"', 'file = "again.csv"\nprobe = "block"')
    both = read_rig(write(tmp_path, text + block))
    assert [one.probe for one in both.trials] == ["", "block"]
    alone = read_rig(write(tmp_path, RIG.replace("{ sphere = 0.008 }", "{ box = [0.004, 0.004, 0.01] }")))
    ball = read_rig(write(tmp_path))
    np.testing.assert_array_equal(stimulus_of(both.trials[1], both).depth, stimulus_of(alone.trials[1], alone).depth)
    np.testing.assert_array_equal(stimulus_of(both.trials[0], both).depth, stimulus_of(ball.trials[0], ball).depth)
    assert (stimulus_of(both.trials[0], both).depth != stimulus_of(alone.trials[0], alone).depth).any()


def test_a_rig_needs_no_indenter_where_all_recordings_name_a_probe(tmp_path):
    text = RIG.replace("[indenter]\nshape = { sphere = 0.008 }\n", "")
    probe = '[[probe]]\nname = "a"\nshape = { sphere = 0.008 }\n'
    text = text.replace('.csv"\n', '.csv"\nprobe = "a"\n')
    assert read_rig(write(tmp_path, text + probe)).indenter is None
    assert "no [indenter]" in refusal(tmp_path, text.replace('probe = "a"\n', "", 1) + probe)
    for wrong in ("shpe", "shape"):  # a mistake in a probe is not said of the indenter
        said = refusal(tmp_path, text + probe.replace("shape = { sphere", f"{wrong} = {{ spher"))
        assert "[[probe]] 1 of 'rig.toml'" in said and "[indenter]" not in said
