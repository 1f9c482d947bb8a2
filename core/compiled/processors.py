# SPDX-License-Identifier: GPL-3.0-or-later
"""The processors for which a zip carries machine code. This imports nothing, so that numba can be told before it is loaded."""

from __future__ import annotations

import platform

X86_64_V3 = ["avx", "avx2", "bmi", "bmi2", "cmov", "cx16", "cx8", "f16c", "fma", "fxsr", "lzcnt", "mmx", "movbe", "popcnt"]
X86_64_V3 += ["sahf", "sse", "sse2", "sse3", "sse4.1", "sse4.2", "ssse3", "xsave"]
ARM64 = ["aes", "crc", "fp-armv8", "fullfp16", "lse", "neon", "sha2"]
TARGETS = {"x86_64": ("x86-64-v3", X86_64_V3), "arm64": ("apple-m1", ARM64)}
"""By architecture: LLVM's name of the processor that is compiled for, and the features that a processor must have to run the
code. x86-64-v3 is Intel since Haswell (2013) and AMD since Excavator (2015). Code for arm64 was never tried."""
ARCHITECTURES = {"amd64": "x86_64", "x86_64": "x86_64", "arm64": "arm64", "aarch64": "arm64"}
"""What systems call an architecture, in small letters."""


def architecture() -> str:
    """Return the name of this processor's architecture; empty where none is compiled for."""
    return ARCHITECTURES.get(platform.machine().lower(), "")


def target() -> tuple[str, list[str]] | None:
    """Return the processor that is compiled for on this architecture, and its features; None if there is none."""
    return TARGETS.get(architecture())
