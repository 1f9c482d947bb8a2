# SPDX-License-Identifier: GPL-3.0-or-later
"""Encodes pictures as a video with Blender's sequencer and encoder, in a temporary scene."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import bpy

from ...core.errors import SceneError
from ...core.io.file_writing import atomic_write
from . import render


def encode_video(pictures: Sequence[str | os.PathLike], path: str | os.PathLike, fps: float) -> Path:
    """Write pictures of equal size as an MP4 (H.264), one per frame.

    Parameters
    ----------
    pictures : sequence of path
        PNG files of even width and height in one folder.
    path : path
        An existing file is replaced as a whole or not at all. The suffix becomes .mp4.
    fps : float

    Raises
    ------
    SceneError
        This Blender cannot encode videos.
    FileError
        The video cannot be written.
    """
    if not bpy.app.build_options.codec_ffmpeg:
        raise SceneError("This Blender was built without FFmpeg and cannot write videos: take another, or use the pictures.")
    path = Path(path).with_suffix(".mp4")
    scene = bpy.data.scenes.new("Palpate Video")
    try:
        _strip(scene, [Path(picture) for picture in pictures])
        _settings(scene, len(pictures), fps)
        with atomic_write(path) as temporary:
            scene.render.filepath = str(temporary)
            render.run_render(
                scene,
                temporary,
                failed="The video could not be made",
                not_written=f"The video was not written to '{path}'",
                animation=True,
            )
    finally:
        bpy.data.scenes.remove(scene)
    return path


def _strip(scene, pictures: list[Path]) -> None:
    """Add the pictures to the scene's sequencer and take over their size."""
    editor = scene.sequence_editor_create()
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences  # 4.4 renamed them
    strip = strips.new_image("Pictures", str(pictures[0]), channel=1, frame_start=1)
    for picture in pictures[1:]:
        strip.elements.append(picture.name)
    strip.colorspace_settings.name = "sRGB"
    image = bpy.data.images.load(str(pictures[0]))
    scene.render.resolution_x, scene.render.resolution_y = image.size
    bpy.data.images.remove(image)


def _settings(scene, count: int, fps: float) -> None:
    """Set the output of the temporary scene to MP4 (H.264)."""
    output = scene.render
    scene.frame_start, scene.frame_end = 1, count
    output.fps = max(1, round(fps))
    output.fps_base = output.fps / fps
    output.resolution_percentage = 100
    output.use_sequencer, output.use_compositing = True, False
    output.use_file_extension = False
    scene.view_settings.view_transform = "Standard"
    image = output.image_settings
    if hasattr(image, "media_type"):  # Blender 5.0
        image.media_type = "VIDEO"
    image.file_format = "FFMPEG"
    image.color_mode = "RGB"
    output.ffmpeg.format, output.ffmpeg.codec = "MPEG4", "H264"
    output.ffmpeg.constant_rate_factor = "HIGH"
    output.ffmpeg.gopsize = 12
