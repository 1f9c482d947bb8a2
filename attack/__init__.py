# SPDX-License-Identifier: GPL-3.0-or-later
"""Attacks on Palpate: faults, kills, power cuts and bad input, tried in large numbers. ``make attack`` runs them."""
