# SPDX-License-Identifier: GPL-3.0-or-later
"""All formats that a bake can be exported to: every module of :mod:`.formats` defines an ``EXPORTER``."""

from __future__ import annotations

import importlib
import itertools
import os
import pkgutil
from functools import cache
from pathlib import Path

from ..errors import PalpateError
from ..figures.figure_style import FigureStyle
from ..io.bake_reader import Bake
from ..io.file_list import FileList
from ..io.file_writing import require_space, writable_folder
from ..jobs.progress import Job
from .exporter import Exporter

FORMATS = f"{__package__}.formats"
"""The package of the formats."""


@cache
def exporters() -> dict[str, Exporter]:
    """Return every exporter by its name, in the order of their positions; raise ValueError if two have the same position."""
    package = importlib.import_module(FORMATS)
    found = [importlib.import_module(f"{FORMATS}.{module.name}").EXPORTER for module in pkgutil.iter_modules(package.__path__)]
    found.sort(key=lambda exporter: exporter.position)
    for one, other in itertools.pairwise(found):
        if one.position == other.position:
            raise ValueError(f"The formats '{one.name}' and '{other.name}' have the same position {one.position}.")
    return {exporter.name: exporter for exporter in found}


def export(bake: Bake, kind: str | Exporter, folder: str | os.PathLike, style: FigureStyle | None = None) -> Job[list[Path]]:
    """Write a bake in another format.

    Parameters
    ----------
    bake : Bake
    kind : str or Exporter
        Name of an exporter, as "csv", or one that is not in the registry.
    folder : path
        Created if it is missing, with the folders above it.
    style : FigureStyle, optional
        Colours and their scale, for formats with pictures.

    Yields
    ------
    Progress
        Before each sensor is written; the stage is the sensor's name.

    Returns
    -------
    list of Path
        What was written: files, and folders that hold the others. They take the place of the files that an earlier export of
        this format left, which stay as they are until all new files are complete (:mod:`..io.file_list`).

    Raises
    ------
    PalpateError
        The format is unknown or needs a package that is not installed, the disk has too little space, or a file cannot be
        written.
    """
    exporter = kind if isinstance(kind, Exporter) else exporters().get(kind)
    if exporter is None:
        raise PalpateError(f"There is no export to '{kind}': choose from {', '.join(exporters())}.")
    require_space(folder, exporter.size(bake), "The export")
    folder = writable_folder(folder, create=True)
    files = FileList(folder)
    with files.new_files("export") as new:
        written = yield from exporter.write(bake, new, style or FigureStyle())
        written = files.replace(new, {exporter.name: written})
    return list(dict.fromkeys(path if path.parent == folder else path.parent for path in written))
