# SPDX-License-Identifier: GPL-3.0-or-later
"""Measured data: choose a rig, find the gap, show it, add what is missing."""

import json
import textwrap
from pathlib import Path

import bpy
from bpy.props import BoolProperty, CollectionProperty, FloatProperty, StringProperty

from ..addon.measured import gap_results, log_rigs, planned_probe
from ..core.errors import counted
from . import modal_job, support
from .fits import show_image


class PALPATE_OT_measured_open(support.PalpateOperator, support.FileChooser, bpy.types.Operator):
    """Choose measurements of the real sensor: a rig.toml with its CSV files. They are read and checked"""

    bl_idname = "palpate.measured_open"
    bl_label = "Open Rig…"
    needs = support.EDITABLE_SENSOR

    filename_ext = ".toml"
    filter_glob: StringProperty(default="*.toml", options={"HIDDEN"})

    def run(self, context):
        from ..core.gap.dataset.rig import read_rig

        rig = read_rig(self.filepath)
        blend = bpy.data.filepath
        context.object.palpate.measured = bpy.path.relpath(self.filepath) if blend else self.filepath
        for warning in rig.warnings:
            self.report({"WARNING"}, warning)
        self.report({"INFO"}, f"'{rig.name}': {counted(len(rig.trials), 'trial')} on {counted(len(rig.texels), 'texel')}")


class PALPATE_OT_measured_logs(support.PalpateOperator, support.FileChooser, bpy.types.Operator):
    """Make a rig from logs of the real sensor (CSV, NPZ, MAT; HDF5, MCAP and bags where their packages are installed) in the
    folder rig beside them, and show what was read. Rows, columns and pitch are those of the active sensor. What no log says is
    asked"""

    bl_idname = "palpate.measured_logs"
    bl_label = "Rig from Logs…"
    needs = support.EDITABLE_SENSOR

    files: CollectionProperty(type=bpy.types.OperatorFileListElement, options={"HIDDEN", "SKIP_SAVE"})
    directory: StringProperty(subtype="DIR_PATH", options={"HIDDEN", "SKIP_SAVE"})
    accept: BoolProperty(
        name="Accept Proposals", description="Take what seems to be true as it is; what no log says is asked nevertheless"
    )

    def run(self, context):
        names = [item.name for item in self.files if item.name]
        paths = [str(Path(self.directory) / name) for name in names] if names else [self.filepath]
        _make_rig(self, context, paths, self.accept, [])


class PALPATE_OT_log_question(support.PalpateOperator, bpy.types.Operator):
    """Answer a question that the logs leave open, as in the brackets; an empty reply takes what is in them"""

    bl_idname = "palpate.log_question"
    bl_label = "Rig from Logs"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    question: StringProperty(options={"HIDDEN", "SKIP_SAVE"})
    state: StringProperty(options={"HIDDEN", "SKIP_SAVE"})
    reply: StringProperty(name="Reply", description="As in the brackets; empty: what is in them", options={"SKIP_SAVE"})

    def invoke(self, context, _event):
        return context.window_manager.invoke_props_dialog(self, width=600)

    def draw(self, _context):
        for line in self.question.splitlines():
            for part in textwrap.wrap(line, 100):
                self.layout.label(text=part)
        self.layout.prop(self, "reply", text="")

    def run(self, context):
        state = json.loads(self.state)
        _make_rig(self, context, state["paths"], state["accept"], [*state["replies"], self.reply])


def _make_rig(operator, context, paths: list[str], accept: bool, replies: list[str]) -> None:
    """Make a rig of logs, or ask the next question; without a window nobody is asked."""
    from ..core.gap.logs.questions import OpenQuestion

    folder = Path(paths[0]).parent / "rig"
    try:
        written, plot = log_rigs.make(context, context.object, paths, folder, accept, None if bpy.app.background else replies)
    except OpenQuestion as question:
        state = json.dumps({"paths": paths, "accept": accept, "replies": replies})
        bpy.ops.palpate.log_question("INVOKE_DEFAULT", question=str(question), state=state)
        return
    context.object.palpate.measured = bpy.path.relpath(str(written.path)) if bpy.data.filepath else str(written.path)
    show_image(plot, "Palpate Recordings")
    for note in written.notes:
        operator.report({"WARNING"}, note)
    operator.report({"INFO"}, f"Wrote {written.path}")


class PALPATE_OT_gap_find(modal_job.ModalJob, bpy.types.Operator):
    """Compare the model with the measurements, name what it misses and judge it on trials it has not seen. ESC stops it"""

    bl_idname = "palpate.gap_find"
    bl_label = "Find Gap"
    bl_options = {"REGISTER"}
    needs = support.MEASURED_SENSOR
    stopped = "Stopped; earlier results are unchanged"

    def job(self, context):
        return gap_results.find(context.object)

    def done(self, result):
        self.report({"INFO"}, result.headline)


