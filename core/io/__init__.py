# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading and writing files; each format has a module of its own, imported when it is needed."""
