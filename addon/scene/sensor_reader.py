# SPDX-License-Identifier: GPL-3.0-or-later
"""Read one sensor or target out of Blender: its mesh in the frame of its body, its texels, parameters and painted values."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...core.errors import SensorError
from ...core.geometry.mesh import TriangleMesh, checked_mesh, outward_faces
from ...core.geometry.texels import FRAME_NORMAL, Texels, texels_from_region
from ...core.model.recording import ChannelReadout
from ...core.model.sensor import Sensor
from ...core.model.sensor_parameters import Painted
from ...core.skins import skin_presets
from ...core.skins.channel_readouts import MagneticReadout, net_force_of
from ...core.skins.magnetic_skin import Magnetometers, Magnets, magnetic_skin
from ..properties import effect_stack, object_properties, parameter_properties
from ..session import transforms
from . import mesh_arrays, moved_bodies, sensor_regions, uv_layouts
from .stored_names import STATED_NORMAL


def with_channels(obj, sensor: Sensor, to_body: tuple[np.ndarray, np.ndarray], depsgraph) -> Sensor:
    """Return a sensor with the read-out that its object's settings choose.

    Parameters
    ----------
    obj : Object
    sensor : Sensor
        Of the object.
    to_body : (3, 3) and (3,) float
        A point x of the object is at the product of the first with x, plus the second, in the frame of the sensor's body, m.
    depsgraph : Depsgraph

    Raises
    ------
    SensorError
        There are no magnets or magnetometers, or they make no skin.
    """
    kind = obj.palpate.readout.kind
    if kind == "NONE" or not sensor.readout:
        return sensor
    if kind == object_properties.NET_FORCE:
        return replace(sensor, channels=net_force_of(sensor.texels))
    try:
        return replace(sensor, channels=_magnetic(obj, sensor, to_body, depsgraph))
    except SensorError as error:
        raise SensorError(f"Channels of sensor '{obj.name}': {error}") from error


def _magnetic(obj, sensor: Sensor, to_body: tuple[np.ndarray, np.ndarray], depsgraph) -> ChannelReadout:
    own, texels = obj.palpate.readout, sensor.texels
    if own.kind == object_properties.PLACED:
        magnets, chips = _placed(obj, to_body, depsgraph)
        thickness = transforms.as_typed(own.thickness)
    else:
        preset = skin_presets.preset_named(own.kind.lower())
        magnets, chips = skin_presets.placed(preset, texels)
        thickness = preset.thickness
    stiffness = transforms.as_typed(own.shear_stiffness) or sensor.parameters.k
    return MagneticReadout(magnetic_skin(texels, magnets, chips, thickness), texels, stiffness)


def _placed(obj, to_body: tuple[np.ndarray, np.ndarray], depsgraph) -> tuple[Magnets, Magnetometers]:
    """Return the magnets and magnetometers of a sensor's collection, in the frame of its body."""
    own = obj.palpate.readout
    if own.collection is None:
        raise SensorError("no collection has its magnets: choose one under Readout, or use Place Magnetic Skin.")
    linear, offset = to_body
    inverse = np.linalg.inv(moved_bodies.world_matrix(obj, depsgraph))
    found: dict[str, list] = {"MAGNET": [], "MAGNETOMETER": []}
    for part in object_properties.parts(obj):
        matrix = inverse @ moved_bodies.world_matrix(part, depsgraph)
        turned, place = linear @ matrix[:3, :3], linear @ matrix[:3, 3] + offset
        lengths = np.linalg.norm(turned, axis=0)
        if not (np.isfinite(place).all() and np.isfinite(turned).all() and (lengths > 0.0).all()):
            raise SensorError(f"'{part.name}' has a scale of zero, or a NaN or infinite location: correct it.")
        found[part.palpate.magnetic.part].append((part.palpate.magnetic, place, (turned / lengths).T))
    for kind, what in (("MAGNET", "magnet"), ("MAGNETOMETER", "magnetometer")):
        if not found[kind]:
            raise SensorError(
                f"its collection '{own.collection.name}' has no {what}: give an empty in it this part "
                "(Physics › Palpate Magnet), or use Place Magnetic Skin."
            )
    magnets, chips = found["MAGNET"], found["MAGNETOMETER"]
    return Magnets(
        place=np.array([place for _, place, _ in magnets]),
        moment=np.array([transforms.as_typed(part.moment) * axes[2] for part, _, axes in magnets]),
    ), Magnetometers(
        place=np.array([place for _, place, _ in chips]),
        axes=np.array([axes for _, _, axes in chips]),
        full_scale=np.array([transforms.as_typed(part.full_scale) for part, _, _ in chips]),
        offset=np.array([[transforms.as_typed(value) for value in part.zero_field] for part, _, _ in chips]),
    )


