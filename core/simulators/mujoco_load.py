# SPDX-License-Identifier: GPL-3.0-or-later
"""The load for which contact is put into MuJoCo's terms."""

REFERENCE_MASS = 1.0
"""kg. MuJoCo's contact stiffness is an acceleration per depth: a body sinks in by g times a constant, whatever its mass. The
constant is ours for a body of this mass."""
CONTACTS = 4
"""Contacts of a box that stands on the sensor; they share MuJoCo's stiffness, so the depth is (1 - d) g / (4 stiffness). A
test compares both depths. This holds with elliptic cones; pyramids make contacts stiffer."""
LEAST_DAMPING = 1e-9
"""N·s/m. MuJoCo knows the format of `solref` by both numbers being below zero."""
