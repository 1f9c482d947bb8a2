# SPDX-License-Identifier: GPL-3.0-or-later
"""What every operator shares: errors become one sentence in one place, and poll says why."""

from __future__ import annotations

import os
from pathlib import Path

import bpy
from bpy_extras.io_utils import ImportHelper

from ..addon.measured import gap_results
from ..addon.scene import participants
from ..addon.session import session_state
from ..core.errors import PalpateError


class ErrorReporting:
    """Mixin: `run(context)` does the work; a PalpateError becomes a red sentence and nothing else."""

    def execute(self, context):
        return self.reporting(lambda: self.run(context))

    def reporting(self, work):
        """Do `work` and return its result, or report the user's error and return CANCELLED."""
        try:
            return work() or {"FINISHED"}
        except PalpateError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}


def poll_idle(cls) -> bool:
    """Poll: no frames are being computed, by a bake or after a jump on the timeline."""
    if session_state.is_baking() or session_state.session.catching_up:
        cls.poll_message_set("Frames are being computed")
        return False
    return True


class FileChooser(ImportHelper):
    """Mixin: a file is chosen beside the .blend; Blender by itself would fill in the name of the .blend."""

    def invoke(self, context, event):
        if not self.filepath and bpy.data.filepath:
            self.filepath = str(Path(bpy.data.filepath).parent) + os.sep
        return super().invoke(context, event)


def poll_surface_object(cls, context) -> bool:
    """Poll: there is an active object that could take part."""
    obj = context.object
    if obj is None:
        cls.poll_message_set("Make an object active first")
    elif obj.type not in participants.OBJECT_TYPES:
        cls.poll_message_set(f"'{obj.name}' has no surface: choose a mesh, curve, surface, text or metaball")
    elif not obj.is_editable:
        cls.poll_message_set(f"'{obj.name}' is linked from another file: use Object › Relations › Make Local first")
    else:
        return True
    return False


def poll_mesh_object(cls, context) -> bool:
    """Poll: there is an active mesh object whose mesh is of this file."""
    if not poll_surface_object(cls, context):
        return False
    if context.object.type != "MESH":
        cls.poll_message_set(f"'{context.object.name}' is no mesh: use Object › Convert › Mesh first")
        return False
    if not context.object.data.is_editable:
        cls.poll_message_set(
            f"The mesh of '{context.object.name}' is linked from another file: "
            "use Object › Relations › Make Local › Selected Objects and Data first"
        )
        return False
    return True


def poll_editable_sensor(cls, context) -> bool:
    """Poll: the active object is a sensor or a pad that can be changed."""
    return poll_surface_object(cls, context) and poll_sensor(cls, context)


def poll_sensor(cls, context) -> bool:
    """Poll: the active object is a sensor or a pad, perhaps of another file; enough for what does not change it."""
    if context.object is None:
        cls.poll_message_set("Make an object active first")
        return False
    if context.object.palpate.role not in {"SENSOR", "PAD"}:
        cls.poll_message_set(f"'{context.object.name}' is no sensor: use Make Sensor first")
        return False
    return True


def leave_edit_mode(context) -> None:
    """Go to Object Mode.

    In Edit Mode Blender's undo remembers the mesh being edited and no properties, so that undo could not take back a role.
    """
    if context.object is not None and context.object.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")


def poll_gap_found(cls, context) -> bool:
    """Poll: something was found for the active sensor."""
    if not poll_editable_sensor(cls, context):
        return False
    if gap_results.of(context.object) is None:
        cls.poll_message_set("Nothing was found yet: use Find Gap first")
        return False
    return True
