# SPDX-License-Identifier: GPL-3.0-or-later
"""The heat-map material shows a quantity of a bake in colours. It consists of Blender's own nodes only.

Blender's nodes read the first three channels of the baked images. A quantity in the first one is shown pixel by pixel by an
image texture, where the tactile image of the region is in one piece. A region that is cut open for its image, such as a whole
sphere, has no UV map in which faces share corners: there geometry nodes look up the image once per texel and pass the value to
the material as a vertex attribute. Other quantities are packed into the .blend (:mod:`.played_table`) and shown likewise: where
the image is in one piece pixel by pixel, and geometry nodes choose the picture of the frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from ...core.figures import color_maps
from ...core.figures.quantities import Quantity, Scale
from ...core.io.input_files import require_regular
from ..scene.stored_names import UV_MAP

TEXEL_UV = "palpate_uv"
TABLE = "values"
"""What follows the sensor's identity in the mark of the table of its values."""
IMAGE_CHANNEL = "R"
"""Channel of the baked images that the material reads."""
SENSOR_KEY = "palpate_sensor"
"""Custom property of a material, image, node group or marker: the identity of its sensor."""
RAMP_STOPS = 32


def attribute_of(quantity: Quantity) -> str:
    """Return the name of the vertex attribute with a quantity, which geometry nodes write."""
    return f"palpate_{quantity.name}"


MISSING_COLOR = (1.0, 0.0, 1.0)
"""Colour that Blender shows for an image that it does not find. Forces of exactly these values (N) do not occur in practice."""
GLOW = 0.8
"""Share of a heat map's colour that is its own light; the scene's light adds the rest, so that the shape is seen. Under light
that shows white as white the colours are those of the colour bar; without any light they are 9 % darker on the screen."""
MIX_SOCKETS = ("Factor_Float", "A_Color", "B_Color")


def find_block(blocks, uid: str):
    """Return the data-block of a sensor in a collection of bpy.data; None if there is none."""
    return next((block for block in blocks if block.get(SENSOR_KEY) == uid), None)


def load_sequence(uid: str, first: Path, relative: bool):
    """Return the image that plays a baked sequence.

    Parameters
    ----------
    uid : str
        Identity of the sensor.
    first : Path
        File of the first frame.
    relative : bool
        True to store the path relative to the .blend.
    """
    image = find_block(bpy.data.images, uid)
    path = bpy.path.relpath(str(first)) if relative else str(first)
    require_regular(first)
    if image is None:
        # The files of a bake that is saved together with its .blend are not in their place yet.
        image = bpy.data.images.load(path) if first.exists() else bpy.data.images.new(first.parent.name, 1, 1)
        image[SENSOR_KEY] = uid
    image.name = f"Palpate {first.parent.name}"
    image.filepath = path
    image.source = "SEQUENCE"
    image.colorspace_settings.name = "Non-Color"
    image.reload()
    return image


def set_image_frames(user, frame_start: int, frame_end: int) -> None:
    """Make an image user show file f at frame f and keep the last file afterwards; before the first frame it finds no file."""
    user.frame_duration = frame_end - frame_start + 1
    user.frame_start = frame_start
    user.frame_offset = frame_start - 1
    user.use_cyclic = False
    user.use_auto_refresh = True


@dataclass(frozen=True)
class ImageMapping:
    """How an image lies on a sensor: its UV map or another attribute with texture coordinates, and if pixels are blended."""

    coordinates: str = UV_MAP
    smooth: bool = False


def heat_map_material(
    uid: str, name: str, image, frames: tuple[int, int], scale: Scale, mapping: ImageMapping = ImageMapping()
):
    """Create a sensor's heat-map material, or rebuild the nodes of the existing one.

    Parameters
    ----------
    uid, name : str
        Identity and name of the sensor.
    image : Image or None
        From :func:`load_sequence`, or packed; None to read the values from the vertex attribute :func:`attribute_of`.
    frames : (int, int)
        First and last frame of the bake.
    scale : Scale
    mapping : ImageMapping

    Returns
    -------
    Material
    """
    material = find_block(bpy.data.materials, uid) or bpy.data.materials.new(f"Palpate {name}")
    material[SENSOR_KEY] = uid
    if material.node_tree is None:
        material.use_nodes = True
    material.node_tree.nodes.clear()
    add = NodeAdder(material.node_tree)
    value, missing = _add_value(add, image, frames, scale, mapping)
    color = _add_colors(add, value, scale)
    if missing is not None:
        color = _add_missing_color(add, color, missing)
    _add_surface(add, color)
    return material


def _add_value(add, image, frames: tuple[int, int], scale: Scale, mapping: ImageMapping):
    """Return the sockets of the value and, where it comes from an image, of a test that the image is missing."""
    if image is None:
        return add("ShaderNodeAttribute", attribute_name=attribute_of(scale.quantity)).outputs["Fac"], None
    texture = _texture(add, image, mapping)
    if image.source != "SEQUENCE":
        return _red(add, texture), None  # it is in the .blend
    set_image_frames(texture.image_user, *frames)
    return _red(add, texture), add_missing_test(add, texture.outputs["Color"])


def _add_colors(add, value, scale: Scale):
    """Return the socket of the colour of a value."""
    share = add("ShaderNodeMapRange", clamp=True, label=f"{scale.quantity.title} ({scale.unit})")
    add.tree.links.new(value, share.inputs["Value"])
    share.inputs["From Min"].default_value, share.inputs["From Max"].default_value = scale.low, scale.high
    ramp = add("ShaderNodeValToRGB")
    _fill_ramp(ramp.color_ramp, scale.colour_map)
    add.tree.links.new(share.outputs["Result"], ramp.inputs["Fac"])
    return ramp.outputs["Color"]


