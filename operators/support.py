# SPDX-License-Identifier: GPL-3.0-or-later
"""Base classes of operators: errors are reported in one place, and a grey button says why."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import bpy
from bpy_extras.io_utils import ImportHelper

from ..addon.measured import gap_results
from ..addon.scene import participants
from ..addon.session import session_state
from ..core.errors import PalpateError

BAKE, STUDY = "PALPATE_OT_bake", "PALPATE_OT_study_run"
"""The operators that compute a bake and a study, among the jobs of the session."""


class Condition(NamedTuple):
    """What an operator needs, and the sentence for where it is missing, in which {name} is the active object's."""

    is_met: Callable[[Any], bool]
    missing: str


class Conditions:
    """Mixin for an operator whose button is grey, and says why, where one of `needs` is not met."""

    needs: tuple[Condition, ...] = ()

    @classmethod
    def poll(cls, context):
        missing = next((need.missing for need in cls.needs if not need.is_met(context)), None)
        if missing is not None:
            cls.poll_message_set(missing.replace("{name}", context.object.name if context.object else ""))
        return missing is None


class PalpateOperator(Conditions):
    """Mixin for an operator whose work is `run(context)`: a PalpateError is reported as an error message."""

    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        return self.report_errors_of(lambda: self.run(context))

    def report_errors_of(self, work):
        """Call `work` and return its result or FINISHED; report a PalpateError and return CANCELLED."""
        try:
            return work() or {"FINISHED"}
        except PalpateError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}


class FileChooser(ImportHelper):
    """Mixin: the file browser opens in the folder of the .blend, without the .blend's own name as the file."""

    def invoke(self, context, event):
        if not self.filepath and bpy.data.filepath:
            self.filepath = str(Path(bpy.data.filepath).parent) + os.sep
        return super().invoke(context, event)


def leave_edit_mode(context) -> None:
    """Switch to Object Mode: in Edit Mode, Blender's undo restores the edited mesh only and not the properties of objects."""
    if context.object is not None and context.object.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")


ACTIVE = Condition(lambda context: context.object is not None, "Make an object active first")
SURFACE = (
    ACTIVE,
    Condition(
        lambda context: context.object.type in participants.OBJECT_TYPES,
        "'{name}' has no surface: choose a mesh, curve, surface, text or metaball",
    ),
    Condition(
        lambda context: context.object.is_editable,
        "'{name}' is linked from another file: use Object › Relations › Make Local first",
    ),
)
"""The active object has a surface and can be changed."""
MESH = (
    *SURFACE,
    Condition(lambda context: context.object.type == "MESH", "'{name}' is not a mesh: use Object › Convert › Mesh first"),
    Condition(
        lambda context: context.object.data.is_editable,
        "The mesh of '{name}' is linked from another file: "
        "use Object › Relations › Make Local › Selected Objects and Data first",
    ),
)
"""The active object is a mesh object whose mesh belongs to this file."""
IS_SENSOR = Condition(
    lambda context: context.object.palpate.role in {"SENSOR", "PAD"}, "'{name}' is not a sensor: use Make Sensor first"
)
SENSOR = (ACTIVE, IS_SENSOR)
"""The active object is a sensor or a pad. It may be linked from another file."""
EDITABLE_SENSOR = (*SURFACE, IS_SENSOR)
MEASURED_SENSOR = (
    *EDITABLE_SENSOR,
    Condition(lambda context: bool(context.object.palpate.measured), "Choose the sensor's measurements first: Open Rig"),
)
IS_GAP_FOUND = Condition(
    lambda context: gap_results.of(context.object) is not None, "Nothing was found yet: use Find Gap first"
)
GAP_FOUND = (*EDITABLE_SENSOR, IS_GAP_FOUND)
SCENE = Condition(lambda context: context.scene is not None, "There is no scene")
ANY_SENSOR = Condition(
    lambda context: any(obj.palpate.role == "SENSOR" for obj in context.scene.objects),
    "There is no sensor in this scene: use Make Sensor first",
)


def _is_idle(_context) -> bool:
    session = session_state.session
    return BAKE not in session.jobs and not session.catching_up and not session.rendering


IDLE = Condition(_is_idle, "Frames are being computed or rendered")
"""No bake, no computation of missing frames and no render is running: each of them moves the scene to other frames."""
NO_STUDY = Condition(
    lambda _context: STUDY not in session_state.session.jobs, "A study is running: wait for it, or press ESC to stop it"
)
