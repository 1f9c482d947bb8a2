# SPDX-License-Identifier: GPL-3.0-or-later
"""One picture of the rooms and the way of data through them, drawn from the imports.

Rooms stand in layers: a room rests on those that it imports. Only imports that no others imply are drawn (the transitive
reduction), so that the picture stays legible; a red arrow is an import against the order. What was drawn is kept in the file
as JSON, with which a test compares the source.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from html import unescape
from pathlib import Path

from import_graph import ORDER, ROOT, Graph

PICTURE = ROOT / "docs" / "images" / "architecture.svg"

CAPTIONS = {
    "core.errors": "errors that a user can mend",
    "core.version": "number of this version",
    "core.compiled": "kernels and thread team (numba)",
    "core.jobs": "progress, cancel, long work",
    "core.geometry": "meshes, rays, texels, layouts",
    "core.model": "plain data of a run",
    "core.skins": "signed channels, magnets",
    "core.laws": "normal force, LuGre friction",
    "core.effects": "what real sensors add",
    "core.response": "forces to readings, metrics",
    "core.solver": "bodies and contacts over time",
    "core.io": "files in and out",
    "core.study": "many runs of a scene",
    "core.figures": "images, curves, strips",
    "core.export": "a bake for other programs",
    "core.simulators": "sensors for other programs",
    "core.gap": "what a sensor's model lacks",
    "addon.session": "units, clock, identity, jobs",
    "addon.properties": "settings kept in the .blend",
    "addon.scene": "reads the scene",
    "addon.study": "what a study varies",
    "addon.authoring": "makes sensors, finds problems",
    "addon.timeline": "plays in the viewport",
    "addon.bake": "runs, saves, resumes",
    "addon.display": "heat maps, arrows, overlays",
    "addon.render": "figures and videos",
    "addon.measured": "measured data and gaps",
    "addon.events": "Blender's handlers",
    "addon.scripting": "objects for scripts",
    "api": "what scripts call",
    "operators": "buttons",
    "panels": "user interface",
    "commands": "command line",
    "paper": "the paper's experiments",
    "sample_blends": "sample scenes",
}

# The two ways of data. A room may have several steps, and a step several rooms.
SIMULATION = {
    "author": ("addon.authoring",),
    "sample": ("addon.scene",),
    "solve": ("core.solver",),
    "respond": ("core.response",),
    "write": ("addon.bake", "core.io"),
    "look": ("addon.display", "addon.render", "core.figures"),
}
IDENTIFICATION = {
    "dataset": "dataset",
    "forward model": "forward",
    "fit": "fitting",
    "select": "selection",
    "report": "report",
}

INK, PALE, RED, BLUE, ORANGE = "#1d2733", "#8a96a3", "#d0342c", "#2563a8", "#c9650a"
BACK = {"core": "#e8f0f8", "addon": "#fbf1e4", "drivers": "#eef3ec"}
EDGE = {"core": "#9db8d2", "addon": "#dcb98c", "drivers": "#a9c0a2"}
DRIVERS = ("api", "panels", "operators", "commands", "paper", "sample_blends")
WIDTH, HEIGHT, ROW = 2.35, 0.98, 1.5  # of a box, and from layer to layer, inches
GAP_WIDTH = 5.4  # the room of the second way, which shows its steps


@dataclass(frozen=True)
class Rooms:
    """What the picture shows: imports among the rooms of each package, and from each room into core."""

    inside: dict[str, dict[str, list[str]]]
    into_core: dict[str, list[str]]
    subrooms: dict[str, list[str]]

    def as_json(self) -> str:
        """Return the data as they are kept in the picture."""
        return json.dumps({"inside": self.inside, "into_core": self.into_core, "subrooms": self.subrooms}, sort_keys=True)


def rooms_and_imports(graph: Graph) -> Rooms:
    """Read the data of the picture from the imports."""
    inside = {
        p: {room: sorted(ts) for room, ts in sorted(graph.children(p).items()) if room in ORDER[p]} for p in ("core", "addon")
    }
    into_core: dict[str, set[str]] = {}
    drivers: dict[str, set[str]] = {name: set() for name in DRIVERS}
    for module, targets in graph.edges.items():
        top = module.split(".")[0]
        if top in drivers:
            drivers[top] |= {target.split(".")[0] for target in targets} - {top}
        if top == "addon" and module.count("."):
            room = module.split(".")[1]
            into_core.setdefault(room, set()).update(t.split(".")[1] for t in targets if t.startswith("core."))
    inside["drivers"] = {name: sorted(targets & set(DRIVERS)) for name, targets in drivers.items()}
    subrooms = {package: list(order) for package, order in ORDER.items() if package.count(".")}
    return Rooms(inside, {room: sorted(ts, key=ORDER["core"].index) for room, ts in sorted(into_core.items())}, subrooms)


def drawn_data(picture: Path = PICTURE) -> str:
    """Return the data from which a picture was drawn."""
    found = re.search(r"<dc:description>(.*?)</dc:description>", picture.read_text(encoding="utf-8"), re.S)
    if found is None:
        raise ValueError(f"{picture} holds no data; draw it with tools/architecture.py")
    return unescape(found.group(1))


def reduced(graph: Mapping[str, set[str]]) -> dict[str, set[str]]:
    """Leave out the edges that a longer path implies."""

    def reach(node: str, without: str) -> set[str]:
        seen: set[str] = set()
        open_nodes = [target for target in graph.get(node, ()) if target != without]
        while open_nodes:
            at = open_nodes.pop()
            if at not in seen:
                seen.add(at)
                open_nodes += graph.get(at, ())
        return seen

    return {node: {target for target in targets if target not in reach(node, target)} for node, targets in graph.items()}


# --- layout: layers by longest path, order by the mean of the neighbours


@dataclass
class Layout:
    """Places of the boxes of one package: `layers` from the lowest to the highest, bends of long edges among them."""

    layers: list[list[str]] = field(default_factory=list)
    edges: list[list[str]] = field(default_factory=list)
    upward: list[tuple[str, str]] = field(default_factory=list)
    x: dict[str, float] = field(default_factory=dict)


def layout(imports: Mapping[str, list[str]], order: tuple[str, ...]) -> Layout:
    """Place the rooms of one package; imports against the order are set aside as `upward`."""
    rank = {room: i for i, room in enumerate(order)}
    down = {room: {t for t in ts if rank[t] < rank[room]} for room, ts in imports.items()}
    found = Layout(upward=[(room, t) for room, ts in imports.items() for t in ts if rank[t] > rank[room]])
    slim = reduced(down)
    level: dict[str, int] = {}
    for room in order:
        level[room] = 1 + max((level[t] for t in slim.get(room, ())), default=-1)
    found.layers = [[room for room in order if level[room] == i] for i in range(max(level.values()) + 1)]
    for room in order:
        for target in sorted(slim.get(room, ()), key=rank.__getitem__):
            path = [room]
            for i in range(level[room] - 1, level[target], -1):
                bend = f"{room}>{target}@{i}"
                found.layers[i].append(bend)
                path.append(bend)
            found.edges.append([*path, target])
    _sort_layers(found)
    return found


def _width(node: str) -> float:
    if "@" in node:
        return 0.35
    return 0.3 + (GAP_WIDTH if node == "gap" else WIDTH)


def _sort_layers(found: Layout) -> None:
    """Order each layer by the mean place of its neighbours, again and again, and spread it around the middle."""
    neighbours: dict[str, list[str]] = {}
    for path in found.edges:
        for above, below in zip(path, path[1:], strict=False):
            neighbours.setdefault(above, []).append(below)
            neighbours.setdefault(below, []).append(above)
    for layer in found.layers:
        _spread(layer, found.x)
    for _ in range(24):
        for layer in (*found.layers, *reversed(found.layers)):
            mean = {n: sum(found.x[m] for m in neighbours.get(n, [n])) / len(neighbours.get(n, [n])) for n in layer}
            layer.sort(key=lambda n, mean=mean: (round(mean[n], 6), n))
            _spread(layer, found.x)


def _spread(layer: list[str], x: dict[str, float]) -> None:
    left = -sum(map(_width, layer)) / 2
    for node in layer:
        x[node] = left + _width(node) / 2
        left += _width(node)


# --- drawing


def draw(rooms: Rooms, path: Path = PICTURE) -> None:
    """Draw the picture into an SVG, or into what matplotlib makes of the file's ending."""
    import matplotlib

    matplotlib.use("Agg")
    matplotlib.rcParams.update({"svg.fonttype": "path", "svg.hashsalt": "palpate", "font.family": "DejaVu Sans"})
    from matplotlib.figure import Figure

    towers = {p: layout(rooms.inside[p], ORDER[p]) for p in ("addon", "core")}
    wide = {p: max(sum(map(_width, layer)) for layer in tower.layers) + 0.5 for p, tower in towers.items()}
    tall = max(len(tower.layers) for tower in towers.values()) * ROW
    width, height = sum(wide.values()) + 1.7, tall + 3.95
    figure = Figure(figsize=(width, height))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0, width), ylim=(0, height))
    axes.axis("off")
    picture = _Canvas(axes, {})
    bottom = 1.75
    middle = {"addon": 0.4 + wide["addon"] / 2, "core": width - 0.4 - wide["core"] / 2}
    for package, tower in towers.items():
        picture.tower(package, tower, middle[package], wide[package], bottom, tall, rooms)
    picture.drivers(width, bottom + tall + 0.75)
    picture.between(middle, wide, bottom + tall)
    picture.ways()
    picture.legend(width)
    about = {"Description": rooms.as_json(), "Date": None} if path.suffix == ".svg" else {}
    figure.savefig(path, metadata=about, dpi=110, facecolor="white")


