# SPDX-License-Identifier: GPL-3.0-or-later
"""The formulas of contact: normal law, LuGre friction and series compliance, each written once.

They are small compiled functions that take a :class:`.ContactLaw`. The solver, the effects, the gap analysis and the
calibration call them; none of those writes a formula of its own.
"""

__all__ = ["contact_law", "contact_stiffness", "friction", "normal_force"]
