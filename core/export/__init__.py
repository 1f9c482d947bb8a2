# SPDX-License-Identifier: GPL-3.0-or-later
"""A bake as files for other programs: one module per format in :mod:`.formats`, which :mod:`.exporter` loads.

All files hold SI units, in the frames and with the signs of :mod:`..model.recording`. A new format is one new module in
:mod:`.formats` and a line of :mod:`.format_table`, from which the command line and the scene's figure settings take it.
"""

__all__ = ["exporter", "format_table", "formats"]