@dataclass
class _Canvas:
    """Draws boxes and arrows and remembers where each room is."""

    axes: object
    place: dict[str, tuple[float, float, float]]

    def box(self, key: str, x: float, y: float, kind: str, width: float = WIDTH, notes: tuple[str, ...] = ()) -> None:
        """Draw one room with its name, its caption and further lines."""
        from matplotlib.patches import FancyBboxPatch

        style = "round,pad=0,rounding_size=0.09"
        shape = FancyBboxPatch((x - width / 2, y - HEIGHT / 2), width, HEIGHT, boxstyle=style)
        shape.set(facecolor="white", edgecolor=EDGE[kind], linewidth=1.6, zorder=4)
        self.axes.add_patch(shape)
        top = y + 0.115 + 0.08 * len(notes)
        self.text(x, top, key.rpartition(".")[2], 13, INK, weight="bold")
        self.text(x, top - 0.25, CAPTIONS[key], 9.3, INK)
        for i, note in enumerate(notes):
            self.text(x, top - 0.44 - 0.165 * i, note, 8.2, PALE)
        self.place[key] = (x, y, width)

    def text(self, x: float, y: float, text: str, size: float, color: str, **more: object) -> None:
        """Write one line."""
        self.axes.text(x, y, text, **{"fontsize": size, "color": color, "ha": "center", "va": "center", "zorder": 6, **more})

    def tower(self, package: str, tower: Layout, x: float, wide: float, bottom: float, tall: float, rooms: Rooms) -> None:
        """Draw the rooms of one package and the imports among them."""
        self.ground(package, x, wide, bottom, tall)
        step = tall / len(tower.layers)
        height = {n: bottom + step * (i + 0.5) for i, layer in enumerate(tower.layers) for n in layer}
        for layer in tower.layers:
            for room in layer:
                if "@" not in room:
                    key, notes = f"{package}.{room}", []
                    if package == "addon" and rooms.into_core.get(room):
                        notes = _wrapped("core: ", rooms.into_core[room])
                    if key in rooms.subrooms:
                        notes = [""] if key == "core.gap" else _wrapped("", rooms.subrooms[key])
                    width = GAP_WIDTH if key == "core.gap" else WIDTH
                    self.box(key, x + tower.x[room], height[room], package, width, tuple(notes))
        for path in tower.edges:
            points = [(x + tower.x[n], height[n]) for n in path]
            self.arrow(
                [(points[0][0], points[0][1] - HEIGHT / 2), *points[1:-1], (points[-1][0], points[-1][1] + HEIGHT / 2)], PALE
            )
        for room, target in tower.upward:
            (xa, ya), (xb, yb) = ((x + tower.x[n], height[n]) for n in (room, target))
            self.arrow([(xa + 0.5, ya), (xa + 1.0, (ya + yb) / 2), (xb + 0.5, yb)], RED, 2.0)

    def ground(self, package: str, x: float, wide: float, bottom: float, tall: float) -> None:
        """Draw the background of a package with its name."""
        from matplotlib.patches import FancyBboxPatch

        shape = FancyBboxPatch((x - wide / 2, bottom - 0.1), wide, tall + 0.55, boxstyle="round,pad=0,rounding_size=0.15")
        shape.set(facecolor=BACK[package], edgecolor="none", zorder=0)
        self.axes.add_patch(shape)
        words = {"core": "core – arrays in, arrays out; knows nothing of Blender", "addon": "addon – connects Blender and core"}
        name, _, rest = words[package].partition(" – ")
        self.text(x - wide / 2 + 0.2, bottom + tall + 0.2, name, 17, INK, weight="bold", ha="left")
        self.text(x - wide / 2 + 0.45 + 0.17 * len(name), bottom + tall + 0.18, rest, 9.5, INK, ha="left")

    def drivers(self, width: float, y: float) -> None:
        """Draw the packages that drive addon and core."""
        step = (width - 0.8) / len(DRIVERS)
        for i, name in enumerate(DRIVERS):
            self.box(name, 0.4 + step * (i + 0.5), y + 0.72, "drivers")
        self.text(
            width / 2,
            y + 0.03,
            "api uses core; addon and all others use api and core; panels use operators, commands use paper and sample_blends",
            9,
            PALE,
        )

    def between(self, middle: Mapping[str, float], wide: Mapping[str, float], top: float) -> None:
        """Draw the arrow from addon to core."""
        left, right = middle["addon"] + wide["addon"] / 2, middle["core"] - wide["core"] / 2
        self.axes.annotate(
            "",
            (right - 0.03, top - 0.6),
            (left + 0.03, top - 0.6),
            arrowprops={"arrowstyle": "simple,head_width=1.6,head_length=1.1,tail_width=0.7", "color": PALE},
        )

    def arrow(self, points: list[tuple[float, float]], color: str, line: float = 1.3) -> None:
        """Draw a smooth arrow through points."""
        from matplotlib.patches import FancyArrowPatch
        from matplotlib.path import Path as Curve

        start, codes = [points[0]], [Curve.MOVETO]
        for (xa, ya), (xb, yb) in zip(points, points[1:], strict=False):
            start += [(xa, (ya + yb) / 2), (xb, (ya + yb) / 2), (xb, yb)]
            codes += [Curve.CURVE4] * 3
        patch = FancyArrowPatch(
            path=Curve(start, codes),
            arrowstyle="-|>",
            mutation_scale=13,
            color=color,
            lw=line,
            zorder=3 if color == PALE else 7,
        )
        self.axes.add_patch(patch)

    def badge(self, key: str, text: str, color: str) -> None:
        """Put the number of a step on the corner of a room."""
        x, y, width = self.place[key]
        self.disc(x - width / 2 + 0.05, y + HEIGHT / 2 - 0.05, text, color, 19)

    def disc(self, x: float, y: float, text: str, color: str, size: float = 15) -> None:
        """Draw the number of a step."""
        self.axes.plot(x, y, "o", markersize=size, color=color, markeredgecolor="white", zorder=8)
        self.text(x, y - 0.005, text, 0.55 * size, "white", weight="bold", zorder=9)

    def ways(self) -> None:
        """Put the steps of both ways of data on their rooms, and draw the first as a broad line."""
        for (_, before), (_, after) in zip(SIMULATION.items(), list(SIMULATION.items())[1:], strict=False):
            for target in after:
                near = [key for key in before if key.split(".")[0] == target.split(".")[0]] or before[:1]
                self.stretch(near[0], target)
        for number, keys in enumerate(SIMULATION.values(), 1):
            for key in keys:
                self.badge(key, str(number), BLUE)
        x, y, width = self.place["core.gap"]
        for i, room in enumerate(IDENTIFICATION.values()):
            at = x - width / 2 + width * (i + 0.5) / len(IDENTIFICATION)
            self.text(at, y - 0.3, room, 9.3, INK, ha="left")
            self.disc(at - 0.17, y - 0.3, "ABCDE"[i], ORANGE)

    def stretch(self, start: str, end: str) -> None:
        """Draw a stretch of the first way, from the middle of one room to the middle of the next."""
        from matplotlib.patches import PathPatch
        from matplotlib.path import Path as Curve

        (xa, ya, _), (xb, yb, _) = self.place[start], self.place[end]
        if start.split(".")[0] == end.split(".")[0]:
            bends = [(xa, (ya + yb) / 2), (xb, (ya + yb) / 2)]
        else:
            bends = [((xa + xb) / 2, ya), ((xa + xb) / 2, yb)]
        curve = Curve([(xa, ya), *bends, (xb, yb)], [Curve.MOVETO, *[Curve.CURVE4] * 3])
        self.axes.add_patch(PathPatch(curve, facecolor="none", edgecolor=BLUE, alpha=0.22, linewidth=9, zorder=2))

    def legend(self, width: float) -> None:
        """Say below the picture what the steps are."""
        lines = [
            (BLUE, "simulation", "   ".join(f"{i} {step}" for i, step in enumerate(SIMULATION, 1))),
            (ORANGE, "measurements", "   ".join(f"{'ABCDE'[i]} {step}" for i, step in enumerate(IDENTIFICATION))),
        ]
        for i, (color, name, steps) in enumerate(lines):
            y = 1.15 - 0.36 * i
            self.text(0.5, y, name, 12, color, weight="bold", ha="left")
            self.text(2.3, y, steps.replace("   ", "  →  "), 12, INK, ha="left")
        text = "Grey arrows: imports that no longer path implies. A red arrow would be an import against the order."
        self.text(0.5, 0.4, text, 9, PALE, ha="left")


def _wrapped(start: str, words: list[str], most: int = 34) -> list[str]:
    """Join words into lines of at most `most` letters."""
    lines, line = [], start
    for word in words:
        longer = f"{line}{'' if line in ('', start) else ' · '}{word}"
        if len(longer) > most:
            lines.append(line)
            longer = word
        line = longer
    return [*lines, line]
