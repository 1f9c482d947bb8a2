# SPDX-License-Identifier: GPL-3.0-or-later
"""What the rigs of the benchmarks on mounting and on sessions have in common: a grid of texels under a ball."""

from __future__ import annotations

from collections.abc import Mapping


def rig_head(name: str, grid: tuple[int, int, float], words: Mapping[str, object], radius: float) -> list[str]:
    """Return the lines of a rig up to its recordings.

    Parameters
    ----------
    name : str
    grid : (int, int, float)
        Rows, columns, pitch in metres.
    words : mapping of str to object
        Further words of the table ``[sensor]``.
    radius : float, m
        Of the ball.
    """
    rows, columns, pitch = grid
    return [
        'format = "palpate-rig/1"',
        f'name = "{name}"',
        "[sensor]",
        f"grid = {{ rows = {rows}, columns = {columns}, pitch = [{pitch!r}, {pitch!r}] }}",
        "thickness = 6e-3",
        *(f'{key} = "{v}"' if isinstance(v, str) else f"{key} = {v!r}" for key, v in words.items()),
        "[indenter]",
        f"shape = {{ sphere = {radius!r} }}",
    ]


def csv_header(count: int) -> str:
    """Return the first line of a recording of so many texels."""
    return ",".join(["time", "x", "y", "z", *(f"texel_{i}" for i in range(count))])
