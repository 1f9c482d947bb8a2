# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands and code blocks in README.md, docs/ and the other pages are true; `make docs` checks their links.

Short code is run. Commands that take long are parsed by the command line's own parser and not run.
"""

from __future__ import annotations

import re
import shlex
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest
from small_study import write_study

from palpate.commands import COMMANDS, _parser, main
from palpate.core.export.exporter import export
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.io.bake_reader import read_bake
from palpate.core.jobs import run_job

ROOT = Path(__file__).resolve().parents[3]
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "benchmarks/RESULTS.md", "tests/ui/README.md")),
    *sorted((ROOT / "docs").glob("*.md")),
]
TEXTS = [page.read_text(encoding="utf-8") for page in PAGES]


def blocks(text: str, language: str) -> list[str]:
    """Fenced blocks in a language."""
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def inline_code(text: str) -> list[str]:
    """Code between single backticks, without the fenced blocks."""
    return re.findall(r"(?<!`)`([^`\n]+)`(?!`)", re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE))


def command_lines(text: str) -> list[str]:
    """Command lines of `palpate` in shell blocks and indented blocks, without loops and redirections around them."""
    lines = [line for block in blocks(text, "sh") for line in block.splitlines()]
    lines += re.findall(r"^    (.*)$", text, re.MULTILINE)
    found = []
    for line in lines:
        for part in re.split(r"&&|\|\||;", line.partition(" #")[0]):
            words = re.search(r"(?:^|\s|/)palpate (\w+ .*)", part)
            if words and words.group(1).split()[0] in COMMANDS:
                found.append(words.group(1))
    return found


def test_commands_are_ones_that_the_command_line_takes(capsys):
    for line in (line for text in TEXTS for line in command_lines(text)):
        words = shlex.split(line.replace('$(basename "$f" .blend)', "name").replace("[", "").replace("]", ""))
        try:
            _parser(words).parse_args(words)
        except SystemExit:
            pytest.fail(f"palpate {line}: {capsys.readouterr().err}")


def test_options_that_are_told_of_are_in_the_help(capsys):
    """`palpate bake SCENE.blend [--out DIR]` in a sentence or a table names options of that command."""
    for code in (code for text in TEXTS for code in inline_code(text.replace("\\|", "|"))):
        words = re.match(r"palpate (\w+)", code)
        if words and words.group(1) in COMMANDS:
            told = re.match(r"palpate (\w+(?: (?:stiffness|friction|show|import|export|new)\b)?)", code).group(1).split()
            assert main([*told, "--help"]) == 0
            text = capsys.readouterr().out
            for option in re.findall(r"--[a-z][a-z-]*", code):
                assert option in text, code


@pytest.fixture(scope="module")
def bake_folder(tmp_path_factory):
    """Folder in which `palpate-bake` holds the bake of the demo scene's frames 71 and 72, and `rig.toml` the sample rig."""
    folder = tmp_path_factory.mktemp("pages")
    shutil.copytree(ROOT / "docs" / "sample-rig", folder, dirs_exist_ok=True)
    scene = shutil.copy(ROOT / "sample_blends" / "demo.blend", folder)
    assert main(["bake", str(scene), "--frames", "71", "72", "--out", str(folder / "palpate-bake")]) == 0
    for target in ("probes", "mjcf"):
        scene = str(ROOT / "sample_blends" / "weighing.blend")
        assert main(["sensor", "export", scene, "--to", target, "--sensor", "Finger", "--out", str(folder / "sensors")]) == 0
    pytest.importorskip("mcap")
    run_job(export(read_bake(folder / "palpate-bake"), "mcap", folder))
    return folder


LONG = pytest.mark.long("a whole diagnosis of the sample rig, or a whole study")
STUDIED = "presses/runs.parquet"


@pytest.fixture(scope="module")
def finished_study(bake_folder):
    """A study of three presses with recordings, in the folder `presses` beside the bake."""
    file = write_study(bake_folder / "study", 3)
    file.write_text(file.read_text(encoding="utf-8").replace("[vary]", "recordings = true\n[vary]"), encoding="utf-8")
    assert main(["sweep", str(file), "--out", str(bake_folder / "presses"), "--workers", "1"]) == 0


def page_blocks(language: str) -> list:
    found = []
    for page, text in zip(PAGES, TEXTS, strict=True):
        for number, block in enumerate(blocks(text, language)):
            # test_tutorial.py runs the block that needs Blender; tests/core/sweep reads a dataset by the libraries of its page
            if language != "python" or ("bpy" not in block and page.stem != "dataset"):
                marks = LONG if re.search(rf"\b(diagnose|find_gap|plan_experiment)\(|{STUDIED}", block) else ()
                found.append(pytest.param(block, id=f"{page.stem}-{number}", marks=marks))
    return found


@pytest.mark.slow("the first of them makes the bake that all pages share")
@pytest.mark.parametrize("block", page_blocks("python"))
def test_python_blocks_run(block, bake_folder, request, monkeypatch, capsys):
    import dataclasses

    from solver_scenes import cube_on_pad

    for package in re.findall(r"^import (genesis|mujoco|torch)\b", block, re.MULTILINE):
        pytest.importorskip(package, reason=f"{package} is not among what the tests install: this block of the page is not run")
    if STUDIED in block:
        request.getfixturevalue("finished_study")
    monkeypatch.chdir(bake_folder)
    cube = cube_on_pad()
    at_rest = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    names = {"dataclasses": dataclasses, "sensor": cube.sensors[0], "mesh": cube.targets[0].mesh, "dt": 1e-3}
    names |= {"sensor_pose": at_rest, "target_pose": (np.array([0.0, 0.0, 0.02]), at_rest[1])}
    given = set(names)
    exec(compile(block, "page", "exec"), names)
    assert set(names) - given - {"__builtins__"}


STIMULUS = ("time", "x", "y", "z")
"""Columns before those of the texels."""


@pytest.mark.parametrize("block", page_blocks("toml"))
def test_toml_blocks_are_read(block, bake_folder):
    table = tomllib.loads(block)
    if table.get("format") == "palpate-rig/1":
        lines = (bake_folder / "press_0.csv").read_text(encoding="utf-8").splitlines()
        grid = table["sensor"].get("grid")
        count = len(STIMULUS) + (grid["rows"] * grid["columns"] if grid else 84)
        header, *rows = (",".join(line.split(",")[:count]) + "\n" for line in lines)
        for own, other in table.get("columns", {}).items():  # the logger of this page has names of its own
            header = re.sub(rf"\b{own}\b", other if isinstance(other, str) else other["name"], header)
        for trial in table["trial"]:
            (bake_folder / trial["file"]).write_text("".join([header, *rows]), encoding="utf-8")
        (bake_folder / "page.toml").write_text(block, encoding="utf-8")
        assert read_rig(bake_folder / "page.toml").trials
    else:
        assert table
