# SPDX-License-Identifier: GPL-3.0-or-later
"""State and services of a Blender session, which no file stores.

Units, time, poses and F-curves in Blender's terms; objects by an id that lasts; the state of the session; the packages that
are installed, and the solver's first compilation.
"""

__all__ = [
    "dependencies",
    "fcurves",
    "first_use",
    "frame_status",
    "identity",
    "session_state",
    "transforms",
]
