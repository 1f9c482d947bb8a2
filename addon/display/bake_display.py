# SPDX-License-Identifier: GPL-3.0-or-later
"""Display of a bake in the scene: heat maps, markers and arrows, with the same scales for all sensors.

:func:`show_bake` makes them when a scene is baked. :func:`refresh` makes them again from the files of the bake, after the
settings of the display have changed.
"""

from __future__ import annotations

from itertools import combinations

import bpy
import numpy as np

from ...core import response
from ...core.errors import SceneError
from ...core.figures.figure_style import FigureStyle
from ...core.figures.quantities import Extent
from ...core.io.bake_folder import frame_file
from ...core.io.bake_reader import Bake, read_sensors
from ..properties import scene_properties
from ..scene import stored_names
from ..session import transforms
from . import bake_identity, baked_scene, heat_map, indentation, markers, materials, texel_arrows
from .baked_sensor import BakedSensor

LONGEST_TEXEL_ARROW = 0.2
"""Automatic length of the longest arrow of a texel, as a share of the largest sensor's size."""
FACING_COSINE = 0.7
"""Cosine of the largest angle between a force and the direction to another sensor at which it points at that sensor."""
FACING_ARROWS_SHARE = 0.94
"""Share of the distance between two sensors facing each other that their arrows may take up together."""


def _scales(settings, baked_sensors: list[BakedSensor]) -> tuple[dict[str, float], dict[str, float], dict[str, float]]:
    """Return the scales that all sensors of a scene share: as the settings name them, or chosen automatically.

    By kind: Blender units per newton and per newton metre, for the markers; Blender units per newton, for the arrows at the
    texels; and the length of the longest of these arrows, Blender units. Each kind of arrows at the texels has a scale of its
    own, because shear forces are much smaller than normal forces.
    """
    size = max((item.size for item in baked_sensors), default=1.0)
    unit = baked_sensors[0].scale if baked_sensors else 1.0
    largest_force = _largest(np.linalg.norm(item.readings.net_force, axis=1) for item in baked_sensors)
    largest_moment = _largest(np.linalg.norm(response.free_moment(item.readings), axis=1) for item in baked_sensors)
    peaks = {
        "NORMALS": _largest(item.readings.normal_force for item in baked_sensors),
        "SHEARS": _largest(np.linalg.norm(item.readings.shear, axis=2) for item in baked_sensors),
    }
    if settings.use_auto_arrow:
        force = min(size / largest_force, _max_scale_of_facing_arrows(baked_sensors)) if largest_force > 0 else 0.0
        texel = {kind: LONGEST_TEXEL_ARROW * size / peak if peak > 0 else 0.0 for kind, peak in peaks.items()}
    else:
        force = transforms.as_typed(settings.arrow_scale) / unit
        texel = dict.fromkeys(peaks, transforms.as_typed(settings.texel_arrow_scale) / unit)
    moment = 0.6 * size / largest_moment if largest_moment > 0 else 0.0
    return {"FORCE": force, "TORQUE": moment}, texel, {kind: texel[kind] * peak for kind, peak in peaks.items()}


def _max_scale_of_facing_arrows(baked_sensors: list[BakedSensor]) -> float:
    """Return the largest scale, Blender units per newton, at which arrows of sensors that face each other do not meet.

    Sensors face each other in a grasp: each pushes towards the other.
    """
    limit = np.inf
    reactions = [item.reactions() for item in baked_sensors]
    touching = [item.in_contact for item in baked_sensors]
    for a, b in combinations(range(len(baked_sensors)), 2):
        frames = touching[a] & touching[b]
        (from_a, push_a), (from_b, push_b) = ((foot[frames], push[frames]) for foot, push in (reactions[a], reactions[b]))
        distance = np.linalg.norm(from_b - from_a, axis=1)
        way = (from_b - from_a) / np.maximum(distance, 1e-12)[:, None]
        strengths = [np.maximum(np.linalg.norm(push, axis=1), 1e-12) for push in (push_a, push_b)]
        towards = (push_a * way).sum(axis=1) / strengths[0], -(push_b * way).sum(axis=1) / strengths[1]
        facing = (np.minimum(*towards) > FACING_COSINE) & (distance > 0)
        limit = min(limit, (0.5 * FACING_ARROWS_SHARE * distance / np.maximum(*strengths))[facing].min(initial=np.inf))
    return limit


