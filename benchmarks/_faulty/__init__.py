# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigs whose data have a known fault, or none: sensors by formulas of their own, nothing of which the package knows."""
