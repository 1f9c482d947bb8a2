# SPDX-License-Identifier: GPL-3.0-or-later
"""One module per format of a log. Each has a function that takes the path of a file and returns its tables."""

__all__ = ["array_files", "bags", "message_columns"]
