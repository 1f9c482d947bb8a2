# SPDX-License-Identifier: GPL-3.0-or-later
"""Zips are judged by the rules of extensions.blender.org: ours is found good, and each fault is found."""

import tomllib
import zipfile
from pathlib import Path

import extension_rules
import pytest
import tomli_w
from build_zip import MACHINE_CODE, manifest_for, package_files

from palpate.core.version import VERSION

WHEELS = ["jinja2-3.1.6-py3-none-any.whl", "numba-0.68.1-cp311-cp311-manylinux2014_x86_64.manylinux_2_17_x86_64.whl"]


@pytest.fixture(scope="module")
def whole(repository):
    """Return what is in a zip: the whole source, and empty wheels."""
    return zip_content(repository, [file for file in package_files() if file.suffix != ".blend"])


@pytest.fixture(scope="module")
def good(repository):
    """Return a zip of few files, which is checked faster: among them are all that are excused."""
    names = {"__init__.py", "LICENSE", "core/errors.py", *(file for _, file in extension_rules.EXCUSED)}
    return zip_content(repository, [Path(name) for name in names])


def zip_content(repository, files):
    content = {file.as_posix(): (repository / file).read_bytes() for file in files}
    manifest = tomllib.loads((repository / "blender_manifest.toml").read_text(encoding="utf-8"))
    tables = {"permissions": manifest.pop("permissions")}
    manifest |= {"platforms": ["linux-x64"], "wheels": [f"./wheels/{name}" for name in WHEELS]}
    manifest |= {"website": "https://palpate.invalid/docs"}
    content |= {f"wheels/{name}": b"" for name in WHEELS}
    return content | {"blender_manifest.toml": tomli_w.dumps(manifest | tables).encode()}


def zipped(content, folder, name=f"palpate-{VERSION}-linux-x64-cp311.zip"):
    with zipfile.ZipFile(folder / name, "w") as archive:
        for file, data in content.items():
            archive.writestr(file, data)
    return folder / name


def changed(content, **values):
    manifest = tomllib.loads(content["blender_manifest.toml"].decode()) | values
    tables = {"permissions": manifest.pop("permissions")}
    return content | {"blender_manifest.toml": tomli_w.dumps(manifest | tables).encode()}


def test_the_extension_keeps_the_rules(whole, good, tmp_path):
    assert extension_rules.check(zipped(whole, tmp_path)) == []
    assert extension_rules.check(zipped(good, tmp_path)) == []


FAULTS = {
    "name": ({"name": "Palpate for Blender"}, "contains 'Blender'"),
    "long tagline": ({"tagline": "x" * 65}, "tagline has 65 characters"),
    "tagline": ({"tagline": "Feel it."}, "tagline ends with punctuation"),
    "permission": ({"permissions": {"files": "Read and write."}}, "permission files ends with punctuation"),
    "no permission": ({"permissions": {"network": "Look for news"}}, "'files' is missing"),
    "tag": ({"tags": ["Physics", "Robotics"]}, "no tag Robotics"),
    "licence": ({"license": ["SPDX:MIT"]}, "GPL-3.0-or-later"),
    "copyright": ({"copyright": ["Palpate contributors"]}, "a year or two, and a name"),
    "early": ({"blender_version_min": "4.1.0"}, "begin with Blender 4.2.0"),
    "template": ({"maintainer": "Developer name <mail>"}, "value of the template"),
    "website": ({"website": ""}, "website is missing"),
    "platforms": ({"platforms": ["linux-x64", "windows-x64"]}, "one platform per zip, and not 2"),
    "wheels": ({"wheels": ["./wheels/other-1-py3-none-any.whl"]}, "the wheels listed are not those in the zip"),
    "foreign wheel": ({"platforms": ["windows-x64"]}, "is not for windows-x64"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_the_manifest_is_found(good, tmp_path, fault):
    values, sentence = FAULTS[fault]
    found = extension_rules.check(zipped(changed(good, **values), tmp_path))
    assert sentence in "; ".join(one.sentence for one in found)


CODE = {
    "eval": ("eval('1')", "eval()"),
    "network": ("import urllib.request", "uses a network"),
    "absolute import": ("from palpate.core import errors", "absolute name"),
    "search": ("import sys\nsys.path.insert(0, 'x')", "where all extensions search"),
    "search by assignment": ("import sys\nsys.path += ['x']", "where all extensions search"),
    "process": ("import subprocess\nsubprocess.check_output(['x'])", "starts a process"),
    "shell": ("import os\nos.system('x')", "starts a process"),
    "pip": ("import pip", "comes as wheels"),
}


@pytest.mark.parametrize("fault", CODE)
def test_code_that_reviewers_refuse_is_found(good, tmp_path, fault):
    text, sentence = CODE[fault]
    found = extension_rules.check(zipped(good | {"core/new.py": text.encode()}, tmp_path))
    assert len(found) == 1 and sentence in found[0].sentence and found[0].where.startswith("core/new.py:")


@pytest.mark.parametrize(
    "name, sentence",
    [
        ("core/fast.so", "is no source"),
        (MACHINE_CODE, "is no source"),
        (".git/config", "redundant"),
        ("a/__pycache__/x", "redundant"),
    ],
)
def test_files_that_do_not_belong_are_found(good, tmp_path, name, sentence):
    assert [sentence in one.sentence for one in extension_rules.check(zipped(good | {name: b""}, tmp_path))] == [True]


def test_wheels_of_blenders_own_and_of_two_pythons_are_found(good, tmp_path):
    names = [*WHEELS, "numpy-2.2.4-cp313-cp313-manylinux_2_17_x86_64.whl"]
    content = changed(good, wheels=[f"./wheels/{name}" for name in names]) | {f"wheels/{names[-1]}": b""}
    found = "; ".join(one.sentence for one in extension_rules.check(zipped(content, tmp_path)))
    assert "Blender ships this package itself" in found and "several Pythons (cp311, cp313)" in found


def test_an_excuse_that_is_not_needed_is_found(good, tmp_path):
    content = good | {"addon/session/first_use.py": b""}
    assert "no longer starts a process" in extension_rules.check(zipped(content, tmp_path))[0].sentence


def test_every_excuse_is_on_the_page(repository):
    page = (repository / "docs" / "extension-platform.md").read_text(encoding="utf-8")
    for _, file in extension_rules.EXCUSED:
        assert f"`{file}`" in page


def test_a_zip_for_a_site_of_ones_own_is_not_to_be_uploaded(good, tmp_path, capsys):
    content = {name: data for name, data in changed(good, website="").items()} | {MACHINE_CODE: b"\0"}
    sources = [zipped(content, tmp_path, f"palpate-{VERSION}-linux-x64-{python}.zip") for python in ("cp311", "cp313")]
    assert extension_rules.main([str(path) for path in sources]) == 0
    assert extension_rules.main(["--upload", *map(str, sources)]) == 1
    said = capsys.readouterr().out
    assert "give each a version of its own" in said and "machine_code.bin" in said and "website is missing" in said


@pytest.mark.parametrize("python", ["cp311", "cp313"])
def test_the_manifest_of_a_zip_to_upload(python):
    upload = {"website": "https://palpate.invalid", "python": python}
    manifest = tomllib.loads(manifest_for("linux-x64", [], ("4.2.0", None), upload).decode())
    assert (manifest["version"], manifest["website"]) == (f"{VERSION}+{python}", "https://palpate.invalid")