class PALPATE_OT_gap_plan(modal_job.ModalJob, bpy.types.Operator):
    """Plan the recording that separates the effects that the recordings leave ambiguous, and put it on a probe as keyframes: on
    the selected target, else on a new one with the shape of the rig's. ESC stops it"""

    bl_idname = "palpate.gap_plan"
    bl_label = "Plan Experiment"
    needs = support.MEASURED_SENSOR
    stopped = "Stopped; no probe has changed"

    depth: FloatProperty(
        name="Depth (m)", description="Largest depth, m; 0: that of the recordings", min=0.0, precision=5, step=0.01
    )
    speed: FloatProperty(
        name="Speed (m/s)",
        description="Largest speed, m/s; 0: that of the recordings",
        min=0.0,
        precision=4,
        step=0.1,
    )
    duration: FloatProperty(
        name="Duration (s)", description="Longest duration, s; 0: that of the longest recording", min=0.0, precision=1
    )

    def job(self, context):
        from ..core.gap.planning.paths import Wishes

        support.leave_edit_mode(context)
        self._sensor = context.object.name
        wishes = Wishes(depth=self.depth or None, speed=self.speed or None, duration=self.duration or None)
        return planned_probe.plan(context.object, wishes)

    def done(self, result):
        experiment, rig = result
        if experiment is None:
            self.report({"INFO"}, "The recordings distinguish all effects: nothing is planned")
            return
        sensor = bpy.data.objects[self._sensor]
        planned_probe.put_on_probe(bpy.context, sensor, experiment, rig)
        self.report({"INFO"}, planned_probe.sentence_of(sensor))


class PALPATE_OT_gap_add(support.PalpateOperator, bpy.types.Operator):
    """Replace the parameters and all effects of the sensor by the fitted ones"""

    bl_idname = "palpate.gap_add"
    bl_label = "Use Fitted Sensor"
    needs = support.GAP_FOUND

    def run(self, context):
        count = gap_results.add_found(context.object)
        caution = gap_results.of(context.object).caution
        said = f"'{context.object.name}' has the fitted parameters and {counted(count, 'effect')}"
        self.report({"WARNING"} if caution else {"INFO"}, f"{said}. {caution}" if caution else said)


class PALPATE_OT_gap_curves(support.PalpateOperator, bpy.types.Operator):
    """Plot measurement and model, before and after"""

    bl_idname = "palpate.gap_curves"
    bl_label = "Before and After"
    needs = support.GAP_FOUND

    def run(self, context):
        show_image(gap_results.of(context.object).pictures["curves"], "Palpate Gap Curves")


class PALPATE_OT_gap_show(support.PalpateOperator, bpy.types.Operator):
    """Colour the sensor by the error of its texels, and mark the phases of the first trial on the timeline"""

    bl_idname = "palpate.gap_show"
    bl_label = "Show on Sensor"
    needs = (*support.MESH, support.IS_SENSOR, support.IS_GAP_FOUND)

    amended: BoolProperty(name="Amended", description="With the effects found, on the same scale", options={"SKIP_SAVE"})

    def run(self, context):
        support.leave_edit_mode(context)
        largest = gap_results.show_on_sensor(context, context.object, self.amended)
        gap_results.mark_phases(context.scene, context.object)
        self.report({"INFO"}, f"Largest texel error: {largest}")


class PALPATE_OT_gap_report(modal_job.ModalJob, bpy.types.Operator):
    """Write the report, the amended sensor and the plots into a folder of their own beside the rig, as rig-report. ESC stops it
    and keeps an earlier report"""

    bl_idname = "palpate.gap_report"
    bl_label = "Write Report"
    bl_options = {"REGISTER"}
    needs = support.GAP_FOUND
    stopped = "Stopped; an earlier report is unchanged"

    directory: StringProperty(
        name="Folder", description="Another folder, for scripts", subtype="DIR_PATH", options={"SKIP_SAVE"}
    )

    def job(self, context):
        from ..core.gap.report import summary
        from ..core.io.file_writing import writable_folder

        rig = gap_results.rig_path(context.object)
        beside = rig.with_name(f"{rig.stem}-report")
        folder = writable_folder(bpy.path.abspath(self.directory) if self.directory else beside, create=True)
        result = gap_results.of(context.object)
        yield from summary.write_report(result.diagnosis, folder, result.errors)
        return folder / "report.html"

    def done(self, result):
        self.report({"INFO"}, f"Wrote {result}")
