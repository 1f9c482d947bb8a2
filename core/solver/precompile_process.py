# SPDX-License-Identifier: GPL-3.0-or-later
"""Compile the solver (:mod:`.precompile`) in a process beside Blender; this file is run by its path.

    python -I precompile_process.py PACKAGE SYS_PATH_AS_JSON

Numba's cache contains names of modules, so the package is loaded under the name that it has in Blender, as in
``bl_ext.user_default.palpate``. The parents of that name only exist in Blender; here they are empty packages.
"""

import importlib.util
import json
import sys
import types
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def load(name: str) -> None:
    """Load the package in the folder above under a name, with empty packages as its parents."""
    parts = name.split(".")
    for i in range(1, len(parts)):
        parent = types.ModuleType(".".join(parts[:i]))
        parent.__path__ = []
        sys.modules[parent.__name__] = parent
    spec = importlib.util.spec_from_file_location(name, ROOT / "__init__.py", submodule_search_locations=[str(ROOT)])
    assert spec is not None and spec.loader is not None
    sys.modules[name] = package = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(package)


if __name__ == "__main__":
    package, paths = sys.argv[1:]
    sys.path[:] = json.loads(paths)
    load(package)
    importlib.import_module(f"{package}.core.solver.precompile").main()
