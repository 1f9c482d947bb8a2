# SPDX-License-Identifier: GPL-3.0-or-later
"""Heat maps and force arrows drawn over the sensors in the 3D view. They are stored in no file.

They show what playing computes, and a bake where its materials cannot be seen, as in Solid view.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import bpy
import numpy as np

from ...core.figures.quantities import Scale
from ...core.geometry.mesh import TriangleMesh, vertex_normals
from ...core.io.bake_reader import frame_index
from ..scene import participants, stored_names
from ..session import session_state, transforms
from . import bake_display, indentation, inset, materials

LIFT = 0.004
"""Distance of the overlay from the sensor's surface, as a share of the sensor's size: at zero the two would flicker."""
ARROW_SHARE = 1.0
"""Length of the longest arrow, as a share of the largest sensor's size, as on a bake."""
DENT_ORDER = 0.01
"""Share of the distance of a dent from the surface at rest by which it is drawn behind it: a dent of up to 40 % of the sensor's
size, by :data:`LIFT`, still lies above the surface that Blender draws."""
PAINT_MODES = {"WEIGHT_PAINT", "VERTEX_PAINT", "TEXTURE_PAINT", "SCULPT"}
"""Modes that change an object stroke by stroke."""
SHOWING_MATERIALS = {"RENDERED"}
"""Kinds of shading in which a bake's own materials suffice. In the light of Material Preview, which is not the user's choice,
they are up to 7 % darker than their bar."""


@dataclass
class SensorOverlay:
    """Triangles and arrow of one sensor in the world; its GPU batches are made when it is first drawn.

    Attributes
    ----------
    corners : (c, 3) float32
        Of one triangle after another.
    colors : (c, 4) float32
    at_rest : (c, 3) float32 or None
        Where the corners would be on a surface without indentation, as the one that Blender draws while playing. What hides
        that surface hides the indentation, and that surface itself does not.
    normals : (c, 3) float32 or None
        Of that surface.
    line : (2, 3) float32 or None
        Ends of the net-force arrow.
    plain_only : bool
        Drawn only in views whose materials do not show the same.
    sensor : int
        Blender's number of the sensor in this session. Its overlay is not drawn while it is painted or edited.
    """

    corners: np.ndarray
    colors: np.ndarray
    line: np.ndarray | None
    plain_only: bool = False
    sensor: int = 0
    at_rest: np.ndarray | None = None
    normals: np.ndarray | None = None
    batches: list | None = None


_overlays: dict[int, list[SensorOverlay]] = {}
_shown: dict[int, tuple] = {}
"""By scene: the settings of the display with which a frame was shown last."""


def _settings_of(scene) -> tuple:
    """Return the settings of the display on which overlays depend."""
    own = scene.palpate
    indentation_factor = own.indentation_factor if own.show_indentation else 0.0
    return bake_display.figure_style(scene), own.show_overlay, own.show_inset, indentation_factor


def is_up_to_date(scene) -> bool:
    """Return True unless settings of the display have changed since a frame of a live simulation was shown."""
    return _shown.get(scene.session_uid) in (None, _settings_of(scene))


def show(scene, run, frame) -> None:
    """Show one frame of a live simulation."""
    if bpy.app.background:
        return
    settings = scene.palpate
    _overlays[scene.session_uid] = sensor_overlays(scene, run, frame) if settings.show_overlay else []
    if settings.show_inset:
        inset.show(scene, inset_content(scene, run, frame))
    else:
        inset.clear(scene)
    _shown[scene.session_uid] = _settings_of(scene)
    session_state.redraw_views()


