# SPDX-License-Identifier: GPL-3.0-or-later
"""One sensor, pressed in MuJoCo with Palpate's texels and with MuJoCo's own: a table and a picture.

palpate sensor export sample_blends/weighing.blend --to probes --out sensors
palpate sensor export sample_blends/weighing.blend --to mjcf --out sensors
python examples/mujoco_side_by_side.py sensors/Finger docs/images/mujoco-side-by-side.png
"""

import sys
import xml.etree.ElementTree as ElementTree
from typing import NamedTuple

import mujoco
import numpy as np
import trimesh

from palpate.core.figures import color_maps
from palpate.core.figures.figure_canvas import new_figure, save_figure
from palpate.core.figures.figure_style import GREY, INK
from palpate.core.geometry.mesh import TriangleMesh
from palpate.core.simulators.pressed_sensor import PressedSensor
from palpate.core.simulators.probe_list import read_probe_list
from palpate.core.simulators.sensor_on_mesh import SensorOnMesh

STEP = 0.0002
"""Seconds; short enough for half a kilogram on 84 texels with a damping of 10 N·s/m each."""
SETTLING = 1.0
"""Seconds."""


class Load(NamedTuple):
    """What is put on the middle of the sensor, and the sideways force on it, newtons."""

    title: str
    shape: str
    size: float
    mass: float
    push: float = 0.0
    aside: float = 0.0

    @property
    def geom(self) -> str:
        """Attributes of MuJoCo's geom."""
        sides = f"{self.size} {self.size} {self.size}" if self.shape == "box" else f"{self.size}"
        return f'type="{self.shape}" size="{sides}" mass="{self.mass}"'

    @property
    def mesh(self) -> TriangleMesh:
        """Its surface, about its middle, metres."""
        made = trimesh.creation.box([2 * self.size] * 3) if self.shape == "box" else trimesh.creation.icosphere(4, self.size)
        return TriangleMesh(made.vertices, made.faces)


LOADS = (
    Load("cube of 1 kg", "box", 0.025, 1.0),
    Load("cube of 0.5 kg", "box", 0.025, 0.5),
    Load("cube of 1 kg, pushed by 1 N", "box", 0.025, 1.0, push=1.0),
    Load("cube of 1 kg, 5 mm aside", "box", 0.025, 1.0, aside=0.005),
    Load("ball of 1 kg, radius 40 mm", "sphere", 0.04, 1.0),
)


class Outcome(NamedTuple):
    """Texels' normal forces (n,), the size of the sum of their shear, N, and how far the load has sunk, metres."""

    force: np.ndarray
    shear: float
    sunk: float


def start(finger: SensorOnMesh, load: Load) -> np.ndarray:
    """Return where the load's middle begins: where it touches the highest texel."""
    texels = finger.sensor.texels.position
    middle = 0.5 * (texels.min(axis=0) + texels.max(axis=0))
    return np.array([*middle[:2] + [load.aside, 0.0], texels[:, 2].max() + load.size]) + finger.position


def by_palpate(finger: SensorOnMesh, load: Load) -> Outcome:
    """MuJoCo moves the load, and Palpate's texels carry it."""
    place = start(finger, load)
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{STEP}"/><worldbody><body name="load" pos="{place[0]} {place[1]} {place[2]}"><freejoint/>'
        f"<geom {load.geom}/></body></worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    body = data.body("load")
    pose = finger.position, finger.quaternion
    pressed = PressedSensor(finger, load.mesh, STEP, pose, (body.xpos, body.xquat))
    for _ in range(round(SETTLING / STEP)):
        mujoco.mj_step1(model, data)
        contact = pressed.step(pose, (body.xpos, body.xquat))
        data.qfrc_applied[:] = [load.push, 0, 0, 0, 0, 0]
        mujoco.mj_applyFT(model, data, contact.force_on_target, contact.torque_on_target, body.xpos, body.id, data.qfrc_applied)
        mujoco.mj_step2(model, data)
    texels = contact.texels
    return Outcome(texels.normal_force, float(np.linalg.norm(texels.shear.sum(axis=0))), float(place[2] - body.xpos[2]))


