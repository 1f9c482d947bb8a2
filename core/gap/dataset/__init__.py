# SPDX-License-Identifier: GPL-3.0-or-later
"""Measurements of a sensor: a rig file in TOML, and one CSV file for each trial."""

__all__ = ["column_names", "rig", "second_logger", "trial"]
