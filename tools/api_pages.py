# SPDX-License-Identifier: GPL-3.0-or-later
"""Pages of the documentation site for the API of core: one for each package, with the modules that its ``__all__`` names."""

from __future__ import annotations

import ast
import shutil
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def pages(package: str) -> Iterator[tuple[str, str]]:
    """Pairs of a page's name and its text, of a package and those in it, in the order of imports."""
    folder = ROOT.joinpath(*package.split("."))
    names = _offered(folder)
    blocks = [_automodule(f"palpate.{package}", members=False)]
    for name in names:
        if not (folder / name).is_dir() and ast.get_docstring(ast.parse((folder / f"{name}.py").read_text(encoding="utf-8"))):
            blocks.append(f"## `{name}`\n\n{_automodule(f'palpate.{package}.{name}')}")
    yield package.replace(".", "-"), f"# `palpate.{package}`\n\n" + "\n\n".join(blocks) + "\n"
    for name in names:
        if (folder / name).is_dir():
            yield from pages(f"{package}.{name}")


def _offered(folder: Path) -> list[str]:
    """Return the list `__all__` of a package."""
    for node in ast.parse((folder / "__init__.py").read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            return list(ast.literal_eval(node.value))
    return []


def _automodule(module: str, members: bool = True) -> str:
    options = "" if members else "\n   :no-members:"
    return f"```{{eval-rst}}\n.. automodule:: {module}{options}\n```"


def write(folder: Path) -> None:
    """Write all pages and a list of them into a folder of their own."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    names = []
    for name, text in pages("core"):
        (folder / f"{name}.md").write_text(text, encoding="utf-8")
        names.append(name)
    listed = "\n".join(names)
    intro = "Modules of core that other packages, the add-on and scripts use, in the order of their imports."
    text = f"# API of core\n\n{intro}\n\n```{{toctree}}\n:maxdepth: 1\n\n{listed}\n```\n"
    (folder / "index.md").write_text(text, encoding="utf-8")
