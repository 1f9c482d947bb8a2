# SPDX-License-Identifier: GPL-3.0-or-later
"""Compilation and threads: the only room that knows numba and LLVM.

It offers the decorators of kernels, tuples of arrays that kernels take as one pointer, a fingerprint of all kernels for numba's
cache, machine code that a zip carries, and helper threads that share the loops of a step. Without numba every kernel runs as
plain Python.
"""

__all__ = ["kernel_fingerprint", "kernels", "machine_code", "struct_reference", "thread_team"]
