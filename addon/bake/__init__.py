# SPDX-License-Identifier: GPL-3.0-or-later
"""A bake: the scene is read, its forces are computed for all frames, and the result goes into files and into the scene.

:func:`.bake.bake` is the whole of it, step by step. Until its last step an earlier bake stays as it is.
"""

__all__ = ["bake", "bake_files", "scene_writer"]
