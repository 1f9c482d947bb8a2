# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures, figures and videos of a baked scene.

No forces are computed: pictures are renders of the scene, and figures are drawn from the files of its bake.
"""

__all__ = ["figure_export", "figure_request", "render", "render_setup", "video"]
