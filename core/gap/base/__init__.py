# SPDX-License-Identifier: GPL-3.0-or-later
"""The base model of a rig: which of its parameters the recordings identify, its fit, and how recordings differ."""

__all__ = ["base_model", "contact_heights", "quantities", "recording_differences"]
