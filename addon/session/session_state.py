# SPDX-License-Identifier: GPL-3.0-or-later
"""State of the Blender session that no file stores: participants, what is running, what changed since the last look."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import bpy


@dataclass
class Session:
    """State that handlers, bake and panels share."""

    file_examined: bool = False
    """True once the objects of the open file were examined, also when the file was open before the add-on was enabled."""
    changed_geometry: set[str] = field(default_factory=set)
    """Names of objects whose geometry Blender reported as changed, and that were not compared since."""
    geometry_version: int = 0
    """Number of geometry changes of any object; reports on sensors are outdated when it grows."""
    changed_motion: set[str] = field(default_factory=set)
    """Names of objects that the user, a script or an edited animation moved since a live run started."""
    has_roles: dict[int, tuple[int, bool]] = field(default_factory=dict)
    """By scene: the number of its objects, and whether any of them participates. Empty when a role may have changed since."""
    suspension_depth: int = 0
    """Above zero while a bake or another reader of the scene runs: the timeline must not simulate then."""
    rendering: bool = False
    rendered_from: tuple[int, float] = (0, 0.0)
    """The frame at which the scene stood when the render began."""
    render_note: str = ""
    """Parts that the present or last render lacks, in one sentence; empty where nothing is missing."""
    catching_up: bool = False
    """True while the frames that a jump on the timeline left out are computed."""
    jobs: dict[str, object] = field(default_factory=dict)
    """By the class of an operator that works beside the window: its last Progress, for the panel."""
    unreadable_settings: dict[str, str] = field(default_factory=dict)
    """By scene or object name: why its settings could not be read."""


session = Session()

when_settings_change: list[Callable[[], None]] = []
"""Called when the user or a script has changed a setting, which Blender reports to nobody else."""

when_baked: list[Callable[..., None]] = []
"""Called with a scene, its new bake's recording and the folders of its sensors when the bake has been put into the scene."""


def settings_changed(_settings=None, _context=None) -> None:
    """Tell those who want to know; the update function of the properties."""
    for notify in when_settings_change:
        notify()


def participants_changed() -> None:
    """Note that an object may have got or lost its role."""
    session.has_roles.clear()


@contextmanager
def suspended() -> Iterator[None]:
    """Keep the timeline from simulating while the context is open."""
    session.suspension_depth += 1
    try:
        yield
    finally:
        # It is already zero when another file was opened meanwhile.
        session.suspension_depth = max(0, session.suspension_depth - 1)


def forget(states: dict, scene=None) -> None:
    """Forget a state by the numbers of scenes (`session_uid`): that of one scene, or of all."""
    if scene is None:
        states.clear()
    else:
        states.pop(scene.session_uid, None)


def reset() -> None:
    """Reset everything, because another file is open or the add-on is being disabled."""
    session.__init__()


def redraw_panels() -> None:
    """Redraw panels, but no 3D view, because that may take long."""
    for manager in bpy.data.window_managers:
        for window in manager.windows:
            for area in window.screen.areas:
                if area.type == "PROPERTIES":
                    area.tag_redraw()
                for region in area.regions:
                    if region.type == "UI" and area.type == "VIEW_3D":
                        region.tag_redraw()


def redraw_views() -> None:
    """Redraw 3D views and panels."""
    if bpy.app.background:
        return
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in {"VIEW_3D", "PROPERTIES"}:
                area.tag_redraw()


def is_xray(shading) -> bool:
    """Return True where a 3D view draws objects see-through: Solid and Wireframe have a switch each."""
    if shading.type == "WIREFRAME":
        return shading.show_xray_wireframe
    return shading.type == "SOLID" and shading.show_xray
