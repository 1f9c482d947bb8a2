# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the film about Palpate: paint, press, slip, the gap to measurements, a simulator's loop. All numbers are computed here.

python examples/film.py [--out palpate.mp4] [--work DIR]

It takes about twelve minutes on two cores. Renders in the work folder are used again, so a run that was stopped continues.
The last chapter needs MuJoCo (pip install mujoco) and is left out without it.
"""

from __future__ import annotations

import argparse
import importlib.util
import math
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import bpy
import numpy as np
from mathutils import Euler
from matplotlib.image import imread

import palpate as pp
from palpate.addon.render import render, render_setup
from palpate.addon.render.video import encode_video
from palpate.commands.bake import bake_with_progress
from palpate.commands.console import blender_output_hidden
from palpate.core import response
from palpate.core.figures import color_maps
from palpate.core.figures.figure_canvas import new_figure, save_figure, tidy_axes
from palpate.core.figures.figure_style import INK, NORMAL_COLOUR, SHEAR_COLOUR, FigureStyle
from palpate.core.figures.quantities import Extent, Scale
from palpate.core.figures.tactile_image import SensorView, draw_colour_bar
from palpate.core.gap.report.plots import overview
from palpate.core.geometry.texels import Texels
from palpate.core.jobs import progress_bar
from palpate.sample_blends import demo, hand, scene_builder, weighing

ROOT = Path(__file__).resolve().parents[1]
FPS = 12
WIDE, HIGH = 6.4, 3.6
"""Inches of a frame: text of 8 pt, the smallest there is, is then 3.1 % as high as the frame."""
SMALL = 8.5
BROAD, NARROW = (0.0, 0.17, 0.63, 0.74), (0.0, 0.17, 0.44, 0.74)
"""Left, bottom, width and height of the 3D view, as shares of the frame: alone with images above a curve, and beside both."""
BACKGROUND = "#f3f3f3"
SAMPLES = 4
STYLE = FigureStyle("VIRIDIS")
Place = tuple[float, float, float, float]
"""Left, bottom, width and height of a part of a frame, as shares of it."""
Renderer = Callable[[Path, int], None]
"""Renders the frame of this number to a file, unless there is one."""


@dataclass
class Film:
    """Frames of the film, and how they are made.

    Attributes
    ----------
    folder : Path
        For renders, scenes and bakes, and frames.
    height : int, pixels
        Of the film.
    every : int
        Only every so many frames of a scene are rendered; each is shown longer.
    frames : list of Path
        A picture for each frame of the film; pictures that stay are repeated.
    bar : tqdm
        Counts the frames on a terminal.
    """

    folder: Path
    height: int = 720
    every: int = 1
    frames: list[Path] = field(default_factory=list)
    bar: Any = field(default_factory=lambda: progress_bar("Film", None))

    def show(self, seconds: float, title: str, words: str, draw: Callable[[Any], None]) -> Path:
        """Add a picture with a title above and a caption below it, shown for a number of seconds."""
        figure = new_figure(WIDE, HIGH)
        figure.set_facecolor(BACKGROUND)
        draw(figure)
        figure.text(0.03, 0.95, title, fontsize=12.0, weight="bold", color=INK, va="center")
        figure.text(0.03, 0.09, textwrap.fill(words, 72), fontsize=10.5, color=INK, va="center", linespacing=1.3)
        path = self.folder / f"frame-{len(self.frames):05d}.png"
        save_figure(figure, path, self.height / HIGH)
        count = max(1, round(seconds * FPS))
        self.frames += [path] * count
        self.bar.update(count)
        return path

    def play(self, name: str, numbers: Iterable[int], seconds: float = 1.0 / FPS) -> Iterator[tuple[float, int, Path]]:
        """Yield, for the numbers that are rendered, the seconds to show, the number and where its render goes."""
        numbers = list(numbers)
        for start in range(0, len(numbers), self.every):
            shown = min(self.every, len(numbers) - start)
            yield seconds * shown, numbers[start], self.folder / f"{name}-{numbers[start]:04d}.png"

    def pixels(self, view: Place) -> tuple[int, int]:
        """Return the size of renders for a part of the frame: three quarters of its pixels, which saves half of the time."""
        scale = 0.75 * self.height / HIGH
        return round(scale * WIDE * view[2]), round(scale * HIGH * view[3])


# --- the 3D view


def new_scene(film: Film, sample, name: str):
    """Build one of the sample scenes and save it, because a bake lies next to its file; return the scene."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    sample.build(scene)
    scene.palpate.color_map = STYLE.colour_map
    scene.cycles.denoising_input_passes, scene.cycles.use_light_tree = "RGB", False  # as in `palpate demo`
    bpy.ops.wm.save_as_mainfile(filepath=str(film.folder / f"{name}.blend"))
    return scene


