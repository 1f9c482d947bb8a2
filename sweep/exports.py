# SPDX-License-Identifier: GPL-3.0-or-later
"""A finished dataset in other formats, HDF5 and Zarr.

Both have an array for each feature over all frames, and under ``episodes`` a value for each run; units and meanings are
attributes. They are made group of rows by group of rows, so that memory does not grow with the dataset.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from ..core.errors import FileError, imported, os_error_reason
from ..core.io.file_writing import atomic_write
from ..core.io.hidden_folder import temporary_folder
from .dataset import DATASET_FOLDER, replace_folder

EPISODE_COLUMNS = ("run", "length", "dataset_from_index", "dataset_to_index", "digest")
ZARR_FILES = re.compile(r"(.+/)?(\.z(group|attrs|array|metadata)|[0-9.]+)")
"""Names of the files of a Zarr store of format 2."""
PACKAGES = {"hdf5": "h5py", "zarr": "zarr"}
"""Package that each export needs, by the name that the command takes."""


def require_packages(formats: Sequence[str]) -> None:
    """Raise PalpateError where a package for one of the formats is not installed."""
    for name in formats:
        imported(PACKAGES[name], f"--format {name}")


def export_hdf5(folder: Path) -> list[Path]:
    """Write ``dataset.h5`` beside the dataset of a study; each part becomes one. Return what was written.

    Raises
    ------
    FileError
        There is no dataset, a package is missing, or the file cannot be written.
    """
    require_packages(["hdf5"])
    import h5py

    packed = {"track_times": False, "compression": "gzip", "shuffle": True}
    written = []
    for part, stem in _parts(folder):
        target = folder / f"{stem}.h5"
        with atomic_write(target) as temporary, h5py.File(temporary, "w", libver="latest", locking=False) as file:
            _fill(part, file.attrs, partial(file.create_dataset, **packed), h5py.string_dtype())
        written.append(target)
    return written


def export_zarr(folder: Path) -> list[Path]:
    """Write ``dataset.zarr`` beside the dataset of a study, as :func:`export_hdf5`; a folder that is renamed into its place."""
    require_packages(["zarr"])
    import zarr

    written = []
    for part, stem in _parts(folder):
        target = folder / f"{stem}.zarr"
        try:
            with temporary_folder(folder, "zarr") as hidden:
                group = zarr.open_group(hidden / "new", mode="w", zarr_format=2)  # what the most readers know
                _fill(part, group.attrs, group.create_array, "U64")
                replace_folder(hidden / "new", target, hidden, ZARR_FILES)
        except OSError as error:
            raise FileError(f"'{target}' could not be written ({os_error_reason(error)}): free some space.") from error
        written.append(target)
    return written


EXPORTS: dict[str, Callable[[Path], list[Path]]] = {"hdf5": export_hdf5, "zarr": export_zarr}


def _parts(folder: Path) -> list[tuple[Path, str]]:
    """Return the datasets of a study and the names of their exports without the ending."""
    found = sorted(path.parents[1] for path in (folder / DATASET_FOLDER).rglob("meta/info.json"))
    if not found:
        raise FileError(f"'{folder}' has no dataset: let `palpate sweep` finish first.")
    return [(part, "dataset" if part.name == DATASET_FOLDER else f"dataset-{part.name}") for part in found]


def _fill(part: Path, attributes: Any, create: Callable[..., Any], text: Any) -> None:
    """Create all arrays with `create(name, shape=shape, dtype=dtype)`, where that of a text is `text`, and fill them."""
    from pyarrow import parquet

    info = json.loads((part / "meta" / "info.json").read_text(encoding="utf-8"))
    attributes["fps"] = info["fps"]
    arrays, at = {}, 0
    for name, feature in info["features"].items():
        dtype = text if feature["dtype"] == "string" else feature["dtype"]
        arrays[name] = create(name, shape=(info["total_frames"], *_shape(feature)), dtype=dtype)
        about = feature.get("palpate", {})
        words = {"names": feature.get("names"), "channels": about.get("channels")}
        arrays[name].attrs.update({"unit": about.get("unit", ""), "about": about.get("about", "")})
        arrays[name].attrs.update({key: list(value) for key, value in words.items() if value})
    for table in _row_groups(part / "data"):
        for name, feature in info["features"].items():
            flat = table[name].combine_chunks()
            for _ in _shape(feature):  # no Python object for each list
                flat = flat.flatten()
            arrays[name][at : at + len(table)] = flat.to_numpy(zero_copy_only=False).reshape(len(table), *_shape(feature))
        at += len(table)
    for name in EPISODE_COLUMNS:
        column = parquet.read_table(part / "meta" / "episodes", columns=[name], partitioning=None)[name]
        array = create(f"episodes/{name}", shape=(len(column),), dtype=text if name == "digest" else "int64")
        array[:] = column.to_numpy()


def _shape(feature: dict[str, Any]) -> tuple[int, ...]:
    """Return the shape of a feature in one frame, () for a single number."""
    return () if feature["shape"] == [1] else tuple(feature["shape"])


def _row_groups(folder: Path) -> Iterator[Any]:
    from pyarrow import parquet

    for path in sorted(folder.glob("*/*.parquet")):
        with parquet.ParquetFile(path) as file:
            for number in range(file.num_row_groups):
                yield file.read_row_group(number)
