# SPDX-License-Identifier: GPL-3.0-or-later
"""Forward selection of the effects that a base model misses, and the verdict on them.

``diagnosis`` runs it all. Candidates are screened by score tests, fitted, and judged on stretches of the recordings that no fit
has seen. ``findings`` holds the result.
"""

__all__ = [
    "base_model",
    "candidates",
    "check_recordings",
    "confidence",
    "diagnosis",
    "findings",
    "gap_sizes",
    "identifiability",
    "silenced_texels",
    "unfitted",
]
