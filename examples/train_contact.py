# SPDX-License-Identifier: GPL-3.0-or-later
"""Learn where something touches a sensor, and how strongly, from its tactile image.

::

    pip install scikit-learn matplotlib pyarrow
    python examples/train_contact.py STUDY

STUDY is the folder that `palpate sweep` wrote, for instance for a study of presses. A small neural network learns the contact's
position and force from single frames of some runs. It is then tried on runs that it has never seen, and the errors, in
millimetres and newtons, are printed beside those of always answering the mean. ``train_contact.png`` shows them.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as parquet

LEAST_FORCE = 0.1
"""Newtons: frames with less say nothing about a place."""


def read_frames(dataset: Path, sensor: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return images (F, …), answers (F, 4) – position in mm and force in N – and the run of each frame."""
    columns = {
        "image": f"observation.tactile.{sensor}",
        "place": f"contact.centre_of_pressure.{sensor}",
        "force": f"observation.net_force.{sensor}",
    }
    features = json.loads((dataset / "meta" / "info.json").read_text(encoding="utf-8"))["features"]
    table = parquet.read_table(dataset / "data", columns=["episode_index", *columns.values()])
    found = {}
    for what, name in columns.items():
        flat = table.column(name).combine_chunks()
        for _ in features[name]["shape"]:
            flat = flat.flatten()
        found[what] = flat.to_numpy().reshape(len(table), -1)
    force = np.linalg.norm(found["force"], axis=1)
    touching = force > LEAST_FORCE
    answers = np.column_stack([1e3 * found["place"], force])
    return found["image"][touching], answers[touching], table.column("episode_index").to_numpy()[touching]


def noisy(images: np.ndarray, noise: float, seed: int) -> np.ndarray:
    """Return images with the noise of a sensor: normal, of the deviation `noise` in newtons."""
    return images + np.random.default_rng(seed).normal(0.0, noise, images.shape)


def trained(images: np.ndarray, answers: np.ndarray, seed: int) -> object:
    """Return a network with two layers that has learnt the answers."""
    from sklearn.compose import TransformedTargetRegressor
    from sklearn.neural_network import MLPRegressor
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    network = MLPRegressor(hidden_layer_sizes=(128, 64), early_stopping=True, max_iter=300, random_state=seed)
    return TransformedTargetRegressor(make_pipeline(StandardScaler(), network), transformer=StandardScaler()).fit(
        images, answers
    )


def plot(path: Path, answers: np.ndarray, guesses: np.ndarray) -> None:
    """Draw true against learnt positions and forces of the unseen runs."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 3.8), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(f"{len(answers):,} frames of runs that were not learnt from", fontsize=10)
    widest = np.argsort(-np.ptp(answers[:, :3], axis=0))[:2]
    shown = [(axis, "xyz"[axis], "mm") for axis in sorted(widest)] + [(3, "force", "N")]
    for axes, (column, name, unit) in zip(figure.subplots(1, 3), shown, strict=True):
        true, learnt = answers[:, column], guesses[:, column]
        ends = [min(true.min(), learnt.min()), max(true.max(), learnt.max())]
        axes.plot(ends, ends, color="0.4", lw=1)
        axes.plot(true, learnt, ".", ms=3, alpha=0.25, mew=0)
        axes.set(xlabel=f"true {name} ({unit})", ylabel=f"learnt {name} ({unit})", aspect="equal")
        axes.set_title(f"median error {np.median(np.abs(learnt - true)):.2g} {unit}", fontsize=9)
        axes.locator_params(nbins=6)
    figure.savefig(path, dpi=150)


def main() -> None:
    """Read, train, try, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", type=Path, help="folder that palpate sweep wrote")
    parser.add_argument("--sensor", help="default: the first one")
    parser.add_argument("--unseen", type=float, default=0.25, help="share of the runs that are kept for the trial")
    parser.add_argument("--noise", type=float, default=0.005, help="noise of a texel, newtons")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    dataset = options.study / "dataset"
    features = json.loads((dataset / "meta" / "info.json").read_text(encoding="utf-8"))["features"]
    sensors = [name.removeprefix("observation.tactile.") for name in features if name.startswith("observation.tactile.")]
    images, answers, runs = read_frames(dataset, options.sensor or sensors[0])
    images = noisy(images, options.noise, options.seed)

    names = np.random.default_rng(options.seed).permutation(np.unique(runs))
    unseen = np.isin(runs, names[: max(1, round(options.unseen * len(names)))])
    guesses = trained(images[~unseen], answers[~unseen], options.seed).predict(images[unseen])
    constant = np.broadcast_to(answers[~unseen].mean(axis=0), guesses.shape)

    print(f"{len(names)} runs with contact, {(~unseen).sum()} frames learnt, {unseen.sum()} frames of unseen runs tried")
    for title, errors in (("learnt", guesses - answers[unseen]), ("mean of all", constant - answers[unseen])):
        place, force = np.linalg.norm(errors[:, :3], axis=1), np.abs(errors[:, 3])
        middle, most = np.percentile(place, [50, 90]), np.percentile(force, [50, 90])
        print(
            f"{title:12s} position {middle[0]:6.2f} mm (90 % below {middle[1]:5.2f} mm), "
            f"force {most[0]:6.3f} N (90 % below {most[1]:.3f} N)"
        )
    plot(options.study / "train_contact.png", answers[unseen], guesses)
    print(f"plot: {options.study / 'train_contact.png'}")


if __name__ == "__main__":
    main()
