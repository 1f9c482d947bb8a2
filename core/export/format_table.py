# SPDX-License-Identifier: GPL-3.0-or-later
"""The formats of an export by name, without the modules that write them: lists and commands load none of those."""

from __future__ import annotations

from typing import NamedTuple


class Format(NamedTuple):
    """A format in lists and panels, and the module of :mod:`.formats` that writes it."""

    title: str
    description: str
    module: str


FORMATS = {
    "csv": Format("CSV", "Tables, one column per texel", "csv_tables"),
    "npz": Format("NPZ", "Arrays for NumPy in double precision", "npz_arrays"),
    "hdf5": Format("HDF5", "One file with units; needs the package h5py", "hdf5"),
    "png": Format("PNG", "Every tactile image as a picture in colours", "png_images"),
    "mcap": Format("MCAP", "Messages over time for Foxglove, rerun and ROS 2; needs mcap and rosbags", "mcap_messages"),
}
"""By the name on the command line. Scenes store a choice by its place here, so a new format comes last."""
