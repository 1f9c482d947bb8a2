# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings saved by an older Palpate become today's: plain dictionary in, plain dictionary out.

Each step in :data:`STEPS` brings the settings of one kind from its version to the next. A saved version of 0 means that
nothing was ever set. Settings of a newer Palpate are not touched.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ..errors import FileError

VERSION = 1
"""Version of the settings that this Palpate reads and writes."""

Settings = dict[str, Any]
Step = Callable[[Settings], Settings]

STEPS: dict[tuple[str, int], Step] = {}
"""(kind, version) → what brings settings of that version to the next; kinds are "object" and "scene"."""


def migrate(
    settings: Mapping[str, Any],
    kind: str,
    name: str,
    steps: Mapping[tuple[str, int], Step] | None = None,
    version: int = VERSION,
) -> Settings:
    """Return settings as this version has them, with ``schema_version`` set.

    Parameters
    ----------
    settings : mapping
        With ``schema_version``; not changed.
    kind : str
        "object" or "scene".
    name : str
        Whose settings, for the message.
    steps, version
        Others than this version's, for tests.

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
