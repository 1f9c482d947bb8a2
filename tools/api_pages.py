# SPDX-License-Identifier: GPL-3.0-or-later
"""Pages of the documentation site for the API of core: one for each package, with the modules that its ``__all__`` names."""

from __future__ import annotations

import ast
import shutil
from collections.abc import Iterator
from pathlib import Path

from import_graph import ROOT, Graph, module_name


def pages(graph: Graph) -> Iterator[tuple[str, str]]:
    """Pairs of a page's name and its text, in the order of imports."""
    docstrings = {module_name(file): ast.get_docstring(ast.parse(source)) for file, source in graph.sources.items()}
    for package in _in_order("core", graph):
        offered = graph.public[package] or []
        modules = [f"{package}.{name}" for name in offered if f"{package}.{name}" not in graph.packages]
        title = f"`palpate.{package}`"
        blocks = [_automodule(f"palpate.{package}", members=False)]
        for module in modules:
            if docstrings.get(module):
                blocks.append(f"## `{module.rpartition('.')[2]}`\n\n{_automodule(f'palpate.{module}')}")
        yield package.replace(".", "-"), f"# {title}\n\n" + "\n\n".join(blocks) + "\n"


def _in_order(package: str, graph: Graph) -> Iterator[str]:
    yield package
    for name in graph.public[package] or ():
        if f"{package}.{name}" in graph.packages:
            yield from _in_order(f"{package}.{name}", graph)


def _automodule(module: str, members: bool = True) -> str:
    options = "" if members else "\n   :no-members:"
    return f"```{{eval-rst}}\n.. automodule:: {module}{options}\n```"


def write(folder: Path) -> None:
    """Write all pages and a list of them into a folder of their own."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    names = []
    for name, text in pages(Graph.read(ROOT, ("core",))):
        (folder / f"{name}.md").write_text(text, encoding="utf-8")
        names.append(name)
    listed = "\n".join(names)
    intro = "Modules of core that other packages, the add-on and scripts use, in the order of their imports."
    text = f"# API of core\n\n{intro}\n\n```{{toctree}}\n:maxdepth: 1\n\n{listed}\n```\n"
    (folder / "index.md").write_text(text, encoding="utf-8")
