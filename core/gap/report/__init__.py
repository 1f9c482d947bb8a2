# SPDX-License-Identifier: GPL-3.0-or-later
"""The result of a diagnosis for a reader: gap.json, sensor.toml, report.html, pictures and sentences.

Nothing is fitted here.
"""

__all__ = ["amended_sensor", "comparison", "gap_table", "plan_files", "plots", "sentences", "summary"]
