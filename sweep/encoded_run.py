# SPDX-License-Identifier: GPL-3.0-or-later
"""The frames of a run as the dataset has them, encoded once: by the process that computes the run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .features import Feature, Layout, RunFrames
from .parquet_pages import EncodedColumn, decode_column, encode_column


@dataclass(frozen=True)
class EncodedRun:
    """The frames of a run.

    Attributes
    ----------
    layout : Layout
    rows : int
        Number of frames.
    columns : sequence of EncodedColumn
        Of the layout's `frame_features`, in their order.
    """

    layout: Layout
    rows: int
    columns: Sequence[EncodedColumn]

    def decoded(self, feature: Feature) -> np.ndarray:
        """Return the (F, …) values of one of the layout's `frame_features`; raises ValueError where they are damaged."""
        return decode_column(feature, self.columns[self.layout.frame_features.index(feature)])


def encode_run(frames: RunFrames) -> EncodedRun:
    """Return the frames of a run, encoded; equal frames give equal bytes."""
    columns = [encode_column(feature, frames.columns[feature.name]) for feature in frames.layout.frame_features]
    return EncodedRun(frames.layout, frames.rows, columns)
