# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact detection: narrow phase, neighbour lists, shapes in closed form, and surfaces that deform."""

__all__ = ["deformation", "detection_data", "narrow_phase", "neighbour_lists", "shape_contacts", "surface_kinematics"]
