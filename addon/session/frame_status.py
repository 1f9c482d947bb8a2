# SPDX-License-Identifier: GPL-3.0-or-later
"""Status of the frame at which each scene stands. The timeline writes it; panels and overlays read it."""

from __future__ import annotations

from dataclasses import dataclass

from ...core.model.recording import Frame
from . import session_state


@dataclass(frozen=True)
class FrameStatus:
    """Status of the present frame, for the panel.

    Attributes
    ----------
    text : str
        One or more sentences for the user.
    frame : Frame or None
        The numbers of this frame, where there are any.
    step : str
        Why the solver chose its substep.
    warnings : str
        Sentences about what is wrong with the numbers; empty where nothing is.
    """

    text: str
    frame: Frame | None = None
    step: str = ""
    warnings: str = ""


_statuses: dict[int, FrameStatus] = {}


def status_of(scene) -> FrameStatus:
    """Return the status of a scene's present frame; fast enough to be called while drawing."""
    return _statuses.get(scene.session_uid, FrameStatus("Not computed: play from the first frame."))


def set_status(scene, text: str, frame: Frame | None = None, step: str = "", warnings: str = "") -> None:
    """Replace what is known about a scene's present frame; see :class:`FrameStatus`."""
    _statuses[scene.session_uid] = FrameStatus(text, frame, step, warnings)


def forget(scene=None) -> None:
    """Forget the status of a scene, or of every scene."""
    session_state.forget(_statuses, scene)