@contextmanager
def studio(film: Film, view: Place, scene, direction: tuple[float, float], shown: np.ndarray) -> Iterator[Renderer]:
    """Look at points (m, 3) of the scene in studio light; yield what renders a frame to a file.

    `direction` is the azimuth and elevation of the camera, degrees.
    """
    size, (azimuth, elevation) = film.pixels(view), direction
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.camera.rotation_euler = Euler((math.radians(90.0 - elevation), 0.0, math.radians(azimuth + 90.0)))
    bpy.context.view_layer.update()
    render.fit_camera(scene, shown, (0.03, 0.03, 0.97, 0.97))
    options = render_setup.RenderOptions("cycles", own_camera=True, size=size)
    with render_setup.render_setup(scene, [scene.frame_current], options):

        def render_to(path: Path, frame: int) -> None:
            if not path.exists():
                render.render_frame(scene, path, frame, samples=SAMPLES, size=size)

        yield render_to


def draw_view(figure, path: Path, view: Place) -> None:
    """Draw a render."""
    axes = figure.add_axes(view)
    axes.imshow(imread(path), aspect="auto", interpolation="antialiased")
    axes.set_axis_off()


# --- tactile images and curves next to the 3D view


def force_scale(top: float) -> Scale:
    """Return the colours of normal forces up to one of them, N."""
    return Scale.of(STYLE.shown, Extent(units=("N",)), STYLE.colour_map, top)


class Touch(NamedTuple):
    """Tactile images at one moment: texels, normal force (n,) N and shear (n, 2) N of each sensor by its name, and the scales.

    `scale` is that of the colours; `strongest` is the shear (N) of the longest arrow.
    """

    sensors: Mapping[str, tuple[Texels, np.ndarray, np.ndarray]]
    scale: Scale
    strongest: float


def touch_of(recording, texels: Mapping[str, Texels], frame: int) -> Touch:
    """Return the tactile images of a frame of a bake."""
    i = int(np.searchsorted(recording.frames, frame))
    seen = recording.sensors
    found = {name: (own, seen[name].normal_force[i], seen[name].shear[i]) for name, own in texels.items()}
    return Touch(found, STYLE.scale(recording, texels), response.peak_shear(recording))


def draw_touch(figure, touch: Touch, place: Place) -> None:
    """Draw tactile images beside one another into a part of the figure; the colour bar is on the longer free side."""
    (left, bottom, width, height), image = place, None
    upright = width * WIDE < 0.7 * height * HIGH
    room = (width - 0.09, height - 0.08) if upright else (width / len(touch.sensors) - 0.015, height - 0.23)
    for number, (name, (texels, force, shear)) in enumerate(touch.sensors.items()):
        view = SensorView.of(texels, force)
        inches = min(room[0] * WIDE / view.width, room[1] * HIGH / view.height)
        across, up = inches * view.width / WIDE, inches * view.height / HIGH
        x = left + (number + 0.5) * (room[0] if upright else width / len(touch.sensors)) - 0.5 * across
        axes = figure.add_axes((x, bottom + height - 0.07 - up, across, up))
        image = view.at_size(inches).draw(axes, force, shear, touch.strongest, touch.scale)
        figure.text(x + 0.5 * across, bottom + height - 0.03, name, fontsize=SMALL, color=INK, ha="center", va="center")
    sideways = (left + 0.03, bottom + 0.115, width - 0.06, 0.022)
    bar = (x + across + 0.012, bottom + height - 0.07 - up, 0.014, up) if upright else sideways
    draw_colour_bar(figure, image, figure.add_axes(bar), touch.scale)


