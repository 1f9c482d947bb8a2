# SPDX-License-Identifier: GPL-3.0-or-later
"""Options and names that mean nothing end a command in one sentence, before anything is written. Commands without Blender."""

import os

import pytest
from sample_bake import write_bake

from palpate.commands import main

FOAM = "compression,pressure\n0.001,1\n0.002,2\n0.003,3.1\n"
SLIDE = "velocity,force\n" + "".join(f"{0.1 * i:.1f},{1 + 0.1 * i:.1f}\n" for i in range(1, 8))
NUMBERS = ["0", "-1", "nan", "inf", "-inf", "1e308", "1e-320", "1e400", "x", ""]
COUNTS = ["0", "-1", "nan", "99999999999999999999", "1.5", "x", ""]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "foam.csv").write_text(FOAM)
    (tmp_path / "slide.csv").write_text(SLIDE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refusal(capsys, *words) -> str:
    """Run a command that has to refuse; return its sentence, or its last line where the usage is wrong."""
    before = sorted(os.walk("."))
    status = main(list(words))
    error = capsys.readouterr().err.strip().splitlines()
    assert status in (1, 2), words
    assert len(error) == 1 or status == 2, error
    assert sorted(os.walk(".")) == before
    return error[-1]


@pytest.mark.parametrize("value", NUMBERS)
def test_areas_and_forces_that_mean_nothing(folder, capsys, value):
    assert "area" in refusal(capsys, "fit", "stiffness", "foam.csv", f"--area={value}", "--texels=3")
    assert "force" in refusal(capsys, "fit", "friction", "slide.csv", f"--normal-force={value}").replace("-", " ")


@pytest.mark.parametrize("value", COUNTS)
def test_numbers_of_texels_that_mean_nothing(folder, capsys, value):
    assert "texels" in refusal(capsys, "fit", "stiffness", "foam.csv", "--area=1", f"--texels={value}")
    assert "texels" in refusal(capsys, "fit", "friction", "slide.csv", "--normal-force=1", f"--texels={value}")


@pytest.mark.parametrize("value", NUMBERS)
def test_colour_scales_and_resolutions_that_mean_nothing(folder, capsys, value):
    write_bake(folder / "bake")
    if value != "1e308":  # a scale may be long: everything is dark then
        assert refusal(capsys, "export", "bake", "--format=png", "--out=out", f"--limit={value}")
    assert refusal(capsys, "export", "bake", "--format=png", "--out=out", f"--dpi={value}")


NAMES = ["", "a\0b", "x" * 300, "x" * 5000, "foam.csv/deeper"]


@pytest.mark.parametrize("name", NAMES, ids=lambda name: repr(name)[:20])
def test_names_that_nothing_can_have(folder, capsys, name):
    write_bake(folder / "bake")
    assert refusal(capsys, "export", name, "--out", "out")
    assert refusal(capsys, "export", "bake", "--out", name)
    assert refusal(capsys, "export", "bake", "--sensor", name, "--out", "out")
    assert refusal(capsys, "gap", name, "--out", "out")
    assert refusal(capsys, "openrave", "show", name)
    assert refusal(capsys, "fit", "stiffness", name, "--area=1", "--texels=2")
    if name:
        assert refusal(capsys, "fit", "stiffness", "foam.csv", "--area=1", "--texels=2", "--plot", f"{name}.png")


def test_a_plot_is_checked_before_the_fit(folder, capsys):
    words = ("fit", "stiffness", "foam.csv", "--area=1", "--texels=2", "--plot")
    assert "is read and would be overwritten" in refusal(capsys, *words, "foam.csv")
    assert "end its name with .png" in refusal(capsys, *words, "plot.gif")
    (folder / "plot.png").mkdir()
    assert "is a folder" in refusal(capsys, *words, "plot.png")


def test_folders_that_are_missing_are_made(folder, capsys):
    write_bake(folder / "bake")
    assert main(["export", "bake", "--out", "a/b/c", "--format", "npz"]) == 0
    assert main(["fit", "stiffness", "foam.csv", "--area=1", "--texels=2", "--plot", "d/e/f.png"]) == 0
    assert (folder / "a" / "b" / "c" / "pad.npz").is_file() and (folder / "d" / "e" / "f.png").is_file()


def test_a_linked_bake_folder_is_read_and_stays_a_link(folder):
    write_bake(folder / "elsewhere" / "bake")
    os.symlink("elsewhere/bake", "bake")
    os.symlink("elsewhere", "way")
    (folder / "target").mkdir()
    os.symlink("target", "out")
    for source in ("bake", "way/bake", "bake/pad"):
        assert main(["export", source, "--out", "out"]) == 0
    assert os.path.islink("bake") and os.path.islink("out")
    assert (folder / "target" / "pad" / "sums.csv").is_file()


def test_an_export_into_the_bake_is_refused_through_a_link(folder, capsys):
    write_bake(folder / "bake")
    os.symlink("bake/pad", "link")
    assert "holds the bake itself" in refusal(capsys, "export", "bake", "--out", "link")
