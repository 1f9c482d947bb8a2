# SPDX-License-Identifier: GPL-3.0-or-later
"""Results that runs of one task share, because they follow from what the runs have in common."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")

MOST_OF_EACH = 4
"""Results of a function that are kept: runs of a study go through its scenes one after the other, and each may be large."""


class SharedResults:
    """The last results of functions.

    Arguments that are numbers, texts or bytes are compared by value. All others are compared by identity, which takes no time
    for a mesh of a million faces: they and the results must not be changed.
    """

    def __init__(self) -> None:
        self._kept: dict[Callable[..., Any], dict[tuple[Any, ...], tuple[Any, Any]]] = {}

    def of(self, function: Callable[Parameters, Result], *arguments: Parameters.args, **named: Parameters.kwargs) -> Result:
        """Return the function's result for the arguments, which is computed if it is none of the last ones."""
        kept = self._kept.setdefault(function, {})
        key = tuple(one if isinstance(one, (int, float, str, bytes)) else id(one) for one in (*arguments, *named.values()))
        found = kept.pop(key, None)
        if found is None:
            # The arguments are kept, so that no other object gets their identity.
            found = (arguments, named), function(*arguments, **named)
        kept[key] = found  # the last one now
        if len(kept) > MOST_OF_EACH:
            del kept[next(iter(kept))]
        result: Result = found[1]
        return result
