# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the documentation's pictures of the sample scenes: python tools/sample_pictures.py [NAME …].

Each sample is baked and drawn as `palpate bake` and `palpate render` do it for a user, without options that choose a camera or
a light; the demo is what `palpate demo` makes. The gel's picture is drawn by the commands on its page, pictures of windows by
the window tests.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ROOT / "docs" / "images"
COMMAND = [sys.executable, "-m", "palpate.commands"]
SIZE = (960, 720)
QUALITY = 88
"""Of JPEG files."""
FRONT = (
    ("hand", 45, (-138, 22), (960, 720), (0, 0, 960, 720)),
    ("grasp_bottle", 43, (-50, 18), (1280, 960), (313, 180, 913, 900)),
)
"""Pictures of the front page: sample, frame, azimuth and elevation of the camera in degrees, size of the render, and the part
that is shown (left, top, right, bottom)."""
FRONT_RANGE, FRONT_HEIGHT, FRONT_DPI = 0.2, 720, 150
"""End of their colour scale, N; height of them, pixels; dots per inch of the words below."""
PICK_FRAMES = (30, 60, 90, 130)
"""Before the touch, held, lifted and about to be let go, in the sample of pick and place."""


def palpate(*words: object) -> None:
    """Run one of Palpate's commands."""
    subprocess.run([*COMMAND, *map(str, words)], check=True)


def baked(name: str, folder: Path, **settings: object) -> Path:
    """Bake a sample into a folder, with other settings of Palpate's in its scene; return its .blend."""
    scene, source = folder / f"{name}.blend", ROOT / "sample_blends" / f"{name}.blend"
    if settings:
        code = f"import bpy, palpate; palpate.register(); bpy.ops.wm.open_mainfile(filepath={str(source)!r}); "
        code += "".join(f"bpy.context.scene.palpate.{key} = {value!r}; " for key, value in settings.items())
        source = folder / f"{name}-set.blend"
        subprocess.run([sys.executable, "-c", f"{code}bpy.ops.wm.save_as_mainfile(filepath={str(source)!r})"], check=True)
    palpate("bake", source, "--save-as", scene, "--out", folder / name)
    return scene


def rendered(scene: Path, *options: object) -> Path:
    """Return the folder with a scene's figures."""
    out = scene.with_suffix(".figures")
    palpate("render", scene, "--out", out, "--format", "png", *options)
    return out


def save_jpeg(picture, name: str, width: int | None = None) -> None:
    """Write a picture, no wider than this, as a JPEG file of the documentation."""
    picture = picture.convert("RGB")
    if width is not None and picture.width > width:
        picture = picture.resize((width, round(picture.height * width / picture.width)))
    picture.save(IMAGES / name, quality=QUALITY, optimize=True)


def page_of_pictures(sample: str, name: str, overlays: tuple[str, ...] = ()) -> Callable[[Path], None]:
    """Return what makes the four pictures of a sample on the page about pictures."""

    def make(folder: Path) -> None:
        from PIL import Image

        scene = baked(sample, folder, overlays=set(overlays)) if overlays else baked(sample, folder)
        out = rendered(scene, "--size", *SIZE)
        save_jpeg(Image.open(next(out.glob("scene_and_touch_*.png"))), f"overlays-{name}.jpg")
        for kind in ("strip", "curves"):
            shrink(out / f"{kind}.png", f"{kind}-{name}.png")
        shrink(sorted(out.glob("numbers_*.png"))[0], f"numbers-{name}.png")

    return make


def shrink(file: Path, name: str, share: float = 0.5) -> None:
    """Write a figure into the documentation, with fewer pixels: the documentation is read on a screen."""
    from PIL import Image

    with Image.open(file) as figure:
        size = round(figure.width * share), round(figure.height * share)
        figure.convert("RGB").resize(size, Image.Resampling.LANCZOS).save(IMAGES / name, optimize=True)