def draw_curves(figure, place: Place, time, curves: Mapping[str, tuple[np.ndarray, str, str]], i: int, unit: str) -> None:
    """Draw curves up to sample `i`; each has values, colour and line style by its name."""
    axes = figure.add_axes(place)
    for name, (values, colour, dashes) in curves.items():
        axes.plot(time[: i + 1], values[: i + 1], color=colour, ls=dashes, lw=1.6, label=name)
    axes.set_xlim(time[0], time[-1])
    axes.set_ylim(0.0, 1.5 * max(float(np.nanmax(values)) for values, *_ in curves.values()))
    axes.set_xlabel("time (s)", labelpad=1)
    axes.set_ylabel(unit)
    tidy_axes(axes)
    axes.set_facecolor(BACKGROUND)
    axes.legend(frameon=False, fontsize=8, loc="upper left", borderaxespad=0.1, handlelength=1.4)


# --- chapters

UPPER, LOWER = (0.65, 0.45, 0.33, 0.46), (0.715, 0.26, 0.255, 0.17)
"""Places of tactile images and curve beside a broad 3D view."""
MIDDLE, RIGHT = (0.46, 0.18, 0.22, 0.74), (0.815, 0.32, 0.165, 0.5)
"""The same beside a narrow one."""
HAND_VIEW = (-138.0, 22.0)
STROKES, BRUSH = 24, 6.0
"""Pictures of the painting, and the radius of the brush, mm."""


def hand_corners(scene) -> np.ndarray:
    """Return corners around the cylinder and both fingers."""
    bpy.context.view_layer.update()
    return render.bounding_box_corners([scene.objects[name] for name in (hand.INDEX, hand.THUMB, hand.CYLINDER)])


def paint(film: Film, scene) -> Any:
    """Paint the tip of the index finger stroke by stroke, into the vertex group that is the sensor's region."""
    finger = scene.objects[hand.INDEX]
    group = finger.vertex_groups["tactile"]
    points = np.array([vertex.co[:] for vertex in finger.data.vertices])
    region = np.array([any(g.group == group.index and g.weight >= 0.5 for g in v.groups) for v in finger.data.vertices])
    group.remove([int(i) for i in np.flatnonzero(region)])
    red = scene_builder.material("Painted", (0.85, 0.06, 0.03), roughness=0.5)
    finger.data.materials.append(red)
    low, high = points[region].min(axis=0), points[region].max(axis=0)
    along = np.linspace(0.0, 1.0, 12 * STROKES)
    swing = 0.5 + 0.5 * np.sin(along * 6.0 * math.pi)
    brush = low + (high - low) * np.stack([np.full_like(along, 0.5), along, swing], axis=1)
    reached = np.linalg.norm((points[:, None] - brush[None])[:, :, 1:], axis=2) <= BRUSH
    title = "1  Paint"
    with studio(film, BROAD, scene, HAND_VIEW, hand_corners(scene)) as render_to:
        for seconds, number, path in film.play("paint", range(STROKES + 1), 2.0 / FPS):
            done = region & (reached[:, : 12 * number].any(axis=1) if number < STROKES else True)
            for face in finger.data.polygons:
                face.material_index = len(finger.data.materials) - 1 if done[list(face.vertices)].all() else 0
            render_to(path, scene.frame_start)
            words = "Paint the part of a mesh that measures contact. Any mesh will do: here, the tip of a finger."
            film.show(seconds + 2.0 * (number == 0), title, words, counted(path, int(done.sum())))
    group.add([int(i) for i in np.flatnonzero(region)], 1.0, "REPLACE")
    for face in finger.data.polygons:
        face.material_index = 0
    finger.data.materials.pop()
    texels = pp.sensor_of(finger).texels
    none = np.zeros(len(texels))
    touch = Touch({hand.INDEX: (texels, none, np.zeros((len(texels), 2)))}, force_scale(0.15), 1.0)

    def draw(figure) -> None:
        draw_view(figure, path, BROAD)
        draw_touch(figure, touch, UPPER)

    words = f"The region is a sensor now: each of its {len(texels)} vertices is a tactile element (texel)."
    film.show(3.5, title, words, draw)


