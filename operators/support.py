# SPDX-License-Identifier: GPL-3.0-or-later
"""Base classes of operators: errors are reported in one place, and polls say why a button is greyed out."""

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
    """Mixin for an operator whose work is `run(context)`: a PalpateError is reported as an error message."""

    def execute(self, context):
        return self.report_errors_of(lambda: self.run(context))

    def report_errors_of(self, work):
        """Call `work` and return its result or FINISHED; report a PalpateError and return CANCELLED."""
        try:
            return work() or {"FINISHED"}
        except PalpateError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}


def poll_idle(cls) -> bool:
    """Poll: no bake and no computation of missing frames is running."""
    if session_state.is_baking() or session_state.session.catching_up:
        cls.poll_message_set("Frames are being computed")
        return False
    return True


class FileChooser(ImportHelper):
    """Mixin: the file browser opens in the folder of the .blend, without the .blend's own name as the file."""

    def invoke(self, context, event):
        if not self.filepath and bpy.data.filepath:
            self.filepath = str(Path(bpy.data.filepath).parent) + os.sep
        return super().invoke(context, event)


def poll_surface_object(cls, context) -> bool:
    """Poll: the active object has a surface and can be changed."""
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
    """Poll: the active object is a mesh object whose mesh belongs to this file."""
    if not poll_surface_object(cls, context):
        return False
    if context.object.type != "MESH":
        cls.poll_message_set(f"'{context.object.name}' is not a mesh: use Object › Convert › Mesh first")
        return False
    if not context.object.data.is_editable:
        cls.poll_message_set(
            f"The mesh of '{context.object.name}' is linked from another file: "
            "use Object › Relations › Make Local › Selected Objects and Data first"
        )
        return False
    return True


def poll_any_sensor(cls, context) -> bool:
    """Poll: the scene has a sensor."""
    if not any(obj.palpate.role == "SENSOR" for obj in context.scene.objects):
        cls.poll_message_set("There is no sensor in this scene: use Make Sensor first")
        return False
    return True


def poll_editable_sensor(cls, context) -> bool:
    """Poll: the active object is a sensor or a pad, and can be changed."""
    return poll_surface_object(cls, context) and poll_sensor(cls, context)


def poll_sensor(cls, context) -> bool:
    """Poll: the active object is a sensor or a pad. It may be linked from another file."""
    if context.object is None:
        cls.poll_message_set("Make an object active first")
        return False
    if context.object.palpate.role not in {"SENSOR", "PAD"}:
        cls.poll_message_set(f"'{context.object.name}' is not a sensor: use Make Sensor first")
        return False
    return True


def leave_edit_mode(context) -> None:
    """Switch to Object Mode: in Edit Mode, Blender's undo restores the edited mesh only and not the properties of objects."""
    if context.object is not None and context.object.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")


def poll_measured_sensor(cls, context) -> bool:
    """Poll: the active object is a sensor or a pad that can be changed, and a rig with its measurements was chosen."""
    if not poll_editable_sensor(cls, context):
        return False
    if not context.object.palpate.measured:
        cls.poll_message_set("Choose the sensor's measurements first: Open Rig")
        return False
    return True


def poll_gap_found(cls, context) -> bool:
    """Poll: a gap was found for the active sensor."""
    if not poll_editable_sensor(cls, context):
        return False
    if gap_results.of(context.object) is None:
        cls.poll_message_set("Nothing was found yet: use Find Gap first")
        return False
    return True


def poll_scene(cls, context) -> bool:
    """Poll: there is a scene."""
    if context.scene is None:
        cls.poll_message_set("There is no scene")
        return False
    return True


def poll_study(cls, context) -> bool:
    """Poll: there is a scene, and no study runs."""
    if session_state.session.study_progress is not None:
        cls.poll_message_set("A study is running: wait for it, or press ESC to stop it")
        return False
    return poll_scene(cls, context)