def _add_missing_color(add, color, missing):
    """Return the socket of a colour that turns to :data:`MISSING_COLOR` where there is no image."""
    mix = add("ShaderNodeMix", data_type="RGBA", label="Magenta: no image")
    factor, below, above = (next(s for s in mix.inputs if s.identifier == key) for key in MIX_SOCKETS)
    add.tree.links.new(missing, factor)
    add.tree.links.new(color, below)
    above.default_value = (*MISSING_COLOR, 1.0)
    return next(s for s in mix.outputs if s.identifier == "Result_Color")


def _add_surface(add, color) -> None:
    """Add a surface that shows a colour mostly by its own light, and its shape by little of the scene's light."""
    surface = add("ShaderNodeBsdfPrincipled")
    surface.inputs["Roughness"].default_value = 1.0
    surface.inputs["Specular IOR Level"].default_value = 0.0  # gloss would brighten the dark end of the colours
    surface.inputs["Emission Strength"].default_value = GLOW
    shaded = add("ShaderNodeVectorMath", operation="SCALE")
    shaded.inputs["Scale"].default_value = 1.0 - GLOW
    add.tree.links.new(color, shaded.inputs[0])
    add.tree.links.new(shaded.outputs["Vector"], surface.inputs["Base Color"])
    add.tree.links.new(color, surface.inputs["Emission Color"])
    output = add("ShaderNodeOutputMaterial")
    add.tree.links.new(surface.outputs["BSDF"], output.inputs["Surface"])


def _texture(add, image, mapping: ImageMapping):
    """Return a node that shows an image."""
    interpolation = "Linear" if mapping.smooth else "Closest"
    texture = add("ShaderNodeTexImage", image=image, interpolation=interpolation, extension="EXTEND")
    place = add("ShaderNodeAttribute", attribute_name=mapping.coordinates)
    add.tree.links.new(place.outputs["Vector"], texture.inputs["Vector"])
    return texture


def _red(add, texture):
    """Return the socket of an image's red channel, :data:`IMAGE_CHANNEL`."""
    channels = add("ShaderNodeSeparateColor")
    add.tree.links.new(texture.outputs["Color"], channels.inputs["Color"])
    return channels.outputs["Red"]


def add_missing_test(add, color):
    """Return a socket that is 1 where Blender found no image: the colour shown there must not be read as a large force."""
    distance = add("ShaderNodeVectorMath", operation="DISTANCE")
    distance.inputs[1].default_value = MISSING_COLOR
    add.tree.links.new(color, distance.inputs[0])
    is_equal = add("ShaderNodeMath", operation="LESS_THAN")
    is_equal.inputs[1].default_value = 1e-6
    add.tree.links.new(distance.outputs["Value"], is_equal.inputs[0])
    return is_equal.outputs[0]


class NodeAdder:
    """Adds nodes to a tree, from left to right."""

    def __init__(self, tree):
        self.tree, self.x = tree, 0.0

    def __call__(self, kind: str, **settings):
        node = self.tree.nodes.new(kind)
        for key, value in settings.items():
            setattr(node, key, value)
        node.location = self.x, 0.0
        self.x += 300.0
        return node


def _fill_ramp(ramp, color_map: str) -> None:
    at = np.linspace(0.0, 1.0, RAMP_STOPS)
    colors = color_maps.linear(color_maps.colors(color_map, at))
    while len(ramp.elements) < RAMP_STOPS:
        ramp.elements.new(1.0)
    for element, position, color in zip(ramp.elements, at, colors, strict=True):
        element.position = position
        element.color = (*color, 1.0)


def empty_node_group(mark: str, name: str):
    """Return an empty group of geometry nodes with this mark as its :data:`SENSOR_KEY`; an existing one is emptied."""
    group = find_block(bpy.data.node_groups, mark)
    if group is None:
        group = bpy.data.node_groups.new(f"Palpate {name}", "GeometryNodeTree")
        group[SENSOR_KEY] = mark
        group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
        group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    group.nodes.clear()
    return group


def add_image_lookup(add, image, frames: tuple[int, int]):
    """Return the socket of the image's colour at each texel, whose channels are normal force, shear x and shear y (N)."""
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


def image_values(add, image, frames: tuple[int, int]):
    """Return the socket of the image's channel :data:`IMAGE_CHANNEL` at each texel."""
    channels = add("FunctionNodeSeparateColor")
    add.tree.links.new(add_image_lookup(add, image, frames), channels.inputs["Color"])
    return channels.outputs["Red"]


def remove_blocks(uid: str, keep_image: bool = False) -> None:
    """Remove the data-blocks of a sensor's heat map; `keep_image` keeps the image sequence."""
    for blocks, mark in (
        (bpy.data.materials, uid),
        (bpy.data.node_groups, uid),
        (bpy.data.images, f"{uid}:{TABLE}"),
        (bpy.data.images, f"{uid}:area"),  # of Palpate 0.1.0
        (bpy.data.images, uid),
    ):
        block = find_block(blocks, mark)
        if block is not None and not (keep_image and mark == uid and blocks == bpy.data.images):
            blocks.remove(block)


def remove_orphans(uids) -> None:
    """Remove unused data-blocks of sensors that were deleted; `uids` are the identities of all objects."""
    for blocks in (bpy.data.materials, bpy.data.node_groups, bpy.data.images):  # images last: the others use them
        for block in list(blocks):
            if (
                block.users == 0
                and block.library is None
                and SENSOR_KEY in block
                and block[SENSOR_KEY].partition(":")[0] not in uids
            ):
                blocks.remove(block)
