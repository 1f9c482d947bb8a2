# SPDX-License-Identifier: GPL-3.0-or-later
"""The heat-map material: normal force from the baked images, coloured. Made of Blender's own nodes, so it plays without us.

Where a texture map of the region is in one piece, an image texture shows the EXR sequence pixel by pixel. On a region that
had to be cut up (a whole sphere) no texture map of shared corners exists; there geometry nodes look the image up once per
texel and hand the force to the material as an attribute.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from ...core.figures import color_maps
from ..scene.display_names import UV_MAP

TEXEL_UV = "palpate_uv"
FORCE = "palpate_force"
"""Vertex attribute with the normal force (N): from geometry nodes after a bake, from the timeline while playing."""
AREA = "palpate_area"
"""Vertex attribute with the area of the texel, m²."""
SENSOR_KEY = "palpate_sensor"
"""Custom property that tells whose a material, an image, a node group or an arrow is."""
RAMP_STOPS = 32
MISSING_COLOR = (1.0, 0.0, 1.0)
"""What Blender shows for an image that it does not find. As forces in newtons it will not occur to the sixth digit."""
MIX_SOCKETS = ("Factor_Float", "A_Color", "B_Color")


def find_block(blocks, uid: str):
    """Return the data-block of a sensor in a collection of bpy.data; None when there is none."""
    return next((block for block in blocks if block.get(SENSOR_KEY) == uid), None)


def load_sequence(uid: str, first: Path, relative: bool):
    """Return the image that plays a baked sequence, by a path relative to the .blend or an absolute one."""
    image = find_block(bpy.data.images, uid)
    path = bpy.path.relpath(str(first)) if relative else str(first)
    if image is None:
        image = bpy.data.images.load(path)
        image[SENSOR_KEY] = uid
    image.name = f"Palpate {first.parent.name}"
    image.filepath = path
    image.source = "SEQUENCE"
    image.colorspace_settings.name = "Non-Color"
    image.reload()
    return image


def set_image_frames(user, frame_start: int, frame_end: int) -> None:
    """Make an image user show file number f at frame f and hold the last beyond; before the first it finds no file."""
    user.frame_duration = frame_end - frame_start + 1
    user.frame_start = frame_start
    user.frame_offset = frame_start - 1
    user.use_cyclic = False
    user.use_auto_refresh = True


def area_image(uid: str, name: str, area: np.ndarray):
    """Return an image of the texels' areas, (height, width) float in m², that is kept in the .blend."""
    mark = f"{uid}:area"
    image = find_block(bpy.data.images, mark)
    if image is not None:
        bpy.data.images.remove(image)
    height, width = area.shape
    image = bpy.data.images.new(f"Palpate {name} area", width, height, alpha=False, float_buffer=True, is_data=True)
    image[SENSOR_KEY] = mark
    pixels = np.ones((height, width, 4), dtype=np.float32)
    pixels[..., :3] = area[..., None]
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    return image


@dataclass(frozen=True)
class ImageMapping:
    """Where an image lies on a sensor: by which UV map, and if its pixels are blended."""

    uv_map: str = UV_MAP
    smooth: bool = False


def heat_map_material(
    uid: str,
    name: str,
    image,
    frames: tuple[int, int],
    maximum: float,
    color_map: str,
    area=None,
    coordinates: ImageMapping = ImageMapping(),
):
    """Return a sensor's heat-map material, made or made anew.

    Parameters
    ----------
    uid, name : str
        Of the sensor.
    image : Image or None
        From :func:`load_sequence`; None to take the force from the vertex attribute.
    frames : (int, int)
        First and last frame of the bake.
    maximum : float, N or Pa
        At the upper end of the colours.
    color_map : str
        Key of :data:`.colormaps.STOPS`.
    area : Image, str or None
        What the force is divided by: an image as :func:`area_image` makes it, or the name of a vertex attribute.
    coordinates : Coordinates
        Of the images.
    """
    material = find_block(bpy.data.materials, uid) or bpy.data.materials.new(f"Palpate {name}")
    material[SENSOR_KEY] = uid
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    add = NodeAdder(tree)
    missing = None
    if image is None:
        value = add("ShaderNodeAttribute", attribute_name=FORCE).outputs["Fac"]
    else:
        texture = _texture(add, image, coordinates)
        set_image_frames(texture.image_user, *frames)
        value, missing = _red(add, texture), add_missing_test(add, texture.outputs["Color"])
    if area is not None:
        own = add("ShaderNodeAttribute", attribute_name=area).outputs["Fac"] if isinstance(area, str) else None
        over = add("ShaderNodeMath", operation="DIVIDE", label="Pressure (Pa)")
        tree.links.new(value, over.inputs[0])
        tree.links.new(own or _red(add, _texture(add, area, coordinates)), over.inputs[1])
        value = over.outputs[0]
    label = "Normal force / maximum (N)" if area is None else "Pressure / maximum (Pa)"
    share = add("ShaderNodeMath", operation="DIVIDE", use_clamp=True, label=label)
    tree.links.new(value, share.inputs[0])
    share.inputs[1].default_value = maximum
    ramp = add("ShaderNodeValToRGB")
    _fill(ramp.color_ramp, color_map)
    tree.links.new(share.outputs[0], ramp.inputs["Fac"])
    color = ramp.outputs["Color"]
    if missing is not None:
        mix = add("ShaderNodeMix", data_type="RGBA", label="Magenta: no image")
        factor, below, above = (next(s for s in mix.inputs if s.identifier == key) for key in MIX_SOCKETS)
        tree.links.new(missing, factor)
        tree.links.new(color, below)
        above.default_value = (*MISSING_COLOR, 1.0)
        color = next(s for s in mix.outputs if s.identifier == "Result_Color")
    surface = add("ShaderNodeBsdfPrincipled")
    surface.inputs["Roughness"].default_value = 0.6
    surface.inputs["Specular IOR Level"].default_value = 0.1  # a shine would lighten the dark end of the colours
    surface.inputs["Emission Strength"].default_value = 0.4
    tree.links.new(color, surface.inputs["Base Color"])
    tree.links.new(color, surface.inputs["Emission Color"])
    output = add("ShaderNodeOutputMaterial")
    tree.links.new(surface.outputs["BSDF"], output.inputs["Surface"])
    return material


