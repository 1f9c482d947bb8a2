# SPDX-License-Identifier: GPL-3.0-or-later
"""Bake, clear, reset."""

import bpy

from ..addon import dress, jobs, live, write
from ..addon.bake import bake
from ..core.drive import drive
from . import support


class PALPATE_OT_bake(support.Reporting, bpy.types.Operator):
    """Compute all frames of the scene and write tactile images, recordings, force arrows and heat maps. ESC stops it and keeps
    what was there before"""

    bl_idname = "palpate.bake"
    bl_label = "Bake"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if context.scene is None or not live.has_roles(context.scene):
            cls.poll_message_set("No object has a role: make a sensor and a target first")
            return False
        if live.is_baking():
            cls.poll_message_set("A bake is running")
            return False
        return True

    def invoke(self, context, _event):
        if bpy.app.background:
            return self.execute(context)
        return self.reporting(lambda: self._start(context))

    def run(self, context):
        support.leave_edit_mode(context)
        baked = drive(bake(context.scene))
        self._say(baked)

    def _start(self, context):
        support.leave_edit_mode(context)
        self._slice = jobs.Slice(bake(context.scene))
        self._slice.work(0.0)  # what is wrong from the beginning is said at once
        manager = context.window_manager
        self._timer = manager.event_timer_add(0.01, window=context.window)
        manager.progress_begin(0.0, 1.0)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC" and event.value == "PRESS":
            self._slice.cancel()
            self._end(context)
            self.report({"WARNING"}, "Bake stopped; what was there before is unchanged")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"RUNNING_MODAL"}  # nothing may change under the bake
        result = None
        try:
            result = self.reporting(lambda: self._work(context))
        finally:  # an error of ours, too, ends the operator: no timer and no progress may be left of it
            if result != {"RUNNING_MODAL"}:
                self._end(context)
        return result

    def _work(self, context):
        self._slice.work()
        if self._slice.is_done:
            self._say(self._slice.result)
            return {"FINISHED"}
        progress = self._slice.progress
        context.window_manager.progress_update(progress.done / progress.total)
        context.workspace.status_text_set(f"{progress.stage}: frame {progress.frame}    ESC: stop")
        _redraw_panels(context)
        return {"RUNNING_MODAL"}

    def cancel(self, context):
        """Blender closes, or loads another file."""
        self._slice.cancel()
        self._end(context)

    def _end(self, context):
        self._slice.cancel()
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)
        _redraw_panels(context)

    def _say(self, baked):
        for warning in baked.recording.warnings:
            self.report({"WARNING"}, warning)
        frames = baked.recording.frames
        names = ", ".join(f"'{name}'" for name in baked.folders)
        self.report({"INFO"}, f"Baked frames {frames[0]} to {frames[-1]} of {names}")


def _redraw_panels(context):
    for area in context.screen.areas:
        if area.type in {"PROPERTIES", "VIEW_3D"}:
            area.tag_redraw()


class PALPATE_OT_bake_clear(support.Reporting, bpy.types.Operator):
    """Remove baked keyframes, force arrows and heat maps, and put free bodies back to their start. Files on disk stay"""

    bl_idname = "palpate.bake_clear"
    bl_label = "Clear Bake"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if context.scene is None or not write.has_bake(context.scene):
            cls.poll_message_set("Nothing is baked in this scene")
            return False
        return True

    def run(self, context):
        support.leave_edit_mode(context)
        write.clear(context.scene)
        live.reset(context.scene)


class PALPATE_OT_reset(support.Reporting, bpy.types.Operator):
    """Forget what playing has computed and put free bodies back to where they start"""

    bl_idname = "palpate.reset"
    bl_label = "Reset"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if context.scene is None or not live.has_roles(context.scene):
            cls.poll_message_set("No object has a role")
            return False
        if write.baked_objects(context.scene):
            cls.poll_message_set("The scene is baked: use Clear Bake")
            return False
        return True

    def run(self, context):
        live.reset(context.scene)


class PALPATE_OT_dress(support.Reporting, bpy.types.Operator):
    """Show the bake with the present colours, scales, arrows and markers; nothing is computed"""

    bl_idname = "palpate.dress"
    bl_label = "Apply to Bake"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if context.scene is None or not write.baked_objects(context.scene):
            cls.poll_message_set("Nothing is baked in this scene")
            return False
        return True

    def run(self, context):
        support.leave_edit_mode(context)
        dress.again(context.scene, write.bake_folders(context.scene))


CLASSES = (PALPATE_OT_bake, PALPATE_OT_bake_clear, PALPATE_OT_reset, PALPATE_OT_dress)
