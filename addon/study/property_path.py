# SPDX-License-Identifier: GPL-3.0-or-later
"""The path of a property that a button shows. Menus ask for it at each click, so nothing heavy is imported here."""

from __future__ import annotations

import re
from typing import Any

_QUOTED = re.compile(r"""\['([^'"\\]*)'\]""")


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
    start = _QUOTED.sub(lambda key: f'["{key[1]}"]', repr(block))  # as Copy Full Data Path writes it
    if not start.startswith("bpy.data."):
        return ""
    whole = f"{start}{'' if path.startswith('[') else '.'}{path}"
    return whole if index < 0 else f"{whole}[{index}]"
