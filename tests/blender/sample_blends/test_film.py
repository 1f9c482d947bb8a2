# SPDX-License-Identifier: GPL-3.0-or-later
"""The film of examples/film.py, small and with few renders: each chapter is drawn, and its words can be read."""

import importlib.util
import sys

import pytest
from matplotlib.image import imread
from matplotlib.text import Text

from palpate.addon.render.video import encode_video

SHORTEST, LONGEST = 60.0, 90.0
"""Seconds that the film may last."""
SMALLEST_TEXT = 0.03
"""Height of letters, as a share of the frame."""


@pytest.fixture
def film(repository, monkeypatch):
    """The example as a module, in which every figure is checked before it is written."""
    spec = importlib.util.spec_from_file_location("palpate_film", repository / "examples" / "film.py")
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, spec.name, module)  # its dataclasses look it up
    spec.loader.exec_module(module)
    write = module.save_figure

    def checked(figure, path, dpi):
        write(figure, path, dpi)
        for text in figure.findobj(Text):
            assert text.get_fontsize() / 72.0 >= SMALLEST_TEXT * module.HIGH or not text.get_text().strip(), text
        box, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
        assert box.x0 >= -0.01 and box.x1 <= width + 0.01 and box.y0 >= -0.01 and box.y1 <= height + 0.01, (
            "something is cut off"
        )
        if path.name.startswith("frame") and figure.texts[-1].get_text():
            assert figure.texts[-1].get_window_extent().y1 <= module.BROAD[1] * figure.bbox.height, (
                "the caption covers the picture"
            )

    monkeypatch.setattr(module, "save_figure", checked)
    return module


@pytest.mark.long("bakes three samples, finds a gap, and renders by Cycles")
def test_all_chapters(film, scene, tmp_path):
    made = film.make(film.Film(tmp_path, height=90, every=48))
    assert {imread(path).shape[:2] for path in set(made.frames)} == {(90, 160)}
    renders = {name: len(list(tmp_path.glob(f"{name}-[0-9]*.png"))) for name in ("paint", "press", "slip", "mujoco")}
    assert renders == {"paint": 1, "press": 2, "slip": 2, "mujoco": 2 * bool(importlib.util.find_spec("mujoco"))}
    if renders["mujoco"]:
        assert SHORTEST <= len(made.frames) / film.FPS <= LONGEST
    path = encode_video(made.frames, tmp_path / "film.mp4", film.FPS)
    assert path.read_bytes()[4:8] == b"ftyp"
