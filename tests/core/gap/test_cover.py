# SPDX-License-Identifier: GPL-3.0-or-later
"""Transducers at given places under a cover, and strips: readings are sums over a surface that is computed densely."""

from dataclasses import replace

import numpy as np
import pytest
from gap_cases import diagnosed
from rig_files import write
from scipy.integrate import dblquad

from palpate.core.errors import FileError
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.forward.predictor import Model, predictors_of

SIZE, DEPTH, RADIUS, K = (0.030, 0.018), 0.003, 0.010, 80.0
PLACES = [[x, y] for y in (-0.004, 0.004) for x in (-0.0105, -0.0035, 0.0035, 0.0105)]
AREA = SIZE[0] * SIZE[1] / len(PLACES)
RIG = f"""
format = "palpate-rig/1"
name = "eight transducers under a cover"
[sensor]
sensors = {PLACES}
cover = {{ size = {list(SIZE)}, depth = {DEPTH} }}
thickness = 0.006
k = {K}
[indenter]
shape = {{ sphere = {RADIUS} }}
"""


def recording(seed, relaxing=False, use="fit", noise=0.0):
    """A CSV of a ball pressed at three places: Boussinesq's stress summed over points 0.3 mm apart, by code of its own."""
    rng, step = np.random.default_rng(seed), 0.05
    lowest = np.concatenate([np.interp(np.arange(0, 5, step), [0, 0.6, 1.5, 3.5, 4.2, 5], d) for d in rng.uniform(6e-4, 2e-3, 3)
                             [:, None] * [-0.5, -0.5, 1, 1, -0.5, -0.5]])  # fmt: skip
    time = step * np.arange(len(lowest))
    x, y = (np.repeat(rng.uniform(-half, half, 3), len(time) // 3) for half in (0.010, 0.005))
    px, py = (np.arange(-0.5 * side + 1.5e-4, 0.5 * side, 3e-4) for side in SIZE)
    px, py = (axis.ravel() for axis in np.meshgrid(px, py))
    square = (px - x[:, None]) ** 2 + (py - y[:, None]) ** 2
    height = np.sqrt(np.maximum(RADIUS**2 - square, 0.0))
    depth = np.maximum(height - (RADIUS - lowest[:, None]), 0.0) * height / RADIUS
    rate = np.gradient(lowest, time)[:, None] * height / RADIUS * (depth > 0)
    pressure = np.maximum(K * depth + 0.01 * K * rate, 0.0) / AREA
    if relaxing:
        slow, keep = np.zeros(pressure.shape[1]), np.exp(-step / 0.8)
        for i in range(len(time)):
            slow = keep * slow + (1.0 - keep) * pressure[i]
            pressure[i] = np.maximum(pressure[i] - 0.3 * slow, 0.0)
    columns = [time, x, y, RADIUS - lowest]
    for sx, sy in PLACES:
        away = DEPTH**2 + (px - sx) ** 2 + (py - sy) ** 2
        columns.append(AREA * 3e-4**2 * pressure @ (3 * DEPTH**3 / (2 * np.pi) * away**-2.5))
    table = np.stack(columns, axis=1)
    table[:, 4:] += noise * rng.normal(size=(len(time), len(PLACES)))
    head = "time,x,y,z," + ",".join(f"texel_{i}" for i in range(len(PLACES)))
    return "\n".join([head, *(",".join(f"{value:.8g}" for value in row) for row in table)]) + "\n"


def written(folder, rig=RIG, trials=2, **words):
    for i in range(trials):
        (folder / f"press_{i}.csv").write_text(recording(i, **words))
        rig += f'[[trial]]\nfile = "press_{i}.csv"\nuse = "{"check" if 0 < i == trials - 1 else "fit"}"\n'
    (folder / "rig.toml").write_text(rig)
    return folder / "rig.toml"


def relative_error(rig):
    """Largest error of the predicted readings, as a share of the largest reading."""
    model = Model(replace(rig.parameters, cn=0.01 * K))
    pairs = [(one.predict(model).reading, one.trial.reading) for one in predictors_of(rig.trials, rig)]
    return max(float(np.abs(a - b).max()) for a, b in pairs) / max(float(b.max()) for _, b in pairs)


def test_a_coarse_surface_predicts_what_a_dense_one_does(tmp_path):
    errors = []
    for pitch in (0.003, 0.0015, 0.00075):
        text = RIG.replace(f"depth = {DEPTH}", f"depth = {DEPTH}, pitch = {pitch}")
        errors.append(relative_error(read_rig(written(tmp_path, text, trials=1))))
    assert errors[0] > errors[1] > errors[2] and errors[2] < 0.005 and errors[1] < 0.02


def test_an_even_depth_gives_the_stiffness_and_the_net_force_of_the_area(tmp_path):
    text = RIG.replace("[indenter]", "").replace(f"shape = {{ sphere = {RADIUS} }}", "")
    time = np.arange(20) * 0.1
    level = np.interp(time, [0, 0.5, 1.0, 2.0], [0, 0, 1e-3, 1e-3])
    header = "time,depth,force_z," + ",".join(f"texel_{i}" for i in range(8))
    rows = [f"{t},{d}," + ",".join(["0.1"] * 9) for t, d in zip(time, level, strict=True)]
    rig = read_rig(write(tmp_path, text + '[[trial]]\nfile = "even.csv"\n', even="\n".join([header, *rows]) + "\n"))
    (one,) = predictors_of(rig.trials, rig)
    found = one.predict(Model(replace(rig.parameters, cn=0.0)))
    assert found.force[-1, 2] == pytest.approx(-8 * K * 1e-3, rel=1e-9)  # eight texels cover the whole area
    x, y = PLACES[0]
    kernel = lambda b, a: 1.5 / np.pi * DEPTH**3 * (DEPTH**2 + (a - x) ** 2 + (b - y) ** 2) ** -2.5  # noqa: E731
    share = dblquad(kernel, -0.5 * SIZE[0], 0.5 * SIZE[0], -0.5 * SIZE[1], 0.5 * SIZE[1])[0]
    assert 0.8 < share < 1.0  # the rest would come from beyond the rim
    assert found.reading[-1, 0] == pytest.approx(share * K * 1e-3, rel=0.01)


def test_strips_carry_what_lies_on_them(tmp_path):
    strips = [
        [[-0.015, -0.009], [-0.005, 0.009]],
        [[-0.004, -0.009], [0.000, 0.009]],
        [[0.005, -0.009], [0.015, -0.009], [0.01, 0.009]],
    ]
    text = RIG.replace(f"sensors = {PLACES}", f"strips = {strips}").replace(f", depth = {DEPTH}", "")
    trial, columns = '[[trial]]\nfile = "press_0.csv"\n', [line.split(",")[:7] for line in recording(0).splitlines()]
    rig = read_rig(write(tmp_path, text + trial, press_0=columns))
    areas = np.array([1.8e-4, 0.72e-4, 0.9e-4])
    np.testing.assert_allclose(rig.texels.area, areas, rtol=0.02)
    np.testing.assert_allclose(rig.cover.weights.sum(axis=1), areas / areas.mean(), rtol=0.02)
    np.testing.assert_allclose(rig.texels.position[:, :2], [[-0.01, 0], [-0.002, 0], [0.01, -0.003]], atol=2e-4)
    (one,) = predictors_of(rig.trials, rig)
    reading = one.predict(Model(rig.parameters)).reading
    x = rig.trials[0].position[:, 0]
    pressed = one.stimulus.load.max(axis=1) > 0
    on_first = pressed & (x < -0.012)
    assert (reading[on_first, 2] == 0.0).all() and (~on_first | (reading[:, 0] > reading[:, 1])).all()
    shallow = text.replace("size", "depth = 0.001, size")
    spread = read_rig(write(tmp_path, shallow + trial)).cover.weights
    assert ((spread > 0).sum(axis=1) > (rig.cover.weights > 0).sum(axis=1)).all()


@pytest.mark.parametrize("pitch", [0.018, 0.03])
def test_a_cover_with_one_row_of_points_or_one_point_gives_strips_their_areas(tmp_path, pitch):
    strip = [[-0.015, -0.009], [0.0, 0.009]]
    words = f"strips = [{strip}]\ncover = {{ size = {list(SIZE)}, pitch = {pitch} }}"
    text = RIG.replace(f"sensors = {PLACES}\ncover = {{ size = {list(SIZE)}, depth = {DEPTH} }}", words)
    columns = [line.split(",")[:5] for line in recording(0).splitlines()]
    rig = read_rig(write(tmp_path, text + '[[trial]]\nfile = "press_0.csv"\n', press_0=columns))
    np.testing.assert_allclose(rig.texels.area, 0.5 * SIZE[0] * SIZE[1], rtol=1e-9)


@pytest.mark.long("a whole diagnosis under a cover")
def test_eight_transducers_of_which_nothing_is_wrong_but_creep(tmp_path):
    text = RIG.replace(f"k = {K}", f"k = {1.2 * K}")
    assert len(read_rig(written(tmp_path, text)).surface) == 40 * 24  # points a quarter of the depth apart
    text = text.replace(f"depth = {DEPTH}", f"depth = {DEPTH}, pitch = 0.0015")
    rig = read_rig(written(tmp_path, text, trials=3, relaxing=True, noise=2e-4))
    assert len(rig.texels) == 8 and len(rig.surface) == 20 * 12
    found = diagnosed(rig)
    assert [one.name for one in found.findings if one.confidence >= 0.5] == ["creep"]
    assert found.verdict == "explained"
    assert found.best.model.parameters.k == pytest.approx(K, rel=0.05)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (f"depth = {DEPTH}", "pitch = 0.001", "no depth"),
        ("[-0.0105, -0.004]", "[-0.105, -0.004]", "not on the cover"),
        ("[-0.0105, -0.004]", "[-0.0105]", "places"),
        (f"depth = {DEPTH}", f"depth = {DEPTH}, pitch = 1e-5", "larger pitch"),
        ("cover =", "grid =", "one of grid"),
        ("thickness", "strips = [[[0, 0], [0.001, 0.001]]]\nthickness", "not both"),
        (f"sensors = {PLACES}", "strips = [[[0, 0], [0.001, 0.0]]]", "no area"),
        (f"sensors = {PLACES}", "", "either sensors"),
        (
            f"sensors = {PLACES}\ncover = {{ size = {list(SIZE)}, depth = {DEPTH} }}",
            "strips = [[[-0.01, -0.006], [-0.0099, 0.006]]]\ncover = { size = [0.02, 0.012], pitch = 0.03 }",
            "smaller pitch",
        ),
        (f"size = {list(SIZE)}", "size = 3", "size of cover"),
    ],
)
def test_mistakes_are_said(tmp_path, old, new, said):
    assert old in RIG
    trial = '\n[[trial]]\nfile = "a.csv"\n'
    with pytest.raises(FileError, match=said):
        read_rig(write(tmp_path, RIG.replace(old, new) + trial))
