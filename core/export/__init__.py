# SPDX-License-Identifier: GPL-3.0-or-later
"""A bake as files for other programs: one module per format in :mod:`.formats`, found by :mod:`.exporter`.

All files hold SI units, in the frames and with the signs of :mod:`..model.recording`. A new format is one new module in
:mod:`.formats` that defines an ``EXPORTER``; the command line, the scene's figure settings and the checks take it from there.
"""

__all__ = ["exporter"]
