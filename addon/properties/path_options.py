# SPDX-License-Identifier: GPL-3.0-or-later
"""Options of properties that are paths of files and folders which Palpate writes.

Newer Blenders draw such a field red, as an error, unless the property says that // may begin its path and that it is an output.
"""

import bpy

_NAMES = {"PATH_SUPPORTS_BLEND_RELATIVE": "is_path_supports_blend_relative", "OUTPUT_PATH": "is_path_output"}
OUTPUT: set = {option for option, flag in _NAMES.items() if flag in bpy.types.Property.bl_rna.properties}
