# SPDX-License-Identifier: GPL-3.0-or-later
"""The zip as a user gets it: built, installed into a Blender with nothing else in it, enabled, used and removed again."""

from __future__ import annotations

import importlib.metadata
import json
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import build_zip
import pytest

from palpate.core.version import VERSION

SHIPPED = ("numpy-", "requests-", "certifi-", "charset_normalizer-", "idna-", "urllib3-", "zstandard-")
"""Beginnings of wheels of packages that Blender brings, which would shadow its own."""
HEAVY = {"numba", "llvmlite", "scipy", "matplotlib", "trimesh", "OpenEXR", "tqdm", "tomli_w", "jinja2"}


@pytest.fixture(scope="module")
def zip_path(tmp_path_factory):
    return build_zip.build("linux-x64", "3.11", tmp_path_factory.mktemp("zip"))


@pytest.fixture(scope="module")
def life(zip_path, tmp_path_factory):
    """Run the whole life of the extension in a process of its own and return what it noted at each stage."""
    folder = tmp_path_factory.mktemp("life")
    blender, user, home = (folder / name for name in ("only-blender", "user", "home"))
    for made in (blender, user, home):
        made.mkdir()
    for name, path in what_blender_brings().items():
        (blender / name).symlink_to(path)
    own = {key: value for key, value in os.environ.items() if not key.startswith(("XDG_", "MPL", "NUMBA"))}
    report = folder / "report.json"
    script = Path(__file__).with_name("zip_life.py")
    # -I -S: this environment's own packages, among them our dependencies, are out of sight
    command = [sys.executable, "-I", "-S", str(script), str(blender), str(zip_path), str(report)]
    own |= {"BLENDER_USER_RESOURCES": str(user), "HOME": str(home)}
    run = subprocess.run(command, env=own, capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stdout + run.stderr
    assert "Traceback" not in run.stdout + run.stderr, run.stdout + run.stderr
    return json.loads(report.read_text(encoding="utf-8")) | {"user": user, "home": home}


def what_blender_brings() -> dict[str, Path]:
    """Files and folders in site-packages of bpy and what it requires: what an official Blender has, and no more."""
    found: dict[str, Path] = {}
    open_ends, seen = ["bpy"], set()
    while open_ends:
        name = open_ends.pop()
        if name in seen:
            continue
        seen.add(name)
        distribution = importlib.metadata.distribution(name)
        for file in distribution.files or []:
            top = file.parts[0]
            if top not in ("..", "__pycache__"):
                found[top] = Path(distribution.locate_file(top))
        for requirement in distribution.requires or []:
            if "extra ==" not in requirement:
                open_ends.append(re.split(r"[^A-Za-z0-9_.-]", requirement, maxsplit=1)[0])
    assert not HEAVY & set(found)
    return found


@pytest.mark.long("builds the zip with its machine code")
def test_zip_holds_what_the_extension_needs_and_no_more(zip_path, repository):
    with zipfile.ZipFile(zip_path) as archive:
        names = set(archive.namelist())
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
    assert {"__init__.py", "LICENSE", "core/__init__.py", "addon/__init__.py"} <= names
    rooms = {name.split("/")[0] for name in names if "/" in name}
    assert rooms <= {"core", "api", "addon", "operators", "panels", "commands", "paper", "sample_blends", "wheels"}
    assert {f"./{name}" for name in names if name.startswith("wheels/")} == set(manifest["wheels"])
    assert manifest["platforms"] == ["linux-x64"]
    assert (manifest["blender_version_min"], manifest["blender_version_max"]) == ("4.2.0", "5.1.0")
    assert not any("cp313" in name for name in names)
    assert not any(name.startswith(tuple(f"wheels/{package}" for package in SHIPPED)) for name in names)
    # the repository's own manifest is for development: it names no wheels
    assert "wheels" not in tomllib.loads((repository / "blender_manifest.toml").read_text(encoding="utf-8"))


@pytest.mark.long("builds the zip with its machine code, twice")
def test_same_sources_give_the_same_zip(zip_path, tmp_path):
    assert build_zip.build("linux-x64", "3.11", tmp_path).read_bytes() == zip_path.read_bytes()


@pytest.mark.parametrize(
    ("name", "says"),
    [(build_zip.MACHINE_CODE, ", with machine code"), ("other", "without machine code: the solver is compiled at first use")],
)
def test_a_line_says_of_a_zip_whether_it_has_machine_code(tmp_path, name, says):
    build_zip.write_zip(tmp_path / "palpate.zip", {name: b"code"})
    assert says in build_zip.description(tmp_path / "palpate.zip")


@pytest.mark.parametrize("python", ["cp311", "cp313"])
def test_the_manifest_of_a_zip_to_upload(python):
    upload = {"website": "https://palpate.invalid", "python": python}
    manifest = tomllib.loads(build_zip.manifest_for("linux-x64", [], ("4.2.0", None), upload).decode())
    assert (manifest["version"], manifest["website"]) == (f"{VERSION}+{python}", "https://palpate.invalid")


def test_blender_refuses_a_broken_zip(tmp_path):
    broken = tmp_path / "broken.zip"
    with zipfile.ZipFile(broken, "w") as archive:
        archive.writestr("blender_manifest.toml", 'schema_version = "1.0.0"\nid = "palpate"\n')
        archive.writestr("__init__.py", "")
    with pytest.raises(build_zip.BuildError, match="refuses"):
        build_zip.validate(broken)


@pytest.mark.long("reads all wheels of a zip")
@pytest.mark.parametrize("missing", ["llvmlite", "tzdata"])
def test_a_missing_wheel_is_noticed(missing):
    wheels = [wheel for wheel in build_zip.wheels_for("linux-x64", "3.11") if not wheel.name.startswith(missing)]
    with pytest.raises(build_zip.BuildError, match=missing):
        build_zip.check_complete(wheels, "linux-x64", "3.11")


@pytest.mark.long("builds the zip and installs it")
def test_the_life_of_an_installed_extension(life):
    """It is enabled and disabled as often as one likes, runs from its wheels alone, and leaves nothing behind."""
    assert life["enabled"] == life["enabled again"] == [True, True]
    assert life["disabled"] == life["uninstalled"] == [False, False]
    assert set(life["wheels"]) >= {"numba", "trimesh", "tqdm", "matplotlib", "tomli_w", "jinja2", "markupsafe"}
    for name, origin in life["wheels"].items():
        assert origin.startswith(str(life["user"] / "extensions" / ".local")), name
    assert life["compiled"] == 45
    assert life["written beside the source"] == []
    assert any(name.startswith("fontlist") for name in life["fonts"]) and life["MPLCONFIGDIR"] is None
    assert [path for path in life["home"].rglob("*") if path.is_file()] == []  # Blender made its folders there before
    assert [path for path in (life["user"] / "extensions").rglob("*") if "palpate" in path.name or path.name == "numba"] == []


@pytest.mark.long("builds the zip and installs it")
def test_the_whole_road_runs_from_the_zip_alone(life):
    """1 kg on the pad weighs 9.81 N, played and baked."""
    road = life["road"]
    assert road["played"] == pytest.approx(9.81, abs=1e-4)
    assert road["baked"] == pytest.approx(9.81, abs=1e-6)
    assert len([name for name in road["files"] if name.endswith(".exr")]) == 20
    assert road["compiled"] > 0, "numba keeps machine code in the extension's user folder"
    assert road["loaded"] > 5 and road["compiled here"] == [], "the zip's machine code is used; nothing had to be compiled"
