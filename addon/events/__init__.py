# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's events: frame changes, edits, loading, saving and rendering are handed on to the rooms that act on them."""

__all__ = ["file_handlers", "handlers"]