def by_mujoco(finger: SensorOnMesh, path: str, load: Load) -> Outcome:
    """MuJoCo's contact carries the load, and its sensor `tactile` gives the depth of each texel."""
    place = start(finger, load)
    root = ElementTree.parse(path).getroot()
    root.find("option").set("timestep", str(STEP))
    body = ElementTree.SubElement(root.find("worldbody"), "body", name="load", pos=" ".join(map(str, place)))
    ElementTree.SubElement(body, "freejoint")
    body.append(ElementTree.fromstring(f"<geom {load.geom}/>"))
    model = mujoco.MjModel.from_xml_string(ElementTree.tostring(root, "unicode"))
    data = mujoco.MjData(model)
    for _ in range(round(SETTLING / STEP)):
        data.qfrc_applied[:3] = load.push, 0, 0
        mujoco.mj_step(model, data)
    depth = data.sensor(finger.name).data.reshape(3, -1)[0]
    return Outcome(model.numeric(f"{finger.name} k").data[0] * depth, float("nan"), float(place[2] - data.body("load").xpos[2]))


def draw(finger: SensorOnMesh, outcomes: list[tuple[Outcome, Outcome]], path: str) -> None:
    """Draw the texels from above, Palpate's on top and MuJoCo's below; each column has one scale."""
    position = finger.sensor.texels.position * 1e3
    figure = new_figure(9.6, 4.6)
    columns, colours = len(LOADS), color_maps.matplotlib_colormap("VIRIDIS")
    for i, (load, pair) in enumerate(zip(LOADS, outcomes, strict=True)):
        limit = max(outcome.force.max() for outcome in pair)
        for row, (name, outcome) in enumerate(zip(("Palpate's texels", "MuJoCo's tactile"), pair, strict=True)):
            axes = figure.add_axes((0.06 + i * 0.93 / columns, 0.56 - 0.42 * row, 0.93 / columns - 0.03, 0.34))
            drawn = axes.scatter(*position[:, :2].T, c=outcome.force, cmap=colours, vmin=0.0, vmax=limit, s=16, lw=0)
            axes.set_aspect("equal")
            axes.set_xticks([])
            axes.set_yticks([])
            for spine in axes.spines.values():
                spine.set_color(GREY)
            axes.set_xlabel(f"sum {outcome.force.sum():.3f} N", fontsize=8, color=INK, labelpad=3)
            if row == 0:
                axes.set_title(load.title.replace(", ", ",\n"), fontsize=8.5, color=INK)
            if i == 0:
                axes.set_ylabel(name, fontsize=8.5, color=INK)
        place = figure.add_axes((0.08 + i * 0.93 / columns, 0.065, 0.93 / columns - 0.07, 0.02))
        bar = figure.colorbar(drawn, cax=place, orientation="horizontal")
        bar.set_ticks([0.0, limit], labels=["0", f"{limit * 1e3:.0f} mN"])
        bar.ax.tick_params(labelsize=7.5, length=2, colors=INK)
    save_figure(figure, path, 150)


def main(stem: str, picture: str) -> None:
    """Press, print the table and draw the picture."""
    finger = read_probe_list(f"{stem}.json")
    outcomes = [(by_palpate(finger, load), by_mujoco(finger, f"{stem}.xml", load)) for load in LOADS]
    print("| load | texels' sum (N) | texels lit | largest (mN) | shear (N) | sunk in (µm) |")
    print(f"|{' --- |' * 6}")
    for load, pair in zip(LOADS, outcomes, strict=True):
        cells = [" · ".join(f"{value:{form}}" for value in column) for form, column in (
            (".3f", [one.force.sum() for one in pair]),
            ("d", [np.count_nonzero(one.force > 0.0) for one in pair]),
            (".1f", [1e3 * one.force.max() for one in pair]),
            (".3f", [one.shear for one in pair]),
            (".1f", [1e6 * one.sunk for one in pair]),
        )]  # fmt: skip
        print(f"| {load.title} | {' | '.join(cells)} |".replace("nan", "–"))
    draw(finger, outcomes, picture)


if __name__ == "__main__":
    main(*sys.argv[1:])
