# SPDX-License-Identifier: GPL-3.0-or-later
"""What a search by kinds says: which kinds act, how well each is supported, and which others would do as well.

Of all sets that come near the best score the smallest counts. A kind's support is by how much the best set without it is worse
than the best set with it. Kinds that can take its place, beside the same others, at hardly a worse score are its rivals; they
and the kind are one group of which the recordings do not tell the member.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from .decision_numbers import LEAST_SUPPORT, RIVAL_MARGIN, TIE
from .search import KindSearch, ScoredSet, floor_of


@dataclass(frozen=True)
class NamedKind:
    """A kind that acts.

    Attributes
    ----------
    kind : str
    support : float
        By how much the best score without it is worse.
    rivals : tuple of str
        Kinds that would do nearly as well in its place.
    leaves : dict of str to float
        How many times as much of the gap each other kind that was fitted in its place leaves.
    """

    kind: str
    support: float
    rivals: tuple[str, ...]
    leaves: dict[str, float] = field(default_factory=dict)

    @property
    def is_clear(self) -> bool:
        """Whether it is supported and has no rival."""
        return self.support >= LEAST_SUPPORT and not self.rivals


@dataclass(frozen=True)
class Decision:
    """The set of kinds that acts.

    Attributes
    ----------
    chosen : ScoredSet
    named : tuple of NamedKind
    without_kinds : float
        What the base model alone leaves above the noise.
    """

    chosen: ScoredSet
    named: tuple[NamedKind, ...]
    without_kinds: float = 0.0

    @property
    def kinds(self) -> frozenset[str]:
        """Names of all of them."""
        return self.chosen.kinds

    @property
    def clear(self) -> dict[str, NamedKind]:
        """Those that are supported and have no rival, by name."""
        return {one.kind: one for one in self.named if one.is_clear}

    @property
    def is_clear(self) -> bool:
        """Whether each of them is supported and has no rival."""
        return all(one.is_clear for one in self.named)


def decided(search: KindSearch) -> Decision:
    """Return what a finished search says."""
    near = [one for one in search.fitted if one.score <= search.best.score + TIE]
    chosen = min(near, key=lambda one: (len(one.kinds), one.score))
    named = []
    for kind in sorted(chosen.kinds):
        beside = chosen.kinds - {kind}
        others = [
            one for one in search.fitted if len(one.kinds) == len(chosen.kinds) and beside < one.kinds and kind not in one.kinds
        ]
        names = [next(iter(one.kinds - beside)) for one in others]
        rivals = [name for name, one in zip(names, others, strict=True) if one.score <= chosen.score + RIVAL_MARGIN]
        least = floor_of(search.recorded)
        leaves = {
            name: (one.solution.excess + least) / (chosen.solution.excess + least)
            for name, one in zip(names, others, strict=True)
        }
        named.append(NamedKind(kind, search.support(kind), tuple(rivals), leaves))
    return Decision(chosen, tuple(named), search.none.solution.excess)
