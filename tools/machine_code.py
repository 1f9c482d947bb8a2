# SPDX-License-Identifier: GPL-3.0-or-later
"""Compile all kernels for a common processor of this architecture and pack them for a zip (core/compiled/machine_code.py).

    python tools/machine_code.py OUT.bin

It takes a minute. tools/build_zip.py runs it in the Python and with the packages of the zip, as the code holds for these only.
"""

import importlib.util
import os
import sys
import tempfile
from pathlib import Path

SOLVER = Path(__file__).resolve().parents[1] / "core" / "solver"


def main(out: Path) -> None:
    """Write the packed machine code to a file."""
    spec = importlib.util.spec_from_file_location("precompile_process", SOLVER / "precompile_process.py")
    assert spec is not None and spec.loader is not None
    process = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(process)
    process.load("palpate")
    with tempfile.TemporaryDirectory() as cache:
        os.environ |= {"NUMBA_CACHE_DIR": cache, "PALPATE_NUMBA": "1"}
        _choose_processor()
        from palpate.core.compiled import kernels, machine_code
        from palpate.core.solver import precompile

        machine_code.PACKED_FILE = Path(cache) / "none"  # an earlier one is not copied
        precompile.compile_solver()
        out.write_bytes(machine_code.pack(kernels.KERNELS))


def _choose_processor() -> None:
    """Tell numba for which processor it compiles; this holds when numba is imported afterwards."""
    import llvmlite.binding as llvm

    from palpate.core.compiled import machine_code

    found = machine_code.target()
    if found is None:
        sys.exit("No common processor is known for this architecture: the solver is compiled at first use.")
    name, features = found
    own = llvm.get_host_cpu_features()
    lacking = [feature for feature in features if not own.get(feature, False)]
    if lacking:
        sys.exit(f"This processor lacks {', '.join(lacking)}: build the zip on another machine, or without machine code.")
    os.environ |= {"NUMBA_CPU_NAME": name, "NUMBA_CPU_FEATURES": ",".join(f"+{feature}" for feature in features)}


if __name__ == "__main__":
    main(Path(sys.argv[1]))