def front(folder: Path) -> None:
    """A hand and a gripper that hold something, with one colour bar, at the top of the README."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from PIL import Image

    from palpate.core.figures.figure_canvas import new_figure, save_figure
    from palpate.core.figures.figure_style import FigureStyle
    from palpate.core.figures.tactile_image import draw_colour_bar

    style = FigureStyle("VIRIDIS", limit=FRONT_RANGE)
    scale = {"color_map": style.colour_map, "use_auto_range": False, "range_max": FRONT_RANGE}
    width = sum(right - left for *_, (left, _, right, _) in FRONT)
    figure, x = new_figure(width / FRONT_DPI, (FRONT_HEIGHT + 90) / FRONT_DPI), 0.0
    figure.set_facecolor("#f3f3f3")
    low = 90 / (FRONT_HEIGHT + 90)
    for sample, frame, view, size, box in FRONT:
        scene = baked(sample, folder, **scale)
        out = rendered(scene, "--only", "scene", "--frame", frame, "--size", *size, "--view", *view)
        picture = Image.open(out / f"scene_{frame:04d}.png").convert("RGB").crop(box)
        axes = figure.add_axes((x, low, picture.width / width, 1.0 - low))
        axes.imshow(picture, aspect="auto", interpolation="antialiased")
        axes.set_axis_off()
        x += picture.width / width
    scale_of = ScalarMappable(Normalize(0.0, FRONT_RANGE), style.matplotlib_colormap())
    draw_colour_bar(figure, scale_of, figure.add_axes((0.32, 0.72 * low, 0.36, 0.2 * low)), style)
    save_figure(figure, folder / "front.png", FRONT_DPI)
    save_jpeg(Image.open(folder / "front.png"), "front.jpg")


def demo(folder: Path) -> None:
    """The picture of the demo in the README, and its forces."""
    from PIL import Image

    palpate("demo", "--out", folder / "demo", "--size", 1280, 720)
    save_jpeg(Image.open(folder / "demo" / "scene.png"), "demo.jpg", 1280)
    with Image.open(folder / "demo" / "forces.png") as figure:
        size = 1440, round(figure.height * 1440 / figure.width)
        figure.convert("RGB").resize(size, Image.Resampling.LANCZOS).save(IMAGES / "forces.png", optimize=True)


def hand(folder: Path) -> None:
    """Index finger and thumb on the page about the paper."""
    from PIL import Image

    out = rendered(baked("hand", folder), "--only", "scene", "--size", *SIZE)
    save_jpeg(Image.open(next(out.glob("scene_0*.png"))), "paper-hand.jpg", 800)


def pick_and_place(folder: Path) -> None:
    """Four frames of pick and place beside one another, on the page about the paper."""
    from PIL import Image

    scene = baked("pick_and_place", folder)
    frames = [word for number in PICK_FRAMES for word in ("--frame", number)]
    out = rendered(scene, "--only", "scene", "--size", 480, 480, *frames)
    pictures = [Image.open(out / f"scene_{number:04d}.png").convert("RGB") for number in PICK_FRAMES]
    sheet = Image.new("RGB", (sum(picture.width for picture in pictures), pictures[0].height))
    for number, picture in enumerate(pictures):
        sheet.paste(picture, (number * picture.width, 0))
    save_jpeg(sheet, "paper-pick.jpg", 1440)


PICTURES: dict[str, Callable[[Path], None]] = {
    "front": front,
    "demo": demo,
    "pads": page_of_pictures("demo", "pads"),
    "fingertip": page_of_pictures("fingertip", "fingertip", ("FORCE", "SHEARS")),
    "grasp": page_of_pictures("grasp", "grasp", ("FORCE", "SHEARS")),
    "hand": hand,
    "pick": pick_and_place,
}

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Make the documentation's pictures of the sample scenes.")
    parser.add_argument("name", nargs="*", help=f"only these of {', '.join(PICTURES)} (default: all)")
    for name in parser.parse_args().name or PICTURES:
        with tempfile.TemporaryDirectory() as folder:
            PICTURES[name](Path(folder))
