# SPDX-License-Identifier: GPL-3.0-or-later
"""Hashes of meshes, by which a change of geometry is noticed."""

from __future__ import annotations

import hashlib
from contextlib import suppress

import numpy as np

from ...core.errors import SensorError
from ..properties import painted_maps
from . import mesh_arrays, sensor_regions


def evaluated_fingerprint(obj, depsgraph) -> str:
    """Return a hash of an object's evaluated geometry, of everything in it that forces depend on."""
    with mesh_arrays.evaluated_mesh(obj, depsgraph) as mesh:
        return _fingerprint(obj, mesh)


def own_fingerprint(obj) -> str:
    """Return the hash of an object's own mesh, without modifiers and animation; empty for curves, text and metaballs."""
    return _fingerprint(obj, obj.data) if obj.type == "MESH" else ""


def _fingerprint(obj, mesh) -> str:
    """Return the hash of a mesh of an object."""
    return arrays_fingerprint(mesh_arrays.positions(mesh), mesh_arrays.corner_vertices(mesh), region_bytes(obj))


def arrays_fingerprint(positions: np.ndarray, corners: np.ndarray, region: bytes) -> str:
    """Return the hash of positions and corners of a mesh (:mod:`.mesh_arrays`) and of :func:`region_bytes`."""
    digest = hashlib.blake2b(digest_size=16)
    for part in (positions, corners, region):
        digest.update(part)
    return digest.hexdigest()


def region_bytes(obj) -> bytes:
    """Return what the mesh of a sensor or pad says besides its shape: region, painted values, and UV maps of its images."""
    if obj.type != "MESH" or obj.palpate.role not in ("SENSOR", "PAD"):
        return b""
    parts = []
    with suppress(SensorError):  # reading the scene reports it
        parts.append(np.packbits(sensor_regions.region_vertices(obj, len(obj.data.vertices))).tobytes())
        for key in painted_maps.PAINTED_PARAMETERS:
            values = sensor_regions.painted_multipliers(obj, key)
            parts.append(b"" if values is None else values.tobytes())
    if obj.palpate.image_layout == "UV":
        for layer in obj.data.uv_layers:
            uv = np.empty(2 * len(layer.uv), dtype=np.float32)
            layer.uv.foreach_get("vector", uv)
            parts.append(layer.name.encode("utf-8", "surrogatepass") + uv.tobytes())
    return b"".join(parts)
