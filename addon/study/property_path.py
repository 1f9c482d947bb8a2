# SPDX-License-Identifier: GPL-3.0-or-later
"""The path of a property that a button shows. Menus ask for it at each click, so nothing heavy is imported here."""

from __future__ import annotations

import re
from typing import Any

_QUOTED = re.compile(r"""\['([^'"\\]*)'\]""")


def double_quoted(path: str) -> str:
    """Return a path with its keys in double quotation marks, as *Copy Full Data Path* writes it and Blender resolves it."""
    return _QUOTED.sub(r'["\1"]', path)


def path_of(pointer: Any, key: str, index: int = -1) -> str:
    """Return the path of a property that a button shows, as :func:`.find_property` reads it; "" if it has none.

    Parameters
    ----------
    pointer : bpy_struct
        Owner of the property.
    key : str
    index : int
        Component of a vector; -1 for all.
    """
    block = getattr(pointer, "id_data", None)
    if block is None:
        return ""
    try:
        path = pointer.path_from_id(key)
    except ValueError:  # it does not belong to a data-block, as a setting of an operator
        return ""
    start = double_quoted(repr(block))
    if not start.startswith("bpy.data."):
        return ""
    whole = f"{start}{'' if path.startswith('[') else '.'}{path}"
    return whole if index < 0 else f"{whole}[{index}]"