def counted(path: Path, vertices: int) -> Callable[[Any], None]:
    """Return what draws a render and the number of vertices that are painted."""

    def draw(figure) -> None:
        draw_view(figure, path, BROAD)
        figure.text(0.82, 0.6, f"{vertices}", fontsize=30.0, color=INK, ha="center", va="center")
        figure.text(0.82, 0.5, "vertices painted", fontsize=10.5, color=INK, ha="center", va="center")

    return draw


def press(film: Film, scene) -> None:
    """Bake the grasp of the hand and play it next to its tactile images."""
    baked = bake_with_progress(scene)
    texels = {sensor.name: sensor.texels for sensor in baked.scenario.sensors if sensor.readout}
    recording, title = baked.recording, "2  Press and bake"
    force = recording.sensors[hand.INDEX].normal_force.sum(axis=1)
    curves = {"index finger": (force, NORMAL_COLOUR, "-")}

    def drawing(number: int, path: Path) -> Callable[[Any], None]:
        def draw(figure) -> None:
            draw_view(figure, path, BROAD)
            draw_touch(figure, touch_of(recording, texels, number), UPPER)
            draw_curves(figure, LOWER, recording.times, curves, int(np.searchsorted(recording.frames, number)), "force (N)")

        return draw

    with studio(film, BROAD, scene, HAND_VIEW, hand_corners(scene)) as render_to:
        for seconds, number, path in film.play("press", range(6, hand.FRAME_END + 1)):
            render_to(path, number)
            words = "The fingers close until the index finger measures 2 N. Palpate computes force and friction in every texel."
            film.show(seconds, title, words, drawing(number, path))
    words = f"The bake has tactile images for all {len(recording.frames)} frames, and a heat map that plays in any Blender."
    film.show(3.0, title, words, drawing(number, path))


def slip(film: Film) -> None:
    """Bake the demo and play the ball that sticks and then slips, with shear in the tactile image."""
    scene = new_scene(film, demo, "slip")
    baked = bake_with_progress(scene)
    recording, (sensor,) = baked.recording, [one for one in baked.scenario.sensors if one.name == demo.PAD_A]
    seen, mu, texels = recording.sensors[sensor.name], sensor.parameters, {sensor.name: sensor.texels}
    shear = np.linalg.norm(response.net_shear(seen, sensor.texels), axis=1)
    limit = mu.mus * seen.normal_force.sum(axis=1)
    sliding, title = response.slipping(seen, mu).sum(axis=1), "3  Shear and slip"
    curves = {"shear": (shear, SHEAR_COLOUR, "-"), "static limit": (limit, INK, "--")}
    scene.frame_set(demo.PICTURE_FRAME)
    shown = render.bounding_box_corners([scene.objects[name] for name in (demo.PAD_A, f"{demo.PAD_A} base", demo.BALL)])

    def drawing(number: int, path: Path) -> Callable[[Any], None]:
        def draw(figure) -> None:
            draw_view(figure, path, NARROW)
            draw_touch(figure, touch_of(recording, texels, number), MIDDLE)
            draw_curves(figure, RIGHT, recording.times, curves, int(np.searchsorted(recording.frames, number)), "force (N)")

        return draw

    for obj in scene.objects:
        if demo.PAD_B in obj.name or obj.name == demo.CUBE:
            obj.hide_render = True
    with studio(film, NARROW, scene, (-70.0, 32.0), shown) as render_to:
        for seconds, number, path in film.play("slip", range(8, demo.PICTURE_FRAME + 1)):
            render_to(path, number)
            words = "A ball is pressed on a finger pad and drawn along it. Arrows in the image show the shear of each texel."
            film.show(seconds, title, words, drawing(number, path))
    i = int(np.searchsorted(recording.frames, number))
    words = f"Near the limit of static friction the ball slips: {sliding[i]} of {np.count_nonzero(seen.contact[i])} "
    words += f"texels in contact slip, with {shear[i]:.2f} N of shear under {seen.normal_force[i].sum():.2f} N."
    film.show(3.5, title, words, drawing(number, path))


