# SPDX-License-Identifier: GPL-3.0-or-later
"""Lay out a sensor's tactile image by a UV map of its mesh, if the user has chosen that."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from ...core.errors import ImageError
from ...core.geometry.texels import Texels
from ...core.geometry.texture_maps import UVLayout, mapped_layout
from ..session import transforms
from . import mesh_arrays, stored_names

IMAGE_PROPERTIES = ("image_layout", "image_map", "image_size", "image_filter")
"""Properties of :class:`.properties.PALPATE_PG_object` that choose the layout."""


def with_uv_layout(obj, texels: Texels) -> Texels:
    """Return texels with the layout that their object's settings choose.

    Raises
    ------
    ImageError
        The UV map is missing, or no image can be made of it.
    """
    own = obj.palpate
    if own.image_layout != "UV":
        return texels
    layer = uv_layer(obj)
    texel_of_vertex = np.full(len(obj.data.vertices), -1)
    texel_of_vertex[texels.vertex] = np.arange(len(texels))
    obj.data.calc_loop_triangles()
    loops = transforms.values_of(obj.data.loop_triangles, "loops", np.int32, 3).reshape(-1, 3)
    triangles = texel_of_vertex[mesh_arrays.corner_vertices(obj.data)[loops]]
    inside = (triangles >= 0).all(axis=1)
    uv = transforms.values_of(layer.uv, "vector", width=2)
    triangles, corner_uv = triangles[inside], uv.reshape(-1, 2).astype(float)[loops[inside]]
    if obj.matrix_world.is_negative:  # the sensor's triangles are turned too, so that both are anticlockwise from outside
        triangles, corner_uv = triangles[:, ::-1], corner_uv[:, ::-1]
    nearest = own.image_filter == "NEAREST"
    layout = _layout(triangles.tobytes(), corner_uv.tobytes(), own.image_size, layer.name, nearest, obj.name)
    return replace(texels, layout=layout)


def uv_layer(obj):
    """Return the UV map of a sensor's tactile image: the named one, else the one that renders use.

    Raises
    ------
    ImageError
        There is no such map, or the mesh is being edited.
    """
    layers = [layer for layer in obj.data.uv_layers if layer.name != stored_names.UV_MAP]
    wanted = obj.palpate.image_map
    if not layers:
        raise ImageError(
            f"Sensor '{obj.name}' has no UV map for its tactile image: unwrap it (Edit Mode, UV › Smart UV Project), "
            "or set Readout › Image to Automatic."
        )
    if wanted and all(layer.name != wanted for layer in layers):
        there = ", ".join(f"'{layer.name}'" for layer in layers)
        raise ImageError(f"Sensor '{obj.name}' has no UV map '{wanted}': choose one of {there} in its Readout panel.")
    found = next((layer for layer in layers if layer.name == wanted), None)
    found = found or next((layer for layer in layers if layer.active_render), layers[0])
    if len(found.uv) != len(obj.data.loops):
        raise ImageError(f"The UV map of sensor '{obj.name}' cannot be read in Edit Mode: leave it (Tab) first.")
    return found


def layout_warnings(obj, texels: Texels) -> list[str]:
    """Return warnings about the layout of a sensor's texels."""
    layout = texels.layout
    small = layout.unresolved_texels() if isinstance(layout, UVLayout) and layout.map_name else 0
    if not small:
        return []
    return [
        f"{small} of {len(texels)} texels of '{obj.name}' are smaller than a pixel of its tactile image: "
        "choose a larger Readout › Resolution."
    ]


@lru_cache(maxsize=8)
def _layout(triangles: bytes, corner_uv: bytes, size: int, name: str, nearest: bool, sensor: str) -> UVLayout:
    """Compute a layout, which takes a while; panels ask for the same one repeatedly."""
    corners, uv = np.frombuffer(triangles, int).reshape(-1, 3), np.frombuffer(corner_uv).reshape(-1, 3, 2)
    return mapped_layout(corners, uv, size, map_name=name, nearest=nearest, sensor=sensor)
