# SPDX-License-Identifier: GPL-3.0-or-later
"""The heat-map material shows a quantity of a bake in colours. It consists of Blender's own nodes only.

Blender's nodes read the first three channels of the baked images. A quantity in the first one is shown pixel by pixel by an
image texture, where the tactile image of the region is in one piece. A region that is cut open for its image, such as a whole
sphere, has no UV map in which faces share corners: there geometry nodes look up the image once per texel and pass the value to
the material as a vertex attribute. Other quantities are packed into the .blend (:mod:`.played_table`) and shown likewise: where
the image is in one piece pixel by pixel, and geometry nodes choose the picture of the frame.
"""

from __future__ import annotations

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
IMAGE_CHANNEL, IMAGE_OUTPUT = "R", "Red"
"""Channel of the baked images that the material reads, and what Blender's nodes call it."""
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


def heat_map_material(
    uid: str, name: str, image, frames: tuple[int, int], scale: Scale, coordinates: str = UV_MAP, smooth: bool = False
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
    coordinates : str
        UV map of the image, or another attribute with texture coordinates.
    smooth : bool
        Pixels of the image are blended.

    Returns
    -------
    Material
    """
    material = find_block(bpy.data.materials, uid) or bpy.data.materials.new(f"Palpate {name}")
    material[SENSOR_KEY] = uid
    tree = tree_of(material)
    tree.nodes.clear()
    add = NodeAdder(tree)
    value, missing = _value(add, image, frames, scale, coordinates, smooth)
    color = _colors(add, value, scale)
    if missing is not None:
        color = add.mix(missing, color, (*MISSING_COLOR, 1.0), label="Magenta: no image")
    _add_surface(add, color)
    return material


def _value(add, image, frames: tuple[int, int], scale: Scale, coordinates: str, smooth: bool):
    """Return the sockets of the value and, where it comes from an image, of a test that the image is missing."""
    if image is None:
        return add("ShaderNodeAttribute", output="Fac", attribute_name=attribute_of(scale.quantity)), None
    place = add("ShaderNodeAttribute", output="Vector", attribute_name=coordinates)
    interpolation = "Linear" if smooth else "Closest"
    color = add("ShaderNodeTexImage", {"Vector": place}, image=image, interpolation=interpolation, extension="EXTEND")
    value = add("ShaderNodeSeparateColor", {"Color": color}, IMAGE_OUTPUT)
    if image.source != "SEQUENCE":
        return value, None  # it is in the .blend
    user, (first, last) = color.node.image_user, frames  # file f at frame f; before the first no file, afterwards the last
    user.frame_duration, user.frame_start, user.frame_offset = last - first + 1, first, first - 1
    user.use_cyclic, user.use_auto_refresh = False, True
    return value, add_missing_test(add, color)


def _colors(add, value, scale: Scale):
    """Return the socket of the colour of a value."""
    ends = {"From Min": scale.low, "From Max": scale.high}
    share = add("ShaderNodeMapRange", {"Value": value, **ends}, clamp=True, label=f"{scale.quantity.title} ({scale.unit})")
    color = add("ShaderNodeValToRGB", {"Fac": share})
    ramp, at = color.node.color_ramp, np.linspace(0.0, 1.0, RAMP_STOPS)
    while len(ramp.elements) < RAMP_STOPS:
        ramp.elements.new(1.0)
    colors = color_maps.linear(color_maps.colors(scale.colour_map, at))
    for element, position, rgb in zip(ramp.elements, at, colors, strict=True):
        element.position, element.color = position, (*rgb, 1.0)
    return color


def _add_surface(add, color) -> None:
    """Add a surface that shows a colour mostly by its own light, and its shape by little of the scene's light."""
    shaded = add.vector("SCALE", color, Scale=1.0 - GLOW)
    dull = {"Roughness": 1.0, "Specular IOR Level": 0.0}  # gloss would brighten the dark end of the colours
    light = {"Base Color": shaded, "Emission Color": color, "Emission Strength": GLOW}
    add.end("ShaderNodeOutputMaterial", {"Surface": add("ShaderNodeBsdfPrincipled", {**light, **dull})})


def add_missing_test(add, color):
    """Return a socket that is 1 where Blender found no image: the colour shown there must not be read as a large force."""
    return add.math("LESS_THAN", add.vector("DISTANCE", color, MISSING_COLOR, output="Value"), 1e-6)


def tree_of(block):
    """Return the node tree of a material or world; it is made where there is none, as in Blenders before 5.0."""
    if block.node_tree is None:
        block.use_nodes = True
    return block.node_tree


class NodeAdder:
    """Adds nodes to a tree, from left to right."""

    def __init__(self, tree):
        self.tree, self.x = tree, 0.0

    def __call__(self, kind: str, given: dict | None = None, output: int | str = 0, **settings):
        """Return an output of a new node; `given` are the sockets that lead to its inputs, or their values."""
        return self.end(kind, given, **settings).outputs[output]

    def end(self, kind: str, given: dict | None = None, **settings):
        """Return a new node; arguments as above."""
        node = self.tree.nodes.new(kind)
        for key, value in settings.items():
            setattr(node, key, value)
        node.location = self.x, 0.0
        self.x += 300.0
        self.feed(node, given or {})
        return node

    def feed(self, node, given: dict) -> None:
        """Give inputs of a node, by name or number, the sockets that lead to them, or their values."""
        for place, value in given.items():
            if isinstance(value, bpy.types.NodeSocket):
                self.tree.links.new(value, node.inputs[place])
            else:
                node.inputs[place].default_value = value

    def math(self, operation: str, *given):
        """Return the socket of a calculation with numbers."""
        return self("ShaderNodeMath", dict(enumerate(given)), operation=operation)

    def vector(self, operation: str, *given, output: int | str = 0, **scale):
        """Return the socket of a calculation with vectors; `scale` is the factor ``Scale`` of the operation ``SCALE``."""
        return self("ShaderNodeVectorMath", {**dict(enumerate(given)), **scale}, output, operation=operation)

    def mix(self, factor, below, above, **settings):
        """Return the socket of a mixture of two colours."""
        node = self.end("ShaderNodeMix", data_type="RGBA", **settings)
        sockets = {socket.identifier: number for number, socket in enumerate(node.inputs)}
        self.feed(node, dict(zip(map(sockets.get, MIX_SOCKETS), (factor, below, above), strict=True)))
        return next(socket for socket in node.outputs if socket.identifier == "Result_Color")

    def attribute(self, name: str, data_type: str = "FLOAT_VECTOR"):
        """Return the socket of a named attribute."""
        return self("GeometryNodeInputNamedAttribute", {"Name": name}, data_type=data_type)

    def stored(self, geometry, name: str, value, data_type: str):
        """Return the socket of a geometry with an attribute on its points."""
        given = {"Geometry": geometry, "Name": name, "Value": value}
        return self("GeometryNodeStoreNamedAttribute", given, data_type=data_type, domain="POINT")


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
    time = add("GeometryNodeInputSceneTime", output="Frame")
    # A geometry node's Frame counts files from frame_start, like an image user with offset zero.
    frame = add("ShaderNodeClamp", {"Value": time, "Min": frames[0], "Max": frames[1]})
    given = {"Image": image, "Vector": add.attribute(TEXEL_UV), "Frame": frame}
    return add("GeometryNodeImageTexture", given, interpolation="Closest", extension="EXTEND")


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
