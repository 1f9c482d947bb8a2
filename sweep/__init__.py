# SPDX-License-Identifier: GPL-3.0-or-later
"""Studies of many runs: what becomes of the folder of runs that `palpate sweep` fills.

:mod:`.dataset` makes the dataset and the table of runs, :mod:`.report` the page about them, :mod:`.exports` other formats.
"""
