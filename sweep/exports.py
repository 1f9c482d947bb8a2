# SPDX-License-Identifier: GPL-3.0-or-later
"""A finished dataset in other formats: HDF5 and Zarr.

Both hold the same arrays: one for each feature, with all frames along its first axis, and under ``episodes`` a value for each
run. Units and meanings are attributes. They are made from ``dataset/`` alone, group of rows by group of rows, so that memory
does not grow with the dataset.
"""

from __future__ import annotations

import importlib
import json
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..core.errors import FileError, os_error_reason
from ..core.io.file_writing import atomic_write
from ..core.io.hidden_folder import temporary_folder
from .dataset import DATASET_FOLDER, exchange_folder
from .parts import require_pyarrow

EPISODE_COLUMNS = ("run", "length", "dataset_from_index", "dataset_to_index", "digest")
ZARR_FILES = re.compile(r"(.+/)?(\.z(group|attrs|array|metadata)|[0-9.]+)")
"""Names of the files of a Zarr store of format 2."""
CHUNK_BYTES = 1 << 20
"""Numbers of an array that are compressed together."""


def export_hdf5(folder: Path) -> list[Path]:
    """Write ``dataset.h5`` beside the dataset of a study; each part becomes one. Return what was written.

    Raises
    ------
    FileError
        There is no dataset, a package is missing, or the file cannot be written.
    """
    require_packages(["hdf5"])
    import h5py

    written = []
    for part, stem in _parts(folder):
        target = folder / f"{stem}.h5"
        # atomic_write holds the lock on the file already
        with atomic_write(target) as temporary, h5py.File(temporary, "w", libver="latest", locking=False) as file:

            def create(name: str, shape: tuple[int, ...], kind: Any, chunks: tuple[int, ...], file: Any = file) -> Any:
                kind = h5py.string_dtype() if kind == "string" else kind
                packed = {"compression": "gzip", "compression_opts": 4, "shuffle": True, "chunks": chunks} if shape[0] else {}
                return file.create_dataset(name, shape, kind, track_times=False, **packed)

            _fill(part, create, file.attrs)
        written.append(target)
    return written


def export_zarr(folder: Path) -> list[Path]:
    """Write ``dataset.zarr`` beside the dataset of a study; each part becomes one. Return what was written.

    The folder is written under a hidden name and renamed into its place.

    Raises
    ------
    FileError
        As :func:`export_hdf5`.
    """
    require_packages(["zarr"])
    import zarr

    written = []
    for part, stem in _parts(folder):
        target = folder / f"{stem}.zarr"
        try:
            with temporary_folder(folder, "zarr") as hidden:
                group = zarr.open_group(hidden / "new", mode="w", zarr_format=2)  # what the most readers know

                def create(name: str, shape: tuple[int, ...], kind: Any, chunks: tuple[int, ...], group: Any = group) -> Any:
                    kind = "U64" if kind == "string" else kind
                    return group.create_array(name, shape=shape, dtype=kind, chunks=chunks)

                _fill(part, create, group.attrs)
                exchange_folder(hidden / "new", target, hidden / "before", ZARR_FILES)
        except OSError as error:
            raise FileError(f"'{target}' could not be written ({os_error_reason(error)}): free some space.") from error
        written.append(target)
    return written


EXPORTS: dict[str, Callable[[Path], list[Path]]] = {"hdf5": export_hdf5, "zarr": export_zarr}
"""Exports of a finished dataset, by the name that the command takes."""
PACKAGES = {"hdf5": "h5py", "zarr": "zarr"}
"""What each of them needs."""


def require_packages(formats: Sequence[str]) -> None:
    """Raise FileError where a package for one of the formats is not installed."""
    for name in formats:
        package = PACKAGES[name]
        try:
            importlib.import_module(package)
        except ImportError as error:
            raise FileError(f"--format {name} needs the package {package}: install it with 'pip install {package}'.") from error


def _parts(folder: Path) -> list[tuple[Path, str]]:
    """Return the datasets of a study and the names of their exports without the ending."""
    require_pyarrow()
    dataset = folder / DATASET_FOLDER
    if (dataset / "meta" / "info.json").is_file():
        return [(dataset, "dataset")]
    parts = sorted(path for path in dataset.glob("part-*") if (path / "meta" / "info.json").is_file())
    if not parts:
        raise FileError(f"'{folder}' has no dataset: let `palpate sweep` finish first.")
    return [(part, f"dataset-{part.name}") for part in parts]


def _fill(part: Path, create: Callable[..., Any], attributes: Any) -> None:
    """Create all arrays with `create(name, shape, kind, chunks)` and fill them."""
    info = json.loads((part / "meta" / "info.json").read_text(encoding="utf-8"))
    attributes["fps"] = info["fps"]
    features, total = info["features"], info["total_frames"]
    arrays = {}
    for name, feature in features.items():
        shape = () if feature["shape"] == [1] else tuple(feature["shape"])
        size = max(1, int(np.prod(shape))) * (8 if feature["dtype"] == "string" else np.dtype(feature["dtype"]).itemsize)
        rows = int(np.clip(CHUNK_BYTES // size, 1, max(total, 1)))
        arrays[name] = create(name, (total, *shape), feature["dtype"], (rows, *shape))
        arrays[name].attrs.update(_attributes(feature))
    at = 0
    for table in _row_groups(part / "data"):
        for name, feature in features.items():
            arrays[name][at : at + len(table)] = _dense(table.column(name), feature)
        at += len(table)
    episodes = [table.select(EPISODE_COLUMNS) for table in _row_groups(part / "meta" / "episodes")]
    for name in EPISODE_COLUMNS:
        values = [value for table in episodes for value in table.column(name).to_pylist()]
        array = create(f"episodes/{name}", (len(values),), "string" if name == "digest" else "int64", (max(1, len(values)),))
        array[:] = np.array(values, dtype=object if name == "digest" else np.int64)


def _attributes(feature: dict[str, Any]) -> dict[str, Any]:
    own = feature.get("palpate", {})
    found = {"unit": own.get("unit", ""), "about": own.get("about", "")}
    for key, names in (("names", feature.get("names")), ("channels", own.get("channels"))):
        if names:
            found[key] = list(names)
    return found


def _row_groups(folder: Path) -> Iterator[Any]:
    from pyarrow import parquet

    for path in sorted(folder.glob("*/*.parquet")):
        with parquet.ParquetFile(path) as file:
            for number in range(file.num_row_groups):
                yield file.read_row_group(number)


def _dense(column: Any, feature: dict[str, Any]) -> np.ndarray:
    """Return a column of lists of lists as one array, without a Python object for each of them."""
    array = column.combine_chunks()
    if feature["shape"] == [1]:
        return array.to_numpy(zero_copy_only=False)
    for _ in feature["shape"]:
        array = array.flatten()
    return array.to_numpy(zero_copy_only=False).reshape(len(column), *feature["shape"])
