# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds of effects, whatever their formulas: which of them recordings can tell apart.

``palpate gap`` uses it for its plans; effects are found by :mod:`..selection`.

``dictionaries`` says what each kind can add to a signal, ``columns`` what becomes of it in readings and net forces, and
``normal_equations`` sums products of these. ``distinguishability`` computes from the stimulus which kinds recordings can tell
apart.
"""

__all__ = ["decision_numbers", "distinguishability", "recorded"]