def sensor_in_own_frame(scene, obj, depsgraph) -> tuple[Sensor, TriangleMesh]:
    """Return a sensor in the frame of its own object, and its mesh in this frame.

    Raises
    ------
    PalpateError
        Its mesh or region makes no sensor.
    """
    _, _, stretch = moved_bodies.decompose(obj, moved_bodies.world_matrix(obj, depsgraph))
    mesh, _ = mesh_in_body_frame(obj, depsgraph, stretch * transforms.metres_per_unit(scene))
    return read_sensor(obj, 0, mesh, stretch), mesh


def mesh_in_body_frame(obj, depsgraph, linear: np.ndarray, offset: np.ndarray | float = 0.0) -> tuple[TriangleMesh, list[str]]:
    """Return an object's mesh in the frame of its body, metres, and warnings.

    Parameters
    ----------
    obj : Object
    depsgraph : Depsgraph
    linear, offset : (3, 3) and (3,) float
        A vertex x of the object is at linear · x + offset in the body's frame.
    """
    if obj.palpate.role == "TARGET":
        arrays, warnings = mesh_arrays.target_arrays(obj, depsgraph), []
    else:
        arrays, warnings = mesh_arrays.sensor_arrays(obj, depsgraph)
    triangles, quads = arrays.triangles, arrays.quads
    if np.linalg.det(linear) < 0:
        triangles, quads = triangles[:, ::-1], quads[:, ::-1]
        warnings.append(f"The scale of '{obj.name}' mirrors it: its faces were turned so that they still point outwards.")
    mesh, more = checked_mesh(arrays.vertices @ linear.T + offset, triangles, obj.name, quads)
    if obj.palpate.role == "TARGET":
        mesh, turned = outward_faces(mesh, obj.name)
        more += turned
    return mesh, warnings + more


def read_sensor(obj, body: int, mesh: TriangleMesh, linear: np.ndarray) -> Sensor:
    """Return the sensor or pad that an object is.

    Parameters
    ----------
    obj : Object
    body : int
        Index of its body.
    mesh : TriangleMesh
        Of the object, in the body's frame.
    linear : (3, 3) float
        Of the map from the object to the body's frame.
    """
    parameters = parameter_properties.sensor_parameters(obj.palpate)
    parameters.check(obj.name)
    is_read_out = obj.palpate.role == "SENSOR"
    texels = texels_from_region(mesh, sensor_regions.region_vertices(obj), obj.name)
    texels = _with_stated_normals(obj.data, texels, linear)
    if is_read_out:
        texels = uv_layouts.with_uv_layout(obj, texels)
    maps = {key: sensor_regions.painted_multipliers(obj, key) for key in parameter_properties.PAINTED_PARAMETERS}
    painted = Painted(**{key: None if values is None else values[texels.vertex] for key, values in maps.items()})
    return Sensor(obj.name, body, texels, parameters, readout=is_read_out, painted=painted, effects=effect_stack.stack(obj))


def _with_stated_normals(data, texels: Texels, linear: np.ndarray) -> Texels:
    """The texels with the normals that the file of an imported sensor states, if it states others than the surface has."""
    stated = mesh_arrays.point_vectors(data, STATED_NORMAL)
    if stated is None:
        return texels
    normal = np.linalg.solve(linear.T, stated[texels.vertex].T).T
    has_one = np.linalg.norm(normal, axis=1) > 0.0  # vertices that were added later have none
    frames = texels.local_frames
    frames[has_one, FRAME_NORMAL] = normal[has_one]
    return texels.with_local_frames(frames)
