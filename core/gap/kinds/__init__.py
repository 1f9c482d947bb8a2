# SPDX-License-Identifier: GPL-3.0-or-later
"""The search by kinds: which sets of kinds of effects explain recordings, whatever their formulas.

``dictionaries`` says what each kind can add to a signal, ``cascade`` composes all kinds between contact and reading, and
``normal_equations`` fits any set of them. ``search`` scores sets and ``decision`` names the kinds. ``distinguishability``
computes from the stimulus which kinds recordings can tell apart.
"""

__all__ = ["decision", "distinguishability", "recorded", "search"]
