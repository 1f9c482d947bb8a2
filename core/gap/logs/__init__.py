# SPDX-License-Identifier: GPL-3.0-or-later
"""From the logs that a laboratory has to a rig: files of many kinds in, ``rig.toml`` and CSV files in SI units out.

:mod:`.log_file` reads a log as tables of named columns. :mod:`.proposal` makes a list of guesses, each a :mod:`.guess` with its
reason. A user corrects and completes it as a file, or by :mod:`.questions`: then it is :mod:`.answers`, from which
:mod:`.new_rig` writes the rig.
"""

__all__ = ["answers", "guess", "log_file", "log_table", "new_rig", "preview", "proposal", "questions"]
