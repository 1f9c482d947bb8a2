# SPDX-License-Identifier: GPL-3.0-or-later
"""Fingerprint of all kernels. It is found without numba, so that the panel can ask whether they were compiled before."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

KERNEL_MARKS = (
    b"@kernel",
    b"@inlined",
    b"@allocating_kernel",
    b"@by_reference",
    b"KIND = Kind(",
    b"from numba",
    b"= specified(",
)
"""A file that holds one of these influences the compiled code.

The laws of effects are compiled as well, and the specified parameters of a sensor are the fields of the contact law. Of the
packages laws and compiled every file counts.
"""


CORE = Path(__file__).resolve().parents[1]


@cache
def fingerprint() -> str:
    """Return a hash of all files in core that kernels are made from.

    A compiled kernel contains the machine code of the kernels that it calls, but numba looks only at a kernel's own file to
    see whether its cached result is still good. After a change in another file, or an upgrade, old code would go on running.
    """
    digest = hashlib.sha256()
    for path in sorted(CORE.rglob("*.py")):
        source = path.read_bytes()
        if path.parent.name in ("laws", "compiled") or any(mark in source for mark in KERNEL_MARKS):
            digest.update(source)
    return digest.hexdigest()[:12]
