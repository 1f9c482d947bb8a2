# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that run a job beside the window: a slice at each tick of a timer, progress in the status bar, ESC to stop."""

from __future__ import annotations

import bpy

from ..addon.session import session_state
from ..core.jobs import SlicedJob, run_job
from . import support


class ModalJob(support.PalpateOperator):
    """Mixin for an operator that runs a job.

    The operator defines `job(context)`, which returns the :class:`.Job`, and `done(result)`, which reports its result.
    `stopped` is the message after ESC. Without a window the job runs in one go.
    """

    stopped = "Stopped"

    @classmethod
    def poll(cls, context):
        if cls.__name__ in session_state.session.jobs:
            cls.poll_message_set("It is running; ESC stops it")
            return False
        return super().poll(context)

    def invoke(self, context, _event):
        if bpy.app.background:
            return self.execute(context)
        return self.report_errors_of(lambda: self._start(context))

    def run(self, context):
        self.done(run_job(self.job(context)))

    def done(self, result):
        """Report the result of the job."""

    def _start(self, context):
        """Begin the job and its timer."""
        self._running = SlicedJob(self.job(context))
        self._running.work(0.0)  # errors at the beginning are reported at once
        manager = context.window_manager
        self._timer = manager.event_timer_add(0.01, window=context.window)
        manager.progress_begin(0.0, 1.0)
        manager.modal_handler_add(self)
        session_state.session.jobs[type(self).__name__] = self._running.progress
        session_state.redraw_views()
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC" and event.value == "PRESS":
            return self.stop(context)
        if event.type != "TIMER":
            return {"RUNNING_MODAL"}  # other events must not change the scene while the job runs
        result = None
        try:
            result = self.report_errors_of(lambda: self._work(context))
        finally:  # also after an unexpected error, timer and progress have to be removed
            if result != {"RUNNING_MODAL"}:
                self._end(context)
        return result

    def stop(self, context):
        """Stop the job on the user's word."""
        self._running.cancel()
        self._end(context)
        self.report({"WARNING"}, self.stopped)
        return {"CANCELLED"}

    def _work(self, context):
        """Run a slice of the job and show its progress."""
        self._running.work()
        if self._running.is_done:
            self.done(self._running.result)
            return {"FINISHED"}
        progress = session_state.session.jobs[type(self).__name__] = self._running.progress
        context.window_manager.progress_update(progress.share)
        context.workspace.status_text_set(f"{progress.text}, {progress.share:.0%}    ESC: stop")
        session_state.redraw_views()
        return {"RUNNING_MODAL"}

    def cancel(self, context):
        """Stop the job, because Blender closes or loads another file."""
        self._running.cancel()
        self._end(context)

    def _end(self, context):
        """Remove timer and progress."""
        session_state.session.jobs.pop(type(self).__name__, None)
        self._running.cancel()
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)
        session_state.redraw_views()
