# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders a frame of the scene as a PNG, and places the camera so that given points fit into the picture."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

from ...core.errors import FileError, SceneError
from ...core.io.file_writing import atomic_write
from ..scene import participants
from ..session import fcurves

NEED_GL = {"BLENDER_EEVEE_NEXT", "BLENDER_EEVEE", "BLENDER_WORKBENCH"}
"""Engines that need OpenGL, from a graphics card or from Mesa's software renderer."""
SAMPLES_WITHOUT_DENOISER = 4
"""Factor of the samples where there is no denoiser: it halves the noise."""
_SURFACELESS = 0x31DD
"""EGL_PLATFORM_SURFACELESS_MESA"""


def bounding_box_corners(objects) -> np.ndarray:
    """Return the corners of the objects' bounding boxes, modifiers included, in world coordinates.

    Returns
    -------
    (8 m, 3) float, Blender units
    """
    depsgraph = bpy.context.evaluated_depsgraph_get()
    found = []
    for obj in objects:
        evaluated = obj.evaluated_get(depsgraph)
        box = np.array(evaluated.bound_box)
        matrix = np.array(evaluated.matrix_world)
        found.append(box @ matrix[:3, :3].T + matrix[:3, 3])
    return np.concatenate(found)


def is_rendered(obj) -> bool:
    """Return True for an object with a surface that pictures show."""
    return obj.type in participants.OBJECT_TYPES and not obj.hide_render and obj.visible_get()


class TemporaryChanges:
    """Properties that are changed, and data-blocks that are added, until the context is left."""

    def __init__(self):
        self._before: list[tuple[object, str, object]] = []
        self._added: list = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for owner, name, value in self._before:
            setattr(owner, name, value)
        for block in self._added:
            _remove(block)

    def keep(self, owner, *names: str) -> None:
        """Restore these properties at the end, before those that are named later."""
        known = [name for other, name, _ in self._before if other == owner]
        self._before += [(owner, name, getattr(owner, name)) for name in names if name not in known]

    def set(self, owner, **values) -> None:
        """Give properties other values."""
        for name, value in values.items():
            self.keep(owner, name)
            setattr(owner, name, value)

    def add(self, block):
        """Return a new data-block, which is removed at the end."""
        self._added.append(block)
        return block


def _remove(block) -> None:
    if isinstance(block, bpy.types.World | bpy.types.Material):
        (bpy.data.worlds if isinstance(block, bpy.types.World) else bpy.data.materials).remove(block)
        return
    data = block.data
    bpy.data.objects.remove(block)
    kinds = {bpy.types.Camera: bpy.data.cameras, bpy.types.Light: bpy.data.lights, bpy.types.Mesh: bpy.data.meshes}
    next(blocks for kind, blocks in kinds.items() if isinstance(data, kind)).remove(data)


def fit_camera(scene, points: np.ndarray, region=(0.05, 0.05, 0.95, 0.95)) -> None:
    """Move the scene's camera, without rotating it, so that all points just fit into a region of the picture.

    Parameters
    ----------
    scene : bpy.types.Scene
        Its camera is perspective; the size of its render determines the aspect ratio.
    points : (n, 3) float, Blender units, world
    region : (4,) float
        Left, bottom, right and top of the region, as shares of the picture's width and height.

    Raises
    ------
    SceneError
        There is no perspective camera.
    """
    camera, width, height = _camera_view(scene)
    turn = np.array(camera.matrix_world)[:3, :3]
    turn = turn / np.linalg.norm(turn, axis=0)
    local = np.asarray(points, float) @ turn  # x to the right, y up, z towards the viewer
    left, bottom, right, top = ((2 * r - 1) * half for r, half in zip(region, (width, height, width, height), strict=True))
    # A point is seen at slope (x - cx) / (cz - z). For slopes within [low, high] the camera's cx lies between two lines in cz,
    # and the nearest camera is where the tighter pair of lines crosses.
    spans = []
    for axis, low, high in ((0, left, right), (1, bottom, top)):
        at_least = (local[:, axis] + high * local[:, 2]).max()
        at_most = (local[:, axis] + low * local[:, 2]).min()
        spans.append((at_least, high, at_most, low))
    distance = max((at_least - at_most) / (high - low) for at_least, high, at_most, low in spans)
    centre = [0.5 * (at_least - high * distance + at_most - low * distance) for at_least, high, at_most, low in spans]
    matrix = camera.matrix_world.copy()
    matrix.translation = tuple(turn @ np.array([*centre, distance]))
    camera.matrix_world = matrix
    bpy.context.view_layer.update()


def image_position(scene, point) -> tuple[float, float]:
    """Return the position of a world point in the picture, as shares of its width and height from the lower left corner."""
    camera, width, height = _camera_view(scene)
    x, y, z = camera.matrix_world.normalized().inverted() @ Vector(point)
    return 0.5 + 0.5 * x / (-z * width), 0.5 + 0.5 * y / (-z * height)


def view_direction(scene, x: float, y: float) -> Vector:
    """Return the direction in which a place in the picture is seen, (3,) in the world: :func:`image_position` backwards."""
    camera, width, height = _camera_view(scene)
    return camera.matrix_world.normalized().to_3x3() @ Vector(((2.0 * x - 1.0) * width, (2.0 * y - 1.0) * height, -1.0))


def pixels_per_unit(scene, point, width: int) -> float:
    """Return how many pixels a Blender unit across the view takes at a world point, in a picture of this width."""
    camera, across, _ = _camera_view(scene)
    depth = -(camera.matrix_world.normalized().inverted() @ Vector(point)).z
    return 0.5 * width / (max(depth, 1e-9) * across)


