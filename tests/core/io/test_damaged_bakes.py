# SPDX-License-Identifier: GPL-3.0-or-later
"""A damaged bake is refused in one sentence, however it was damaged; a sample of the ways that attacks try."""

import os
import random
import shutil

import pytest

from palpate.attack import damaged_bakes
from palpate.attack.sample_bake import write_bake
from palpate.commands import main
from palpate.core.export.registry import export, exporters
from palpate.core.io.bake_reader import read_bake
from palpate.core.jobs.job_runner import run_job

WAYS = damaged_bakes.ways()
COUNT = int(os.environ.get("PALPATE_EXAMPLES", "45"))
SAMPLE = random.Random(13).sample(WAYS, min(COUNT, len(WAYS)))


@pytest.fixture(scope="module", params=[False, True], ids=["older", "with checksums"])
def good(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("good") / "bake"
    write_bake(folder, request.param)
    return folder


def damaged(good, tmp_path, way):
    if not way.applies(good):
        pytest.skip("older bakes have no such file")
    shutil.copytree(good, tmp_path / "bake")
    way.damage(tmp_path / "bake")
    return tmp_path / "bake"


def test_there_are_many_ways():
    assert len(WAYS) >= 600


def test_the_undamaged_bake_is_read(good):
    assert sorted(read_bake(good).texels) == ["cap", "pad"]


@pytest.mark.parametrize("way", SAMPLE, ids=lambda way: way.name[:80].replace("\0", "0"))
def test_a_damaged_bake_is_one_sentence(good, tmp_path, way):
    bake = damaged(good, tmp_path, way)
    verdict, words = damaged_bakes.judge(way, lambda: read_bake(bake))
    assert verdict in (damaged_bakes.CLEAR, damaged_bakes.HARMLESS), words


@pytest.mark.parametrize("kind", ["csv", "npz", "hdf5", "png"])
def test_what_is_harmless_can_be_exported(tmp_path, kind):
    if kind == "hdf5":
        pytest.importorskip("h5py")
    write_bake(tmp_path / "good")
    ways = [way for way in WAYS if way.harmless and not way.needs and not way.name.startswith(("pad/recording", "image"))]
    for i, way in enumerate(random.Random(7).sample(ways, 4)):
        bake = damaged(tmp_path / "good", tmp_path / str(i), way)
        verdict, words = damaged_bakes.judge(
            way, lambda bake=bake, i=i: run_job(export(read_bake(bake), kind, tmp_path / f"out{i}"))
        )
        assert verdict in (damaged_bakes.CLEAR, damaged_bakes.HARMLESS), words


@pytest.mark.parametrize("kind", list(exporters()))
def test_an_export_of_a_damaged_bake_writes_nothing(tmp_path, kind, capsys):
    write_bake(tmp_path / "good", checksums=True)
    ways = [way for way in WAYS if not way.harmless]
    for i, way in enumerate(random.Random(kind).sample(ways, 3)):
        bake = damaged(tmp_path / "good", tmp_path / str(i), way)
        assert main(["export", str(bake), "--format", kind, "--out", str(tmp_path / "out")]) == 1, way.name
        (line,) = capsys.readouterr().err.strip().splitlines()
        assert line.startswith("palpate export: "), line
        assert not (tmp_path / "out").exists()
