# SPDX-License-Identifier: GPL-3.0-or-later
"""The next experiment: which kinds of effects recordings separate, and which of a dozen programmes separates the others best.

``paths`` says how far the probe may go, names sequences of motions, and makes trajectories of them.
``separation`` asks the forward model how well recordings separate two kinds, and ``experiment_plan`` chooses the programme.
"""

__all__ = ["experiment_plan", "paths", "separation"]
