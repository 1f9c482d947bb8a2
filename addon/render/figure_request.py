# SPDX-License-Identifier: GPL-3.0-or-later
"""Which figures are wanted: from the panel's settings, or from words of a command line."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import bpy

from ...core.errors import FileError, ParameterError
from ...core.figures.figure_style import FigureStyle, GelStyle
from ..display import bake_display
from ..properties import figure_properties
from ..session import transforms
from .render_setup import RenderOptions

KINDS = ("scene", "strip", "curves", "numbers", "video", "gel")
"""Kinds of figures."""
FORMATS = ("png", "pdf", "svg")


@dataclass(frozen=True)
class FigureRequest(RenderOptions):
    """The figures that are wanted, and how pictures of the scene are to be taken.

    Attributes
    ----------
    kinds : tuple of str
        From :data:`KINDS`.
    style : FigureStyle
    frames : tuple of int
        Frames of the pictures and numbers; two or more are also the columns of the strip. Empty: the frame at which the
        settled forces are largest, for the gel all frames.
    sensors : tuple of str
        Names; empty: all sensors.
    formats : tuple of str
        File formats of the figures that are not renders.
    exports : tuple of str
        Names from :data:`.format_table.FORMATS`; each is written into a folder of its own.
    at_peak : bool
        Without `frames`: the frame with the largest force, settled or not.
    size : (2,) int, pixels
        Width and height of the renders.
    samples : int or None
        Samples per pixel; None: the scene's.
    light_angle, markers, marker_pitch
        See :class:`.figure_style.GelStyle`.
    """

    kinds: tuple[str, ...] = ("scene", "strip", "curves", "numbers")
    style: FigureStyle = field(default_factory=FigureStyle)
    frames: tuple[int, ...] = ()
    sensors: tuple[str, ...] = ()
    formats: tuple[str, ...] = ("png", "pdf")
    exports: tuple[str, ...] = ()
    see_through: bool = field(default=True, kw_only=True)
    at_peak: bool = False
    size: tuple[int, int] = field(default=(1280, 960), kw_only=True)
    samples: int | None = None
    light_angle: float = GelStyle.light_angle
    markers: bool = True
    marker_pitch: float | None = None

    def __post_init__(self) -> None:
        for what, chosen, known in (("figure", self.kinds, KINDS), ("format", self.formats, FORMATS)):
            for word in chosen:
                if word not in known:
                    raise ParameterError(f"There is no {what} '{word}': choose from {', '.join(known)}.")
        self.gel_style()

    def gel_style(self) -> GelStyle:
        """Return how images of gels are to be made.

        Raises
        ------
        ParameterError
            The light's angle or the distance between markers has no meaning.
        """
        return GelStyle(self.light_angle, self.markers, self.marker_pitch, self.size)


def requested_figures(scene, active=None) -> FigureRequest:
    """Return the figures that the panel of a scene asks for.

    Parameters
    ----------
    active : Object, optional
        The active object, if only its figures are wanted.

    Raises
    ------
    ParameterError
        The frames cannot be read, no figure is chosen, or the active object is no sensor.
    """
    own = scene.palpate.figures
    sensors: tuple[str, ...] = ()
    if own.sensors == "ACTIVE":
        if active is None or active.palpate.role != "SENSOR":
            raise ParameterError("The active object is not a sensor: choose another, or set Figures › Sensors to All Sensors.")
        sensors = (active.name,)
    if not (own.kinds or own.exports):
        raise ParameterError("Nothing is chosen: choose at least one figure in Palpate › Figures.")
    return FigureRequest(
        kinds=_chosen(figure_properties.KINDS, own.kinds),
        style=bake_display.figure_style(scene, width=own.width.lower(), dpi=own.dpi),
        frames=() if asks_for_peak(own.frames) else frames_of(own.frames),
        at_peak=asks_for_peak(own.frames),
        sensors=sensors,
        formats=_chosen(figure_properties.FORMATS, own.formats) or ("png",),
        exports=_chosen(figure_properties.EXPORTS, own.exports),
        engine=None if own.engine == "SCENE" else own.engine.lower(),
        view=tuple(own.view) if own.camera == "VIEW" else None,
        transparent=own.transparent,
        own_camera=own.camera == "OWN",
        own_light=own.own_light,
        see_through=own.see_through,
        size=tuple(own.size),
        samples=own.samples or None,
        light_angle=transforms.as_typed(own.light_angle),
        markers=own.markers,
        marker_pitch=transforms.as_typed(own.marker_pitch) or None,
    )


def _chosen(items, names: set[str]) -> tuple[str, ...]:
    return tuple(key.lower() for key, *_ in items if key in names)


def asks_for_peak(text: str) -> bool:
    """Return True for the word that stands for the frame with the largest force."""
    return text.strip().lower() == "peak"


def frames_of(text: str) -> tuple[int, ...]:
    """Return the frames in a text like ``12, 40-44``, in its order and each once; none for an empty text.

    Raises
    ------
    ParameterError
        The text holds something else.
    """
    found: list[int] = []
    for part in filter(None, re.split(r"[,;\s]+", text.strip())):
        match = re.fullmatch(r"(-?\d{1,7})(?:-(-?\d{1,7}))?", part)
        if match is None:
            raise ParameterError(f"'{part}' in Figures › Frames is not a frame: write numbers as in 12, 40-44, or peak.")
        first = int(match[1])
        found += range(first, (int(match[2]) if match[2] else first) + 1)
    return tuple(dict.fromkeys(found))


def figure_folder(scene) -> Path:
    """Return the folder of a scene's figures.

    Raises
    ------
    FileError
        The folder is empty, or relative to a .blend that has not been saved yet.
    """
    text = scene.palpate.figures.folder
    if not text.strip():
        raise FileError("The folder of the figures is empty: name one in Palpate › Figures.")
    if text.startswith("//") and not bpy.data.filepath:
        raise FileError(f"The folder '{text}' is relative to a file that is not saved yet: save the .blend first.")
    return Path(bpy.path.abspath(text))
