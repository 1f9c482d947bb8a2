# SPDX-License-Identifier: GPL-3.0-or-later
"""From the logs that a laboratory has to a rig: files of many kinds in, ``rig.toml`` and CSV files in SI units out.

:mod:`.log_file` reads a log as tables of named columns. :mod:`.proposal` says what each column seems to be and what is
not known, as :mod:`.answers`. A user completes them. :mod:`.new_rig` writes the rig, with comments that say what was taken for
what.
"""

__all__ = ["answers", "log_file", "log_table", "new_rig", "preview", "proposal", "questions", "template"]
