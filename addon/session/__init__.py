# SPDX-License-Identifier: GPL-3.0-or-later
"""What every other room of the add-on needs while Blender runs, and no file stores.

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
