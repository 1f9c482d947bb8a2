# SPDX-License-Identifier: GPL-3.0-or-later
"""Files in and out: one module per format, and atomic writing for all of them.

A bake folder (:mod:`.bake_folder`, :mod:`.bake_reader`) holds tactile images (:mod:`.tactile_exr`), recordings and sensors as
.npz, and a manifest. Tables of measurements, sensor descriptions and OpenRAVE files are read and written beside it. The formats
that a bake can be exported to are in the package ``export``, because some of them need colours of figures.
"""

__all__ = [
    "bake_folder",
    "bake_reader",
    "csv_table",
    "file_writing",
    "hidden_folder",
    "input_files",
    "recording_npz",
    "row_tables",
    "scenario_npz",
    "schema",
    "sensor_toml",
    "tactile_exr",
    "text_table",
]
