# SPDX-License-Identifier: GPL-3.0-or-later
"""From measurements of a real sensor to what its model is missing: rig → compare → diagnose → amend → report."""
