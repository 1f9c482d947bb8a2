# SPDX-License-Identifier: GPL-3.0-or-later
"""Measurements of a real sensor beside the sensor in the scene: the results of the gap workflow in this session."""

__all__ = ["gap_results", "log_rigs", "planned_probe"]
