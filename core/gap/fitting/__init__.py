# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits of models to trials, and tests of their residuals.

Least squares with parameters per texel, the scale of forces, intervals of the parameters, the noise floor of the recordings,
which effects the recordings can show (``identifiability``), and three tests of a residual: for structure, for heteroscedastic
noise, for spectral lines.
"""

__all__ = ["force_scale", "identifiability", "intervals", "least_squares", "noise_floor", "residual_tests"]
