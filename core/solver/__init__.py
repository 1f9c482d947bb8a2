# SPDX-License-Identifier: GPL-3.0-or-later
"""The solver: scenario → recording, substep by substep, as compiled kernels on plain arrays.

:mod:`.simulation` is the loop over frames and :mod:`.substep` that over the steps of a frame. :mod:`.detection` finds the
contacts. :mod:`.implicit_velocities` solves for the velocities with the parts in :mod:`.dynamics`, which also advances
friction. The formulas of contact themselves stand in laws/. :mod:`.pressing` runs single steps for the loops of other programs,
of any number of environments that share what :mod:`.pressed_model` builds. Warp's kernels of the same step use
parts of :mod:`.detection` and :mod:`.dynamics`.
"""

__all__ = [
    "detection",
    "dynamics",
    "jumps",
    "precompile",
    "pressed_model",
    "pressing",
    "simulation",
    "time_step_adviser",
]