def close_gap(film: Film) -> None:
    """Find the effects that the model of the sample rig lacks, and show curves and errors without and with them."""
    gap = pp.find_gap(ROOT / "docs" / "sample-rig" / "rig.toml", progress=True)
    result, title = gap.diagnosis, "4  Close the gap to measurements"
    predictor = result.of("check")[0]
    time, measured = predictor.trial.time, predictor.trial.reading
    models = {"base model": result.base.model, "with the effects found": result.best.model}
    base, amended = (predictor.predict(model).reading for model in models.values())
    texel = int(np.argmax(np.nansum((measured - base) ** 2, axis=0)))
    rows = [measured[:, texel], base[:, texel], amended[:, texel]]
    span = float(np.nanmax(rows)) - float(np.nanmin(rows))

    def drawing(count: int, until: int) -> Callable[[Any], None]:
        def draw(figure) -> None:
            axes = figure.add_axes((0.1, 0.3, 0.86, 0.57))
            names = "measured", "simulated", "simulated with the effects found"
            for values, name, colour in list(zip(rows, names, (INK, SHEAR_COLOUR, NORMAL_COLOUR), strict=True))[:count]:
                axes.plot(time[:until], values[:until], color=colour, lw=1.7, label=name)
            axes.set_xlim(time[0], time[-1])
            axes.set_ylim(float(np.nanmin(rows)) - 0.05 * span, float(np.nanmax(rows)) + 0.25 * span)
            axes.set_xlabel("time (s)")
            axes.set_ylabel(f"reading of texel {texel} ({gap.rig.parameters.unit})")
            tidy_axes(axes)
            axes.set_facecolor(BACKGROUND)
            axes.legend(frameon=False, fontsize=SMALL, loc="upper left", ncols=3)

        return draw

    words = f"Readings of a pad of {len(gap.rig.texels)} texels under a ball: the sample rig, which is synthetic. "
    words += "This recording is never fitted."
    for until in np.linspace(0, len(time), 25).astype(int)[1:]:
        film.show(1.0 / FPS, title, words, drawing(1, int(until)))
    film.show(1.5, title, words, drawing(1, len(time)))
    errors = gap.errors
    film.show(3.5, title, f"The simulation differs from it by {errors.base['check']:.1%} of the range.", drawing(2, len(time)))
    names = " and ".join(one.name.replace("-", " ") for one in gap.effects)
    words = f"What the model lacks is found: {names}. With them the error is {errors.amended['check']:.1%}."
    film.show(4.0, title, words, drawing(3, len(time)))
    chart = film.folder / "gap.png"
    figure = overview(result, errors, WIDE)
    for part in (figure, *figure.axes[-1:]):
        part.set_facecolor(BACKGROUND)
    save_figure(figure, chart, film.height / HIGH)

    def draw_chart(figure) -> None:
        picture = imread(chart)
        tall = picture.shape[0] / film.height
        axes = figure.add_axes((0.0, 0.17 + 0.5 * (0.73 - tall), 1.0, tall))
        axes.imshow(picture, aspect="auto", interpolation="antialiased")
        axes.set_axis_off()

    words = "The report shows where the error is and which effect removes how much of it, also in trials that were not fitted."
    film.show(5.0, title, words, draw_chart)


