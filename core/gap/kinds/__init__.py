# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds of effects, whatever their formulas: which of them recordings can tell apart, and which sets explain recordings.

``palpate gap`` uses the first for its plans. Effects are found by :mod:`..selection`, which asks the search by kinds
(``search``, ``decision``) where the library's formulas leave doubts.

``dictionaries`` says what each kind can add to a signal, ``cascade`` composes all kinds between contact and reading, and
``normal_equations`` fits any set of them. ``search`` scores sets and ``decision`` names the kinds. ``distinguishability``
computes from the stimulus which kinds recordings can tell apart.
"""

__all__ = ["decision", "decision_numbers", "distinguishability", "recorded", "search"]
