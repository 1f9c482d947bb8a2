# SPDX-License-Identifier: GPL-3.0-or-later
"""Machine code of the kernels that comes with the extension, so that its first use need not wait for the compiler.

``tools/machine_code.py`` compiles all kernels for a processor that nearly all computers of an architecture contain
(:mod:`.machine_code`) and packs them into one file, which a zip carries. :func:`install` puts them into numba's cache where the
processor has what they need and numba, Python and the kernels are the same; otherwise they are compiled as without the file.
The numbers are the same: no kernel lets the compiler reorder arithmetic.
"""

from __future__ import annotations

import hashlib
import io
import json
import pickle
import platform
import sys
import zlib
from pathlib import Path
from typing import Any

from .kernel_fingerprint import fingerprint
from .numba_internals import CAN_PACK, dumps, processor_features, rebuild_environment, reduced_overloads, save_overload

X86_64_V3 = ["avx", "avx2", "bmi", "bmi2", "cmov", "cx16", "cx8", "f16c", "fma", "fxsr", "lzcnt", "mmx", "movbe", "popcnt"]
X86_64_V3 += ["sahf", "sse", "sse2", "sse3", "sse4.1", "sse4.2", "ssse3", "xsave"]
ARM64 = ["aes", "crc", "fp-armv8", "fullfp16", "lse", "neon", "sha2"]
TARGETS = {"x86_64": ("x86-64-v3", X86_64_V3), "arm64": ("apple-m1", ARM64)}
"""By architecture: LLVM's name of the processor that is compiled for, and the features that a processor must have to run the
code. x86-64-v3 is Intel since Haswell (2013) and AMD since Excavator (2015). Code for arm64 was never tried."""
ARCHITECTURES = {"amd64": "x86_64", "x86_64": "x86_64", "arm64": "arm64", "aarch64": "arm64"}
"""Names that systems give to an architecture, in small letters."""


def architecture() -> str:
    """Return the name of this processor's architecture; empty where none is compiled for."""
    return ARCHITECTURES.get(platform.machine().lower(), "")


def target() -> tuple[str, list[str]] | None:
    """Return the processor that is compiled for on this architecture, and its features; None if there is none."""
    return TARGETS.get(architecture())


PACKED_FILE = Path(__file__).parent / "machine_code.bin"
"""Where a zip carries the file."""


def pack(kernels: list[Any]) -> bytes:
    """Return the machine code of kernels that this process has compiled for :func:`target`: JSON, then a pickle."""
    found = target()
    assert found is not None
    entries = {name: own for name, kernel in sorted(_by_name(kernels).items()) if (own := reduced_overloads(kernel))}
    body = zlib.compress(dumps(entries), 9)
    head = {**_made_by(), "processor": found[0], "features": found[1], "package": _root_package(), "digest": _digest(body)}
    return json.dumps(head, sort_keys=True).encode() + b"\n" + body


def fits() -> bool:
    """Return True if the file is there and its code runs here: same kernels, numba, Python and system, a processor like it."""
    if not CAN_PACK:
        return False
    head = _head()
    return head is not None and all(head.get(key) == value for key, value in _made_by().items()) and _has(head["features"])


def install(kernels: list[Any]) -> int:
    """Put the machine code of kernels into numba's cache, from where they are loaded when they are called.

    Returns
    -------
    int
        How many were put there; zero where the file does not fit (:func:`fits`) or is damaged.
    """
    if not fits():
        return 0
    line, _, body = PACKED_FILE.read_bytes().partition(b"\n")
    head = json.loads(line)
    if head["digest"] != _digest(body):
        return 0
    entries = _Renaming(zlib.decompress(body), head["package"], _root_package()).load()
    count = 0
    for name, kernel in _by_name(kernels).items():
        for signature, content in entries.get(name, ()):
            save_overload(kernel, signature, content)
            count += 1
    return count


def _by_name(kernels: list[Any]) -> dict[str, Any]:
    """Return kernels by their names within the package."""
    return {f"{kernel.__module__.removeprefix(_root_package())}.{kernel.__qualname__}": kernel for kernel in kernels}


def _digest(body: bytes) -> str:
    return hashlib.blake2b(body, digest_size=16).hexdigest()


def _head() -> dict[str, Any] | None:
    try:
        with PACKED_FILE.open("rb") as file:
            found: dict[str, Any] = json.loads(file.readline(1 << 16))
            return found
    except (OSError, ValueError):
        return None


def _made_by() -> dict[str, str]:
    """Return the properties that the machine of a build and the machine of a user must share."""
    from importlib.metadata import version

    return {
        "fingerprint": fingerprint(),
        "numba": version("numba"),
        "llvmlite": version("llvmlite"),
        "python": str(sys.implementation.cache_tag),
        "system": f"{platform.system()}-{architecture()}",
    }


def _has(features: list[str]) -> bool:
    """Return True if this processor has all these features."""
    own = processor_features()
    return all(own.get(name, False) for name in features)


def _root_package() -> str:
    """Return the name under which the package is loaded: "palpate", or a longer one inside Blender."""
    return __name__.removesuffix(".core.compiled.machine_code")


class _Renaming(pickle.Unpickler):
    """Unpickles what was packed where the package had another name. The file is part of the zip, as the code beside it is."""

    def __init__(self, data: bytes, old: str, new: str):
        super().__init__(io.BytesIO(data))
        self._old, self._new = old, new

    def find_class(self, module: str, name: str) -> Any:
        found = super().find_class(self._renamed(module), name)
        if found is rebuild_environment:
            return lambda module, *others: rebuild_environment(self._renamed(module), *others)
        return found

    def _renamed(self, module: str) -> str:
        inside = module == self._old or module.startswith(self._old + ".")
        return self._new + module[len(self._old) :] if inside else module
