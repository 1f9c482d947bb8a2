# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of a recording: tactile images over time, curves, numbers, and what goes on a rendered picture.

Forces are in newtons, pressures in kilopascals, lengths in millimetres, and no text is smaller than 8 pt at the size of the
written figure. What a figure looks like is said once, by a :class:`FigureStyle`, for all figures of a recording.
"""
