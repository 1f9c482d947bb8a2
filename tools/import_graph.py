# SPDX-License-Identifier: GPL-3.0-or-later
"""The imports of the extension as a graph, and the rules that they keep.

The source is parsed, never run, so an import inside a function or under ``TYPE_CHECKING`` counts like any other. Used by
tests/core/test_import_direction.py, which fails on a breach, and by tools/architecture.py, which draws and counts.

``python tools/import_graph.py`` prints every breach with its file and line.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

# Which packages a package may import from; each may import from itself. The root package ("") registers everything.
MAY_IMPORT: dict[str, set[str]] = {
    "core": set(),
    "api": {"core", "sweep"},
    "addon": {"core", "api"},
    "operators": {"core", "api", "addon"},
    "panels": {"core", "addon", "operators"},
    "commands": {"core", "api", "addon", "paper", "sample_blends", "sweep"},
    "paper": {"core", "addon", "sample_blends"},
    "plugins": {"core"},
    "sample_blends": {"core", "addon"},
    "sweep": {"core"},
    "": {"core", "api", "addon", "operators", "panels", "commands", "paper", "sample_blends"},
}


def _all_of(source: str) -> list[str] | None:
    """Return the list `__all__` of a module's source, None where it has none."""
    for node in ast.parse(source).body:
        if isinstance(node, ast.Assign) and any(isinstance(t, ast.Name) and t.id == "__all__" for t in node.targets):
            return list(ast.literal_eval(node.value))
    return None


def _rooms_of(package: str) -> tuple[str, ...]:
    """Return the rooms that a package names in its `__all__`, in their order."""
    return tuple(_all_of((ROOT / package / "__init__.py").read_text(encoding="utf-8")) or ())


# The order of the rooms: each may import only from those that stand before it. The two packages that others enter only by
# their rooms name them in this order themselves; inside the rooms, `__all__` is in alphabetical order.
ORDER: dict[str, tuple[str, ...]] = {
    "core": _rooms_of("core"),
    "core.effects": ("engine", "library"),
    "core.gap": (
        "dataset",
        "forward",
        "data_faults",
        "fitting",
        "kinds",
        "selection",
        "planning",
        "report",
        "calibration",
        "logs",
    ),
    "core.solver": ("detection", "dynamics"),
    "addon": _rooms_of("addon"),
}
DEEPEST = 8  # layers of imports among the direct children of one package
# Folders inside a package that Blender runs as scripts; they are not modules of it.
NOT_MODULES = {"presets"}


@dataclass(frozen=True)
class Import:
    """What one import statement names: `module` is absolute, or counted from the repository root."""

    file: Path
    line: int
    module: str
    relative: bool
    at_module_level: bool
    names: tuple[str, ...] = ()

    @property
    def top(self) -> str:
        """First part of the module's name."""
        return self.module.partition(".")[0]

    def __str__(self) -> str:
        return f"{self.file.as_posix()}:{self.line} imports {self.module or 'the root package'}"


@dataclass(frozen=True, order=True)
class Breach:
    """One breach of the rules: `room` is the package at fault, `kind` the rule, `text` a sentence with file and line."""

    room: str
    kind: str
    text: str


