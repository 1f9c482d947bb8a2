# SPDX-License-Identifier: GPL-3.0-or-later
"""The next experiment: what recordings can tell apart, and the trajectory that tells best what they cannot.

``limits`` says how far the probe may go, ``programmes`` are sequences of presses, ``paths`` makes trajectories of them.
``outlook`` says how sure one may be, ``design`` computes it for a further recording and looks for the best one, and
``experiment_plan`` puts it together.
"""

__all__ = ["experiment_plan", "limits", "outlook", "paths", "programmes"]
