# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures say what the recording says, at a size at which it can be read, and nothing else in the process notices them."""

import subprocess
import sys

import numpy as np
import pytest
from sample_bake import COLUMNS, ROWS, grid_texels, recording_of, round_texels

from palpate.core import response
from palpate.core.errors import FileError, ParameterError, SensorError
from palpate.core.figures import figure_canvas, figure_style, tactile_image
from palpate.core.figures.figure_canvas import save_figure
from palpate.core.figures.figure_style import FigureStyle
from palpate.core.figures.picture_labels import label_picture
from palpate.core.figures.side_by_side import side_by_side
from palpate.core.figures.tactile_strip import strip_figure
from palpate.core.figures.texel_numbers import texel_numbers
from palpate.core.figures.time_curves import curves_figure, force_curves
from palpate.core.geometry.mesh import TriangleMesh
from palpate.core.geometry.texels import texels_from_region
from palpate.core.model.sensor_parameters import SensorParameters


def test_net_shear_of_a_flat_pad_is_the_plain_sum():
    texels = grid_texels()
    sensor = recording_of(texels).sensors["pad"]
    expected = np.zeros((10, 3))
    expected[:, 1] = sensor.shear[:, :, 1].sum(axis=1)  # rows run along +y
    np.testing.assert_allclose(response.net_shear(sensor, texels), expected, atol=1e-15)


def test_mobilised_friction_is_shear_over_limit_and_zero_without_contact():
    texels = grid_texels()
    sensor = recording_of(texels).sensors["pad"]
    ratio = response.mobilised_friction(sensor, texels, mus=0.4)
    touching = sensor.normal_force.any(axis=1)
    np.testing.assert_allclose(ratio[touching], 0.5)
    assert (ratio[~touching] == 0).all()


def test_frames_are_spread_over_what_happens():
    recording = recording_of(grid_texels())
    chosen = response.choose_frames(recording, 4)
    assert len(chosen) == 4
    assert (np.diff(chosen) > 0).all()
    assert chosen.max() <= 8  # the last three frames are alike
    assert set(response.choose_frames(recording, 100)) <= set(recording.frames)


def test_frames_of_a_still_recording_are_spread_over_all_of_it():
    recording = recording_of(grid_texels())
    recording.sensors["pad"].normal_force[:] = 0.3
    recording.sensors["pad"].shear[:] = 0
    assert list(response.choose_frames(recording, 2)) == [3, 8]


@pytest.mark.parametrize("texels", [grid_texels(), round_texels()], ids=["grid", "uv"])
@pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
def test_strip_is_written_and_the_same_every_time(tmp_path, texels, suffix):
    recording = recording_of(texels)
    first, second = tmp_path / f"a.{suffix}", tmp_path / f"b.{suffix}"
    for path in (first, second):
        save_figure(strip_figure(recording, {"pad": texels}), path, 300)
    assert first.stat().st_size > 2000
    assert first.read_bytes() == second.read_bytes()


@pytest.mark.long("draws every kind of figure at every width")
def test_no_text_is_smaller_than_eight_points_or_leaves_the_figure(tmp_path, monkeypatch):
    from matplotlib.image import imsave

    seen = []

    def look(figure, *_):
        from matplotlib.text import Text

        figure.canvas.draw()
        renderer = figure.canvas.get_renderer()
        width, height = figure.canvas.get_width_height()
        ticks, drawn = set(), set()  # matplotlib also keeps labels that it does not draw
        for axes in figure.axes:
            for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
                ticks |= {label for tick in axis.majorTicks for label in (tick.label1, tick.label2)}
                places = zip(axis.get_majorticklocs(), axis.get_majorticklabels(), strict=False)
                drawn |= {label for place, label in places if axes.axison and low <= place <= high}
        for text in set(figure.findobj(Text)) - (ticks - drawn):
            if text.get_text().strip() and text.get_visible():
                box = text.get_window_extent(renderer)
                inside = box.x0 >= 0 and box.x1 <= width and box.y0 >= 0 and box.y1 <= height
                seen.append((text.get_text(), text.get_fontsize(), inside))

    monkeypatch.setattr(figure_canvas, "_write", look)
    texels = grid_texels()
    recording = recording_of(texels)
    long_name = "Index finger of the left hand"
    recording.sensors[long_name] = recording.sensors["pad"]
    both = {"pad": texels, long_name: texels}
    parameters = dict.fromkeys(both, SensorParameters())
    for width in figure_style.WIDTHS:
        for quantity in ("force", "pressure", "reading", "slip"):
            look = FigureStyle(width=width, quantity=quantity)
            save_figure(strip_figure(recording, both, style=look), tmp_path / "a.png", 300)
            save_figure(curves_figure(recording, both, parameters, style=look), tmp_path / "c.png", 300)
            texel_numbers(tmp_path / "d.png", recording, both, "pad", 5, look)
    force_curves(tmp_path / "b.png", recording, both, parameters, {"pad": 9.81})
    source = tmp_path / "scene.png"
    imsave(source, np.full((480, 640, 3), 0.4))
    for shown in ({"pad": texels}, both, dict.fromkeys((*both, "c", "d"), texels)):
        recording.sensors.update(dict.fromkeys(shown, recording.sensors["pad"]))
        side_by_side(source, tmp_path / "e.png", recording, shown, 5)
    assert len(seen) > 20
    assert [entry for entry in seen if entry[1] < 8 or not entry[2]] == []