class Moment(NamedTuple):
    """A moment of the simulator's loop: time s, position (3,) m and quaternion (4,) of the cube, texels, force on it N."""

    time: float
    position: np.ndarray
    quaternion: np.ndarray
    force: np.ndarray
    shear: np.ndarray
    lift: float


WEIGHT = 9.81
"""Of the cube of 1 kg, N."""
HEAT = "film_heat"
"""Name of the colour attribute of the pad."""
PUSH, PUSHED = 3.0, (0.3, 0.5)
"""Force that pushes the cube along the pad, N, and from when to when, s."""


def mujoco_moments(pad: pp.Sensor, seconds: float, count: int) -> list[Moment]:
    """Let a cube of 1 kg fall on the sensor in MuJoCo, and push it; return `count` moments."""
    import mujoco

    start, turn = pad.position + [0.0, 0.0, 0.033], math.radians(8.0)
    xml = '<mujoco><option timestep="0.0005"/><worldbody><body name="cube" pos="{} {} {}" quat="{} {} 0 0"><freejoint/>'
    xml += '<geom type="box" size="0.025 0.025 0.025" mass="1"/></body></worldbody></mujoco>'
    model = mujoco.MjModel.from_xml_string(xml.format(*start, math.cos(0.5 * turn), math.sin(0.5 * turn)))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    cube, pose, moments = data.body("cube"), (pad.position, pad.quaternion), []
    pressed = pp.PressedSensor(pad, pp.Body.box(0.05), model.opt.timestep, pose, (cube.xpos, cube.xquat))
    steps = round(seconds / model.opt.timestep)
    keep = set(np.linspace(0, steps - 1, count).round().astype(int).tolist())
    for step in range(steps):
        mujoco.mj_step1(model, data)
        contact = pressed.step(pose, (cube.xpos, cube.xquat))
        data.qfrc_applied[:] = 0.0
        data.qfrc_applied[1] = PUSH if PUSHED[0] <= data.time < PUSHED[1] else 0.0
        mujoco.mj_applyFT(model, data, contact.force_on_target, contact.torque_on_target, cube.xpos, cube.id, data.qfrc_applied)
        mujoco.mj_step2(model, data)
        if step in keep:
            texels = contact.texels.normal_force.copy(), contact.texels.shear.copy()
            moments.append(Moment(data.time, cube.xpos.copy(), cube.xquat.copy(), *texels, float(contact.force_on_target[2])))
    return moments


def heat_material():
    """Return a material that shows the colours of the vertices as they are."""
    made = scene_builder.material("Heat map", (0.0, 0.0, 0.0), roughness=0.6)
    nodes, links = made.node_tree.nodes, made.node_tree.links
    color, light = nodes.new("ShaderNodeAttribute"), nodes.new("ShaderNodeEmission")
    color.attribute_name = HEAT
    links.new(color.outputs["Color"], light.inputs["Color"])
    links.new(light.outputs["Emission"], nodes["Material Output"].inputs["Surface"])
    return made


