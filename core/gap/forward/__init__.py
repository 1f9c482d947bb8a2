# SPDX-License-Identifier: GPL-3.0-or-later
"""The forward model: what a sensor with given parameters and effects reads in a trial.

``stimulus`` computes the contact of each texel, ``force_model`` the forces on it, and ``predictor`` the readings.
``contact_phases`` describes a trial: phases of contact, and the features on which a residual may depend.
"""

__all__ = ["contact_phases", "predictor", "response_check", "stimulus"]
