# SPDX-License-Identifier: GPL-3.0-or-later
"""The dictionaries of all kinds, in the order in which they act: what each can add to a signal, column by column.

A kind is not a formula but a cone: all sums of its columns with coefficients from zero on, or of either sign. Each module of
the library of effects states its own (see :class:`...effects.engine.declarations.Variant`).
"""

from __future__ import annotations

from ...effects.engine.declarations import Variant
from ...effects.engine.registry import library

__all__ = ["MISALIGNMENT", "VARIANTS", "Variant"]

_ALL = [variant for kind in library().values() for variant in kind.variants]

_ALL.sort(key=lambda one: (not one.in_contact, one.after_clip, one.rank, one.label))

VARIANTS: tuple[Variant, ...] = tuple(one for one in _ALL if not one.displaces)
"""All kinds in the order in which they act. Misalignment is none of these: it changes what the base model is told."""
MISALIGNMENT = next(one for one in _ALL if one.displaces)
