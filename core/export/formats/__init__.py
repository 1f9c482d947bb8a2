# SPDX-License-Identifier: GPL-3.0-or-later
"""The formats of exports: each module defines one ``EXPORTER`` (:class:`..exporter.Exporter`) and is loaded when it writes.

Each imports the libraries it needs inside its functions.
"""

__all__ = []
