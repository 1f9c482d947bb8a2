# SPDX-License-Identifier: GPL-3.0-or-later
"""The experiments of the paper, repeated: :mod:`.experiments` lists them, :mod:`.page` compares the numbers."""

__all__ = ["experiments", "page"]
