# SPDX-License-Identifier: GPL-3.0-or-later
"""Studies of the open scene: properties that a study varies by their paths, and the study that a panel shows.

Runs themselves are computed outside (package ``sweep``), where there is no Blender or in Blenders of their own.
"""

__all__ = [
    "property_path",
    "scene_overrides",
    "study_process",
    "study_settings",
]
