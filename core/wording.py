# SPDX-License-Identifier: GPL-3.0-or-later
"""Words for the reader."""


def counted(number: int, noun: str) -> str:
    """Return a number with its noun in the singular or the plural, as "1 texel" or "1,024 texels"."""
    return f"{number:,} {noun}" + ("" if number == 1 else "s")
