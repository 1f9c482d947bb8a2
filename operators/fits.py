# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that fit a sensor's parameters to measurements: stiffness of its foam, friction of its surface."""

from functools import partial
from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from ..addon.authoring import exchange, sensor_report
from ..core.errors import SensorError
from ..core.model.sensor_parameters import DAMPING_PER_STIFFNESS
from . import support


class MeasurementFit(support.PalpateOperator, support.FileChooser):
    """Common part of both fits: choosing a CSV, drawing the settings, and showing the plot."""

    needs = support.EDITABLE_SENSOR
    filename_ext = ".csv"
    filter_glob: StringProperty(default="*.csv;*.txt", options={"HIDDEN"})
    plot: StringProperty(
        name="Plot", description="Also write the plot here: .png, .pdf or .svg", subtype="FILE_PATH", options={"SKIP_SAVE"}
    )

    fields: tuple[str, ...] = ()
    """Names of the fit's own settings."""

    def draw(self, _context):
        layout = self.layout
        layout.use_property_split = False  # labels beside their fields would be cut off in the file browser
        for name in self.fields:
            layout.prop(self, name)
        layout.label(text="Also write the plot to:")
        layout.prop(self, "plot", text="")

    def picture(self, draw, fit, title: str) -> None:
        """Plot a fit, store the plot in the .blend as an image, and show it."""
        path = Path(bpy.app.tempdir) / f"{title}.png"
        draw(path, fit)
        if self.plot:
            draw(Path(bpy.path.abspath(self.plot)), fit)
        show_image(path, title)


def show_image(path: Path, title: str) -> None:
    """Store a picture in the .blend and show it in an image editor; open a window with one if there is none."""
    old = bpy.data.images.get(title)
    if old is not None:
        bpy.data.images.remove(old)
    image = bpy.data.images.load(str(path))
    image.name = title
    image.pack()
    if not bpy.app.background:
        bpy.app.timers.register(partial(_show_in_editor, title), first_interval=0.1)


def _show_in_editor(title: str) -> None:
    """Show an image of the file in an image editor.

    Called once the operator has ended: Blender 4.3 crashes where a dialog that is closing opens a window.
    """
    image, windows = bpy.data.images.get(title), bpy.context.window_manager.windows
    if image is None or not windows:
        return
    areas = [area for window in windows for area in window.screen.areas]
    editor = next((area for area in areas if area.type == "IMAGE_EDITOR" and area.spaces.active.mode == "VIEW"), None)
    if editor is None:
        with bpy.context.temp_override(window=windows[0]):
            bpy.ops.wm.window_new()
        editor = max(windows[-1].screen.areas, key=lambda area: area.width * area.height)
        editor.type = "IMAGE_EDITOR"
    editor.spaces.active.image = image
    editor.tag_redraw()


class PALPATE_OT_stiffness_fit(MeasurementFit, bpy.types.Operator):
    """Fit the stiffness k of the active sensor's texels to foam measurements (Eq. 18, Fig. 6): a CSV with the columns
    compression (m) and pressure (Pa), force (N) or mass (kg)"""

    bl_idname = "palpate.stiffness_fit"
    bl_label = "Stiffness from Foam…"

    line: EnumProperty(
        name="Line",
        description="Which of the two lines gives the stiffness",
        items=(
            ("ZERO", "Through Zero", "Line through zero, as in the model"),
            ("OFFSET", "With Offset", "Line with an offset, for foam with a dead zone"),
        ),
    )
    weight_area: FloatProperty(
        name="Weight Area (m²)",
        description="Contact area of the forces or masses, m²; not needed for pressures",
        min=0.0,
        precision=8,
    )
    with_damping: BoolProperty(name="Damping 1 % of k", description="Also set cn, numerically to 1 % of k", default=True)

    fields = ("line", "weight_area", "with_damping")

    def run(self, context):
        from ..api.fits import fit_stiffness
        from ..core.gap.calibration.plots import plot_stiffness

        obj = context.object
        report = sensor_report.fresh_report(obj, context.scene)
        if report.texels is None:
            raise SensorError(report.problems[0].text)
        fit = fit_stiffness(self.filepath, report.area, len(report.texels), self.weight_area or None)
        chosen = fit.k if self.line == "ZERO" else fit.k_offset
        obj.palpate.k = chosen.value
        if self.with_damping:
            obj.palpate.cn = DAMPING_PER_STIFFNESS * chosen.value
        self.picture(plot_stiffness, fit, "Palpate Stiffness Fit")
        text = f"k = {chosen.value:.4g} N/m (95 %: {chosen.low:.4g} to {chosen.high:.4g}) for {len(report.texels)} texels"
        if fit.stiffens:
            text += "; the curve bends upwards: add the effect stiffening for it"
        if fit.dead_zone > 0:
            text += f"; the foam has a dead zone of {fit.dead_zone * 1e3:.3g} mm: add the effect dead-zone for it"
        self.report({"INFO"}, text)


class PALPATE_OT_friction_fit(MeasurementFit, bpy.types.Operator):
    """Fit the friction of the active sensor's texels to a force–velocity curve (Eq. 13, Fig. 7): a CSV with the columns
    velocity (m/s) and force (N), in steady sliding, or with a column time (s) as well, recorded from rest"""

    bl_idname = "palpate.friction_fit"
    bl_label = "Friction from Curve…"

    normal_force: FloatProperty(
        name="Normal Force (N)",
        description="Normal force on one texel during the measurement, N",
        default=0.08,
        min=1e-9,
        precision=5,
    )
    texels: IntProperty(name="Texels", description="How many texels shared the measured force", default=1, min=1)

    fields = ("normal_force", "texels")

    def run(self, context):
        from ..api.fits import fit_friction
        from ..core.gap.calibration.plots import plot_friction

        obj = context.object
        fit = fit_friction(self.filepath, self.normal_force, self.texels, exchange.parameters_of(obj))
        exchange.put_parameters(obj, fit.parameters)
        self.picture(plot_friction, fit, "Palpate Friction Fit")
        values = ", ".join(f"{name} = {e.value:.3g} ({e.low:.3g} to {e.high:.3g})" for name, e in fit.estimates.items())
        self.report({"INFO"}, values)
        if fit.unidentifiable:
            names = ", ".join(fit.unidentifiable)
            self.report({"WARNING"}, f"These measurements do not identify {names}: add some at other velocities")
