# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects that a model could miss in a rig: their bounds, where their fits start, and what their recordings must show.

``candidates`` lists them. ``starting_points`` finds where a fit begins, with the score tests of ``rao_score`` on the parts of
the recordings in ``view_set``; dead texels and converters are estimated directly from the readings. ``plausibility`` refuses a
fitted effect whose signature the recordings lack.
"""

__all__ = ["candidates", "direct_estimates", "plausibility", "rao_score", "silenced_texels", "starting_points", "view_set"]
