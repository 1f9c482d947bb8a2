# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays of NPZ, MAT and HDF5 files as tables: arrays of one group with the same number of samples are one table.

Sizes are known before anything is read, and nothing in such a file is executed: pickled objects, arrays in other files and
links to them are left out.
"""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ....errors import FileError, imported
from ....io.input_files import open_regular
from ..log_table import FEWEST_ROWS, LogFile, LogTable, cleaned, require_size
from .damaged_file import damage_said

_NUMBERS = "iufb"
_LARGEST_UNLISTED = 200 * 2**20
"""Bytes of a MAT file whose arrays cannot be listed before they are read."""


def read_npz(path: Path) -> LogFile:
    """Read an NPZ file."""
    arrays, notes, total = {}, [], 0
    with open_regular(path) as file, damage_said(path, "NPZ"), zipfile.ZipFile(file) as archive:
        for info in archive.infolist():
            name = info.filename.removesuffix(".npy")
            with archive.open(info) as member:
                version = np.lib.format.read_magic(member)
                read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
                shape, is_fortran, kind = read(member)
                if kind.hasobject or kind.kind not in _NUMBERS:
                    notes.append(f"'{path.name}': '{name}' holds no plain numbers and was left out.")
                    continue
                total += (count := math.prod(shape))
                require_size(total, 0, path)
                values = np.frombuffer(member.read(), kind, count)
                arrays[name] = values.reshape(shape, order="F" if is_fortran else "C")
    return _log(path, arrays, {}, notes)


def read_mat(path: Path) -> LogFile:
    """Read a MAT file: of version 7.3 by h5py, older ones by SciPy."""
    with open_regular(path) as file:
        is_hdf5 = file.read(520)[512:520] == b"\x89HDF\r\n\x1a\n"
    if is_hdf5:
        return read_hdf5(path, "MAT")
    import warnings

    import scipy.io

    arrays: dict[str, np.ndarray] = {}
    notes: list[str] = []
    with open_regular(path) as file, warnings.catch_warnings(), damage_said(path, "MAT"):
        warnings.simplefilter("ignore")  # about names that are there twice
        try:
            require_size(sum(math.prod(shape) for _, shape, _ in scipy.io.whosmat(file)), 0, path)
        except TypeError:  # SciPy lists no files with objects of MATLAB's, as timetables
            if path.stat().st_size > _LARGEST_UNLISTED:
                raise FileError(
                    f"'{path.name}' has objects of MATLAB's and more than {_LARGEST_UNLISTED >> 20} MB: save the arrays alone."
                ) from None
        file.seek(0)
        found = scipy.io.loadmat(file, simplify_cells=True)
    for name, value in found.items():
        if not name.startswith("__"):
            arrays |= _members(name, value)
            if type(value).__name__ == "MatlabOpaque" or (isinstance(value, np.ndarray) and value.dtype.names):
                notes.append(f"'{path.name}': '{name}' is an object of MATLAB's (a timetable or a class) and was left out.")
    return _log(path, arrays, {}, notes)


def _members(name: str, value: Any) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the arrays of a variable; the fields of a structure are named after it."""
    if isinstance(value, dict):
        for field, part in value.items():
            yield from _members(f"{name}/{field}", part)
    elif isinstance(value, np.ndarray) and value.dtype.kind in _NUMBERS:
        yield name, value


def read_hdf5(path: Path, kind: str = "HDF5") -> LogFile:
    """Read an HDF5 file, or a MAT file of version 7.3, which is one."""
    h5py = imported("h5py", f"'{path.name}'")
    arrays: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    notes, total = [], 0
    with open_regular(path) as plain, damage_said(path, kind), h5py.File(plain, "r") as file:
        found: list[tuple[str, Any]] = []
        file.visititems(lambda name, item: found.append((name, item)) if isinstance(item, h5py.Dataset) else None)
        for name, item in found:
            if name.startswith("#refs#") or item.dtype.kind not in _NUMBERS or not item.shape:
                continue
            if item.external or item.is_virtual:
                notes.append(f"'{path.name}': '{name}' lies in another file and was left out.")
                continue
            total += math.prod(item.shape)
            require_size(total, 0, path)
            arrays[name] = item[()]
            unit = item.attrs.get("unit", item.attrs.get("units", ""))
            units[name] = unit.decode("utf-8", "replace") if isinstance(unit, bytes) else unit
    return _log(path, arrays, {name: unit for name, unit in units.items() if isinstance(unit, str) and unit}, notes)


def _log(path: Path, arrays: dict[str, np.ndarray], units: dict[str, str], notes: list[str]) -> LogFile:
    """Return the tables of some arrays, whose names have that of a group before a slash; what is too short is left out.

    The samples of an array lie along the axis whose length most arrays have.
    """
    squeezed = {name: np.squeeze(values) for name, values in arrays.items()}
    kept = {name: values for name, values in squeezed.items() if 0 < values.ndim <= 3 and max(values.shape) >= FEWEST_ROWS}
    if not kept:
        objects = any("object of MATLAB's" in note for note in notes)
        what = ", only objects of MATLAB's: save their arrays" if objects else ": give a file with recordings in arrays"
        raise FileError(f"'{path.name}' holds no array of at least {FEWEST_ROWS} numbers{what}.")
    lengths = [max(values.shape) for values in kept.values()]
    tables: dict[tuple[str, int], LogTable] = {}
    for name, values in kept.items():
        group, _, short = name.rpartition("/")
        axis = max(range(values.ndim), key=lambda i: (lengths.count(values.shape[i]), values.shape[i], -i))
        placed = np.moveaxis(values, axis, 0)
        table = tables.setdefault((group, len(placed)), LogTable(group, {}))
        flat = placed.reshape(len(placed), -1)
        names = [short] if placed.ndim == 1 else [f"{short}_{i}" for i in range(flat.shape[1])]
        if placed.ndim == 3:
            table.grids[short] = (placed.shape[1], placed.shape[2])
        for column, numbers in zip(names, flat.T, strict=True):
            table.columns[column] = cleaned(numbers)
            if name in units:
                table.units[column] = units[name]
        require_size(0, len(table.columns), path)
    for (group, count), table in tables.items():  # of one group the longest table has its name
        if count < max(other for name, other in tables if name == group):
            tables[group, count] = replace(table, name=f"{group}[{count}]")
    return LogFile(path, tuple(tables.values()), tuple(notes))
