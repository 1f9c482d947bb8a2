# SPDX-License-Identifier: GPL-3.0-or-later
"""Which figures a scene asks for: `Scene.palpate.figures`."""

from __future__ import annotations

import bpy
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    IntVectorProperty,
    StringProperty,
)

from ...core.export.format_table import FORMATS as DATA_FORMATS
from ...core.figures.figure_style import LIGHT_ANGLES, MARKERS_ALONG, GelStyle
from . import scene_units
from .scene_units import in_units

KINDS = (
    ("SCENE", "Scene", "The scene with its overlays, alone and with the tactile images"),
    ("STRIP", "Strip", "Tactile images over time"),
    ("CURVES", "Curves", "Forces, slip and centre of pressure over time"),
    ("NUMBERS", "Numbers", "The number of every texel"),
    ("VIDEO", "Video", "Scene and tactile images side by side, MP4"),
    ("GEL", "Gel", "Image of a camera behind the gel: one for each frame, of sensors with rows and columns"),
)
FORMATS = (
    ("PNG", "PNG", "Pixels"),
    ("PDF", "PDF", "Vector graphics with text as text"),
    ("SVG", "SVG", "Vector graphics for web pages"),
)
EXPORTS = tuple((name.upper(), one.title, one.description) for name, one in DATA_FORMATS.items())
_plain: dict = {"options": set()}  # a setting has no keyframes


def check_box(key: str, identifier: str) -> str:
    """Return the name of the property that takes one choice of `kinds`, `exports` or `formats`."""
    return f"{key}_{identifier.lower()}"


def _check_boxes(key: str, items: tuple) -> dict:
    """Return properties by which a panel shows choices as check boxes: Blender only has buttons, and Shift, for a set."""

    def box(identifier: str, label: str, text: str):
        def read(settings) -> bool:
            return identifier in getattr(settings, key)

        def write(settings, value: bool) -> None:
            others = getattr(settings, key) - {identifier}
            setattr(settings, key, others | {identifier} if value else others)

        return BoolProperty(name=label, description=text, get=read, set=write, **_plain)

    return {check_box(key, item[0]): box(*item) for item in items}


class CheckBoxes:
    """The choices of which several may be taken, each as a check box."""

    __annotations__ = _check_boxes("kinds", KINDS) | _check_boxes("exports", EXPORTS) | _check_boxes("formats", FORMATS)


class PALPATE_PG_figures(CheckBoxes, bpy.types.PropertyGroup):
    """`Scene.palpate.figures`"""

    folder: StringProperty(
        name="Folder",
        description="Folder of the figures; // is the folder of the .blend",
        default="//figures",
        subtype="DIR_PATH",
        options=scene_units.OUTPUT,
    )
    kinds: EnumProperty(
        name="Figures",
        description="Figures to make",
        items=KINDS,
        default={"SCENE", "STRIP", "CURVES", "NUMBERS"},
        options={"ENUM_FLAG"},
    )
    exports: EnumProperty(
        name="Data",
        description="Data to write with the figures",
        items=EXPORTS,
        options={"ENUM_FLAG"},
    )
    formats: EnumProperty(
        name="Files",
        description="File formats of figures that are not renders",
        items=FORMATS,
        default={"PNG", "PDF"},
        options={"ENUM_FLAG"},
    )
    sensors: EnumProperty(
        name="Sensors",
        description="Sensors that figures are made of",
        items=(("ALL", "All Sensors", "Every sensor of the scene"), ("ACTIVE", "Active Object", "Only the active object")),
        **_plain,
    )
    frames: StringProperty(
        name="Frames",
        description="Frames of the scene and the numbers, as in 12, 40-44; two or more are also the frames of the strip. "
        "Empty: the frame at which the settled forces are largest, of the gel every frame; peak: that with the largest force",
        **_plain,
    )
    width: EnumProperty(
        name="Width",
        description="Width of figures: a column of a journal",
        items=(
            ("SINGLE", "Single, 89 mm", "One column"),
            ("MIDDLE", "Middle, 140 mm", "One and a half columns"),
            ("DOUBLE", "Double, 183 mm", "Two columns"),
        ),
        default="DOUBLE",
        **_plain,
    )
    dpi: IntProperty(name="Dots per Inch", description="Resolution of PNG figures", default=300, min=50, max=1200, **_plain)
    engine: EnumProperty(
        name="Engine",
        description="Engine that renders the scene",
        items=(
            ("SCENE", "The Scene's", "As chosen in the render properties"),
            ("CYCLES", "Cycles", "Path tracing: physically correct light"),
            ("EEVEE", "EEVEE", "Fast, approximate light"),
            ("WORKBENCH", "Workbench", "Plain colours, immediately"),
        ),
        **_plain,
    )
    camera: EnumProperty(
        name="Camera",
        description="Position of the camera",
        items=(
            ("FRAMED", "Framed", "Turned to the texels that carry force, as near as everything fits"),
            ("VIEW", "Direction", "In the direction given below, as near as everything fits"),
            ("OWN", "As It Is", "The scene's camera, unchanged"),
        ),
        **_plain,
    )
    view: FloatVectorProperty(
        name="Azimuth and Elevation",
        description="Direction from the scene to the camera, degrees: from +x towards +y, and upwards",
        size=2,
        default=(-55.0, 30.0),
        min=-360.0,
        max=360.0,
        **_plain,
    )
    own_light: BoolProperty(
        name="Scene Lights",
        description="Keep the lamps, the world and the backdrop of the scene. Without: studio light and a plain background",
        **_plain,
    )
    see_through: BoolProperty(
        name="See-Through",
        description="Targets become see-through where they cover texels that carry force",
        default=True,
        **_plain,
    )
    transparent: BoolProperty(name="Transparent", description="Render without a background", **_plain)
    size: IntVectorProperty(
        name="Size",
        description="Width and height of renders, pixels; images of the gel fit into it",
        size=2,
        default=(1280, 960),
        min=16,
        max=16384,
        **_plain,
    )
    samples: IntProperty(
        name="Samples", description="Samples per pixel of renders; 0: as in the render properties", min=0, max=65536, **_plain
    )
    light_angle: FloatProperty(
        name="Light Angle (°)",
        description="Angle (°) between the gel and the light of its three lamps; flat light makes slopes strong",
        default=GelStyle.light_angle,
        min=LIGHT_ANGLES[0],
        max=LIGHT_ANGLES[1],
        precision=1,
        **_plain,
    )
    markers: BoolProperty(
        name="Markers",
        description="Print markers on the gel, which shear carries along: by the shear of a texel (N) over σ0 (N/m)",
        default=GelStyle.markers,
        **_plain,
    )
    marker_pitch_in_units: in_units(
        "marker_pitch",
        "m",
        "Marker Pitch",
        f"Distance between markers. 0: a round one, about {MARKERS_ALONG} along the gel",
        min=0.0,
        step=0.1,
    )
    marker_pitch: FloatProperty(
        name="Marker Pitch (m)",
        description=f"Distance between markers, m. 0: a round one, about {MARKERS_ALONG} along the gel",
        min=0.0,
        precision=5,
        step=0.01,
        **_plain,
    )
