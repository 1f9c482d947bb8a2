# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers in, numbers out: the part of Palpate that never heard of Blender.

Importing this package is cheap; numba is loaded only by the modules that hold kernels (:mod:`.bvh`, :mod:`.contact`,
:mod:`.simulation`). SI units, float64, right-handed frames and quaternions ``(w, x, y, z)`` throughout.
"""
