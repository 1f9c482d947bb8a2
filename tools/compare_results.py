# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare what two versions of Palpate compute: bakes of all sample scenes and the gap report of the sample rig.

    python tools/compare_results.py BEFORE [AFTER] [--keep DIR]

BEFORE and AFTER are git revisions, or folders with a checkout. AFTER is this checkout unless it is given. Both versions run
the same scenes and the same rig in the same Python through their command lines, so the interfaces inside may differ. Every file
that they write is compared byte by byte; of arrays and of numbers in JSON that differ the largest difference is printed. Images
whose bytes differ are equal when their channels, pixels and attributes are: another library may compress them otherwise. The
exit status is 0 when all files are equal, else 1.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]


def checkout(version: str, folder: Path) -> Path:
    """Return a folder that holds `version` under the name ``palpate``, for the Python path."""
    folder.mkdir(parents=True)
    source = Path(version)
    if not source.is_dir():
        source = folder / "source"
        subprocess.run(["git", "-C", str(ROOT), "worktree", "add", "--quiet", "--detach", str(source), version], check=True)
    (folder / "palpate").symlink_to(source.resolve(), target_is_directory=True)
    return folder


def run(path: Path, scenes: Path, rig: Path, out: Path) -> None:
    """Bake every scene and report the gap of the rig with the version on the Python path `path`."""
    environment = {**os.environ, "PYTHONPATH": str(path), "NUMBA_CACHE_DIR": str(path / "numba")}
    command = [sys.executable, "-m", "palpate.commands"]
    out.mkdir(parents=True)
    for scene in sorted(scenes.glob("*.blend")):
        print(f"  bake {scene.name}", file=sys.stderr, flush=True)
        subprocess.run([*command, "bake", scene, "--out", out / scene.stem], env=environment, check=True, capture_output=True)
    print(f"  gap {rig.parent.name}", file=sys.stderr, flush=True)
    subprocess.run([*command, "gap", rig, "--out", out / "gap"], env=environment, check=True, capture_output=True)


def numbers_in(value: object, name: str = "") -> dict[str, float]:
    """Return all numbers of a JSON document by their paths."""
    if isinstance(value, dict):
        return {key: number for k, item in value.items() for key, number in numbers_in(item, f"{name}.{k}").items()}
    if isinstance(value, list):
        return {key: number for i, item in enumerate(value) for key, number in numbers_in(item, f"{name}[{i}]").items()}
    return {name: float(value)} if isinstance(value, int | float) else {}


def difference(before: Path, after: Path) -> str:
    """Say in words by how much two files differ whose bytes differ."""
    if before.suffix == ".npz":
        with np.load(before, allow_pickle=False) as a, np.load(after, allow_pickle=False) as b:
            if set(a) != set(b):
                return f"other arrays: {sorted(set(a) ^ set(b))}"
            changed = {name: _largest(a[name], b[name]) for name in a if a[name].tobytes() != b[name].tobytes()}
        return "; ".join(f"{name}: {text}" for name, text in changed.items()) or "equal arrays in another file"
    if before.suffix == ".json":
        a, b = (numbers_in(json.loads(path.read_text(encoding="utf-8"))) for path in (before, after))
        if set(a) != set(b):
            return f"other keys: {sorted(set(a) ^ set(b))[:5]}"
        name = max(a, key=lambda key: abs(a[key] - b[key]))
        return f"largest difference {abs(a[name] - b[name]):.3g} in {name}" if a != b else "equal numbers, other words"
    return f"{before.stat().st_size} bytes before, {after.stat().st_size} after"


def _largest(a: np.ndarray, b: np.ndarray) -> str:
    if a.shape != b.shape or a.dtype != b.dtype:
        return f"{a.dtype}{a.shape} before, {b.dtype}{b.shape} after"
    if a.dtype.kind not in "fiub":
        return "other words"
    gap = np.abs(a.astype(float) - b.astype(float)).max()
    return f"largest difference {gap:.3g} where the largest value is {np.abs(a.astype(float)).max():.3g}"


def same_image(before: Path, after: Path) -> bool:
    """True if two OpenEXR images have equal channels, pixels and attributes; their order and the compression may differ."""
    import OpenEXR

    with OpenEXR.File(str(before), separate_channels=True) as a, OpenEXR.File(str(after), separate_channels=True) as b:
        names = a.channels().keys()
        attributes = [{name: repr(value) for name, value in file.header().items()} for file in (a, b)]
        return (
            names == b.channels().keys()
            and attributes[0] == attributes[1]
            and all(a.channels()[name].pixels.tobytes() == b.channels()[name].pixels.tobytes() for name in names)
        )


def compare(before: Path, after: Path) -> int:
    """Print what differs between two folders and return how many files do."""
    names = sorted({path.relative_to(folder) for folder in (before, after) for path in folder.rglob("*") if path.is_file()})
    faults, images, sizes = 0, 0, np.zeros(2, int)
    for name in names:
        a, b = before / name, after / name
        if not (a.is_file() and b.is_file()):
            print(f"{name}: only {'before' if a.is_file() else 'after'}")
        elif a.read_bytes() == b.read_bytes():
            continue
        elif name.suffix == ".exr" and same_image(a, b):
            images += 1
            sizes += a.stat().st_size, b.stat().st_size
            continue
        else:
            print(f"{name}: {difference(a, b)}")
        faults += 1
    if images:
        print(f"{images} images are equal but compressed otherwise: {sizes[0]} bytes before, {sizes[1]} after")
    print(f"{len(names)} files, {len(names) - images - faults} equal byte by byte, {faults} different")
    return faults


def main() -> int:
    """Run both versions and compare."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n", 1)[0])
    parser.add_argument("before", help="git revision or folder")
    parser.add_argument("after", nargs="?", default=str(ROOT), help="git revision or folder (default: this checkout)")
    parser.add_argument("--keep", type=Path, help="keep the results in this folder; results that are there already are used")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        work = Path(temporary)
        results = options.keep or work / "results"
        try:
            for name in ("before", "after"):
                if not (results / name).is_dir():
                    print(f"{name}: {getattr(options, name)}", file=sys.stderr, flush=True)
                    path = checkout(getattr(options, name), work / name)
                    scenes, rig = ROOT / "sample_blends", ROOT / "docs" / "sample-rig" / "rig.toml"
                    run(path, scenes, rig, results / name)
            return 1 if compare(results / "before", results / "after") else 0
        finally:
            for source in work.glob("*/source"):
                subprocess.run(["git", "-C", str(ROOT), "worktree", "remove", "--force", str(source)], check=False)


if __name__ == "__main__":
    sys.exit(main())
