# SPDX-License-Identifier: GPL-3.0-or-later
"""The numbers of the rule that names what a model lacks: all that decide, each with the experiment that set it.

What is a matter of speed alone (how many models are tried) stands in :mod:`.search` and :mod:`.screening`.
"""

from __future__ import annotations

from ...effects.engine.specification import EXACT_FORM_ERROR

STRETCHES = 8
"""M: independent stretches in the recordings. Programmes of presses repeat themselves, so there are far fewer of them than
samples. With every block as a stretch of its own, load spreading in another formula was called crosstalk."""
BLOCKS = 8
"""Blocks of a recording, of about three seconds: long against the noise, and enough for a bootstrap."""
MEMORIES = 5.0
"""Least length of a block in correlation times of the noise, as long as two blocks remain: then blocks are independent."""
FORMULA_ERROR = 0.05
"""φ: share of the mean square of a kind's change that its formulas leave of a sensor that follows another formula, where the
recordings show no larger one. The textbook forms of load spreading leave 0.04 to 0.09 of other kernels in the middle, and 0.25
at most; a form that is free to follow any law states its own (:attr:`.specification.Form.error`)."""
FREE_FORM_ERROR = EXACT_FORM_ERROR
"""φ of a gain and a zero of each recording, as of a gain of each texel: every gain and zero is one of these."""
LARGEST_FORMULA_ERROR = 0.25
"""Largest φ that recordings may show: two forms of which one leaves more describe two kinds of things."""
LEAST_NOISE_ERROR = 0.01
"""Least standard error of the noise's mean square, as a share of it: readings with and without load have the same noise to
about a hundredth."""
LEAST_VALUES = 200
"""Values without load from which on their mean square is known to ten per cent."""
DRAWS = 200
"""Draws of the Bayesian bootstrap: a standard error is then known to five per cent."""
NEAR_ERRORS = 1.0
"""Models within so many standard errors of the best count as equal, and the smallest of them wins: the usual rule."""
FIT_TOLERANCE = 1e-4
"""Share of the squares below which a step ends the fit of the best models, and so how well scores are known
(:attr:`.score.Score.resolution`, 0.04 at most for one quantity). With 3e-4 and ten steps a Maxwell slip model ended at 1.5
times its share, and wear was named in addition. Gains of zero lead dead texels by up to 0.012 on ten rigs."""
SIGNIFICANT_ERRORS = 2.0
"""What is larger than so many standard errors is significant: the usual two."""
FEWER_NUMBERS = 2.0
"""Of equal models with as many effects, one with so many times fewer numbers wins."""
SURE = 0.5
"""Confidence from which on a name counts as found: it is more likely than not."""
LEAST_WEIGHT = 0.1
"""Least weight of a rival, and of an effect that only helps to predict: odds of one to nine. The leads of 153 development rigs
and 133 judged ones, replayed: with half of it fewer names are sure that are right, with twice one more that is wrong. An effect
that changes nothing has 0.05, by its price; such effects of ten real recordings have 0.25 to 0.43, where they help, and less
than 0.01 elsewhere."""
