# SPDX-License-Identifier: GPL-3.0-or-later
"""From measurements of a real sensor to what its model misses.

The packages stand in the order of the data: ``dataset`` reads a rig, ``forward`` predicts its recordings, ``data_faults`` finds
what loggers did to them, ``fitting`` fits parameters, ``base`` the base model, ``candidates`` lists what may be missing,
``selection`` finds those that act, ``planning`` computes which kinds of effects recordings can tell apart and plans the next
experiment, ``report`` writes the result.
``calibration`` finds single parameters, stiffness and friction, from measurements of their own. ``logs`` makes a rig from the
files of other people's loggers.
"""

__all__ = ["calibration", "data_faults", "dataset", "fitting", "forward", "logs", "planning", "report", "selection"]