def sensor_overlays(scene, run, frame) -> list[SensorOverlay]:
    """Return the heat maps and arrows of one frame of a live simulation; all sensors share one scale."""
    scale, metres, overlays = live_scale(scene, run), run.reading.metres_per_unit, []
    length = ARROW_SHARE * max((_size(sensor.texels) for sensor in run.scenario.read_out), default=0.0) / run.largest_net_force
    settings = scene.palpate
    factor = settings.indentation_factor if settings.show_indentation else 0.0
    for sensor, obj in zip(run.scenario.sensors, run.reading.sensor_objects(scene), strict=True):
        if not sensor.readout:
            continue
        readings, pose = frame.sensors[sensor.name], frame.poses[sensor.body]
        if not scale.quantity.is_in(readings):
            continue
        displacement = (factor if _gives_way(scene, obj) else 0.0) * readings.depth
        overlay = _heat_map(sensor.texels, readings, displacement, pose, scale, metres)
        overlay.line = _net_force(readings, pose, length, metres)
        overlay.sensor = obj.session_uid if obj is not None else 0
        overlays.append(overlay)
    return overlays


def show_bake(scene, bake, number: int, scale: Scale) -> None:
    """Show the heat maps of one frame of a bake in views without materials; its arrows are objects of the scene.

    Parameters
    ----------
    bake : Bake
    number : int
        The frame, which the bake must have.
    scale : Scale
    """
    if scene.palpate.show_overlay:
        _overlays[scene.session_uid] = baked_overlays(scene, bake, number, scale)
        session_state.redraw_views()


def baked_overlays(scene, bake, number: int, scale: Scale) -> list[SensorOverlay]:
    """Return the heat maps of one frame of a bake; see :func:`show_bake`."""
    recording, overlays = bake.recording, []
    sensors, poses = recording.at(number).sensors, recording.poses[frame_index(recording, number)]
    objects = stored_names.objects_of_bake(scene, bake.texels)
    for name, texels in bake.texels.items():
        body = bake.manifests[name].body or name
        if body in recording.body_names:
            pose = poses[recording.body_names.index(body)]
            readings, obj = sensors[name], objects.get(name)
            if not scale.quantity.is_in(readings):
                continue
            displacement = indentation.factor_of(obj) * readings.depth
            overlay = _heat_map(texels, readings, displacement, pose, scale, transforms.metres_per_unit(scene))
            overlay.plain_only = True
            overlay.sensor = obj.session_uid if obj is not None else 0
            overlays.append(overlay)
    return overlays


def inset_content(scene, run, frame) -> inset.InsetContent:
    """Return the tactile images and curves of one frame of a live simulation."""
    known = sorted(run.frames)
    texels = {sensor.name: sensor.texels for sensor in run.scenario.read_out}
    loads = {name: np.array([run.loads[number][name] for number in known]) for name in texels}
    return inset.inset_content(scene, frame, texels, np.array(known, float), loads, live_scale(scene, run))


def live_scale(scene, run) -> Scale:
    """Return the colours of a live simulation, as a bake of the frames so far would have them."""
    style = bake_display.figure_style(scene)
    return style.scale_of(run.extent(style.shown))


def _gives_way(scene, obj) -> bool:
    """Return True for a sensor that a bake would indent."""
    if obj is None or obj.type != "MESH" or obj.mode == "EDIT":
        return False
    # As it is: bringing it up to date while playing would report changes, for which the run is dropped and computed again.
    depsgraph = participants.view_layer_of(scene).depsgraph
    return depsgraph is not None and indentation.may_indent(obj, depsgraph)


