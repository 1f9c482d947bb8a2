# SPDX-License-Identifier: GPL-3.0-or-later
"""Every quantity of the table is in every figure and picture, with its unit and on its scale."""

import json

import numpy as np
import pytest
from sample_bake import grid_texels, recording_of

from palpate.api.recordings import Recording
from palpate.commands import figure_options
from palpate.core.errors import ParameterError
from palpate.core.export.exporter import export
from palpate.core.figures import color_maps, figure_canvas, quantities
from palpate.core.figures.figure_style import FigureStyle
from palpate.core.figures.picture_labels import label_picture
from palpate.core.figures.quantities import QUANTITIES
from palpate.core.figures.side_by_side import side_by_side
from palpate.core.figures.tactile_strip import strip_figure
from palpate.core.figures.texel_numbers import texel_numbers
from palpate.core.io.bake_reader import Bake
from palpate.core.jobs import run_job
from palpate.core.model.recording import VectorReadings
from palpate.core.model.sensor_parameters import Painted, SensorParameters

EVERY = pytest.mark.parametrize("name", QUANTITIES)


@pytest.fixture
def recorded():
    """Texels and a recording in which every quantity differs: 5 V at rest fall by 2 V/N, and a channel has both signs."""
    texels = grid_texels()
    recording = recording_of(texels)
    felt = recording.sensors["pad"]
    felt.reading, felt.unit = 5.0 - 2.0 * felt.normal_force, "V"
    felt.depth, felt.slip = 1e-3 * felt.normal_force, 0.02 * felt.normal_force
    values = np.stack([felt.normal_force, -felt.normal_force, felt.normal_force - 0.03], axis=2)
    felt.channels = VectorReadings(values, np.zeros(values.shape, bool), "T", place=texels.position)
    return texels, recording


EXPECTED = {
    "force": lambda felt, texels: (felt.normal_force, "N"),
    "pressure": lambda felt, texels: (felt.normal_force / texels.area / 1e3, "kPa"),
    "reading": lambda felt, texels: (felt.reading, "V"),
    "shear": lambda felt, texels: (np.hypot(felt.shear[..., 0], felt.shear[..., 1]), "N"),
    "depth": lambda felt, texels: (1e3 * felt.depth, "mm"),
    "slip": lambda felt, texels: (1e3 * felt.slip, "mm/s"),
    "channels": lambda felt, texels: (felt.channels.values[..., 2], "T"),
}


@EVERY
def test_strip_numbers_and_pictures_show_it(tmp_path, monkeypatch, recorded, name):
    from matplotlib.image import imsave

    texels, recording = recorded
    felt, own, style = recording.sensors["pad"], {"pad": texels}, FigureStyle(quantity=name)
    values, unit = EXPECTED[name](felt, texels)
    scale = style.scale(recording, own)
    assert scale.low <= values.min() and values.max() <= scale.high
    kept = []
    monkeypatch.setattr(figure_canvas, "_write", lambda figure, *_: kept.append(figure))
    imsave(tmp_path / "scene.png", np.full((480, 640, 3), 0.4))
    kept.append(Recording.of(recording, {"pad": (texels, Painted(), SensorParameters(unit="V"))}).show(name, [0.17]))
    side_by_side(tmp_path / "scene.png", tmp_path / "a.png", recording, own, 5, style)
    label_picture(tmp_path / "scene.png", tmp_path / "b.png", recording, own, 5, style=style)
    for figure in kept:
        (image,) = (image for axes in figure.axes for image in axes.images if image.get_array().shape == texels.layout.shape)
        assert image.get_array().data[texels.layout.row, texels.layout.column] == pytest.approx(values[4])
        assert image.get_clim() == (scale.low, scale.high) and image.get_cmap().name == scale.colour_map
        labels = [text for axes in figure.axes for text in (axes.get_ylabel(), axes.get_xlabel())]
        assert any(f"({unit})" in label and QUANTITIES[name].label[0] in label for label in labels)
    texel_numbers(tmp_path / "c.png", recording, own, "pad", 5, style)
    words = [float(text.get_text()) for text in kept[-1].axes[0].texts]
    peak = np.abs(values[4]).max()
    factor = 1e3 if peak < 1.0 else 1.0
    expected = [value for value in factor * values[4] if abs(value) > 1e-9]  # no number stands on a texel at zero
    assert words == pytest.approx(expected, abs=0.006 * factor * peak)
    finer = unit if factor == 1.0 else quantities.FINER[unit]
    assert f"numbers in {finer}" in kept[-1].texts[0].get_text() and f"({finer})" in kept[-1].axes[-1].get_ylabel()


