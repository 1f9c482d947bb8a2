# SPDX-License-Identifier: GPL-3.0-or-later
"""Heat maps have the colours of their bar in every view. The test reads the pixels whose places this road notes.

A plate presses three pads of different stiffness evenly, so that each pad has one colour all over.
"""

import bpy
from mathutils import Quaternion
from steps import empty, key_over_view, palpate, solver, status

PADS = {"Stiff": (-1.2, 400.0), "Middle": (0.0, 200.0), "Soft": (1.2, 40.0)}
BESIDE = (0.27, 0.27)  # from a pad's middle, where its arrow is not
BELOW, ABOVE = Quaternion((0.0, 1.0, 0.0, 0.0)), Quaternion((1.0, 0.0, 0.0, 0.0))


def build(folder):
    """Three pads beneath a plate that covers them all, pressed down evenly from the second frame on."""
    empty()
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 3
    scene.unit_settings.scale_length = 0.01
    for name, (x, stiffness) in PADS.items():
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=8, y_subdivisions=8, size=1.0, location=(x, 0.0, 0.0))
        pad = bpy.context.object
        pad.name, pad.palpate.role, pad.palpate.k = name, "SENSOR", stiffness
        pad.palpate.max_penetration = 1.0
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(0.0, 0.0, 0.2), scale=(5.0, 2.0, 0.5))
    plate = bpy.context.object
    plate.name, plate.palpate.role = "Plate", "TARGET"
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "colors.blend"))


class FakePainter:
    """Notes where the inset draws its images, instead of drawing."""

    def __init__(self, scale):
        self.scale, self.images = scale, []

    def image(self, texture, x, y, width, height):
        self.images.append((x, y, width, height))

    def text(self, *args, **settings):
        return 0.0

    def width(self, words):
        return 0.0

    def nothing(self, *args, **settings):
        pass

    rectangle = line = nothing


def inset_spots(region, shares):
    """Return (x, y, share) in the tactile images and along the colour bar."""
    inset = palpate("addon.display.inset")
    content = inset._contents[bpy.context.scene.session_uid]
    painter = FakePainter(bpy.context.preferences.system.ui_scale)
    inset._draw_content(content, painter, 20.0 * painter.scale, 20.0 * painter.scale + inset._height(content, painter.scale))
    *images, (x, y, width, height) = painter.images
    named = zip((one.name for one in content.insets), images, strict=True)
    spots = [(left + wide / 2, low + high / 2, shares[name]) for name, (left, low, wide, high) in named]
    spots += [(x + width / 2, y + share * height, share) for share in (0.05, 0.25, 0.5, 0.75, 0.95)]
    return [(round(region.x + x), round(region.y + y), share) for x, y, share in spots]


def shares_now():
    """Return each pad's force over the force that is written at the end of the colour bar."""
    scene = bpy.context.scene
    readings = status().frame.sensors
    scale = palpate("addon.display.inset")._contents[scene.session_uid].scale
    end = float(scale.words(scale.high).removesuffix(" N"))
    return {name: float(readings[name].normal_force.max()) / end for name in PADS}


def look(area, rotation):
    view = area.spaces.active.region_3d
    view.view_perspective = "ORTHO"
    view.view_rotation, view.view_location, view.view_distance = rotation, (0.0, 0.0, 0.0), 5.5


def picture(ui, name, seconds=1.0, *, with_inset=False):
    """Take a screenshot; note where the test finds which share of the bar."""
    view = ui.area("VIEW_3D")
    yield seconds
    yield from ui.screenshot(name)
    shares = shares_now()
    spots = [(*ui.at((x + BESIDE[0], BESIDE[1], 0.0), view), shares[pad]) for pad, (x, _) in PADS.items()]
    if with_inset:
        spots += inset_spots(ui.region(view), shares)
    ui.result["values"].setdefault("spots", {})[name] = spots
    ui.save()


def views(ui, kind):
    """Look at the pads from below in each kind of shading, and from above through the plate."""
    view, scene = ui.area("VIEW_3D"), bpy.context.scene
    shading = view.spaces.active.shading
    look(view, BELOW)
    shading.type = "SOLID"
    yield from picture(ui, f"{kind}-solid", with_inset=True)
    shading.type = "RENDERED"
    yield from picture(ui, f"{kind}-eevee", 6.0)  # the engine of a new file, whose name depends on the Blender
    if kind == "baked":
        eevee, scene.render.engine = scene.render.engine, "BLENDER_WORKBENCH"
        yield from picture(ui, f"{kind}-workbench")
        scene.render.engine = eevee
        # where no view transform changes colours, Rendered shows the bake's own material
        scene.view_settings.view_transform = "Standard"
        scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
        yield from picture(ui, f"{kind}-standard-eevee", 6.0)
        shading.type = "MATERIAL"
        yield from picture(ui, f"{kind}-standard-material", 6.0)
    shading.type = "SOLID"
    scene.palpate.show_through = True
    look(view, ABOVE)
    yield from picture(ui, f"{kind}-through")
    scene.palpate.show_through = False


def road(ui):
    build(ui.out)
    scene, view = bpy.context.scene, ui.area("VIEW_3D")
    yield from ui.tab("PHYSICS")
    yield from solver(ui)
    look(view, BELOW)
    yield from key_over_view(ui, "RIGHT_ARROW")
    yield from ui.becomes(lambda: scene.frame_current == 2 and status().frame, "frame 2")
    yield from views(ui, "live")
    yield from ui.press("palpate.bake()")
    yield from ui.wait_until(lambda: bpy.data.objects["Soft"].palpate.is_baked, "the bake is done")
    scene.frame_set(2)
    yield from views(ui, "baked")
