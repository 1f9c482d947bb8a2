# SPDX-License-Identifier: GPL-3.0-or-later
"""The package that pip installs and the extension that Blender installs are the same thing."""

from __future__ import annotations

import re
import tomllib

import pytest

# Folders of the repository that are not part of the package.
OUTSIDE = {"tests", "tools", "benchmarks", "docs", "build", "dist"}


@pytest.fixture(scope="module")
def project(repository):
    return tomllib.loads((repository / "pyproject.toml").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def manifest(repository):
    return tomllib.loads((repository / "blender_manifest.toml").read_text(encoding="utf-8"))


def test_version_is_one(project, manifest):
    import palpate

    assert project["project"]["version"] == manifest["version"] == palpate.__version__


def test_types_are_shipped(repository, project):
    assert "py.typed" in project["tool"]["setuptools"]["package-data"]["palpate"] and (repository / "py.typed").is_file()


def test_every_package_folder_is_listed(repository, project):
    """An unlisted folder would be missing from an installed package, and nowhere else."""
    folders = {
        init.parent.relative_to(repository)
        for init in repository.rglob("__init__.py")
        if not any(part.startswith(".") for part in init.relative_to(repository).parts)
    }
    found = {".".join(("palpate", *folder.parts)) for folder in folders if not OUTSIDE & set(folder.parts)}
    assert found == set(project["tool"]["setuptools"]["packages"])


def test_wheels_cover_the_dependencies(repository, project):
    """The zip carries every dependency of the package except numpy, which Blender ships."""
    lines = (repository / "tools" / "wheels.txt").read_text(encoding="utf-8").splitlines()
    pinned = {line.partition("==")[0].strip().lower() for line in lines if line.strip() and not line.startswith("#")}
    needed = {re.split(r"[<>=!~ ]", spec, maxsplit=1)[0].lower() for spec in project["project"]["dependencies"]}
    assert needed - {"numpy"} <= pinned
    assert "numpy" not in pinned


def test_source_files_carry_their_licence(repository):
    def is_source(path):
        folders = path.relative_to(repository).parts[:-1]
        return not any(folder.startswith(".") or folder in ("build", "dist") for folder in folders)

    sources = [path for end in ("*.py", "*.sh") for path in repository.rglob(end) if is_source(path)]
    sources += [repository / "Makefile", repository / ".ci" / "run"]
    assert len(sources) > 20
    line = "SPDX-License-Identifier: GPL-3.0-or-later"
    assert [path for path in sources if line not in path.read_text(encoding="utf-8")[:200]] == []
