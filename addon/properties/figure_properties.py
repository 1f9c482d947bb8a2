# SPDX-License-Identifier: GPL-3.0-or-later
"""Which figures a scene asks for: `Scene.palpate.figures`."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatVectorProperty, IntProperty, IntVectorProperty, StringProperty

from ...core.export.registry import exporters

KINDS = (
    ("SCENE", "Scene", "The scene with its overlays, alone and with the tactile images beside it"),
    ("STRIP", "Strip", "Tactile images over time"),
    ("CURVES", "Curves", "Forces, slip and centre of pressure over time"),
    ("NUMBERS", "Numbers", "The number of every texel"),
    ("VIDEO", "Video", "Scene and tactile images side by side, MP4"),
)
FORMATS = (
    ("PNG", "PNG", "Pixels"),
    ("PDF", "PDF", "Lines and text that stay lines and text"),
    ("SVG", "SVG", "The same for web pages"),
)
EXPORTS = tuple((exporter.name.upper(), exporter.title, exporter.description) for exporter in exporters().values())
_plain: dict = {"options": set()}


class PALPATE_PG_figures(bpy.types.PropertyGroup):
    """`Scene.palpate.figures`"""

    folder: StringProperty(
        name="Folder",
        description="Figures go here; // is the folder of the .blend",
        default="//figures",
        subtype="DIR_PATH",
        **_plain,
    )
    kinds: EnumProperty(
        name="Figures",
        description="What is made; Shift-click adds one to those chosen",
        items=KINDS,
        default={"SCENE", "STRIP", "CURVES", "NUMBERS"},
        options={"ENUM_FLAG"},
    )
    exports: EnumProperty(
        name="Data",
        description="What is written beside them; Shift-click adds one to those chosen",
        items=EXPORTS,
        options={"ENUM_FLAG"},
    )
    formats: EnumProperty(
        name="Files",
        description="Of figures that are no renders; Shift-click adds one to those chosen",
        items=FORMATS,
        default={"PNG", "PDF"},
        options={"ENUM_FLAG"},
    )
    sensors: EnumProperty(
        name="Sensors",
        description="Whose figures",
        items=(("ALL", "All Sensors", "Of the scene"), ("ACTIVE", "Active Object", "Only the active object's")),
        **_plain,
    )
    frames: StringProperty(
        name="Frames",
        description="Of scene and numbers, and where there are two or more of the strip, as in 12, 40-44; "
        "empty: with the largest force",
        **_plain,
    )
    width: EnumProperty(
        name="Width",
        description="Column of a journal that figures fill",
        items=(
            ("SINGLE", "Single, 89 mm", "One column"),
            ("MIDDLE", "Middle, 140 mm", "One and a half columns"),
            ("DOUBLE", "Double, 183 mm", "Two columns"),
        ),
        default="DOUBLE",
        **_plain,
    )
    dpi: IntProperty(name="Dots per Inch", description="Of PNG figures", default=300, min=50, max=1200, **_plain)
    engine: EnumProperty(
        name="Engine",
        description="That renders",
        items=(
            ("SCENE", "The Scene's", "As chosen in the render properties"),
            ("CYCLES", "Cycles", "Light as it is"),
            ("EEVEE", "EEVEE", "Quick light"),
            ("WORKBENCH", "Workbench", "Plain and at once"),
        ),
        **_plain,
    )
    camera: EnumProperty(
        name="Camera",
        description="From where the scene is seen",
        items=(
            ("FRAMED", "Framed", "In the direction of the scene's camera, as near as all fits"),
            ("VIEW", "Direction", "From a direction of choice, as near as all fits"),
            ("OWN", "As It Is", "The scene's camera stays where it is"),
        ),
        **_plain,
    )
    view: FloatVectorProperty(
        name="Azimuth and Elevation",
        description="Of the camera, from +x towards +y and upwards, degrees",
        size=2,
        default=(-55.0, 30.0),
        min=-360.0,
        max=360.0,
        **_plain,
    )
    transparent: BoolProperty(name="Transparent", description="No background", **_plain)
    size: IntVectorProperty(
        name="Size", description="Of renders, pixels", size=2, default=(1280, 960), min=16, max=16384, **_plain
    )
    samples: IntProperty(
        name="Samples", description="Per pixel of renders; 0: as in the render properties", min=0, max=65536, **_plain
    )