def drawn(tmp_path, monkeypatch, draw):
    """Return the figure that `draw(path)` would have written."""
    kept = []
    monkeypatch.setattr(figure_canvas, "_write", lambda figure, *_: kept.append(figure))
    draw(tmp_path / "a.png")
    return kept[0]


def test_numbers_are_those_of_the_texels_in_their_places(tmp_path, monkeypatch):
    texels = grid_texels()
    recording = recording_of(texels)
    figure = drawn(tmp_path, monkeypatch, lambda path: texel_numbers(path, recording, {"pad": texels}, "pad", 5))
    words = {tuple(np.round(np.divide(text.get_position(), 4.0) - 0.5).astype(int)): text for text in figure.axes[0].texts}
    force = recording.sensors["pad"].normal_force[4].reshape(ROWS, COLUMNS)
    assert len(words) == ROWS * COLUMNS
    for (column, row), text in words.items():
        assert float(text.get_text()) == pytest.approx(1e3 * force[row, column], abs=0.05)  # millinewtons


def test_on_a_surface_each_texel_colours_its_share_of_the_area(tmp_path, monkeypatch):
    """A texel has its value on a third of the triangles around it; together the texels cover the surface."""
    texels = round_texels()
    recording = recording_of(texels)
    figure = drawn(tmp_path, monkeypatch, lambda path: save_figure(strip_figure(recording, {"pad": texels}, [5]), path, 300))
    surface, rim = figure.axes[0].collections[:2]
    parts = np.array([path.vertices[:4] for path in surface.get_paths()])
    ahead = np.roll(parts, -1, axis=1)
    area = 0.5 * np.abs((parts[..., 0] * ahead[..., 1] - parts[..., 1] * ahead[..., 0]).sum(axis=1))
    flat = 12 * 0.5 * 10.0**2 * np.sin(np.pi / 6)  # of the rim's polygon in mm²; the cap is flattened along its axis
    assert area.sum() == pytest.approx(flat, rel=0.05)
    force = recording.sensors["pad"].normal_force[4]
    middle = surface.get_array() == force[0]
    assert area[middle].sum() == pytest.approx(area.sum() / 3)
    assert sorted(np.unique(surface.get_array())) == pytest.approx(sorted(force))
    assert len(rim.get_segments()) == 12


@pytest.mark.parametrize("texels", [grid_texels(), round_texels()], ids=["grid", "surface"])
@pytest.mark.parametrize("inches", [0.01, 0.05, 0.5])
def test_no_arrow_is_longer_than_arrows_are_apart(texels, inches):
    view = tactile_image.SensorView.of(texels).at_size(inches)
    places, _ = view._thinned(np.zeros((len(texels), 2)))
    gaps = np.linalg.norm(places[:, None] - places[None], axis=2)[~np.eye(len(places), dtype=bool)]
    assert view.arrow < np.median(gaps.reshape(len(places), -1).min(axis=1)) * 1.3


def test_rounding_is_no_shear():
    recording = recording_of(grid_texels())
    assert response.peak_shear(recording) > 0.0
    recording.sensors["pad"].shear[:] *= 1e-14
    assert response.peak_shear(recording) == 0.0


def test_a_closed_sensor_is_shown_from_the_side_that_bears(tmp_path, monkeypatch):
    """No flat image of it exists; its shear arrows point where the force points."""
    import trimesh

    ball = trimesh.creation.icosphere(2, 0.01)
    texels = texels_from_region(TriangleMesh(ball.vertices, ball.faces), np.ones(len(ball.vertices), bool), "ball")
    recording = recording_of(texels)
    felt = recording.sensors["pad"]
    loaded = texels.normal @ [1.0, 0.0, 0.0] > 0.8
    felt.normal_force[:] = 0.1 * loaded
    force = np.tile([0.0, 0.0, 0.03], (len(texels), 1)) * loaded[:, None]
    felt.shear[:, :, 0] = np.einsum("ij,ij->i", force, texels.tangent)
    felt.shear[:, :, 1] = np.einsum("ij,ij->i", force, texels.bitangent)
    figure = drawn(tmp_path, monkeypatch, lambda path: save_figure(strip_figure(recording, {"pad": texels}, [3]), path, 300))
    axes = figure.axes[0]
    _, _, arrows = axes.collections
    view = tactile_image.SensorView.of(texels, felt.normal_force.sum(axis=0))
    seen = np.unique(view.triangles)
    assert (texels.normal[seen] @ [1.0, 0.0, 0.0] > -0.35).all() and loaded[seen].sum() == loaded.sum()
    expected = np.array([0.0, 0.0, 1.0]) @ view.axes.T
    mean = np.array([arrows.U.mean(), arrows.V.mean()])
    np.testing.assert_allclose(mean / np.linalg.norm(mean), expected, atol=0.05)