def _largest(tables) -> float:
    return max((float(table.max(initial=0.0)) for table in tables), default=0.0)


def figure_style(scene, **others) -> FigureStyle:
    """Return a figure style that agrees with the colours in the scene; `others` are further fields of it."""
    own = scene.palpate
    lowest, limit = (None, None) if own.use_auto_range else scene_properties.color_range(own)
    given = {"colour_map": own.color_map, "quantity": own.quantity.lower(), "lowest": lowest, "limit": limit}
    return FigureStyle(**{**given, **others})


def take_style(scene, style: FigureStyle) -> None:
    """Let the settings of a scene, and its bake, show what a figure style does."""
    if figure_style(scene, width=style.width, dpi=style.dpi) == style:
        return
    own = scene.palpate
    own.color_map, own.quantity, own.use_auto_range = style.colour_map, style.quantity.upper(), style.limit is None
    if style.limit is not None:
        scene_properties.set_color_range(own, style.lowest, style.limit)
    refresh(scene, baked_scene.bake_folders(scene))


def show_bake(scene, baked_sensors: list[BakedSensor]) -> None:
    """Put heat maps, markers and arrows on the sensors of a finished bake; they replace earlier ones."""
    settings = scene.palpate
    of_markers, of_texels, longest = _scales(settings, baked_sensors)
    style = figure_style(scene)
    sources = ((item.readings, item.texels) for item in baked_sensors if style.shown.is_in(item.readings))
    scale = style.scale_of(Extent.of(style.shown, sources))
    relative = settings.folder.startswith("//")
    for item in baked_sensors:
        obj, frames = item.obj, (int(item.frames[0]), int(item.frames[-1]))
        image = materials.load_sequence(obj.palpate.uid, item.folder / frame_file(frames[0]), relative)
        heat_map.apply(item, image, scale)
        markers.keyframe_markers(scene, item, settings.overlays, of_markers)
        texel_arrows.build_arrows(scene, item, image, settings.overlays, of_texels, longest)
        obj.palpate.tactile_images = image
        obj.palpate.bake_folder = bpy.path.relpath(str(item.folder)) if relative else str(item.folder)
    indentation.show(baked_sensors, settings.indentation_factor if settings.show_indentation else None)


def refresh(scene, places: dict) -> None:
    """Make heat maps, markers and arrows again from the files of the bake.

    Parameters
    ----------
    places : dict of Object to Path
        Folder of each sensor.

    Raises
    ------
    PalpateError
        The files are missing or damaged, belong to another bake, or no longer match the scene, or the bake has no images.
    """
    if not places:
        raise SceneError(f"Nothing is baked in '{scene.name}': bake first.")
    bake_identity.require_own_bake(scene)
    bake: Bake = read_sensors(list(places.values()))
    names = {place: name for name, place in bake.folders.items()}
    bake_identity.require_images(bake)
    recording = bake.recording
    baked_sensors = []
    for obj, place in places.items():
        name = names[place]
        body_name = bake.manifests[name].body or obj.name
        body = stored_names.objects_of_bake(scene, [body_name]).get(body_name)
        if body is None or body_name not in recording.body_names:
            raise SceneError(f"'{body_name}', which moves sensor '{obj.name}', is not in the bake any more: bake again.")
        if len(obj.data.vertices) <= bake.texels[name].vertex.max():
            raise SceneError(f"The mesh of sensor '{obj.name}' has changed since it was baked: bake again.")
        baked_sensors.append(
            BakedSensor(
                obj=obj,
                body=body,
                texels=bake.texels[name],
                painted=bake.painted[name],
                parameters=bake.parameters[name],
                readings=recording.sensors[name],
                frames=recording.frames,
                poses=recording.poses[:, recording.body_names.index(body_name)],
                scale=transforms.metres_per_unit(scene),
                folder=place,
            )
        )
    show_bake(scene, baked_sensors)