def _texture(add, image, coordinates: ImageMapping):
    """Return a node that shows an image by texture coordinates."""
    interpolation = "Linear" if coordinates.smooth else "Closest"
    texture = add("ShaderNodeTexImage", image=image, interpolation=interpolation, extension="EXTEND")
    uv = add("ShaderNodeUVMap", uv_map=coordinates.uv_map)
    add.tree.links.new(uv.outputs["UV"], texture.inputs["Vector"])
    return texture


def _red(add, texture):
    channels = add("ShaderNodeSeparateColor")
    add.tree.links.new(texture.outputs["Color"], channels.inputs["Color"])
    return channels.outputs["Red"]


def add_missing_test(add, color):
    """Return a socket that is 1 where Blender found no image: its sign for that must not pass for a large force."""
    distance = add("ShaderNodeVectorMath", operation="DISTANCE")
    distance.inputs[1].default_value = MISSING_COLOR
    add.tree.links.new(color, distance.inputs[0])
    near = add("ShaderNodeMath", operation="LESS_THAN")
    near.inputs[1].default_value = 1e-6
    add.tree.links.new(distance.outputs["Value"], near.inputs[0])
    return near.outputs[0]


class NodeAdder:
    """Adds nodes from left to right."""

    def __init__(self, tree):
        self.tree, self.x = tree, 0.0

    def __call__(self, kind: str, **settings):
        node = self.tree.nodes.new(kind)
        for key, value in settings.items():
            setattr(node, key, value)
        node.location = self.x, 0.0
        self.x += 300.0
        return node


def _fill(ramp, color_map: str) -> None:
    at = np.linspace(0.0, 1.0, RAMP_STOPS)
    colors = color_maps.linear(color_maps.colors(color_map, at))
    while len(ramp.elements) < RAMP_STOPS:
        ramp.elements.new(1.0)
    for element, position, color in zip(ramp.elements, at, colors, strict=True):
        element.position = position
        element.color = (*color, 1.0)


def empty_node_group(mark: str, name: str):
    """Return an empty group of geometry nodes, a sensor's own by its mark; an earlier one is emptied."""
    group = find_block(bpy.data.node_groups, mark)
    if group is None:
        group = bpy.data.node_groups.new(f"Palpate {name}", "GeometryNodeTree")
        group[SENSOR_KEY] = mark
        group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
        group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    group.nodes.clear()
    return group


def add_image_lookup(add, image, frames: tuple[int, int]):
    """Return the socket of the image's colour at each texel: normal force, shear along x and along y, N."""
    link = add.tree.links.new
    where = add("GeometryNodeInputNamedAttribute", data_type="FLOAT_VECTOR")
    where.inputs["Name"].default_value = TEXEL_UV
    time = add("GeometryNodeInputSceneTime")
    # A geometry node's Frame counts files from frame_start, like an image user with offset zero.
    texture = add("GeometryNodeImageTexture", interpolation="Closest", extension="EXTEND")
    texture.inputs["Image"].default_value = image
    link(where.outputs["Attribute"], texture.inputs["Vector"])
    clamp = add("ShaderNodeClamp")
    clamp.inputs["Min"].default_value, clamp.inputs["Max"].default_value = frames
    link(time.outputs["Frame"], clamp.inputs["Value"])
    link(clamp.outputs["Result"], texture.inputs["Frame"])
    return texture.outputs["Color"]


def force_node_group(uid: str, name: str, image, frames: tuple[int, int]):
    """Return the geometry nodes that look the image up at each texel and store the force on the vertices."""
    group = empty_node_group(uid, name)
    add, link = NodeAdder(group), group.links.new
    start = add("NodeGroupInput")
    channels = add("FunctionNodeSeparateColor")
    link(add_image_lookup(add, image, frames), channels.inputs["Color"])
    store = add("GeometryNodeStoreNamedAttribute", data_type="FLOAT", domain="POINT")
    store.inputs["Name"].default_value = FORCE
    link(start.outputs[0], store.inputs["Geometry"])
    link(channels.outputs["Red"], store.inputs["Value"])
    link(store.outputs["Geometry"], add("NodeGroupOutput").inputs[0])
    return group


def remove_blocks(uid: str, keep_image: bool = False) -> None:
    """Remove everything of a sensor's heat map that is not on its mesh."""
    for blocks, mark in (
        (bpy.data.materials, uid),
        (bpy.data.node_groups, uid),
        (bpy.data.images, f"{uid}:area"),
        (bpy.data.images, uid),
    ):
        block = find_block(blocks, mark)
        if block is not None and not (keep_image and mark == uid and blocks == bpy.data.images):
            blocks.remove(block)


def remove_orphans(uids) -> None:
    """Remove what heat maps of deleted sensors have left, as far as nobody uses it; `uids` are those of all objects."""
    for blocks in (bpy.data.materials, bpy.data.node_groups, bpy.data.images):  # images last: the others use them
        for block in list(blocks):
            if (
                block.users == 0
                and block.library is None
                and SENSOR_KEY in block
                and block[SENSOR_KEY].partition(":")[0] not in uids
            ):
                blocks.remove(block)
