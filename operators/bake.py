# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators for bakes and for the live simulation: bake, clear, display, compute missing frames, reset."""

import bpy
from bpy.props import BoolProperty

from ..addon.bake.bake import bake
from ..addon.bake.scene_writer import keyframe_warning
from ..addon.display import bake_display, baked_scene
from ..addon.timeline import playback
from . import modal_job, support


class PALPATE_OT_bake(modal_job.ModalJob, bpy.types.Operator):
    """Compute all frames of the scene and write tactile images, recordings, force arrows and heat maps. ESC stops it and keeps
    the earlier bake"""

    bl_idname = "palpate.bake"
    bl_label = "Bake"

    needs = (
        support.SCENE,
        support.Condition(
            lambda context: playback.has_participants(context.scene), "No object has a role: make a sensor and a target first"
        ),
        support.IDLE,
    )
    stopped = "Bake stopped; the earlier bake is unchanged"

    def job(self, context):
        support.leave_edit_mode(context)
        if warning := keyframe_warning(context.scene):
            self.report({"WARNING"}, warning)
        return bake(context.scene)

    def done(self, baked):
        frames = baked.recording.frames
        names = ", ".join(f"'{name}'" for name in baked.folders)
        self.report({"INFO"}, f"Baked frames {frames[0]} to {frames[-1]} of {names}")
        for warning in baked.recording.warnings:  # the status bar shows the last
            self.report({"WARNING"}, warning)


def is_user_input(event) -> bool:
    """Return True for the press of a key or of a mouse button, but not of ESC."""
    return event.value == "PRESS" and event.type not in {"ESC", "TIMER"}


class PALPATE_OT_catch_up(modal_job.ModalJob, bpy.types.Operator):
    """Compute the frames that are missing up to the present one, and show it. ESC stops and keeps what was computed"""

    bl_idname = "palpate.catch_up"
    bl_label = "Compute to Here"
    bl_options = {"REGISTER"}
    needs = (
        support.SCENE,
        support.Condition(
            lambda context: bool(playback.missing_frames(context.scene)), "No frame is missing up to the current one"
        ),
        support.IDLE,
    )
    stopped = "Stopped; computed frames are kept"

    by_itself: BoolProperty(
        name="By Itself",
        description="Begun by a jump on the timeline: any key or click ends it and does what it always does",
        options={"HIDDEN", "SKIP_SAVE"},
    )

    def job(self, context):
        self._was_playing = context.screen is not None and context.screen.is_animation_playing
        if self._was_playing:
            bpy.ops.screen.animation_cancel(restore_frame=False)  # playing would change the frame during the computation
        return playback.compute_to_present_frame(context.scene)

    def modal(self, context, event):
        if event.type == "SPACE" and event.value == "PRESS":  # the user does not want to go on playing afterwards
            self._was_playing = False
        elif self.by_itself and is_user_input(event):
            return self.stop(context) | {"PASS_THROUGH"}  # nobody asked for the computation
        return super().modal(context, event)

    def done(self, result):
        if self._was_playing:  # playing goes on; it was interrupted because it had skipped frames
            bpy.ops.screen.animation_play()


class PALPATE_OT_bake_clear(support.PalpateOperator, bpy.types.Operator):
    """Remove baked keyframes, force arrows and heat maps, and reset free bodies. Files on disk stay"""

    bl_idname = "palpate.bake_clear"
    bl_label = "Clear Bake"

    needs = (
        support.SCENE,
        support.Condition(lambda context: baked_scene.has_bake(context.scene), "Nothing is baked in this scene"),
    )

    def run(self, context):
        support.leave_edit_mode(context)
        baked_scene.clear_scene(context.scene)
        playback.reset(context.scene)


class PALPATE_OT_reset(support.PalpateOperator, bpy.types.Operator):
    """Discard the frames computed while playing and reset free bodies"""

    bl_idname = "palpate.reset"
    bl_label = "Reset"

    needs = (
        support.SCENE,
        support.Condition(lambda context: playback.has_participants(context.scene), "No object has a role"),
        support.Condition(lambda context: not baked_scene.baked_objects(context.scene), "The scene is baked: use Clear Bake"),
    )

    def run(self, context):
        playback.reset(context.scene)


class PALPATE_OT_display_refresh(support.PalpateOperator, bpy.types.Operator):
    """Show the bake with the current colours, scales, arrows and markers; nothing is computed"""

    bl_idname = "palpate.display_refresh"
    bl_label = "Apply to Bake"

    needs = (
        support.SCENE,
        support.Condition(lambda context: bool(baked_scene.baked_objects(context.scene)), "Nothing is baked in this scene"),
    )

    def run(self, context):
        support.leave_edit_mode(context)
        bake_display.refresh(context.scene, baked_scene.bake_folders(context.scene))
