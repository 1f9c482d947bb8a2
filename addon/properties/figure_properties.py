# SPDX-License-Identifier: GPL-3.0-or-later
"""What figures a scene asks for: `Scene.palpate.figures`, and the :class:`.figure_export.FigureRequest` that it means."""

from __future__ import annotations

import re
from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatVectorProperty, IntProperty, IntVectorProperty, StringProperty

from ...core.errors import FileError, ParameterError

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
EXPORTS = (
    ("CSV", "CSV", "Tables, one column per texel"),
    ("NPZ", "NPZ", "Arrays for NumPy in double precision"),
    ("HDF5", "HDF5", "One file with units; needs the package h5py"),
    ("PNG", "PNG", "Every tactile image as a picture in colours"),
)
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


def wish(scene, active=None):
    """Return what a scene asks for.

    Parameters
    ----------
    active : Object, optional
        The active one, if only its figures are wanted.

    Raises
    ------
    ParameterError
        The frames make no sense, nothing is chosen, or the active object is no sensor.
    """
    from ..render import figure_export

    own = scene.palpate.figures
    sensors: tuple[str, ...] = ()
    if own.sensors == "ACTIVE":
        if active is None or active.palpate.role != "SENSOR":
            raise ParameterError("The active object is no sensor: choose another, or set Figures › Sensors to All Sensors.")
        sensors = (active.name,)
    if not (own.kinds or own.exports):
        raise ParameterError("Nothing is chosen: choose at least one figure in Palpate › Figures.")
    return figure_export.FigureRequest(
        kinds=_chosen(KINDS, own.kinds),
        style=figure_export.scene_style(scene, width=own.width.lower(), dpi=own.dpi),
        frames=frames_of(own.frames),
        sensors=sensors,
        formats=_chosen(FORMATS, own.formats) or ("png",),
        exports=_chosen(EXPORTS, own.exports),
        engine=None if own.engine == "SCENE" else own.engine.lower(),
        view=tuple(own.view) if own.camera == "VIEW" else None,
        transparent=own.transparent,
        own_camera=own.camera == "OWN",
        size=tuple(own.size),
        samples=own.samples or None,
    )


def _chosen(items, names: set[str]) -> tuple[str, ...]:
    return tuple(key.lower() for key, *_ in items if key in names)


def frames_of(text: str) -> tuple[int, ...]:
    """Return the frames that words like ``12, 40-44`` mean, in order and each once; none for an empty text.

    Raises
    ------
    ParameterError
        Something else is written there.
    """
    found: list[int] = []
    for part in filter(None, re.split(r"[,;\s]+", text.strip())):
        match = re.fullmatch(r"(-?\d{1,7})(?:-(-?\d{1,7}))?", part)
        if match is None:
            raise ParameterError(f"'{part}' in Figures › Frames is no frame: write numbers as in 12, 40-44.")
        first = int(match[1])
        found += range(first, (int(match[2]) if match[2] else first) + 1)
    return tuple(dict.fromkeys(found))


def folder(scene) -> Path:
    """Return where a scene's figures go.

    Raises
    ------
    FileError
        It is relative to a .blend that has not been saved yet, or empty.
    """
    text = scene.palpate.figures.folder
    if not text.strip():
        raise FileError("The folder of the figures is empty: name one in Palpate › Figures.")
    if text.startswith("//") and not bpy.data.filepath:
        raise FileError(f"The folder '{text}' is relative to a file that is not saved yet: save the .blend first.")
    return Path(bpy.path.abspath(text))
