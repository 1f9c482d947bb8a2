# SPDX-License-Identifier: GPL-3.0-or-later
"""Further public recordings of real sensors, a model made by hand for each, and a learned one (benchmarks/RESULTS.md)."""
