# SPDX-License-Identifier: GPL-3.0-or-later
"""Texels laid onto a surface: arrays that are wrapped around it, and points spread evenly over it."""
