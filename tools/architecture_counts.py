# SPDX-License-Identifier: GPL-3.0-or-later
"""Counts that tell how easy the extension is to read: layers, circles, long functions, formulas that are written twice.

What is recognised by a rule of thumb is told by the function that does it, so that a count can be judged.
"""

from __future__ import annotations

import ast
import fnmatch
import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from import_graph import DEEPEST, ROOT, Graph, module_name

LONGEST, WIDEST = 60, 8  # lines and parameters of a function
KERNEL_DECORATORS = ("kernel", "inlined", "intrinsic", "njit")

# Names of the contact parameters. A literal or a class that names this many of them is a table of parameters.
CONTACT_PARAMETERS = {"k", "cn", "ct", "sigma0", "sigma1", "x0", "mus", "mud"}
TABLE = 5
# What the friction state keeps over a step, and what it gains from the velocity, in the names of variables.
KEEPS, GAINS = re.compile(r"keep|retain|decay", re.I), re.compile(r"gain|mobility", re.I)


@dataclass
class Counts:
    """What was counted in one checkout; each list names the places."""

    files_beside_packages: dict[str, list[str]] = field(default_factory=dict)
    layers: dict[str, int] = field(default_factory=dict)
    circles: list[str] = field(default_factory=list)
    long_functions: list[str] = field(default_factory=list)
    long_kernels: list[str] = field(default_factory=list)
    wide_functions: list[str] = field(default_factory=list)
    wide_kernels: list[str] = field(default_factory=list)
    normal_law: list[str] = field(default_factory=list)
    friction_step: list[str] = field(default_factory=list)
    parameter_tables: list[str] = field(default_factory=list)
    untyped_modules: list[str] = field(default_factory=list)


BESIDE_PACKAGES = {"__init__.py", "errors.py", "version.py"}
"""Files that no package is needed for."""


def count(root: Path = ROOT) -> Counts:
    """Count everything in the checkout at `root`."""
    graph = Graph.read(root)
    counts = Counts()
    for package in ("core", "addon"):
        files = {f.name for f in (root / package).glob("*.py")}
        counts.files_beside_packages[package] = sorted(files - BESIDE_PACKAGES)
    counts.layers = {package: graph.depth(package) for package in graph.packages}
    counts.circles = [" ↔ ".join(group) for group in graph.file_circles()]
    for file, source in graph.sources.items():
        tree = ast.parse(source)
        _count_functions(file, tree, counts)
        counts.normal_law += _places(file, tree, is_normal_law)
        counts.friction_step += _places(file, tree, is_friction_step)
        counts.parameter_tables += [f"{file.as_posix()}:{line}" for line in parameter_tables(tree)]
    counts.untyped_modules = _untyped_modules(root, graph)
    return counts


def _functions(tree: ast.AST) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    return (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef))


