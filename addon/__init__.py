# SPDX-License-Identifier: GPL-3.0-or-later
"""Between Blender and core: properties, reading a scene, writing results back, the timeline."""
