# SPDX-License-Identifier: GPL-3.0-or-later
"""Dynamics of a step: contacts linearised and summed, friction states and effects, and the linear system of velocities.

Passivity, the modes of bodies, actuators with their commands and grip control, relative motion of bodies, and free rotation
stand here as well.
"""

__all__ = ["actuators", "contact_assembly", "effect_kernels", "friction_state", "linear_system", "modes"]
