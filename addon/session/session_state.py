# SPDX-License-Identifier: GPL-3.0-or-later
"""What the session remembers and no file does: who takes part, what is running, what should not be disturbed."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass, field


@dataclass
class Session:
    """What handlers, bake and panels share."""

    settled: bool = False
    """Whether what the file holds was looked through; also a file that was open before the add-on was enabled."""
    participants_known: bool = False
    """False when objects may have got or lost a role since `has_roles` was filled."""
    changed_geometry: set[str] = field(default_factory=set)
    """Names of objects whose geometry was touched since the last look."""
    geometry_version: int = 0
    """Counts changes of any object's geometry, for what is shown while a sensor is made."""
    changed_motion: set[str] = field(default_factory=set)
    """Names of objects that were moved by hand, by a script or by an edited animation since a run began."""
    has_roles: dict[int, bool] = field(default_factory=dict)
    object_counts: dict[int, int] = field(default_factory=dict)
    """By scene: whether any object takes part, and how many objects it had when that was found out."""
    suspended: int = 0
    """Above zero while a bake reads the scene: the timeline must not simulate then."""
    rendering: bool = False
    catching_up: bool = False
    """While frames that a jump has left out are computed."""
    bake: object = None
    """The running bake's last Progress, for the panel."""
    notes: dict[str, str] = field(default_factory=dict)
    """By scene or object name: what is wrong with settings that could not be read."""


session = Session()


def participants_changed() -> None:
    """Look for the participants anew next time."""
    session.participants_known = False


@contextmanager
def suspended():
    """Keep the timeline handler quiet."""
    session.suspended += 1
    try:
        yield
    finally:
        session.suspended = max(0, session.suspended - 1)  # it is zero already when another file was opened meanwhile


def reset() -> None:
    """Start over, because another file is open or the add-on is being disabled."""
    session.__init__()
