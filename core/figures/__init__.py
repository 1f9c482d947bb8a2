# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of a recording: tactile images over time, curves, numbers of texels, labels on rendered pictures, images of a gel and
of vectors.

Forces are in newtons, pressures in kilopascals, lengths in millimetres. No text is smaller than 8 pt at the size of the written
figure. One :class:`.figure_style.FigureStyle` sets the style of all figures of a recording.
"""

__all__ = [
    "color_maps",
    "figure_canvas",
    "figure_style",
    "gel_image",
    "html_templates",
    "picture_labels",
    "quantities",
    "side_by_side",
    "tactile_image",
    "tactile_strip",
    "texel_numbers",
    "time_curves",
    "vector_image",
]
