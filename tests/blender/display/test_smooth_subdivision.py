# SPDX-License-Identifier: GPL-3.0-or-later
"""What geometry nodes make of a value is the limit surface of Catmull and Clark, on faces and borders of any kind."""

import bpy
import numpy as np
import pytest

from palpate.addon.display import materials, smooth_subdivision
from palpate.addon.scene import mesh_arrays
from palpate.core.geometry.smooth_grid import sharpened_by
from palpate.core.geometry.smooth_mesh import smooth_mesh

CUBE = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
FAN = [[0, 1, 2], [0, 2, 3, 4, 5], [0, 5, 6, 7], [0, 7, 1]]
SHARED_EDGE = [[0, 1, 2], [0, 1, 3], [1, 0, 4, 5]]
TOUCHING_SHEETS = [[0, 1, 2, 3], [0, 4, 5, 6], [4, 7, 5]]


def evaluated(faces, places, values, levels):
    """Return positions and values, (v, 3) and (v,), of a mesh that the nodes have subdivided."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    mesh = bpy.data.meshes.new("Faces")
    mesh.from_pydata(places.tolist(), [], faces)
    mesh.attributes.new("given", "FLOAT", "POINT").data.foreach_set("value", values.astype(np.float32))
    obj = bpy.data.objects.new("Faces", mesh)
    bpy.context.scene.collection.objects.link(obj)
    group = materials.empty_node_group("test", "test")
    add, link = materials.NodeAdder(group), group.links.new
    given = add("GeometryNodeInputNamedAttribute", data_type="FLOAT")
    given.inputs["Name"].default_value = "given"
    geometry, value = smooth_subdivision.smooth_subdivision(
        add, add("NodeGroupInput").outputs[0], given.outputs["Attribute"], levels
    )
    store = add("GeometryNodeStoreNamedAttribute", data_type="FLOAT", domain="POINT")
    store.inputs["Name"].default_value = "found"
    link(geometry, store.inputs["Geometry"])
    link(value, store.inputs["Value"])
    link(store.outputs["Geometry"], add("NodeGroupOutput").inputs[0])
    obj.modifiers.new("Nodes", "NODES").node_group = group
    made = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    found = np.empty(len(made.vertices), dtype=np.float32)
    made.attributes["found"].data.foreach_get("value", found)
    return mesh_arrays.vertices(made), found


@pytest.mark.parametrize("levels", [1, 2, 3])
@pytest.mark.parametrize("faces", [CUBE, FAN, SHARED_EDGE, TOUCHING_SHEETS])
def test_nodes_give_the_limit_surface(faces, levels):
    """Around corners of valence three and five, at triangles and pentagons, on borders, and where sheets meet: to rounding."""
    from scipy.spatial import cKDTree

    rng = np.random.default_rng(levels)
    sizes = [len(face) for face in faces]
    corners = np.concatenate(faces)
    count = int(corners.max()) + 1
    places, values = rng.random((count, 3)), rng.standard_normal(count)
    mesh = smooth_mesh(np.cumsum([0, *sizes[:-1]]), corners, count, levels)
    expected_at, expected = mesh.even @ places, mesh.limit @ sharpened_by(mesh.blur, values)
    at, found = evaluated(faces, places, values, levels)
    assert len(found) == len(expected)
    distance, number = cKDTree(expected_at).query(at)
    assert distance.max() < 1e-6 and len(np.unique(number)) == len(expected)
    np.testing.assert_allclose(found, expected[number], atol=2e-6)


def test_without_levels_nothing_changes():
    values = np.arange(8.0)
    at, found = evaluated(CUBE, np.random.default_rng(0).random((8, 3)), values, 0)
    assert len(at) == 8 and found == pytest.approx(values)
