# SPDX-License-Identifier: GPL-3.0-or-later
"""What a recording cannot tell, whatever is fitted to it: effects whose mark was never brought out."""

from __future__ import annotations

from .noise import Coverage

NEVER_UNLOADED = "nothing was ever unloaded, so that what it leaves behind cannot show"
LEAVES_BEHIND = ("hysteresis", "softening", "adhesion", "wear")
"""Known by what is different after the load was taken back. A formula of theirs also bends the way up, and there it is no more
than a spring that is not straight."""


def untold(coverage: Coverage) -> dict[str, str]:
    """Return the kinds of effects that recordings cannot tell, each with the reason."""
    return {} if coverage.unloading else dict.fromkeys(LEAVES_BEHIND, NEVER_UNLOADED)
