# SPDX-License-Identifier: GPL-3.0-or-later
"""Studies: one scene run many times with varied numbers.

:mod:`.study_file` reads what varies, :mod:`.design` chooses the values of every run, :mod:`.variation` and :mod:`.presses` put
them into a scenario, :mod:`.metrics` sums a run up, and :mod:`.run_files` writes it, its numbers as a :mod:`.run_record`, with
many others into :mod:`.run_shards`; :mod:`.run_placement` writes what no solver has computed. Nothing here starts processes:
the package ``sweep`` does.
"""

__all__ = [
    "design",
    "mesh_choices",
    "metrics",
    "presses",
    "run_files",
    "run_images",
    "run_placement",
    "run_record",
    "run_shards",
    "scene_property",
    "study_file",
    "variation",
]