@EVERY
def test_exported_pictures_and_messages_show_it(tmp_path, recorded, name):
    from matplotlib.image import imread

    texels, recording = recorded
    bake = Bake(recording, {"pad": texels}, {"pad": Painted()}, {"pad": SensorParameters(unit="V")}, {}, {})
    style = FigureStyle(quantity=name)
    run_job(export(bake, "png", tmp_path, style))
    values, unit = EXPECTED[name](recording.sensors["pad"], texels)
    about = json.loads((tmp_path / "pad" / "scale.json").read_text())
    assert about["first_colour"] <= values.min() and values.max() <= about["last_colour"] and f"({unit})" in about["quantity"]
    picture = imread(tmp_path / "pad" / "tactile_0005.png")
    size = picture.shape[0] // texels.layout.shape[0]
    pixels = picture[size // 2 :: size, size // 2 :: size, :3][::-1][texels.layout.row, texels.layout.column]
    share = (values[4] - about["first_colour"]) / (about["last_colour"] - about["first_colour"])
    assert pixels == pytest.approx(color_maps.colors(about["colour_map"], share), abs=0.003)


def test_scales_end_at_round_numbers_around_their_values():
    assert quantities.from_zero(0.01, 0.11) == pytest.approx((0.0, 0.15)) and quantities.from_zero(0.0, 0.0) == (0.0, 1.5)
    assert quantities.about_zero(-0.11, 0.01) == pytest.approx((-0.15, 0.15))
    assert quantities.between(0.0, 0.11) == pytest.approx((0.0, 0.15))
    assert quantities.between(512.0, 700.0) == pytest.approx((500.0, 700.0))
    assert quantities.between(4.17, 5.0) == pytest.approx((4.1, 5.0))
    low, high = quantities.between(-3.2, 4.9)
    assert -4.0 <= low <= -3.2 and 4.9 <= high <= 7.0
    low, high = quantities.between(512.0, 512.0)
    assert low <= 512.0 < high


def test_one_unknown_value_leaves_the_others_on_the_scale(recorded):
    texels, recording = recorded
    felt, source = recording.sensors["pad"], [(recording.sensors["pad"], texels)]
    whole = quantities.Extent.of(QUANTITIES["reading"], source)
    felt.reading[0, np.argsort(felt.reading[0])[1]] = np.nan
    assert quantities.Extent.of(QUANTITIES["reading"], source) == whole


def test_ends_of_a_scale_are_those_of_its_quantity(recorded):
    texels, recording = recorded
    own = {"pad": texels}
    assert FigureStyle(limit=0.2).scale(recording, own).low == 0.0
    signed = FigureStyle(quantity="channels", limit=0.2).scale(recording, own)
    assert (signed.low, signed.high, signed.colour_map) == (-0.2, 0.2, color_maps.SIGNED)
    reading = FigureStyle(quantity="reading", lowest=4.0, limit=5.0).scale(recording, own)
    assert (reading.low, reading.high) == (4.0, 5.0)
    with pytest.raises(ParameterError, match="let it go up"):
        FigureStyle(quantity="reading", lowest=6.0, limit=5.0).scale(recording, own)
    scene = vars(FigureStyle(limit=0.15))
    given = type("Arguments", (), dict.fromkeys(figure_options.STYLE_OPTIONS))()
    assert figure_options.figure_style_from(given, **scene).limit == 0.15
    given.quantity = "pressure"
    assert figure_options.figure_style_from(given, **scene).limit is None


def test_a_sensor_without_channels_is_named_by_one_sentence(recorded):
    texels, recording = recorded
    recording.sensors["pad"].channels = None
    with pytest.raises(ParameterError, match="choose another quantity"):
        strip_figure(recording, {"pad": texels}, [5], FigureStyle(quantity="channels"))


def test_numbers_in_words_have_no_exponent_where_digits_do():
    words = [quantities.three_digits(value) for value in (0.0061234, 20.84, 2000.0, 12345.0, -0.5)]
    assert words == ["0.00612", "20.8", "2000", "12300", "-0.5"]