def render_frame(scene, path: str | os.PathLike, frame: int, *, samples: int | None = None, size=None) -> Path:
    """Render one frame of `scene` with its engine and camera to a PNG; the scene's settings are restored.

    Parameters
    ----------
    path : path
        An existing file is replaced as a whole or not at all.
    frame : int
    samples : int, optional
        Samples per pixel for Cycles and EEVEE. Default: the scene's. Cycles takes four times as many if the scene asks for
        denoising and this Blender cannot denoise.
    size : (2,) int, optional
        Width and height, pixels. Default: the scene's.

    Raises
    ------
    SceneError
        The scene has no perspective camera, or Blender cannot render it with the scene's engine.
    FileError
        The picture cannot be written.
    """
    _camera(scene)
    if scene.render.engine in NEED_GL and not has_opengl():
        raise SceneError(
            f"EEVEE and Workbench need OpenGL, which this machine has not without a window, so '{scene.name}' cannot be "
            "rendered: choose Cycles."
        )
    path = Path(path)
    if path.suffix.lower() != ".png":
        path = path.with_name(path.name + ".png")
    with atomic_write(path) as temporary, _settings(scene, temporary, frame, samples, size):
        run_render(
            scene,
            temporary,
            failed=f"Frame {frame} of '{scene.name}' could not be rendered",
            not_written=f"The render of frame {frame} was not written to '{path}'",
        )
    return path


def run_render(scene, file: Path, failed: str, not_written: str, animation: bool = False) -> None:
    """Run Blender's render operator, which writes `file` as the scene's settings say.

    Parameters
    ----------
    failed, not_written : str
        Beginning of the message if Blender cannot render, and if it writes no file.
    animation : bool
        Render the whole frame range instead of the present frame.

    Raises
    ------
    SceneError
        Blender cannot render the scene.
    FileError
        Blender has not written the file.
    """
    file.unlink(missing_ok=True)  # so that a render that writes no file is noticed
    try:
        bpy.ops.render.render(animation=animation, write_still=not animation, scene=scene.name)
    except RuntimeError as error:
        reason = " ".join(str(error).removeprefix("Error:").split()).rstrip(".")
        raise SceneError(f"{failed}: {reason}.") from error
    if not file.exists():
        raise FileError(f"{not_written}: check the space left on the disk.")


@lru_cache
def has_opengl() -> bool:
    """Return True if Blender can use OpenGL. Without a window and without EGL, EEVEE and Workbench would end the process."""
    if not bpy.app.background or not sys.platform.startswith("linux"):
        return True
    try:
        egl = ctypes.CDLL("libEGL.so.1")
    except OSError:
        return False
    egl.eglGetDisplay.argtypes, egl.eglGetDisplay.restype = [ctypes.c_void_p], ctypes.c_void_p
    egl.eglGetPlatformDisplay.argtypes = [ctypes.c_uint, ctypes.c_void_p, ctypes.c_void_p]
    egl.eglGetPlatformDisplay.restype = ctypes.c_void_p
    egl.eglInitialize.argtypes = [ctypes.c_void_p] * 3
    displays = egl.eglGetDisplay(None), egl.eglGetPlatformDisplay(_SURFACELESS, None, None)
    return any(display and egl.eglInitialize(display, None, None) for display in displays)


def can_denoise() -> bool:
    """Return True if Cycles was built with its denoiser. In some distributions it is not, and refuses to render with it."""
    try:
        import _cycles
    except ImportError:
        return False
    return bool(getattr(_cycles, "with_openimagedenoise", False))


def _camera(scene):
    camera = scene.camera
    if camera is None or camera.type != "CAMERA" or camera.data.type != "PERSP":
        raise SceneError(f"'{scene.name}' has no perspective camera: add one and make it the scene's camera.")
    return camera


def _camera_view(scene) -> tuple[object, float, float]:
    """Return a scene's camera, and the tangents of half its horizontal and half its vertical field of view."""
    render, camera = scene.render, _camera(scene)
    frame = camera.data.view_frame(scene=scene)
    depth = -frame[0].z
    if render.resolution_x <= 0 or depth <= 0:
        raise SceneError(f"The camera of '{scene.name}' has no field of view: check its lens and the render size.")
    return camera, max(abs(c.x) for c in frame) / depth, max(abs(c.y) for c in frame) / depth


@contextmanager
def _settings(scene, path: Path, frame: int, samples: int | None, size) -> Iterator[None]:
    """Change the settings of a scene for one render, then restore them."""
    render, image = scene.render, scene.render.image_settings
    with fcurves.frame_kept(scene), TemporaryChanges() as changes:
        # Blender 5.0 has media types, which decide about the formats to choose from, as these do about the colours.
        kinds = ("media_type", "file_format", "color_mode", "color_depth")
        changes.keep(image, *(name for name in kinds if hasattr(image, name)))
        if hasattr(image, "media_type"):
            image.media_type = "IMAGE"
        image.file_format, image.color_depth = "PNG", "8"
        image.color_mode = "RGBA" if render.film_transparent else "RGB"
        changes.set(render, filepath=str(path), use_file_extension=False, use_overwrite=True)
        if size is not None:
            changes.set(render, resolution_x=int(size[0]), resolution_y=int(size[1]), resolution_percentage=100)
        if render.engine == "CYCLES" and scene.cycles.use_denoising and not can_denoise():
            changes.set(scene.cycles, use_denoising=False)
            samples = SAMPLES_WITHOUT_DENOISER * int(scene.cycles.samples if samples is None else samples)
        if samples is not None:
            if render.engine == "CYCLES":
                changes.set(scene.cycles, samples=int(samples))
            elif hasattr(scene, "eevee"):
                changes.set(scene.eevee, taa_render_samples=int(samples))
        scene.frame_set(frame)
        yield
