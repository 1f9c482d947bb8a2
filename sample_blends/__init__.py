# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes that are built by script, and the .blend files that :mod:`.build_samples` made of them."""
