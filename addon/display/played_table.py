# SPDX-License-Identifier: GPL-3.0-or-later
"""Values of a sensor's vertices at every frame, packed into the .blend as an image, and nodes that look them up.

They play in any Blender and without the files of a bake. Three vertices share a pixel, and each frame has a row.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from ..scene import mesh_arrays
from . import materials

MOST_PIXELS = 4_000_000
"""Pixels of an image at most, 64 MB of memory; of longer bakes every second, third, … frame is kept."""


@dataclass(frozen=True)
class PlayedTable:
    """An image of values, its first and last frame, the frames from one of its rows to the next, and the names of attributes.

    The vector attribute `column` holds the image's texture coordinate u as x. `channel` is one for the channel that holds the
    vertex, and zero for the other two.
    """

    image: object
    first: int
    last: int
    step: int
    column: str
    channel: str

    @classmethod
    def packed(
        cls, mark: str, name: str, mesh, vertices: np.ndarray, rows: np.ndarray, frames: np.ndarray, attributes: tuple
    ) -> PlayedTable:
        """Return a new table.

        Parameters
        ----------
        mark, name : str
            The :data:`.materials.SENSOR_KEY` and the name of the image.
        vertices : (v,) int
        rows : (r, v) float
            Values of every :func:`frame_step` of the frames.
        frames : (F,) int
            One after another.
        attributes : (str, str)
            Names of the attributes that `mesh` gets.
        """
        width = max(1, -(-len(vertices) // 3))
        pixels = np.zeros((len(rows), width, 3))
        for channel in range(3):
            own = rows[:, channel::3]
            pixels[:, : own.shape[1], channel] = own
        image = _packed_image(mark, name, pixels)
        place = np.arange(len(vertices))
        mesh_arrays.store(mesh, attributes[0], np.outer((place // 3 + 0.5) / width, (1.0, 0.0, 0.0)), vertices)
        mesh_arrays.store(mesh, attributes[1], np.eye(3)[place % 3], vertices)
        return cls(image, int(frames[0]), int(frames[-1]), frame_step(len(frames), len(vertices)), *attributes)

    def lookup(self, add):
        """Return the socket of the value at each vertex, between two frames in between."""
        frame = _frame(add, self.first, self.last)
        rows = self.image.size[1]
        last_row = self.first + self.step * (rows - 1)
        ends = {"From Min": self.first, "From Max": max(last_row, self.first + 1)}
        ends |= {"To Min": 0.5 / rows, "To Max": 1.0 - 0.5 / rows}
        row = add("ShaderNodeMapRange", {"Value": frame, **ends}, clamp=True)
        column = add("ShaderNodeSeparateXYZ", {0: add.attribute(self.column)})
        given = {"Image": self.image, "Vector": add("ShaderNodeCombineXYZ", {"X": column, "Y": row})}
        color = add("GeometryNodeImageTexture", given, interpolation="Linear", extension="EXTEND")
        return add.vector("DOT_PRODUCT", color, add.attribute(self.channel), output="Value")


@dataclass(frozen=True)
class PlayedPictures:
    """An image with a picture of each frame beside the others, of which a material shows one pixel by pixel.

    Its first and last frame, the frames from one picture to the next, and how many of them are in a row and in a column.
    """

    image: object
    first: int
    last: int
    step: int
    across: int
    down: int

    @classmethod
    def packed(cls, mark: str, name: str, pictures: np.ndarray, frames: np.ndarray, step: int) -> PlayedPictures:
        """Return a new image of (r, height, width) pictures, one for every `step` of the frames, (F,) one after another."""
        count, height, width = pictures.shape
        across = min(count, -(-round((count * height * width) ** 0.5) // width))
        down = -(-count // across)
        pixels = np.zeros((down, height, across, width, 3))
        for number, picture in enumerate(pictures):
            pixels[number // across, :, number % across, :, 0] = picture
        image = _packed_image(mark, name, pixels.reshape(down * height, across * width, 3))
        return cls(image, int(frames[0]), int(frames[-1]), step, across, down)

    def place(self, add, uv):
        """Return the socket of texture coordinates in the image at the frame in view; `uv` is that of them in one picture."""
        passed = add.math("SUBTRACT", _frame(add, self.first, self.last), self.first)
        number = add.math("FLOOR", add.math("DIVIDE", passed, self.step))
        row = add.math("FLOOR", add.math("DIVIDE", number, self.across))
        corner = add("ShaderNodeCombineXYZ", {"X": add.math("MODULO", number, self.across), "Y": row})
        return add.vector("DIVIDE", add.vector("ADD", uv, corner), (self.across, self.down, 1.0))


def _packed_image(mark: str, name: str, pixels: np.ndarray):
    """Return a new image with (height, width, 3) values, in the .blend."""
    height, width, _ = pixels.shape
    image = bpy.data.images.new(name, width, height, alpha=False, float_buffer=True, is_data=True)
    image[materials.SENSOR_KEY] = mark
    image.use_half_precision = False  # a material would show a small change of a large value in steps
    image.pixels.foreach_set(np.concatenate([pixels, np.ones((height, width, 1))], axis=2).astype(np.float32).ravel())
    image.pack()
    return image


def _frame(add, first: int, last: int):
    """Return the socket of the frame in view, which is `first` before it and `last` after it."""
    frame = add("GeometryNodeInputSceneTime", output="Frame")
    return add("ShaderNodeClamp", {"Value": frame, "Min": first, "Max": last})


def frame_step(frames: int, vertices: int) -> int:
    """Return the least distance of kept frames at which the image has no more than :data:`MOST_PIXELS`."""
    return max(1, -(-frames * -(-vertices // 3) // MOST_PIXELS))
