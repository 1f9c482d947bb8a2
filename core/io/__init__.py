# SPDX-License-Identifier: GPL-3.0-or-later
"""Files in and out: one module per format, and atomic writing for all of them.

A bake folder (:mod:`.bake_folder`, :mod:`.bake_reader`) holds tactile images (:mod:`.tactile_exr`), recordings and sensors as
.npz, and a manifest. Tables of measurements, sensor descriptions and OpenRAVE files are read and written beside it. The formats
that a bake can be exported to are in the package ``export``, because some of them need colours of figures.
"""

__all__ = [
    "bake_check",
    "bake_folder",
    "bake_owner",
    "bake_reader",
    "bake_switch",
    "checksum_list",
    "csv_table",
    "disk_space",
    "exr_file",
    "file_list",
    "file_writing",
    "folder_lock",
    "frame_rows",
    "growing_file",
    "growing_table",
    "group_sync",
    "html_templates",
    "mesh_file",
    "npz",
    "openrave",
    "private_folder",
    "recording_file",
    "recording_npz",
    "regular_file",
    "saved_bake",
    "scenario_npz",
    "schema",
    "sensor_manifest",
    "sensor_npz",
    "sensor_toml",
    "settings_migration",
    "tactile_exr",
    "temporary_folder",
    "toml_file",
    "vector_exr",
    "xml_file",
]
