# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of the sample scenes: shapes as plain meshes, materials, a backdrop, soft lamps and a camera.

Lengths are Blender units of the sample scenes, which are millimetres.
"""

from __future__ import annotations

import math

import bpy
import numpy as np

from ..addon.display.materials import NodeAdder


def prepare(scene, frame_end: int, fps: int = 24) -> None:
    """Empty `scene`, and set units to millimetres, the frame rate to `fps`, and a view transform that keeps colours."""
    for obj in list(scene.objects):
        bpy.data.objects.remove(obj)
    for collection in list(scene.collection.children):
        bpy.data.collections.remove(collection)
    scene.unit_settings.system = "METRIC"
    scene.unit_settings.scale_length = 0.001
    scene.unit_settings.length_unit = "MILLIMETERS"
    scene.frame_start, scene.frame_end = 1, frame_end
    scene.render.fps, scene.render.fps_base = fps, 1.0
    scene.render.engine = "CYCLES"
    # Standard, not Blender's filmic default: a heat map must have the colours of its colour bar.
    scene.view_settings.view_transform = "Standard"
    scene.view_settings.look = "None"
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.use_denoising = "CPU", 8, True  # 16 differ by 0.5 of 255 on average
    cycles.use_adaptive_sampling, cycles.adaptive_threshold = True, 0.05
    cycles.max_bounces, cycles.diffuse_bounces, cycles.glossy_bounces = 5, 1, 3
    cycles.transmission_bounces, cycles.transparent_max_bounces = 0, 12
    cycles.caustics_reflective = cycles.caustics_refractive = False


def mesh_object(scene, name: str, vertices, faces, look=None, smooth: bool = True, parent=None, location=(0.0, 0.0, 0.0)):
    """Return a new object of `scene` made of plain arrays, with a material, at a place in the frame of its parent."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(map(float, v)) for v in vertices], [], [tuple(map(int, f)) for f in faces])
    mesh.validate()
    mesh.polygons.foreach_set("use_smooth", [smooth] * len(mesh.polygons))
    mesh.update()
    obj = bpy.data.objects.new(name, mesh)
    scene.collection.objects.link(obj)
    obj.parent, obj.location = parent, location
    if look is not None:
        mesh.materials.append(look)
    return obj


def tube_faces(rings: int, sides: int, closed: bool = False) -> list[tuple[int, ...]]:
    """Return the faces between rings of vertices, which follow one another; `closed` joins the last ring to the first."""
    return [
        (j * sides + i, j * sides + (i + 1) % sides, (j + 1) % rings * sides + (i + 1) % sides, (j + 1) % rings * sides + i)
        for j in range(rings if closed else rings - 1)
        for i in range(sides)
    ]


def finger_faces(rings: int, sides: int) -> list[tuple[int, ...]]:
    """Return the faces of a tube with a flat end at its first ring, and a tip at the vertex after its last one."""
    last, tip = (rings - 1) * sides, rings * sides
    faces = tube_faces(rings, sides) + [(last + i, last + (i + 1) % sides, tip) for i in range(sides)]
    return [*faces, tuple(range(sides - 1, -1, -1))]


def surface_of_revolution(profile, sides: int = 64):
    """Return vertices and faces of a body of revolution about z, closed at both ends.

    Parameters
    ----------
    profile : (m, 2) float, mm
        Radius and height, from the bottom up; radii above zero.
    """
    profile = np.asarray(profile, float)
    angle = np.arange(sides) * 2 * math.pi / sides
    rings = [np.stack([r * np.cos(angle), r * np.sin(angle), np.full(sides, z)], axis=1) for r, z in profile]
    top = (len(profile) - 1) * sides
    ends = [tuple(range(sides - 1, -1, -1)), tuple(range(top, top + sides))]
    return np.concatenate(rings), tube_faces(len(profile), sides) + ends