def simulator(film: Film) -> None:
    """Put a sensor of a sample scene into MuJoCo's loop and show the cube that falls on it and is pushed."""
    scene = new_scene(film, weighing, "weighing")
    obj, cube, title = scene.objects[weighing.PAD], scene.objects[weighing.CUBE], "5  In a simulator's loop"
    pad = pp.sensor_of(obj)
    moments = mujoco_moments(pad, 0.8, 96)
    scale = force_scale(response.scale_limit(2.0 * WEIGHT / len(pad.texels)))  # the impact is far above the scale
    strongest = max(float(np.linalg.norm(one.shear, axis=1).max()) for one in moments)
    time, lift = np.array([one.time for one in moments]), np.array([one.lift for one in moments])
    curves = {"on the cube": (lift, NORMAL_COLOUR, "-"), "weight": (np.full(len(time), WEIGHT), INK, "--")}
    obj.data.materials.append(heat_material())
    obj.data.color_attributes.new(HEAT, "FLOAT_COLOR", "POINT")
    vertex = np.asarray(pad.texels.vertex)
    for face in obj.data.polygons:
        face.material_index = int(np.isin(list(face.vertices), vertex).all())
    cube.rotation_mode = "QUATERNION"
    corners = []
    for one in moments[:: len(moments) - 1]:
        cube.location, cube.rotation_quaternion = 1e3 * one.position, one.quaternion
        bpy.context.view_layer.update()
        corners.append(render.bounding_box_corners([obj, cube]))
    shown = np.concatenate(corners)

    def drawing(number: int, path: Path) -> Callable[[Any], None]:
        one = moments[number]

        def draw(figure) -> None:
            draw_view(figure, path, NARROW)
            draw_touch(figure, Touch({weighing.PAD: (pad.texels, one.force, one.shear)}, scale, strongest), MIDDLE)
            draw_curves(figure, RIGHT, time, curves, number, "force (N)")

        return draw

    def colour(force: np.ndarray) -> None:
        colors = np.ones((len(obj.data.vertices), 4), np.float32)
        colors[vertex, :3] = color_maps.linear(scale.colors(force))
        obj.data.color_attributes[HEAT].data.foreach_set("color", colors.ravel())
        obj.data.update()

    colour(moments[0].force)  # the studio's background depends on how bright the scene is
    with studio(film, NARROW, scene, (-50.0, 25.0), shown) as render_to:
        for seconds, number, path in film.play("mujoco", range(len(moments))):
            one = moments[number]
            colour(one.force)
            cube.location, cube.rotation_quaternion = 1e3 * one.position, one.quaternion
            render_to(path, scene.frame_start)
            words = "The sensor of a Blender scene in MuJoCo: each step takes the pose of the cube and returns its forces. "
            words += "Shown at a tenth of real speed."
            film.show(seconds, title, words, drawing(number, path))
    words = f"After a push of {PUSH:g} N the cube rests: the texels carry {lift[number]:.3f} N, its weight is {WEIGHT:.3f} N."
    film.show(3.0, title, words, drawing(number, path))


def card(words: str, size: float, below: str) -> Callable[[Any], None]:
    """Return what draws a card with large words and a line below them."""

    def draw(figure) -> None:
        figure.text(0.5, 0.6, words, fontsize=size, weight="bold", color=INK, ha="center", va="center")
        figure.text(0.5, 0.42, below, fontsize=12.0, color=INK, ha="center", va="center", linespacing=1.6)

    return draw


def make(film: Film) -> Film:
    """Add all chapters to a film."""
    film.show(3.0, "", "", card("Palpate", 34.0, "turns any region of any mesh in Blender into a tactile sensor"))
    scene = new_scene(film, hand, "hand")
    paint(film, scene)
    press(film, scene)
    slip(film)
    close_gap(film)
    if importlib.util.find_spec("mujoco"):
        simulator(film)
    film.show(4.0, "", "", card("Palpate", 34.0, "All forces in this film are computed.\nTry it: make demo"))
    return film


def main() -> None:
    """Read the options and make the film."""
    parser = argparse.ArgumentParser(description="Make the film about Palpate.")
    parser.add_argument("--out", type=Path, default=Path("palpate.mp4"), help="the film (default: %(default)s)")
    parser.add_argument("--work", type=Path, default=Path("palpate-film"), help="folder for renders (default: %(default)s)")
    parser.add_argument("--height", type=int, default=720, help="pixels; the width is 16/9 of it (default: %(default)s)")
    parser.add_argument("--every", type=int, default=1, help="render only every so many frames, for a draft")
    given = parser.parse_args()
    pp.register()
    given.work.mkdir(parents=True, exist_ok=True)
    with blender_output_hidden():
        film = make(Film(given.work.absolute(), given.height, given.every))
        film.bar.close()
        path = encode_video(film.frames, given.out.absolute(), FPS)
    print(path, f"{len(film.frames) / FPS:.0f} s")


if __name__ == "__main__":
    main()
