# SPDX-License-Identifier: GPL-3.0-or-later
"""Update settings that an older Palpate has saved: plain dictionary in, plain dictionary out.

Each step in :data:`STEPS` updates the settings of one kind from its version to the next. A saved version of 0 means that
nothing was ever set.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ...core.errors import FileError

VERSION = 1
"""Version of the settings that this Palpate reads and writes."""

Settings = dict[str, Any]
Step = Callable[[Settings], Settings]

STEPS: dict[tuple[str, int], Step] = {}
"""(kind, version) → function that updates settings of that version to the next; kinds are "object" and "scene"."""


def migrate(
    settings: Mapping[str, Any],
    kind: str,
    name: str,
    steps: Mapping[tuple[str, int], Step] | None = None,
    version: int = VERSION,
) -> Settings:
    """Return the settings as they are in this version, with ``schema_version`` set.

    Parameters
    ----------
    settings : mapping
        Settings with ``schema_version``; they are not changed.
    kind : str
        "object" or "scene".
    name : str
        Name of the object or scene, for the message.
    steps, version
        Steps and version for tests; by default those of this version.

    Raises
    ------
    FileError
        The settings were saved by a newer Palpate.
    """
    steps = STEPS if steps is None else steps
    result = dict(settings)
    saved = int(result.get("schema_version", 0))
    if saved > version:
        raise FileError(
            f"The settings of '{name}' were saved by a newer Palpate (version {saved}, this one reads {version}): "
            "install the newer Palpate to use them."
        )
    if saved > 0:
        for old in range(saved, version):
            step = steps.get((kind, old))
            if step is not None:
                result = step(result)
    result["schema_version"] = version
    return result
