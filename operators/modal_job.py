# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work beside the window: a slice at each tick of a timer, progress in the status bar, ESC stops it."""

from __future__ import annotations

import bpy

from ..core.jobs.job_runner import SlicedJob, run_job
from . import support


class ModalJob(support.ErrorReporting):
    """Mixin: `job(context)` returns the generator, `done(result)` says what came of it, `stopped` is said after ESC."""

    stopped = "Stopped"

    def invoke(self, context, _event):
        if bpy.app.background:
            return self.execute(context)
        return self.reporting(lambda: self._start(context))

    def run(self, context):
        self.done(run_job(self.job(context)))

    def done(self, result):
        """Report what was done."""

    def _start(self, context):
        self._slice = SlicedJob(self.job(context))
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
            self.report({"WARNING"}, self.stopped)
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"RUNNING_MODAL"}  # nothing may change under the work
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
            self.done(self._slice.result)
            return {"FINISHED"}
        progress = self._slice.progress
        share = progress.share
        context.window_manager.progress_update(share)
        context.workspace.status_text_set(f"{progress.text}, {share:.0%}    ESC: stop")
        redraw_panels(context)
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
        redraw_panels(context)


def redraw_panels(context):
    """Draw again what shows progress."""
    for area in context.screen.areas:
        if area.type in {"PROPERTIES", "VIEW_3D"}:
            area.tag_redraw()
