# SPDX-License-Identifier: GPL-3.0-or-later
"""One rule names the effects that a base model misses.

``diagnosis`` shows the whole road. ``search`` tries sets of effects, ``score`` weighs them by what they leave on stretches of
the recordings that no fit has seen, ``verdict`` names them; the rule's numbers stand in ``rule_numbers``. ``findings`` holds
the result.
"""

__all__ = ["check_recordings", "diagnosis", "findings", "rule_numbers"]