def box(scene, name: str, size, bevel: float, flat_bottom: bool = False, **place):
    """Return a box of full `size` centred on its origin, with rounded edges; `flat_bottom` keeps the lower ones sharp.

    `place` are further arguments of :func:`mesh_object`, here and below.
    """
    x, y, z = (s / 2 for s in size)
    vertices = [(i, j, k) for i in (-x, x) for j in (-y, y) for k in (-z, z)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    obj = mesh_object(scene, name, vertices, faces, **place)
    modifier = obj.modifiers.new("Bevel", "BEVEL")
    modifier.width, modifier.segments, modifier.harden_normals = bevel, 4, True
    if flat_bottom:
        modifier.limit_method = "WEIGHT"
        weight = obj.data.attributes.new("bevel_weight_edge", "FLOAT", "EDGE")
        for edge in obj.data.edges:
            weight.data[edge.index].value = float(max(obj.data.vertices[v].co.z for v in edge.vertices) > 0)
    return obj


def cylinder(scene, name: str, radius: float, height: float, bevel: float = 0.0, **place):
    """Return an upright cylinder centred on its origin."""
    obj = mesh_object(scene, name, *surface_of_revolution([(radius, -height / 2), (radius, height / 2)], sides=48), **place)
    modifier = obj.modifiers.new("Bevel", "BEVEL")
    modifier.width, modifier.segments, modifier.limit_method = max(bevel, 0.05), 3, "ANGLE"
    modifier.harden_normals = True
    return obj


def ball(scene, name: str, radius: float, **place):
    """Return a sphere: a cube that modifiers subdivide and push onto the sphere exactly, so the file stays small."""
    x = radius / math.sqrt(3)
    vertices = [(i, j, k) for i in (-x, x) for j in (-x, x) for k in (-x, x)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    obj = mesh_object(scene, name, vertices, faces, **place)
    divide = obj.modifiers.new("Subdivide", "SUBSURF")
    divide.levels = divide.render_levels = 6
    cast = obj.modifiers.new("To Sphere", "CAST")
    cast.cast_type, cast.factor, cast.use_radius_as_size, cast.size = "SPHERE", 1.0, False, radius
    return obj


def pad_mesh(rows: int, columns: int, pitch: float, margin: float, thickness: float, rounding: float = 1.5):
    """Return (vertices, faces, texel vertex indices) of a pad with a flat grid of texels on its rounded top.

    The grid is centred on the origin in z = 0, rows along +y, columns along +x. Around it comes a flat rim, so that every
    texel's normal points straight up, then a rounded edge and the sides.
    """
    x = (np.arange(columns) - (columns - 1) / 2) * pitch
    y = (np.arange(rows) - (rows - 1) / 2) * pitch
    steps = 5
    turn = np.linspace(0, math.pi / 2, steps + 1)
    out = np.concatenate([[margin * 0.5], margin - rounding + rounding * np.sin(turn), [margin]])
    down = np.concatenate([[0.0], rounding * (1 - np.cos(turn)), [thickness]])
    n = len(out)
    # Index space: `n` rings around the grid; vertex (i, j) sits on the ring that is farther out of its two.
    vertices, index = [], {}
    for j in range(-n, rows + n):
        for i in range(-n, columns + n):
            ring_x, ring_y = max(-i, i - columns + 1, 0), max(-j, j - rows + 1, 0)
            ring = max(ring_x, ring_y)
            corner = ring_x > 0 and ring_y > 0
            if corner and ring_x != ring_y:
                continue
            along = out[ring - 1] if ring else 0.0
            # A corner lies on a circle around the grid's corner texel, which rounds it in plan view.
            reach = along * (0.78 if corner else 1.0)
            cx, cy = min(max(i, 0), columns - 1), min(max(j, 0), rows - 1)
            sx, sy = np.sign(i - cx), np.sign(j - cy)
            index[i, j] = len(vertices)
            vertices.append((x[cx] + sx * reach, y[cy] + sy * reach, -(down[ring - 1] if ring else 0.0)))
    faces = []
    for j in range(rows - 1):
        for i in range(columns - 1):
            faces.append((index[i, j], index[i + 1, j], index[i + 1, j + 1], index[i, j + 1]))
    for ring in range(n):
        loop_in, loop_out = _ring(rows, columns, ring), _ring(rows, columns, ring + 1)
        faces += _bridge([index[c] for c in loop_in], [index[c] for c in loop_out], loop_in, loop_out)
    bottom = [index[c] for c in _ring(rows, columns, n)]
    faces.append(tuple(reversed(bottom)))
    texels = [index[i, j] for j in range(rows) for i in range(columns)]
    return np.array(vertices), faces, texels


def pad(scene, name: str, look, *grid, rounding: float = 1.5, **settings):
    """Return an object with the mesh of :func:`pad_mesh` of `grid`, whose texels :func:`make_tactile` gets."""
    vertices, faces, texels = pad_mesh(*grid, rounding)
    made = mesh_object(scene, name, vertices, faces, look)
    make_tactile(made, texels, **settings)
    return made


def make_tactile(obj, vertices, role: str = "SENSOR", group: str = "tactile", **settings) -> None:
    """Make vertices of an object the region of a sensor, as a vertex group; further settings as in ``Object.palpate``."""
    obj.vertex_groups.new(name=group).add([int(i) for i in vertices], 1.0, "REPLACE")
    for key, value in {"role": role, "region": "GROUP", "vertex_group": group, **settings}.items():
        setattr(obj.palpate, key, value)


def keyframe(obj, frame: int, location, turn=None) -> None:
    """Put an object in its place at a frame, with an Euler rotation if one is given."""
    obj.location = location
    obj.keyframe_insert("location", frame=frame)
    if turn is not None:
        obj.rotation_euler = turn
        obj.keyframe_insert("rotation_euler", frame=frame)


def _ring(rows: int, columns: int, ring: int) -> list[tuple[int, int]]:
    """Return the cells of ring number `ring` around the grid, counter-clockwise; ring 0 is the border of the grid."""
    low, right, top = -ring, columns - 1 + ring, rows - 1 + ring
    x, y = range(columns), range(rows)
    lower = [(i, low) for i in x]
    upper = [(i, top) for i in reversed(x)]
    east = [(right, j) for j in y]
    west = [(low, j) for j in reversed(y)]
    if ring == 0:
        return lower[:-1] + east[:-1] + upper[:-1] + west[:-1]
    return [*lower, (right, low), *east, (right, top), *upper, (low, top), *west, (low, low)]


def _bridge(inner: list[int], outer: list[int], cells_in, cells_out) -> list[tuple[int, ...]]:
    """Return the faces between two rings; at a corner that only the outer ring has, two quads meet."""
    if len(inner) == len(outer):
        return [(inner[i - 1], outer[i - 1], outer[i], inner[i]) for i in range(len(inner))]
    # The first ring outside the grid: each of its cells is joined to the nearest cell of the border.
    x_max, y_max = max(c[0] for c in cells_in), max(c[1] for c in cells_in)
    at = dict(zip(cells_in, inner, strict=True))
    near = [at[min(max(i, 0), x_max), min(max(j, 0), y_max)] for i, j in cells_out]
    faces = []
    for i in range(len(outer)):
        a, b = near[i - 1], near[i]
        faces.append((a, outer[i - 1], outer[i]) if a == b else (a, outer[i - 1], outer[i], b))
    return faces


def material(name: str, color, metallic: float = 0.0, roughness: float = 0.5, **inputs):
    """Return a Principled material; further inputs by their socket's name with underscores."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    shader = made.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*color, 1.0)
    shader.inputs["Metallic"].default_value = metallic
    shader.inputs["Roughness"].default_value = roughness
    for key, value in inputs.items():
        shader.inputs[key.replace("_", " ")].default_value = value
    made.diffuse_color = (*color, 1.0)
    made.metallic, made.roughness = metallic, roughness
    return made


STEEL = (0.62, 0.64, 0.67)


def see_through_steel(name: str, clear: float, edge: float = 1.0, groove: float = 0.0):
    """Return polished steel that is transparent in the middle.

    The heat map lies under the object that presses, so an opaque object would hide it. `clear` is the transparency seen face
    on, and `edge` the opacity at grazing angles. `groove` is the half-width of dark lines in the planes x = 0 and y = 0, which
    show the rotation of a ball.
    """
    made = material(name, STEEL, metallic=1.0, roughness=0.16)
    add, shader = NodeAdder(made.node_tree), made.node_tree.nodes["Principled BSDF"]
    facing = add("ShaderNodeLayerWeight", {"Blend": 0.35}, "Facing")
    # facing 0 (face on) → mostly clear; 1 (grazing) → solid
    ends = {"From Min": 0.0, "From Max": 0.8, "To Min": 1.0 - clear, "To Max": edge}
    opacity = add("ShaderNodeMapRange", {"Value": facing, **ends})
    if groove > 0:
        split = add.end("ShaderNodeSeparateXYZ", {"Vector": add("ShaderNodeTexCoord", output="Object")})
        lines = [add.math("LESS_THAN", add.math("ABSOLUTE", split.outputs[axis]), groove) for axis in "XY"]
        color = add.mix(add.math("MAXIMUM", *lines), (*STEEL, 1.0), (0.03, 0.03, 0.035, 1.0))
        add.feed(shader, {"Base Color": color})
    # Only the near side of the object is drawn, because the far side would cover the pad a second time.
    front = add.math("SUBTRACT", 1.0, add("ShaderNodeNewGeometry", output="Backfacing"))
    _show_share(made, add, add.math("MULTIPLY", opacity, front), add("ShaderNodeBsdfTransparent"), shader.outputs[0])
    return made


def _show_share(made, add: NodeAdder, share, clear, solid) -> None:
    """Let a share of a material's surface be solid, and the rest clear."""
    surface = add("ShaderNodeMixShader", {0: share, 1: clear, 2: solid})
    add.feed(made.node_tree.nodes["Material Output"], {"Surface": surface})


def clear_block(name: str):
    """Return a material like a block of clear acrylic: transparent, with the reflections of its surface and nothing else.

    Flat sides need it: :func:`see_through_steel` is more opaque on a side that is seen at a flatter angle, which then
    looks like a lid.
    """
    made = material(name, (0.8, 0.85, 0.9), roughness=0.08)
    add = NodeAdder(made.node_tree)
    side = add.end("ShaderNodeNewGeometry").outputs
    true = {"Normal": side["True Normal"]}  # smooth shading bends the other at sharp edges, where a side would be a dark mirror
    facing = add("ShaderNodeFresnel", {"IOR": 1.3, **true})
    # sides that face away reflect nothing
    sum_of = {0: side["Backfacing"], 1: -1.0, 2: facing}
    share = add("ShaderNodeMath", sum_of, operation="MULTIPLY_ADD", use_clamp=True)
    clear = add("ShaderNodeBsdfTransparent", {"Color": (0.96, 0.98, 1.0, 1.0)})
    _show_share(made, add, share, clear, add("ShaderNodeBsdfAnisotropic", {"Roughness": 0.08, **true}))
    return made


def clear_sides(obj, name: str, color, **look) -> None:
    """Give a box sides of :func:`clear_block`, and bevelled edges of a solid material."""
    obj.data.materials.append(clear_block(f"{name}, seen through"))
    obj.data.materials.append(material(name, color, **look))
    obj.modifiers["Bevel"].material = 1


def wooden_box(scene, name: str, size, bevel: float):
    """Return a box of wood for a table: its sides are clear, else they would hide the heat maps."""
    made = box(scene, name, size, bevel)
    clear_sides(made, "Wood", (0.55, 0.36, 0.19), roughness=0.55)
    made.data.polygons[4].material_index = 1  # the bottom, which lies in the table's surface: both would be drawn in spots
    return made


def backdrop(scene) -> None:
    """Add a floor that curves upwards into a wall behind the scene."""
    width, front, back, height, radius = 4000.0, -1500.0, 350.0, 1500.0, 400.0
    turn = np.linspace(0, math.pi / 2, 24)
    profile = [(front, 0.0), *((back + radius * math.sin(a), radius * (1 - math.cos(a))) for a in turn)]
    profile.append((back + radius, height))
    vertices = [(x, y, z) for y, z in profile for x in (-width / 2, width / 2)]
    faces = [(2 * i, 2 * i + 1, 2 * i + 3, 2 * i + 2) for i in range(len(profile) - 1)]
    look = material("Backdrop", (0.30, 0.32, 0.35), roughness=0.85)
    mesh_object(scene, "Backdrop", vertices, faces, look)


def area_lamp(scene, name: str, location, target, size: float, power: float, color) -> None:
    """Add a square area lamp at `location` that points at `target`; power in Blender's W at this scene's size."""
    lamp = bpy.data.lights.new(name, "AREA")
    lamp.shape, lamp.size, lamp.energy, lamp.color = "SQUARE", size, power, color
    obj = bpy.data.objects.new(name, lamp)
    scene.collection.objects.link(obj)
    obj.location = location
    obj.rotation_euler = look_at(location, target)


def look_at(location, target):
    """Return the Euler angles of an upright lamp or camera at `location` that points at `target`."""
    from mathutils import Vector

    return (Vector(target) - Vector(location)).to_track_quat("-Z", "Y").to_euler()


def world(scene) -> None:
    """Give `scene` a faint, even light from all directions."""
    made = bpy.data.worlds.new("Studio")
    made.use_nodes = True
    background = made.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (0.9, 0.92, 1.0, 1.0)
    background.inputs["Strength"].default_value = 0.35
    scene.world = made


def add_stage(scene, aim, camera, size: float = 1.0) -> None:
    """Add backdrop, world, three soft lamps and a camera that points at `aim`; `size` 1 suits objects of 20 cm."""
    backdrop(scene)
    world(scene)
    lamps = (
        ("Key", (-320, -260, 420), 260, 1.3e6, (1.0, 0.97, 0.93)),
        ("Fill", (420, -180, 260), 320, 4.0e5, (0.9, 0.95, 1.0)),
        ("Rim", (-260, 330, 260), 200, 9.0e5, (1.0, 1.0, 1.0)),
    )
    for name, place, edge, power, color in lamps:
        area_lamp(scene, name, tuple(size * x for x in place), aim, size * edge, size * size * power, color)
    made = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(made)
    scene.camera = made
    made.data.lens, made.data.clip_end = 70.0, 5000.0
    made.location, made.rotation_euler = camera, look_at(camera, aim)


def open_at(scene, sensor, frame: int) -> None:
    """Let the file open at `frame`, where there is contact, in the camera's view with materials and the sensor's panel.

    A view's usual clipping ends at 1000 units, which is within the backdrop.
    """
    width, height = scene.render.resolution_x, scene.render.resolution_y
    # At zoom z the longer side of the picture takes (√2 + z/50)² / 4 of the longer side of the view, which is about 3 : 2.
    zoom = 50.0 * (2.0 * math.sqrt(0.95 * min(1.0, width / height / 1.5)) - math.sqrt(2.0))
    scene.frame_set(frame)
    for obj in scene.objects:
        obj.select_set(obj == sensor)
    bpy.context.view_layer.objects.active = sensor
    for space in [area.spaces.active for screen in bpy.data.screens for area in screen.areas]:
        if space.type == "VIEW_3D":
            space.shading.type, space.clip_start, space.clip_end = "MATERIAL", 1.0, 10_000.0
            space.region_3d.view_perspective, space.region_3d.view_camera_zoom = "CAMERA", zoom
            space.overlay.show_cursor = space.overlay.show_floor = False
            space.overlay.show_axis_x = space.overlay.show_axis_y = False
        elif space.type == "PROPERTIES":
            space.context = "PHYSICS"


def add_readme(text: str) -> None:
    """Store a text that explains the scene in the file; the text editor lists it as "Read me"."""
    made = bpy.data.texts.new("Read me")
    made.from_string(text)


def frame_objects(scene, objects, region=(0.06, 0.06, 0.94, 0.94), size=(960, 720)) -> None:
    """Set the size of the picture (pixels) and let the camera frame the objects at the present frame."""
    from ..addon.render import render

    scene.render.resolution_x, scene.render.resolution_y = size
    bpy.context.view_layer.update()
    render.fit_camera(scene, render.bounding_box_corners(objects), region)
    # Rounded to a tenth of a millimetre, because the last digits differ between versions of Blender.
    scene.camera.location = [round(x, 1) for x in scene.camera.location]


def add_normal_needles(scene, sensor, length: float, look, radius: float = 0.26):
    """Return thin needles on all texels of a sensor, along their normals and `length` long; they follow the sensor."""
    from ..addon.scene import sensor_regions
    from ..core.geometry.mesh import checked_mesh
    from ..core.geometry.texels import texels_from_region

    data = sensor.data
    data.calc_loop_triangles()
    triangles = [triangle.vertices[:] for triangle in data.loop_triangles]
    quads = [face.vertices[:] for face in data.polygons if len(face.vertices) == 4]
    mesh, _ = checked_mesh(
        np.array([v.co[:] for v in data.vertices]) * 1e-3, np.array(triangles), sensor.name, np.array(quads, int).reshape(-1, 4)
    )
    texels = texels_from_region(mesh, sensor_regions.region_vertices(sensor), sensor.name)
    side = np.array([[1.0, 0.0], [-0.5, 0.866], [-0.5, -0.866]]) * radius
    foot = texels.position * 1e3  # sample scenes are in mm
    corners = [foot + a * texels.tangent + b * texels.bitangent for a, b in side]
    points = np.stack([*corners, foot + length * texels.normal], axis=1).reshape(-1, 3)
    first = 4 * np.arange(len(texels))
    faces = np.concatenate([np.stack([first + i, first + (i + 1) % 3, first + 3], axis=1) for i in range(3)])
    return mesh_object(scene, f"Normals of {sensor.name}", points, faces, look, smooth=False, parent=sensor)


def use_constant_interpolation(obj) -> None:
    """Make the animated properties of an object change at once at their keyframes, as set points do."""
    from ..addon.session import fcurves

    for curve in fcurves.of_object(obj) or ():
        for key in curve.keyframe_points:
            key.interpolation = "CONSTANT"