def _is_kernel(function: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    return any(word in ast.unparse(d) for d in function.decorator_list for word in KERNEL_DECORATORS)


def _count_functions(file: Path, tree: ast.AST, counts: Counts) -> None:
    """Note functions that are too long or take too much; `self` and `cls` are not counted as parameters."""
    for function in _functions(tree):
        arguments = [a.arg for a in (*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs)]
        number = len(arguments) - (arguments[:1] in (["self"], ["cls"]))
        lines = (function.end_lineno or 0) - function.lineno + 1
        where = f"{file.as_posix()}:{function.lineno} {function.name}"
        kernel = _is_kernel(function)
        if lines > LONGEST:
            (counts.long_kernels if kernel else counts.long_functions).append(f"{where} ({lines} lines)")
        if number > WIDEST:
            (counts.wide_kernels if kernel else counts.wide_functions).append(f"{where} ({number} parameters)")


def _names(node: ast.AST) -> list[str]:
    """Names, attributes and constant indices that occur in an expression."""
    found = [n.id for n in ast.walk(node) if isinstance(n, ast.Name)]
    return found + [n.attr for n in ast.walk(node) if isinstance(n, ast.Attribute)]


def _factors(node: ast.AST) -> Iterator[ast.AST]:
    """Operands of a product."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult):
        yield from _factors(node.left)
        yield from _factors(node.right)
    else:
        yield node


def is_normal_law(node: ast.AST) -> bool:
    """True for a product with 3/2 and a dissipation: only who writes the normal law out needs it."""
    if not (isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult)):
        return False
    factors = list(_factors(node))
    constant = any(isinstance(f, ast.Constant) and f.value == 1.5 for f in factors) or any(
        ast.unparse(f) in ("3 / 2", "3.0 / 2.0") for f in factors
    )
    return constant and any("dissipation" in name.lower() for f in factors for name in _names(f))


def is_friction_step(node: ast.AST) -> bool:
    """True for a sum ``keep · z + gain · v``: only who advances the friction state needs it."""
    if not (isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add)):
        return False
    left, right = list(_factors(node.left)), list(_factors(node.right))
    if len(left) < 2 or len(right) < 2:
        return False
    return any(KEEPS.search(n) for f in left for n in _names(f)) and any(GAINS.search(n) for f in right for n in _names(f))


def _places(file: Path, tree: ast.AST, is_formula) -> list[str]:
    """Functions of a file that write a formula out."""
    inside = {f"{file.as_posix()}:{f.lineno} {f.name}" for f in _functions(tree) if any(map(is_formula, ast.walk(f)))}
    return sorted(inside)


def parameter_tables(tree: ast.AST) -> Iterator[int]:
    """Lines at which a literal or a class names most of the contact parameters."""
    for node in ast.walk(tree):
        names: list[str] = []
        if isinstance(node, ast.Tuple | ast.List | ast.Set):
            names = [_named(element) for element in node.elts]
        elif isinstance(node, ast.Dict):
            names = [_named(key) for key in node.keys if key is not None]
        elif isinstance(node, ast.ClassDef):
            names = [_named(item.target) for item in node.body if isinstance(item, ast.AnnAssign)]
        if len(CONTACT_PARAMETERS.intersection(names)) >= TABLE:
            yield node.lineno


def _named(node: ast.AST) -> str:
    """Return what an element names: a string, a name, `p.k`, or the first argument of a call such as ``Number("k", …)``."""
    if isinstance(node, ast.Call) and node.args:
        return _named(node.args[0])
    if isinstance(node, ast.Tuple) and node.elts:
        return _named(node.elts[0])
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.Attribute):
        return node.attr.lower()
    return node.id.lower() if isinstance(node, ast.Name) else ""


def _untyped_modules(root: Path, graph: Graph) -> list[str]:
    """Modules whose functions may go without annotations by the settings of mypy."""
    settings = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["mypy"]
    patterns: list[str] = []
    for override in settings.get("overrides", []):
        if override.get("ignore_errors") or override.get("disallow_untyped_defs") is False:
            named = override["module"]
            patterns += [named] if isinstance(named, str) else named
    modules = [module_name(f) for f in graph.sources if f.name != "__init__.py"]
    return sorted(m for m in modules if any(fnmatch.fnmatchcase(m, pattern) for pattern in patterns))


def _modules(places: list[str]) -> int:
    return len({place.partition(":")[0] for place in places})


def print_counts(counts: Counts, listed: bool) -> None:
    """Print one line per count, and below it what was counted where that is wanted."""
    over = {package: layers for package, layers in counts.layers.items() if layers > DEEPEST}
    deepest = sorted(counts.layers.items(), key=lambda item: (-item[1], item[0]))
    beside = counts.files_beside_packages
    lines: list[tuple[str, object, list[str]]] = [
        ("files directly in core", len(beside["core"]), beside["core"]),
        ("files directly in addon", len(beside["addon"]), beside["addon"]),
        ("layers of imports, deepest package", f"{deepest[0][1]} ({deepest[0][0]})", [f"{p}: {n}" for p, n in deepest]),
        (f"packages with more than {DEEPEST} layers", len(over), [f"{p}: {n}" for p, n in over.items()]),
        ("circles of files", len(counts.circles), counts.circles),
        (f"functions over {LONGEST} lines", len(counts.long_functions), counts.long_functions),
        (f"kernels over {LONGEST} lines", len(counts.long_kernels), counts.long_kernels),
        (f"functions over {WIDEST} parameters", len(counts.wide_functions), counts.wide_functions),
        (f"kernels over {WIDEST} parameters", len(counts.wide_kernels), counts.wide_kernels),
        ("modules that write out the normal law", _modules(counts.normal_law), counts.normal_law),
        ("functions that write out the friction step", len(counts.friction_step), counts.friction_step),
        ("modules with a table of parameters", _modules(counts.parameter_tables), counts.parameter_tables),
        ("modules exempt from complete types", len(counts.untyped_modules), counts.untyped_modules),
    ]
    for title, value, places in lines:
        print(f"{title}: {value}")
        if listed:
            print(*(f"    {place}" for place in places), sep="\n")