def test_slip_is_the_share_of_the_load_on_texels_at_their_limit():
    texels = grid_texels()
    felt = recording_of(texels).sensors["pad"]
    parameters = SensorParameters(mus=0.2, mud=0.2)  # shear is 0.2 of the normal force
    assert (response.slip_share(felt, parameters) == 0.0).all()  # nothing moves
    felt.slip[:, :5] = 0.01
    share = response.slip_share(felt, parameters)
    expected = felt.normal_force[:, :5].sum(axis=1)[3] / felt.normal_force.sum(axis=1)[3]
    assert share[3] == pytest.approx(expected) and share[-1] == 0.0
    assert (response.slip_share(felt, SensorParameters(mus=0.5, mud=0.5)) == 0.0).all()


def test_the_free_moment_does_not_depend_on_the_origin():
    """A pure couple stays; a force alone has none about the centre of pressure."""
    felt = recording_of(grid_texels()).sensors["pad"]
    place, force, couple = np.array([0.1, -0.2, 0.03]), np.array([1.0, 2.0, -5.0]), np.array([0.0, 0.0, 0.4])
    felt.centre_of_pressure, felt.net_force = np.tile(place, (10, 1)), np.tile(force, (10, 1))
    felt.net_torque = np.tile(np.cross(place, force) + couple, (10, 1))
    np.testing.assert_allclose(response.free_moment(felt), np.tile(couple, (10, 1)), atol=1e-15)


@pytest.mark.parametrize("wrong", [{"colour_map": "JET"}, {"quantity": "torque"}, {"width": "huge"}])
def test_an_unknown_look_is_refused_with_what_there_is(wrong):
    with pytest.raises(ParameterError, match="choose from"):
        FigureStyle(**wrong)


def test_a_figure_of_an_unknown_kind_is_refused(tmp_path):
    texels = grid_texels()
    with pytest.raises(ParameterError, match=".png, .pdf or .svg"):
        save_figure(strip_figure(recording_of(texels), {"pad": texels}), tmp_path / "a.docx", 300)


def test_numbers_of_too_many_texels_are_refused(tmp_path):
    import trimesh

    ball = trimesh.creation.icosphere(4, 0.01)
    texels = texels_from_region(TriangleMesh(ball.vertices, ball.faces), np.ones(len(ball.vertices), bool), "ball")
    with pytest.raises(SensorError, match="export them as CSV"):
        texel_numbers(tmp_path / "a.png", recording_of(texels), {"pad": texels}, "pad", 1)


def test_labels_keep_the_size_of_the_picture(tmp_path):
    from matplotlib.image import imread, imsave

    source = tmp_path / "render.png"
    imsave(source, np.full((360, 640, 3), 0.4))
    texels = grid_texels()
    label_picture(
        source,
        tmp_path / "out.png",
        recording_of(texels),
        {"pad": texels},
        6,
        labels=[("Pad\n1 N", (0.1, 0.8))],
    )
    out = imread(tmp_path / "out.png")
    assert out.shape[:2] == (360, 640)
    assert (out[:, :, :3] > 0.9).any()  # there are white words on the grey
    with pytest.raises(KeyError):
        label_picture(source, tmp_path / "out.png", recording_of(texels), {"pad": texels}, 99)


def test_a_missing_folder_is_one_sentence(tmp_path):
    texels = grid_texels()
    with pytest.raises(FileError, match="nowhere"):
        save_figure(strip_figure(recording_of(texels), {"pad": texels}), tmp_path / "nowhere" / "a.png", 300)


@pytest.mark.parametrize(
    ("code", "unloaded"),
    [
        ("import palpate.core.figures", {"matplotlib", "numba"}),
        (
            "from palpate.core.figures import figure_canvas as f; f.save_figure(f.new_figure(1, 1), sys.argv[1], 50)",
            {"matplotlib.pyplot"},
        ),
    ],
)
def test_figures_load_no_more_than_they_need(tmp_path, code, unloaded):
    command = f"import sys; {code}; sys.exit(bool({unloaded!r} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", command, str(tmp_path / "a.png")]).returncode == 0
