# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw a batch of tactile images from a dataset, to look at what a network would be given.

::

    pip install matplotlib pyarrow
    python examples/plot_batch.py STUDY

STUDY is the folder that `palpate sweep` wrote. Twelve frames with contact are drawn from all runs at random: the normal force
of each texel as its colour, shear as arrows, and the centre of pressure, which is truth, as a ring. They are written to
``batch.png``.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as parquet

FRAMES, ACROSS = 12, 4
LEAST_FORCE = 0.1
"""Newtons: frames with less are left out."""


def column(table, name: str, width: int) -> np.ndarray:
    """Return a column of lists as (frames, numbers)."""
    flat = table.column(name).combine_chunks()
    while hasattr(flat, "flatten") and flat.type.num_fields:
        flat = flat.flatten()
    return flat.to_numpy(zero_copy_only=False).reshape(len(table), width)


def texels_of(dataset: Path, sensor: str, shape: list[int]) -> dict[str, np.ndarray]:
    """Return positions, m, and both tangents of the texels, in the order of the flattened image."""
    table = parquet.read_table(dataset / "meta" / "texels.parquet", filters=[("sensor", "=", sensor)]).to_pydict()
    vectors = {name: np.column_stack([table[f"{name}_{axis}"] for axis in "xyz"]) for name in ("position", "normal", "tangent")}
    order = np.arange(len(vectors["position"]))
    if len(shape) == 3:  # a picture: rows × columns × channels
        order = np.argsort(np.array(table["row"]) * shape[1] + np.array(table["column"]))
    vectors["second"] = np.cross(vectors["normal"], vectors["tangent"])
    return {name: values[order] for name, values in vectors.items()}


def draw(path: Path, images: np.ndarray, centres: np.ndarray, forces: np.ndarray, titles: list[str], texels: dict) -> None:
    """Draw (frames, texels, 3) images over the texels' places along the two widest axes."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    place = 1e3 * texels["position"]
    axes_shown = sorted(np.argsort(-np.ptp(place, axis=0))[:2])
    shear = images[..., 1, None] * texels["tangent"] + images[..., 2, None] * texels["second"]
    tall, wide = np.ptp(place[:, axes_shown[1]]), np.ptp(place[:, axes_shown[0]])
    figure = Figure(
        figsize=(1.9 * ACROSS + 1.4, (1.65 * tall / wide + 0.35) * -(-len(images) // ACROSS) + 0.4), layout="constrained"
    )
    FigureCanvasAgg(figure)
    grid = figure.subplots(-(-len(images) // ACROSS), ACROSS, sharex=True, sharey=True, squeeze=False)
    top, longest = images[..., 0].max(), np.linalg.norm(shear, axis=-1).max()
    for axes in grid.flat[len(images) :]:
        axes.set_axis_off()
    for axes, image, arrows, centre, force, title in zip(grid.flat, images, shear, centres, forces, titles, strict=False):
        x, y = (place[:, axis] for axis in axes_shown)
        drawn = axes.scatter(x, y, c=image[:, 0], s=22, cmap="viridis", vmin=0.0, vmax=top, linewidths=0)
        felt = np.linalg.norm(arrows, axis=1) > 0.02 * longest
        along = arrows[felt][:, axes_shown]
        scale = longest / (0.2 * wide)  # the longest arrow has a fifth of the width
        axes.quiver(x[felt], y[felt], *along.T, color="k", angles="xy", scale_units="xy", scale=scale, width=0.009)
        axes.plot(*(1e3 * centre[axes_shown]), "o", ms=9, mfc="none", mec="tab:red", mew=1.5)
        axes.set_title(f"{title}: {np.linalg.norm(force):.2f} N", fontsize=9)
        axes.set_aspect("equal")
        axes.margins(0.15)  # room for arrows
    names = "xyz"
    figure.supxlabel(f"{names[axes_shown[0]]} (mm)", fontsize=10)
    figure.supylabel(f"{names[axes_shown[1]]} (mm)", fontsize=10)
    figure.colorbar(drawn, ax=grid, label="normal force of a texel (N)", shrink=0.6)
    figure.savefig(path, dpi=130)


def main() -> None:
    """Choose frames and draw them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", type=Path, help="folder that palpate sweep wrote")
    parser.add_argument("--sensor", help="default: the first one")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    dataset = options.study / "dataset"
    features = json.loads((dataset / "meta" / "info.json").read_text(encoding="utf-8"))["features"]
    start = "observation.tactile."
    sensor = options.sensor or next(name.removeprefix(start) for name in features if name.startswith(start))
    shape = features[start + sensor]["shape"]
    names = [start + sensor, f"contact.centre_of_pressure.{sensor}", f"observation.net_force.{sensor}"]
    table = parquet.read_table(dataset / "data", columns=["episode_index", "frame_index", *names])
    images = column(table, names[0], int(np.prod(shape))).reshape(len(table), -1, 3)
    centres, forces = (column(table, name, 3) for name in names[1:])
    touching = np.nonzero(np.linalg.norm(forces, axis=1) > LEAST_FORCE)[0]
    if len(touching) == 0:
        parser.exit(1, f"No frame of '{options.study}' has a contact of more than {LEAST_FORCE} N.\n")
    chosen = np.sort(np.random.default_rng(options.seed).permutation(touching)[:FRAMES])
    runs, frames = (table.column(name).to_numpy() for name in ("episode_index", "frame_index"))
    titles = [f"run {runs[i]}, frame {frames[i]}" for i in chosen]
    texels = texels_of(dataset, sensor, shape)
    draw(options.study / "batch.png", images[chosen], centres[chosen], forces[chosen], titles, texels)
    print(f"{len(chosen)} of {len(touching)} frames with contact: {options.study / 'batch.png'}")


if __name__ == "__main__":
    main()
