# SPDX-License-Identifier: GPL-3.0-or-later
"""Contracts of ``lint-imports`` that import-linter itself does not have; pyproject.toml lists them with the others."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from grimp import ImportGraph
from importlinter import Contract, ContractCheck, fields, output

ROOT = Path(__file__).resolve().parents[1]
DEEPEST = 8  # layers of imports among the direct children of one package


class _SentencesContract(Contract):
    """A contract whose breaches are sentences."""

    packages = fields.ListField(subfield=fields.StringField())
    """Top packages of the extension, without the name of the root."""

    def breaches(self, graph: ImportGraph) -> Iterator[str]:
        """Yield each breach as one sentence."""
        raise NotImplementedError

    def check(self, graph: ImportGraph, verbose: bool) -> ContractCheck:
        found = sorted(self.breaches(graph))
        return ContractCheck(kept=not found, metadata={"found": found})

    def render_broken_contract(self, check: ContractCheck) -> None:
        for sentence in check.metadata["found"]:
            output.print_error(sentence)

    def modules(self, graph: ImportGraph) -> list[str]:
        """Return the modules of the packages."""
        return sorted(m for m in graph.modules if m.count(".") and m.split(".")[1] in self.packages)


class OfferedModules(_SentencesContract):
    """``__all__`` of a package names the modules that others may import, and no module imports a private name.

    Packages of core and addon also say what they are for, and import nothing when they are entered. Imports inside the
    extension are relative: Blender calls it ``bl_ext.<repository>.palpate``.
    """

    type_name = "offered_modules"

    def breaches(self, graph: ImportGraph) -> Iterator[str]:
        modules = self.modules(graph)
        sources = {module: ast.parse(_file(module).read_text(encoding="utf-8")) for module in modules}
        offered = {module: _offered(sources[module]) for module in modules if graph.find_children(module)}
        for module, names in offered.items():
            if module.split(".")[1] in ("core", "addon"):
                yield from _entering_breaches(graph, module, sources[module], names)
        for module in modules:
            for imported in graph.find_modules_directly_imported_by(module):
                parts = imported.split(".")
                for depth in range(2, len(parts)):
                    package, child = ".".join(parts[:depth]), parts[depth]
                    names = offered.get(package)
                    if names is not None and child not in names and not f"{module}.".startswith(f"{package}."):
                        yield f"{module} imports {imported}: __all__ of {package} does not name {child}"
            yield from _statement_breaches(module, sources[module], self.packages)


def _file(module: str) -> Path:
    """Return the file of a module."""
    path = ROOT.joinpath(*module.split(".")[1:])
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def _offered(source: ast.Module) -> list[str] | None:
    """Return the list `__all__` of a module, None where it has none."""
    for node in source.body:
        if isinstance(node, ast.Assign) and any(isinstance(t, ast.Name) and t.id == "__all__" for t in node.targets):
            return list(ast.literal_eval(node.value))
    return None


def _entering_breaches(graph: ImportGraph, package: str, source: ast.Module, names: list[str] | None) -> Iterator[str]:
    if not (ast.get_docstring(source) or "").strip():
        yield f"{package} does not say in a docstring what it is for"
    if names is None:
        yield f"{package} has no __all__ that names what others may import"
    for name in names or ():
        if f"{package}.{name}" not in graph.modules:
            yield f"{package}: __all__ names {name}, which is no module"
    for node in ast.walk(source):
        if isinstance(node, ast.Import | ast.ImportFrom) and getattr(node, "module", "") != "__future__":
            yield f"{package}, line {node.lineno}: a package imports nothing when it is entered"


def _statement_breaches(module: str, source: ast.Module, packages: list[str]) -> Iterator[str]:
    """Yield the absolute imports of the extension's own modules, and the imports of private names."""
    for node in ast.walk(source):
        if isinstance(node, ast.Import):
            absolute = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            absolute = [node.module or ""] if node.level == 0 else []
            if node.level and any(alias.name.startswith("_") and not alias.name.startswith("__") for alias in node.names):
                yield f"{module}, line {node.lineno} imports a private name"
        else:
            continue
        if any(name.split(".")[0] in ("palpate", *packages) for name in absolute):
            yield f"{module}, line {node.lineno}: inside the extension imports are relative"


class Depth(_SentencesContract):
    """The direct children of a package import each other in a few layers at most."""

    type_name = "depth"

    def breaches(self, graph: ImportGraph) -> Iterator[str]:
        for package in self.modules(graph):
            children = graph.find_children(package)
            if (layers := _layers(graph, children)) > DEEPEST:
                yield f"{package} has {layers} layers of imports among its children; {DEEPEST} are allowed"


def _layers(graph: ImportGraph, children: set[str]) -> int:
    """Return the number of children on the longest path of imports; circles are another contract's."""
    below: dict[str, int] = {}

    def depth(child: str) -> int:
        if child not in below:
            below[child] = 1
            others = (o for o in children - {child} if graph.direct_import_exists(importer=child, imported=o, as_packages=True))
            below[child] += max(map(depth, others), default=0)
        return below[child]

    return max(map(depth, children), default=0)
