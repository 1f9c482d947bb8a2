# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of files that an export leaves in its folder, so that the next one can remove what it does not replace.

An export of a hundred frames that is followed by one of ten into the same folder would leave ninety images of the earlier bake
beside the new ones. Only files that the list names, and that still have the content it was written for, are removed.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path, PurePosixPath
from typing import Any

from ..io.file_writing import atomic_write
from ..io.regular_file import open_regular, read_bytes

LIST_NAME = ".palpate-export.json"
LIST_FORMAT = "palpate-export/1"

_BLOCK = 1 << 20


class FileList:
    """The list of the files of all exports into a folder, by format.

    Parameters
    ----------
    folder : Path
    """

    def __init__(self, folder: Path):
        self._folder = folder
        self._formats = _read(folder / LIST_NAME)

    def begin(self, kind: str) -> None:
        """Note that an export of a format has begun: until :meth:`finish` its files may be of two bakes."""
        self._write(kind, self._files(kind), complete=False)

    def finish(self, kind: str, written: Iterable[Path]) -> list[Path]:
        """Note the files of an export, and remove those of the earlier export of this format that were not written again.

        Returns
        -------
        list of Path
            What was removed.
        """
        names = {path.relative_to(self._folder).as_posix(): path for path in written}
        stale = {name: digest for name, digest in self._files(kind).items() if name not in names}
        for other, listed in self._formats.items():
            if other != kind:
                for name in listed["files"]:
                    stale.pop(name, None)
        removed = [path for name, digest in stale.items() if (path := self._own_file(name, digest)) is not None]
        for path in removed:
            path.unlink(missing_ok=True)
        for parent in {path.parent for path in removed} - {self._folder}:
            with suppress(OSError):  # it holds other files
                parent.rmdir()
        self._write(kind, {name: _digest(path) for name, path in names.items()}, complete=True)
        return removed

    def _files(self, kind: str) -> dict[str, str]:
        return self._formats.get(kind, {}).get("files", {})

    def _write(self, kind: str, files: dict[str, str], complete: bool) -> None:
        self._formats[kind] = {"complete": complete, "files": files}
        with atomic_write(self._folder / LIST_NAME) as temporary:
            content = {"format": LIST_FORMAT, "exports": self._formats}
            temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")

    def _own_file(self, name: str, digest: str) -> Path | None:
        """Return the path of a listed file; None when it is gone, was changed since, or lies outside the folder."""
        parts = PurePosixPath(name).parts
        if not parts or PurePosixPath(name).is_absolute() or any(part in ("..", LIST_NAME) or "\\" in part for part in parts):
            return None
        path = self._folder.joinpath(*parts)
        try:
            if path.is_symlink() or not path.is_file() or not path.resolve().is_relative_to(self._folder.resolve()):
                return None
            return path if _digest(path) == digest else None
        except (OSError, ValueError):
            return None


def _read(path: Path) -> dict[str, dict[str, Any]]:
    """Return the exports of a list; none when it is missing or damaged, so that nothing is removed by it."""
    try:
        content = json.loads(read_bytes(path).decode("utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    if not isinstance(content, dict) or content.get("format") != LIST_FORMAT or not isinstance(content.get("exports"), dict):
        return {}
    found = {}
    for kind, listed in content["exports"].items():
        files = listed.get("files") if isinstance(listed, dict) else None
        if isinstance(files, dict) and all(isinstance(digest, str) for digest in files.values()):
            found[kind] = {"complete": listed.get("complete") is True, "files": files}
    return found


def _digest(path: Path) -> str:
    """Return the SHA-256 of a file, as hexadecimal text."""
    digest = hashlib.sha256()
    with open_regular(path) as file:
        while block := file.read(_BLOCK):
            digest.update(block)
    return digest.hexdigest()
