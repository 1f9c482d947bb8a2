# SPDX-License-Identifier: GPL-3.0-or-later
"""Studies: one scene run many times with varied numbers.

:mod:`.study_file` reads what varies, :mod:`.design` chooses the values of every run, :mod:`.variation` and :mod:`.presses` put
them into a scenario, and :mod:`.progress` counts runs. Nothing here starts processes: the package ``sweep`` does.
"""

__all__ = [
    "design",
    "mesh_choices",
    "presses",
    "progress",
    "scene_property",
    "study_file",
    "variation",
]
