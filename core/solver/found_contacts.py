# SPDX-License-Identifier: GPL-3.0-or-later
"""The contacts that the kernels found, as plain arrays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .contact_rows import DEPTH, LANES, NORMAL, POINT, ROW
from .workspace import Workspace


class Contacts(NamedTuple):
    """The n contacts of one pair.

    Attributes
    ----------
    slots : (n,) int
        Slot of each in :class:`.State`.
    normal : (n, 3) float
        The target's outward normal, in the frame of the sensor's body like the point.
    point : (n, 3) float, metres
        From the body's reference point.
    depth : (n,) float, metres
    """

    slots: np.ndarray
    normal: np.ndarray
    point: np.ndarray
    depth: np.ndarray


def contacts_of(pair: int, workspace: Workspace) -> Contacts:
    """Return the contacts of one pair, as they were found last."""
    number, first = workspace.contacts.number[pair], workspace.contacts.first_block[pair]
    blocks = slice(first, first - (-number // LANES))
    rows = workspace.contacts.rows[blocks].reshape(-1, ROW // LANES, LANES).swapaxes(1, 2).reshape(-1, ROW // LANES)[:number]
    n, p = NORMAL // LANES, POINT // LANES
    slots = workspace.contacts.slots[blocks].ravel()[:number]
    return Contacts(slots, rows[:, n : n + 3], rows[:, p : p + 3], rows[:, DEPTH // LANES])