def _heat_map(texels, readings, displacement: np.ndarray, pose: np.ndarray, scale: Scale, metres: float) -> SensorOverlay:
    """Return the heat map of a sensor at a pose, (7,) in metres; `metres` are those of a Blender unit.

    It lies on both sides of the surface, because the body of a sensor that is a sheet is seen from both. Its texels are moved
    inwards by `displacement`, (n,) metres.
    """
    lift = LIFT * _size(texels)
    rotation = transforms.rotation(pose[3:])
    rgb = scale.colors(scale.values(readings, texels))
    triangles = texels.layout.triangles
    # The lower side faces downwards, and comes first: where heat maps are drawn over all else, the upper side is drawn over it.
    sides = (-1.0, triangles[:, ::-1].ravel()), (1.0, triangles.ravel())
    corner = np.concatenate([corners for _, corners in sides])

    def on_both_sides(position: np.ndarray) -> np.ndarray:
        lifted = lift * texels.normal
        places = [(pose[:3] + (position + side * lifted)[corners] @ rotation.T) / metres for side, corners in sides]
        return np.concatenate(places).astype(np.float32)

    if not (displacement > 0.0).any():
        return SensorOverlay(on_both_sides(texels.position), _opaque(rgb[corner]), None)
    position = texels.position - np.maximum(displacement, 0.0)[:, None] * texels.normal
    # The light comes from between the normal and the tangent.
    towards = vertex_normals(TriangleMesh(position, triangles))
    lit = np.clip(np.einsum("ij,ij->i", towards, texels.normal + texels.tangent), 0.0, 1.0)
    shade = np.where(displacement > 0.0, materials.GLOW + (1.0 - materials.GLOW) * lit, 1.0)
    return SensorOverlay(
        on_both_sides(position),
        _opaque((rgb * shade[:, None])[corner]),
        None,
        at_rest=on_both_sides(texels.position),
        normals=(texels.normal[corner] @ rotation.T).astype(np.float32),
    )


def _opaque(rgb: np.ndarray) -> np.ndarray:
    return np.column_stack([rgb, np.ones(len(rgb))]).astype(np.float32)


def _net_force(readings, pose: np.ndarray, length: float, metres: float) -> np.ndarray | None:
    """Return the ends of the net-force arrow, of `length` metres per newton; None without contact."""
    if not readings.contact.any():
        return None
    foot = readings.centre_of_pressure
    tip = foot - readings.net_force * length
    return (pose[:3] + np.array([foot, tip]) @ transforms.rotation(pose[3:]).T) / metres


def _size(texels) -> float:
    """Return the longest side of a sensor, metres."""
    return float(np.ptp(texels.position, axis=0).max())


def clear(scene=None) -> None:
    """Stop showing the overlays of a scene, or of all scenes."""
    session_state.forget(_overlays, scene)
    session_state.forget(_shown, scene)
    inset.clear(scene)


def draw() -> None:
    """Called by each 3D view after the scene's own geometry."""
    overlays = _overlays.get(bpy.context.scene.session_uid)
    space = bpy.context.space_data
    if not overlays or not space.overlay.show_overlays:
        return
    import gpu

    scene = bpy.context.scene
    through, edited = draws_through(scene, space), edited_objects(bpy.context)
    materials_suffice = space.shading.type in SHOWING_MATERIALS and shows_colors_as_they_are(scene) and not through
    gpu.state.depth_test_set("ALWAYS" if through else "LESS_EQUAL")
    gpu.state.face_culling_set("BACK" if through else "NONE")  # of a closed sensor, the far side is below the near one
    gpu.state.depth_mask_set(True)
    for overlay in overlays:
        if overlay.plain_only and materials_suffice or overlay.sensor in edited:
            continue
        if overlay.batches is None:
            overlay.batches = _batches(overlay)
        for number, (shader, batch, uniforms) in enumerate(overlay.batches):
            gpu.state.depth_mask_set(number > 0 or overlay.at_rest is None)  # the dent is drawn over the surface at rest
            shader.bind()
            for name, value in uniforms.items():
                shader.uniform_float(name, value)
            batch.draw(shader)
    gpu.state.depth_mask_set(False)
    gpu.state.face_culling_set("NONE")
    gpu.state.depth_test_set("NONE")


def draws_through(scene, space) -> bool:
    """Return True where a 3D view draws heat maps over what covers them: as set, or in X-ray."""
    return scene.palpate.show_through or session_state.is_xray(space.shading)


def is_edited(obj) -> bool:
    """Return True if there is an object, and it is painted, sculpted or edited."""
    return obj is not None and obj.mode not in ("OBJECT", "POSE")


