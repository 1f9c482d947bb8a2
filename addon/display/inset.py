# SPDX-License-Identifier: GPL-3.0-or-later
"""The inset: tactile images, colour bar and force curves in a corner of the 3D view while the timeline plays."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from ...core.figures import color_maps
from ...core.figures.quantities import Scale
from ...core.geometry.grid_layout import GridLayout
from ...core.geometry.texels import Projection, Texels, projection_of
from ...core.geometry.texture_maps import UVLayout
from ..session import session_state

MAX_SENSORS = 4
"""Number of sensors that are shown at most."""
IMAGE, SPACING, CURVE, BAR = 120.0, 12.0, 56.0, 10.0
"""Longest side of an image, space between parts, height of the curves and width of the colour bar; pixels at a resolution scale
of one."""
MAX_IMAGE_SIDE = 256
"""Pixels along a side of an image: larger images are subsampled, images of few texels are enlarged."""
VIEW_SIDE = 120
"""Pixels along the longer side of a view of a surface whose image is an atlas of single triangles."""
COLORS = ((0.34, 0.7, 0.91), (1.0, 0.62, 0.25), (0.4, 0.85, 0.6), (0.9, 0.6, 0.8))
BACKGROUND_COLOR, AXIS_COLOR = (0.05, 0.05, 0.06, 0.72), (1.0, 1.0, 1.0, 0.35)
VIEW_COLOR = (1.0, 1.0, 1.0, 0.7)
TEXT_COLOR, NOTE_COLOR = (1.0, 1.0, 1.0, 1.0), (1.0, 0.62, 0.1, 1.0)


@dataclass
class SensorInset:
    """The content of the inset for one sensor.

    Attributes
    ----------
    name : str
    pixels : (h, w, 4) float32
        sRGB, row 0 at the bottom.
    frames, force : (f,) float
        Frames so far, and the sum of the normal forces at each of them, N.
    now : float, N
        The sum of the normal forces at the present frame.
    views : tuple of str
        Names of the views of which the image consists, side by side; of one view that needs no name an empty string.
    """

    name: str
    pixels: np.ndarray
    frames: np.ndarray
    force: np.ndarray
    now: float
    views: tuple[str, ...] = ("",)
    texture: object = None


@dataclass
class InsetContent:
    """The content of the inset for a scene; all sensors share one colour scale.

    Attributes
    ----------
    insets : list of SensorInset
    scale : Scale
        What the colours mean.
    span : (2,) float
        First and last frame of the scene.
    frame : float
        The present frame.
    note : str
        Words above the curves that say what is wrong with the numbers; empty where nothing is.
    """

    insets: list[SensorInset]
    scale: Scale
    span: tuple[float, float]
    frame: float
    note: str = ""
    bar: object = None


_contents: dict[int, InsetContent] = {}
_projections: dict[int, tuple[Texels, Projection]] = {}
"""By identity of the texels, which are kept with it: views of the sensors that were shown last."""


def picture_layout(texels: Texels) -> GridLayout | UVLayout | Projection:
    """Return how the texels are laid out here: as in their tactile image, or, where that is an atlas, as seen from outside."""
    if not getattr(texels.layout, "cell", 0):
        return texels.layout
    known = _projections.get(id(texels))
    if known is None:
        if len(_projections) >= 2 * MAX_SENSORS:
            _projections.clear()
        known = _projections[id(texels)] = texels, projection_of(texels, VIEW_SIDE)
    return known[1]


def tactile_pixels(layout, values: np.ndarray, scale: Scale) -> np.ndarray:
    """(h, w, 4) float32: a tactile image in colours, transparent where there is no texel."""
    image, mask = layout.image(values), layout.mask()
    step = -(-max(image.shape) // MAX_IMAGE_SIDE)
    image, mask = image[::step, ::step], mask[::step, ::step]
    rgb = scale.colors(image.ravel()).reshape(*image.shape, 3)
    pixels = np.dstack([rgb, mask]).astype(np.float32)
    if isinstance(layout, GridLayout):  # the screen blends neighbouring pixels, but texels shall stay distinct
        repeats = -(-MAX_IMAGE_SIDE // max(image.shape))
        pixels = pixels.repeat(repeats, axis=0).repeat(repeats, axis=1)
    return pixels


def inset_content(scene, frame, texels: dict, frames: np.ndarray, loads: dict, scale: Scale, note: str = "") -> InsetContent:
    """Return the content of the inset for one frame.

    Parameters
    ----------
    frame : Frame
    texels : dict of str to Texels
        The first :data:`MAX_SENSORS` of these sensors are shown.
    frames : (f,) float
        Frames of the force curves.
    loads : dict of str to (f,) float, N
        Sum of the normal forces of each sensor at these frames.
    scale : Scale
    note : str, optional
        See :class:`InsetContent`.
    """
    insets = []
    shown = {name: own for name, own in texels.items() if scale.quantity.is_in(frame.sensors[name])}
    for name, own in list(shown.items())[:MAX_SENSORS]:
        readings, layout = frame.sensors[name], picture_layout(own)
        pixels = tactile_pixels(layout, scale.values(readings, own), scale)
        views = layout.names if isinstance(layout, Projection) else ("",)
        insets.append(SensorInset(name, pixels, frames, loads[name], float(readings.normal_force.sum()), views))
    span = float(scene.frame_start), float(scene.frame_end)
    return InsetContent(insets, scale, span, float(frame.frame), note)


def show(scene, content: InsetContent) -> None:
    """Show this content in the 3D views of a scene."""
    _contents[scene.session_uid] = content
    session_state.redraw_views()


def clear(scene=None) -> None:
    """Stop showing the inset of a scene, or of all scenes."""
    session_state.forget(_contents, scene)
    session_state.redraw_views()


def draw() -> None:
    """Called by each 3D view, in pixels of its region."""
    content = _contents.get(bpy.context.scene.session_uid)
    if content is None or not content.insets or not bpy.context.space_data.overlay.show_overlays:
        return
    import gpu

    gpu.state.blend_set("ALPHA")
    scale = bpy.context.preferences.system.ui_scale
    canvas = _PixelPainter(scale)
    x, top = 20.0 * scale, 20.0 * scale + _height(content, scale)
    _draw_content(content, canvas, x, top)
    gpu.state.blend_set("NONE")


def _sizes(inset: SensorInset, scale: float) -> tuple[float, float]:
    height, width = inset.pixels.shape[:2]
    zoom = IMAGE * scale / max(height, width / len(inset.views))
    return width * zoom, height * zoom


def _height(content: InsetContent, scale: float) -> float:
    return max(_sizes(inset, scale)[1] for inset in content.insets) + (CURVE + 4 * SPACING + 22.0) * scale


def _draw_content(content: InsetContent, canvas, x: float, top: float) -> None:
    scale, gap = canvas.scale, SPACING * canvas.scale
    tall = max(_sizes(inset, scale)[1] for inset in content.insets)
    widths = [max(_sizes(inset, scale)[0], 70.0 * scale) for inset in content.insets]
    ends = content.scale.words(content.scale.low), content.scale.words(content.scale.high)
    room = max(canvas.width(words) for words in (*ends, content.scale.quantity.title)) + (BAR + 4.0) * scale
    line = sum(canvas.width(text) + 8.0 * scale for text, _ in _line(content)) + 4.0 * scale
    whole = max(sum(widths) + gap * len(widths) + room, line) + 2 * gap
    height = _height(content, scale)
    canvas.rectangle(x, top - height, whole, height, BACKGROUND_COLOR)
    at, upper = x + gap, top - gap - 12.0 * scale
    for inset, width, color in zip(content.insets, widths, COLORS):
        canvas.text(at, upper + 3.0 * scale, inset.name, (*color, 1.0), width)
        if inset.texture is None:
            inset.texture = _texture(inset.pixels)
        size = _sizes(inset, scale)
        canvas.image(inset.texture, at, upper - 3.0 * scale - size[1], *size)
        for number, view in enumerate(inset.views):
            canvas.text(at + size[0] * number / len(inset.views), upper - 1.0 * scale - size[1], view, VIEW_COLOR)
        at += width + gap
    if content.bar is None:
        colors = color_maps.colors(content.scale.colour_map, np.linspace(0.0, 1.0, 64))
        content.bar = _texture(np.column_stack([colors, np.ones(64)])[:, None].astype(np.float32))
    low = upper - 3.0 * scale - tall
    canvas.image(content.bar, at, low, BAR * scale, tall)
    canvas.text(at, upper + 3.0 * scale, content.scale.quantity.title, TEXT_COLOR)
    canvas.text(at + (BAR + 4.0) * scale, low + tall - 9.0 * scale, ends[1], TEXT_COLOR)
    canvas.text(at + (BAR + 4.0) * scale, low, ends[0], TEXT_COLOR)
    _draw_curves(content, canvas, x + gap, top - height + gap, whole - 2 * gap)


def _line(content: InsetContent) -> list[tuple[str, tuple]]:
    """Return the words above the curves with their colours."""
    if content.note:
        return [(content.note, NOTE_COLOR)]
    sums = [(f"{inset.now:.3g} N", (*color, 1.0)) for inset, color in zip(content.insets, COLORS)]
    return [("sum of normals", TEXT_COLOR), *sums]


def _draw_curves(content: InsetContent, canvas, x: float, y: float, width: float) -> None:
    scale = canvas.scale
    height = CURVE * scale
    largest = max((float(inset.force.max(initial=0.0)) for inset in content.insets), default=0.0)
    first, last = content.span
    span = max(last - first, 1.0)
    canvas.line([(x, y + height), (x, y), (x + width, y)], AXIS_COLOR, 1.0)
    if largest > 0.0:
        for below, (inset, color) in zip(range(len(content.insets) - 1, -1, -1), zip(content.insets, COLORS)):
            points = np.column_stack([x + (inset.frames - first) / span * width, y + inset.force / largest * height])
            canvas.line(
                points, (*color, 1.0), 1.5 + 2.0 * below
            )  # the first curves are wider, so that equal curves do not hide each other
    now = x + (content.frame - first) / span * width
    canvas.line([(now, y), (now, y + height)], AXIS_COLOR, 1.0)
    at = x + 4.0 * scale
    for text, color in _line(content):
        at += canvas.text(at, y + height + 3.0 * scale, text, color, x + width - at) + 8.0 * scale


class _PixelPainter:
    """Draws rectangles, images, lines and text, in pixels of the region."""

    def __init__(self, scale: float):
        import gpu

        self.scale = scale
        self._flat = gpu.shader.from_builtin("UNIFORM_COLOR")
        self._lines = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
        self._image = _image_shader()
        self._viewport = gpu.state.viewport_get()[2:]

    def rectangle(self, x, y, width, height, color) -> None:
        self._batch(self._flat, "TRI_FAN", pos=_corners(x, y, width, height), uniforms={"color": color})

    def image(self, texture, x, y, width, height) -> None:
        self._image.bind()
        self._image.uniform_sampler("image", texture)
        places = {"pos": _corners(x, y, width, height), "texCoord": [(0, 0), (1, 0), (1, 1), (0, 1)]}
        self._batch(self._image, "TRI_FAN", **places)

    def line(self, points, color, width: float) -> None:
        if len(points) > 1:
            points = [(float(x), float(y), 0.0) for x, y in points]
            uniforms = {"color": color, "lineWidth": width * self.scale, "viewportSize": self._viewport}
            self._batch(self._lines, "LINE_STRIP", pos=points, uniforms=uniforms)

    def text(self, x, y, words: str, color, room: float | None = None) -> float:
        """Draw words, cut off where there is no more `room`, and return their width."""
        import blf

        blf.size(0, 11.0 * self.scale)
        while room is not None and len(words) > 2 and blf.dimensions(0, words)[0] > room:
            words = words[:-2] + "…"
        blf.color(0, *color)
        blf.position(0, x, y, 0.0)
        blf.draw(0, words)
        return blf.dimensions(0, words)[0]

    def width(self, words: str) -> float:
        """Return the width of words."""
        import blf

        blf.size(0, 11.0 * self.scale)
        return blf.dimensions(0, words)[0]

    @staticmethod
    def _batch(shader, kind: str, uniforms=None, **content) -> None:
        import gpu
        from gpu_extras.batch import batch_for_shader

        batch = batch_for_shader(shader, kind, content)
        shader.bind()
        for name, value in (uniforms or {}).items():
            shader.uniform_float(name, value)
        gpu.state.blend_set("ALPHA")  # drawing text switches blending off
        batch.draw(shader)


def _image_shader():
    """Return the shader that shows textures with scene-linear colours as they are; Blender 5.0 gave it a name of its own."""
    import gpu

    try:
        return gpu.shader.from_builtin("IMAGE_SCENE_LINEAR_TO_REC709_SRGB")
    except ValueError:
        return gpu.shader.from_builtin("IMAGE")


def _corners(x, y, width, height):
    return [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]


def _texture(pixels: np.ndarray):
    import gpu

    height, width = pixels.shape[:2]
    pixels = pixels.copy()
    pixels[..., :3] = color_maps.linear(pixels[..., :3])  # the shader expects scene-linear colours
    buffer = gpu.types.Buffer("FLOAT", height * width * 4, np.ascontiguousarray(pixels, np.float32).ravel())
    return gpu.types.GPUTexture((width, height), format="RGBA32F", data=buffer)