def imports_of(file: Path, source: str) -> list[Import]:
    """All imports of a file, whose path is relative to the repository root."""
    tree = ast.parse(source, filename=str(file))
    inside_functions = {
        id(node)
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
        for node in ast.walk(function)
    }
    found: list[Import] = []
    for node in ast.walk(tree):
        outside = id(node) not in inside_functions
        if isinstance(node, ast.Import):
            found += [Import(file, node.lineno, alias.name, False, outside) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            found += _from_import(file, node, outside)
    return found


def _from_import(file: Path, node: ast.ImportFrom, outside: bool) -> list[Import]:
    """Resolve `from … import …`: one dot is the file's folder, each further dot one folder up."""
    names = tuple(alias.name for alias in node.names)
    if node.level == 0:
        return [Import(file, node.lineno, node.module or "", False, outside, names)]
    folders = file.parent.parts
    if node.level - 1 > len(folders):
        return [Import(file, node.lineno, "<above the root package>", True, outside)]
    base = ".".join([*folders[: len(folders) - (node.level - 1)], *(node.module or "").split(".")]).strip(".")
    if base:
        return [Import(file, node.lineno, base, True, outside, names)]
    return [Import(file, node.lineno, name, True, outside) for name in names]  # `from .. import core, addon`


def module_name(file: Path) -> str:
    """Name of a file's module, counted from the repository root; a package has the name of its folder."""
    parts = file.with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def package_of(module: str) -> str:
    """Package that holds a module."""
    return module.rpartition(".")[0]


def source_files(root: Path = ROOT, packages: Iterable[str] = MAY_IMPORT) -> list[Path]:
    """Python files of the extension, relative to `root`."""
    found = [root / "__init__.py"] if "" in packages else []
    for package in packages:
        if package:
            found += sorted((root / package).rglob("*.py"))
    files = [file.relative_to(root) for file in found]
    return [file for file in files if not NOT_MODULES & set(file.parts)]


@dataclass
class Graph:
    """Modules of the extension and what they import from each other.

    `sources` maps the path of each file, relative to the repository root, to its text.
    """

    sources: Mapping[Path, str]
    imports: dict[str, list[Import]] = field(init=False)

    def __post_init__(self) -> None:
        self.imports = {module_name(file): imports_of(file, source) for file, source in self.sources.items()}

    @classmethod
    def read(cls, root: Path = ROOT, packages: Iterable[str] = MAY_IMPORT) -> Graph:
        """Read the files under `root`."""
        return cls({file: (root / file).read_text(encoding="utf-8") for file in source_files(root, packages)})

    @cached_property
    def packages(self) -> list[str]:
        """Names of all packages except the root."""
        return sorted(filter(None, (module_name(file) for file in self.sources if file.name == "__init__.py")))

    @cached_property
    def public(self) -> dict[str, list[str] | None]:
        """The list `__all__` of each package but the root, which makes its own; None where it has none."""
        return {
            module_name(f): _all_of(source)
            for f, source in self.sources.items()
            if len(f.parts) > 1 and f.name == "__init__.py"
        }

    def targets(self, found: Import) -> Iterator[tuple[str, str]]:
        """Pairs (module, name) that an import inside the extension reaches; the name is empty for a whole module."""
        if not found.relative or found.module.startswith("<"):
            return
        if not found.names and found.module in self.imports:
            yield found.module, ""
        for name in found.names:
            inner = f"{found.module}.{name}"
            if inner in self.imports:
                yield inner, ""
            elif found.module in self.imports:
                yield found.module, name

    @cached_property
    def edges(self) -> dict[str, set[str]]:
        """Modules that each module imports."""
        reached = {m: {target for i in found for target, _ in self.targets(i)} for m, found in self.imports.items()}
        return {module: targets - {module} for module, targets in reached.items()}

    def children(self, package: str) -> dict[str, set[str]]:
        """Imports among the direct children of a package; a subpackage counts as one, with all that it holds."""
        start = f"{package}."
        graph: dict[str, set[str]] = {m.removeprefix(start).partition(".")[0]: set() for m in self.edges if m.startswith(start)}
        for module, targets in self.edges.items():
            if module.startswith(start):
                child = module.removeprefix(start).partition(".")[0]
                reached = {t.removeprefix(start).partition(".")[0] for t in targets if t.startswith(start)}
                graph[child] |= reached - {child}
        return graph

    def depth(self, package: str) -> int:
        """Layers of imports among the direct children of a package; a circle counts as one layer per member."""
        return depth(self.children(package))

    def file_circles(self) -> list[list[str]]:
        """Groups of files that import each other in a circle."""
        return circles(self.edges)


def circles(graph: Mapping[str, set[str]]) -> list[list[str]]:
    """Return groups of nodes that reach each other (Tarjan's strongly connected components of more than one node)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for target in graph.get(node, ()):
            if target not in index:
                visit(target)
                low[node] = min(low[node], low[target])
            elif target in stack:
                low[node] = min(low[node], index[target])
        if low[node] == index[node]:
            group = stack[stack.index(node) :]
            del stack[stack.index(node) :]
            if len(group) > 1:
                found.append(sorted(group))

    for node in sorted(graph):
        if node not in index:
            visit(node)
    return sorted(found)


def depth(graph: Mapping[str, set[str]]) -> int:
    """Number of nodes on the longest path; each member of a circle adds one."""
    group_of = {member: tuple(group) for group in circles(graph) for member in group}
    known: dict[tuple[str, ...], int] = {}

    def below(group: tuple[str, ...]) -> int:
        if group not in known:
            targets = {group_of.get(t, (t,)) for member in group for t in graph.get(member, ())} - {group}
            known[group] = len(group) + max((below(target) for target in targets), default=0)
        return known[group]

    return max((below(group_of.get(node, (node,))) for node in graph), default=0)


# --- the rules


def breaches(graph: Graph) -> list[Breach]:
    """Every breach of the rules about rooms, sorted."""
    rules = (_order, _interfaces, _private_attributes, _packages, _circles, _depths)
    return sorted({breach for rule in rules for breach in rule(graph)})


def room_of(module: str) -> str:
    """Room of a module: `core.solver.simulation` lies in `core.solver`, `operators.bake` in `operators`."""
    parts = module.split(".")
    return ".".join(parts[:2]) if parts[0] in ORDER else parts[0]


def _order(graph: Graph) -> Iterator[Breach]:
    """A room imports only from rooms that stand before it."""
    for module, found in graph.imports.items():
        for statement in found:
            for target, _ in graph.targets(statement):
                for package, rooms in ORDER.items():
                    here, there = _child(module, package), _child(target, package)
                    if here in rooms and there in rooms and rooms.index(here) < rooms.index(there):
                        text = f"{statement}: {there} stands after {here} in the order of {package}"
                        yield Breach(room_of(module), "order", text)
    for package, rooms in ORDER.items():
        for child in graph.children(package):
            if f"{package}.{child}" in graph.packages and child not in rooms:
                yield Breach(f"{package}.{child}", "order", f"{package}/{child} has no place in the order of {package}")


def _child(module: str, package: str) -> str:
    """Direct child of `package` that holds `module`; empty if none does."""
    start = f"{package}."
    return module.removeprefix(start).partition(".")[0] if module.startswith(start) else ""


def _entered(module: str, target: str) -> Iterator[tuple[str, str]]:
    """Pairs (package, child) that an import passes on its way into packages that do not hold `module`."""
    parts = target.split(".")
    for count in range(1, len(parts)):
        package = ".".join(parts[:count])
        if not module.startswith(f"{package}.") and module != package:
            yield package, parts[count]


def _interfaces(graph: Graph) -> Iterator[Breach]:
    """What other packages import is named in `__all__` of the package that holds it, and is not private."""
    for module, found in graph.imports.items():
        for statement in found:
            for target, name in graph.targets(statement):
                for package, child in _entered(module, target):
                    public = graph.public.get(package)
                    if public is not None and child not in public:
                        text = f"{statement}: __all__ of {package} does not name {child}"
                        yield Breach(room_of(module), "interface", text)
                if name.startswith("_") and any(_entered(module, target)):
                    yield Breach(room_of(module), "interface", f"{statement}: {name} is private to {package_of(target)}")


def _private_attributes(graph: Graph) -> Iterator[Breach]:
    """No file reads `module._name` of a module in another package."""
    for file, source in graph.sources.items():
        module = module_name(file)
        modules: dict[str, str] = {}
        tree = ast.parse(source)
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom):
                for statement in _from_import(file, node, True):
                    for alias in node.names:
                        inner = f"{statement.module}.{alias.name}"
                        if inner in graph.imports and any(_entered(module, inner)):
                            modules[alias.asname or alias.name] = inner
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                owner, private = modules.get(node.value.id), node.attr.startswith("_") and not node.attr.startswith("__")
                if owner and private:
                    where = f"{file.as_posix()}:{node.lineno} reads {node.value.id}.{node.attr}"
                    yield Breach(room_of(module), "interface", f"{where}, which is private to {owner}")


def _packages(graph: Graph) -> Iterator[Breach]:
    """Each package of core and addon says what it is for and what others may use, and imports nothing when it is entered."""
    for file, source in graph.sources.items():
        package = module_name(file)
        if file.name != "__init__.py" or package.split(".")[0] not in ORDER:
            continue
        if not (ast.get_docstring(ast.parse(source)) or "").strip():
            yield Breach(room_of(package), "package", f"{file.as_posix()} does not say in a paragraph what the package is for")
        public = graph.public[package]
        if public is None:
            yield Breach(room_of(package), "package", f"{file.as_posix()} has no __all__ that names what others may import")
        for name in public or ():
            if f"{package}.{name}" not in graph.imports:
                yield Breach(room_of(package), "package", f"{file.as_posix()}: __all__ names {name}, which is no module")
        for statement in graph.imports[package]:
            if statement.module != "__future__":
                yield Breach(room_of(package), "package", f"{statement}: a package imports nothing when it is entered")


def _circles(graph: Graph) -> Iterator[Breach]:
    """No two files, and no two children of a package, import each other in a circle."""
    for group in graph.file_circles():
        yield Breach(_common_package(group), "circle", f"These files import each other in a circle: {', '.join(group)}")
    for package in graph.packages:
        for group in circles(graph.children(package)):
            text = f"These children of {package} import each other in a circle: {', '.join(group)}"
            yield Breach(room_of(package), "circle", text)


def _common_package(modules: list[str]) -> str:
    """Room that holds all of the modules, or the package that holds all of their rooms."""
    rooms = {room_of(module) for module in modules}
    return rooms.pop() if len(rooms) == 1 else ".".join({module.split(".")[0] for module in modules})


def _depths(graph: Graph) -> Iterator[Breach]:
    for package in graph.packages:
        layers = graph.depth(package)
        if layers > DEEPEST:
            text = f"{package} has {layers} layers of imports among its children; {DEEPEST} are allowed"
            yield Breach(room_of(package), "depth", text)


def main() -> int:
    """Print every breach."""
    found = breaches(Graph.read())
    for breach in found:
        print(f"{breach.room} [{breach.kind}] {breach.text}")
    print(f"{len(found)} breaches")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
