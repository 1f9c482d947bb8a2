# SPDX-License-Identifier: GPL-3.0-or-later
"""The effects: each module defines one ``KIND``, as :mod:`..engine.specification` describes.

A module is found by the registry, and so appears in the panels, in sensor files, in the gap analysis and in docs/effects.md
(run ``python tools/effects_page.py``) without being named anywhere else. It imports only :mod:`math`, numpy, the plain data of
the model and the engine; its laws are compiled when a sensor first uses them.
"""

__all__ = []