def edited_objects(context) -> set[int]:
    """Return Blender's numbers of the objects that are painted, sculpted or edited, which a heat map would hide."""
    active = context.object
    if not is_edited(active):
        return set()
    return {obj.session_uid for obj in context.objects_in_mode} | {active.session_uid}


def shows_colors_as_they_are(scene) -> bool:
    """Return True when materials have the colours of their bar in a 3D view: other view transforms change them."""
    view = scene.view_settings
    return (view.view_transform, view.look, view.exposure, view.gamma) == ("Standard", "None", 0.0, 1.0)


def _batches(overlay: SensorOverlay) -> list:
    import gpu
    from gpu_extras.batch import batch_for_shader

    plain, content = gpu.shader.from_builtin("SMOOTH_COLOR"), {"pos": overlay.corners, "color": overlay.colors}
    drawn = [(plain, content)]
    if overlay.at_rest is not None:
        # Where the dent is seen at a flat angle, the surface that Blender draws reaches beyond it, and would be grey.
        rest = {"pos": overlay.at_rest, "color": overlay.colors}
        drawn = [(plain, rest), (_indentation_shader(), {**content, "at_rest": overlay.at_rest, "normal": overlay.normals})]
    result = [(shader, batch_for_shader(shader, "TRIS", what), {}) for shader, what in drawn]
    if overlay.line is not None:
        lines = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
        viewport = gpu.state.viewport_get()[2:]
        uniforms = {"color": (1.0, 0.35, 0.05, 1.0), "lineWidth": 4.0, "viewportSize": viewport}
        result.append((lines, batch_for_shader(lines, "LINES", {"pos": overlay.line.astype(np.float32)}), uniforms))
    return result


@lru_cache
def _indentation_shader():
    """Return the shader of an indentation: a corner is as near as the surface at rest before it, or as itself if nearer.

    A small part of its distance stays, so that what is nearer in the dent hides what is behind it.

    `place` is where the line of sight through the corner meets the plane of the surface at rest; seen edge-on it meets none.
    """
    import gpu

    between = gpu.types.GPUStageInterfaceInfo("palpate_indentation")
    between.smooth("VEC4", "finalColor")
    info = gpu.types.GPUShaderCreateInfo()
    info.push_constant("MAT4", "ModelViewProjectionMatrix")
    for number, (kind, name) in enumerate((("VEC3", "pos"), ("VEC3", "at_rest"), ("VEC3", "normal"), ("VEC4", "color"))):
        info.vertex_in(number, kind, name)
    info.vertex_out(between)
    info.fragment_out(0, "VEC4", "fragColor")
    info.vertex_source(
        "void main() {"
        "  vec4 here = ModelViewProjectionMatrix * vec4(pos, 1.0);"
        "  vec4 before = inverse(ModelViewProjectionMatrix) * vec4(here.xy / here.w, -1.0, 1.0);"
        "  vec3 sight = normalize(pos - before.xyz / before.w);"
        "  float facing = dot(sight, normal);"
        "  if (abs(facing) > 0.05) {"
        "    vec4 place = ModelViewProjectionMatrix * vec4(pos + sight * dot(at_rest - pos, normal) / facing, 1.0);"
        "    float behind = here.z / here.w - place.z / place.w;"
        f"    here.z -= max(behind, 0.0) * {1.0 - DENT_ORDER} * here.w;"
        "  }"
        "  gl_Position = here;"
        "  finalColor = color;"
        "}"
    )
    info.push_constant("BOOL", "srgbTarget")  # set by Blender: the target takes linear light, as for its own shaders
    info.fragment_source(
        "void main() {"
        "  vec3 linear = mix(finalColor.rgb / 12.92, pow((finalColor.rgb + 0.055) / 1.055, vec3(2.4)),"
        "                    step(0.04045, finalColor.rgb));"
        "  fragColor = vec4(srgbTarget ? linear : finalColor.rgb, finalColor.a);"
        "}"
    )
    return gpu.shader.create_from_info(info)
