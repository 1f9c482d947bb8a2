# SPDX-License-Identifier: GPL-3.0-or-later
"""Studies: one scene run many times with varied numbers.

:mod:`.study_file` reads what varies, :mod:`.design` chooses the values of every run, :mod:`.variation` and :mod:`.presses` put
them into a scenario, and :mod:`.study_file` counts runs. Nothing here starts processes: the package ``sweep`` does.
"""

__all__ = ["design", "presses", "scene_property", "study_file", "variation"]
